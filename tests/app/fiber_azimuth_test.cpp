// scatter fiber azimuth: what it writes equals what the library computes, and energies add up.
#include "run.hpp"
#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/units.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <fstream>
#include <numeric>
#include <string>
#include <vector>

namespace {

using scatter::fiber::RaySection;
using scatter::test::Outcome;
using scatter::test::run;
using scatter::test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

TEST(FiberAzimuthVerb, JsonHoldsWhatTheLibraryComputes) {
  const Outcome outcome = run(
      {"fiber", "azimuth", "--eta", "1.55", "--sigma-a", "0.2", "--theta-d", "30deg", "--orders", "0..3",
       "--phi", "0:180:22.5deg", "--output", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  const auto json = nlohmann::json::parse(outcome.output);
  const RaySection section(1.55, 0.2);
  const double theta_d = 30 * scatter::radians_per_degree;
  EXPECT_EQ(json.at("eta_prime"), scatter::fiber::bravais_index(1.55, theta_d));
  ASSERT_EQ(json.at("phi_deg").size(), 9U);
  ASSERT_EQ(json.at("N").size(), 9U);
  ASSERT_EQ(json.at("energy").size(), 4U);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_EQ(json.at("phi_deg")[i], 22.5 * static_cast<double>(i));
    ASSERT_EQ(json.at("N")[i].size(), 4U);
    for (std::size_t p = 0; p < 4; ++p)
      EXPECT_EQ(
          json.at("N")[i][p],
          section.distribution(
              static_cast<int>(p), theta_d, 22.5 * static_cast<double>(i) * scatter::radians_per_degree));
    EXPECT_EQ(json.at("error_estimate")[i].size(), 4U);
  }
  EXPECT_EQ(json.at("error_estimate")[2][1], 1e-12);
  for (int p = 0; p < 4; ++p)
    EXPECT_EQ(json.at("energy")[static_cast<std::size_t>(p)], section.moments(p, theta_d).energy);
  EXPECT_EQ(json.at("residual_energy"), section.residual_energy(4, theta_d));
  EXPECT_THAT(
      json.at("caustic_phi_deg"), ElementsAre(
                                      section.caustics(2, theta_d)[0] / scatter::radians_per_degree,
                                      section.caustics(3, theta_d)[0] / scatter::radians_per_degree));
  EXPECT_THAT(json.at("caustic_order"), ElementsAre(2, 3));
  EXPECT_THAT(json.at("provenance").at("command").get<std::string>(), HasSubstr("--sigma-a 0.2"));
}

TEST(FiberAzimuthVerb, ErrorsGrowTowardCaustics) {
  const double caustic = RaySection(1.55, 0).caustics(2, 0)[0] / scatter::radians_per_degree;
  const Outcome outcome =
      run({"fiber", "azimuth", "--eta", "1.55", "--orders", "1,2", "--phi", std::to_string(caustic)});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto json = nlohmann::json::parse(outcome.output);
  EXPECT_EQ(json.at("error_estimate")[0][0], 1e-12);
  // to_string leaves six digits: at most 1e-8 rad beside it.
  EXPECT_GE(json.at("error_estimate")[0][1].get<double>(), 1e-8);
}

TEST(FiberAzimuthVerb, EnergiesAddUpWhicheverOrdersAreListed) {
  for (const char* orders : {"0..2", "1", "0,5", "3..4"})
    for (const char* polarisation : {"mean", "tracked"}) {
      const Outcome outcome = run(
          {"fiber", "azimuth", "--eta", "1.55", "--theta-d=-65deg", "--orders", orders, "--phi", "90",
           "--polarisation", polarisation});
      ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
      const auto json = nlohmann::json::parse(outcome.output);
      double sum = json.at("residual_energy");
      for (const double energy : json.at("energy")) sum += energy;
      EXPECT_NEAR(sum, 1, 1e-12) << orders;
    }
}

TEST(FiberAzimuthVerb, AzimuthsAreEvenAndWholeTurnsGo) {
  const Outcome outcome =
      run({"fiber", "azimuth", "--eta", "1.4", "--phi=-150,150,210,-210", "--theta-d", "0.3rad"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto json = nlohmann::json::parse(outcome.output);
  for (std::size_t i = 1; i < 4; ++i) EXPECT_EQ(json.at("N")[i], json.at("N")[0]);
  EXPECT_GT(json.at("N")[0][1].get<double>(), 0.1);
}

TEST(FiberAzimuthVerb, WritesAFile) {
  const TemporaryFolder folder;
  const Outcome outcome = run({"fiber", "azimuth", "--eta", "1.55", "--output", folder.file("hair.json")});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.output, "");
  EXPECT_THAT(folder.names(), ElementsAre("hair.json"));
  std::ifstream file(folder.file("hair.json"));
  EXPECT_EQ(nlohmann::json::parse(file).at("N").size(), 181U);
}

TEST(FiberAzimuthVerb, WrongRequestsLeaveNothing) {
  const TemporaryFolder folder;
  const Outcome outcome = run({"fiber", "azimuth", "--eta", "1", "--output", folder.file("hair.json")});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(folder.names(), IsEmpty());
}

} // namespace
