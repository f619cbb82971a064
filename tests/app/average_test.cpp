// scatter mie with --distribution, --sun-disc and --band: what it writes is what the library computes.
#include "run.hpp"
#include <scatter/drop/size_distribution.hpp>
#include <scatter/exact/average.hpp>
#include <scatter/optics/refractive_index.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <fstream>
#include <sstream>

namespace {

using scatter::test::Outcome;
using scatter::test::run;
using scatter::test::TemporaryFolder;
using testing::HasSubstr;

const std::vector<double> angles{0, 42.5, 90, 137.9, 180};

TEST(AverageVerb, JsonHoldsWhatTheLibraryComputes) {
  const Outcome outcome = run(
      {"mie", "--distribution", "gamma:effective-radius=1um,effective-variance=0.1", "--band", "500:600nm",
       "--sun-disc", "0.533deg", "--tolerance", "0.03", "--angles", "0,42.5,90,137.9,180"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  const auto json = nlohmann::json::parse(outcome.output);

  const auto sizes = scatter::drop::SizeDistribution::gamma_effective(1e-6, 0.1);
  scatter::exact::AverageRequest request;
  std::tie(request.radii.smallest_m, request.radii.largest_m) = sizes.range(1e-5);
  request.radii.density = [&](double r) { return sizes.density(r); };
  request.band = {500e-9, 600e-9, {}};
  request.index = [](double wavelength_m) { return scatter::refractive_index({}, wavelength_m); };
  request.sun_disc_deg = 0.533;
  request.theta_deg = angles;
  request.tolerance = 0.03;
  const auto expected = scatter::exact::average(request);
  EXPECT_EQ(json.at("phase_function"), nlohmann::json(expected.S11));
  EXPECT_EQ(json.at("mueller").at("S12"), nlohmann::json(expected.S12));
  EXPECT_EQ(json.at("mueller").at("S33"), nlohmann::json(expected.S33));
  EXPECT_EQ(json.at("mueller").at("S34"), nlohmann::json(expected.S34));
  EXPECT_EQ(json.at("phase_function_error"), nlohmann::json(expected.error_estimate));
  EXPECT_EQ(json.at("Cext_m2"), expected.C_ext);
  EXPECT_EQ(json.at("g"), expected.g);
  EXPECT_EQ(json.at("error_estimate"), expected.largest_error);
  EXPECT_EQ(json.at("converged"), true);
  EXPECT_EQ(json.at("validated"), true);
  EXPECT_NEAR(json.at("effective_radius_m").get<double>() / 1e-6, 1, 1e-3);
  EXPECT_NEAR(json.at("effective_variance").get<double>() / 0.1, 1, 1e-3);
  EXPECT_FALSE(json.contains("S1"));
}

TEST(AverageVerb, ListsAndRainSayWhatTheyAre) {
  const TemporaryFolder folder;
  std::ofstream(folder.file("drops.csv")) << "radius_um,number\n1,3\n2,1\n";
  const Outcome list = run(
      {"mie", "--distribution", "list:" + folder.file("drops.csv"), "--wavelength", "600nm", "--angles",
       "0:180:45deg", "--output", folder.file("a.csv")});
  ASSERT_EQ(list.exit_code, 0) << list.errors;
  std::ifstream file(folder.file("a.csv"));
  std::stringstream text;
  text << file.rdbuf();
  EXPECT_THAT(text.str(), HasSubstr("# spheres: 2\n"));
  EXPECT_THAT(text.str(), HasSubstr("theta_deg,phase_function,S12,S33,S34,polarization,error\n0,"));

  const Outcome rain = run(
      {"mie", "--distribution", "marshall-palmer:rate=5mm/h", "--wavelength", "1mm", "--index", "2.4+0.5i",
       "--angles", "90", "--tolerance", "1e-2"});
  ASSERT_EQ(rain.exit_code, 0) << rain.errors;
  const auto json = nlohmann::json::parse(rain.output);
  EXPECT_NEAR(json.at("number_per_m3").get<double>(), 8000 / (4.1 * std::pow(5, -0.21)), 1e-6);
  EXPECT_EQ(
      json.at("extinction_per_m").get<double>(),
      json.at("number_per_m3").get<double>() * json.at("Cext_m2").get<double>());
}

TEST(AverageVerb, TellsWhatIsBeyondTheValidatedDomain) {
  const TemporaryFolder folder;
  std::ofstream(folder.file("drops.csv")) << "radius_um,number\n1,3\n5000,1\n";
  const Outcome outcome = run(
      {"mie", "--distribution", "list:" + folder.file("drops.csv"), "--wavelength", "500nm", "--angles",
       "90"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
  EXPECT_THAT(
      outcome.errors,
      HasSubstr("scatter mie: --distribution: the largest size parameter 62831.8531 is beyond 50000, "));
  EXPECT_EQ(nlohmann::json::parse(outcome.output).at("validated"), false);
}

TEST(AverageVerb, TellsWhenTheToleranceIsNotReached) {
  const Outcome outcome = run(
      {"mie", "--distribution", "lognormal:median=5um,sigma=1.5", "--wavelength", "600nm", "--angles",
       "90,180", "--spheres", "100", "--tolerance", "1e-4"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.error_lines(), 1);
  EXPECT_THAT(outcome.errors, HasSubstr("--spheres"));
  EXPECT_EQ(nlohmann::json::parse(outcome.output).at("converged"), false);
}

} // namespace
