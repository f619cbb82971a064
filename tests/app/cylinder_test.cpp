// scatter cylinder: what it writes equals what the library computes, to the last bit, and wrong requests
// leave nothing.
#include "run.hpp"
#include <scatter/exact/cylinder.hpp>
#include <scatter/optics/units.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace {

using scatter::exact::CylinderAmplitudes;
using scatter::test::Outcome;
using scatter::test::run;
using scatter::test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::vector<double> angles{0, 42.5, 180, 317.5};

void expect_equal(const nlohmann::json& json, const CylinderAmplitudes& expected) {
  for (const auto& [name, list] :
       {std::pair{"T1", &expected.T1}, {"T2", &expected.T2}, {"T3", &expected.T3}, {"T4", &expected.T4}}) {
    ASSERT_EQ(json.at(name).size(), angles.size());
    for (std::size_t i = 0; i < angles.size(); ++i)
      EXPECT_THAT(json.at(name).at(i), ElementsAre((*list)[i].real(), (*list)[i].imag())) << name;
  }
}

TEST(CylinderVerb, JsonRoundTripsEveryBit) {
  const Outcome outcome = run(
      {"cylinder", "--size-parameter", "300.1", "--index", "1.55+1e-4i", "--tilt", "30deg", "--angles",
       "0,42.5,180,317.5", "--orders", "0,2"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  const auto json = nlohmann::json::parse(outcome.output);
  const std::vector<int> orders{0, 2};
  const auto expected = scatter::exact::cylinder_at_degrees(300.1, {1.55, 1e-4}, 30, angles, orders);
  EXPECT_EQ(json.at("x"), 300.1);
  EXPECT_THAT(json.at("m"), ElementsAre(1.55, 1e-4));
  EXPECT_EQ(json.at("tilt_deg"), 30);
  for (const auto& [name, values] :
       {std::pair{"Qext", expected.Qext}, {"Qsca", expected.Qsca}, {"Qabs", expected.Qabs}}) {
    EXPECT_EQ(json.at(name).at("I"), values.I) << name;
    EXPECT_EQ(json.at(name).at("II"), values.II) << name;
  }
  EXPECT_EQ(json.at("error_estimate"), expected.error_estimate);
  EXPECT_EQ(json.at("validated"), true);
  EXPECT_EQ(json.at("theta_deg"), nlohmann::json(angles));
  expect_equal(json, expected.amplitudes);
  expect_equal(json.at("remainder"), expected.remainder);
  ASSERT_EQ(json.at("orders").size(), 2U);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(json.at("orders").at(k).at("p"), orders[k]);
    EXPECT_EQ(json.at("orders").at(k).at("error_estimate"), expected.orders[k].error_estimate);
    expect_equal(json.at("orders").at(k), expected.orders[k].amplitudes);
  }
  EXPECT_THAT(json.at("provenance").at("command").get<std::string>(), HasSubstr("--tilt 30deg"));
}

TEST(CylinderVerb, CsvHoldsAmplitudesAndOrders) {
  const TemporaryFolder folder;
  const std::string path = folder.file("hair.csv");
  const Outcome outcome = run(
      {"cylinder", "--radius", "4um", "--wavelength", "550nm", "--index", "1.55", "--tilt=-20deg", "--angles",
       "0,42.5,180,317.5", "--orders", "1", "--output", path});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.output, "");
  EXPECT_THAT(folder.names(), ElementsAre("hair.csv"));
  const std::vector<int> orders{1};
  const auto expected =
      scatter::exact::cylinder_at_degrees(2 * scatter::pi * (4e-6 / 550e-9), 1.55, -20, angles, orders);

  std::ifstream file(path);
  std::string line, comments;
  while (std::getline(file, line) && line.starts_with('#')) comments += line + '\n';
  EXPECT_THAT(comments, HasSubstr("# command: scatter cylinder"));
  EXPECT_THAT(comments, HasSubstr("\n# tilt_deg: -20\n"));
  EXPECT_THAT(comments, HasSubstr("\n# Qext: "));
  EXPECT_EQ(
      line,
      "theta_deg,T1_re,T1_im,T2_re,T2_im,T3_re,T3_im,T1_p1_re,T1_p1_im,T2_p1_re,T2_p1_im,T3_p1_re,T3_p1_im,"
      "T1_rest_re,T1_rest_im,T2_rest_re,T2_rest_im,T3_rest_re,T3_rest_im");
  for (std::size_t i = 0; i < angles.size(); ++i) {
    ASSERT_TRUE(std::getline(file, line));
    std::vector<double> found, wanted{angles[i]};
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');) found.push_back(std::stod(field));
    for (const auto* amplitudes : {&expected.amplitudes, &expected.orders[0].amplitudes, &expected.remainder})
      for (const auto* T : {&amplitudes->T1, &amplitudes->T2, &amplitudes->T3}) {
        wanted.push_back((*T)[i].real());
        wanted.push_back((*T)[i].imag());
      }
    EXPECT_EQ(found, wanted);
  }
  EXPECT_FALSE(std::getline(file, line));
}

TEST(CylinderVerb, WithoutOrdersThereAreNone) {
  const Outcome outcome = run({"cylinder", "--x", "10", "--index", "1.55", "--angles", "0"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto json = nlohmann::json::parse(outcome.output);
  EXPECT_EQ(json.at("tilt_deg"), 0);
  EXPECT_FALSE(json.contains("orders"));
  EXPECT_FALSE(json.contains("remainder"));
  EXPECT_THAT(json.at("T3").at(0), ElementsAre(0, 0));
}

TEST(CylinderVerb, TellsWhatIsBeyondTheValidatedDomain) {
  const Outcome large = run({"cylinder", "--size-parameter", "6000", "--index", "1.55", "--angles", "90"});
  EXPECT_EQ(large.exit_code, 0);
  EXPECT_EQ(
      large.errors,
      "scatter cylinder: --size-parameter 6000 is beyond 5000, up to which results were compared with 50 "
      "digits; computed the same way\n");
  EXPECT_EQ(nlohmann::json::parse(large.output).at("validated"), false);
  const Outcome tilted =
      run({"cylinder", "--x", "10", "--index", "1.55", "--tilt=-89.75deg", "--angles", "90"});
  EXPECT_EQ(tilted.exit_code, 0);
  EXPECT_EQ(tilted.error_lines(), 1);
  EXPECT_THAT(tilted.errors, HasSubstr("--tilt: 89.75 deg is beyond 89.5, "));
  EXPECT_EQ(nlohmann::json::parse(tilted.output).at("validated"), false);
}

struct Case {
  const char* name;
  std::vector<std::string> arguments;
  std::vector<std::string> says;
};

void PrintTo(const Case& bad, std::ostream* stream) {
  *stream << bad.name;
}

class BadCylinderInput : public testing::TestWithParam<Case> {};

TEST_P(BadCylinderInput, IsRefusedInOneLineAndLeavesNothing) {
  const TemporaryFolder folder;
  std::vector<std::string> arguments{"cylinder"};
  arguments.insert(arguments.end(), GetParam().arguments.begin(), GetParam().arguments.end());
  if (std::find(arguments.begin(), arguments.end(), "--output") == arguments.end())
    arguments.insert(arguments.end(), {"--output", folder.file("cylinder.json")});
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 2) << "signal " << outcome.signal;
  EXPECT_EQ(outcome.output, "");
  EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
  for (const auto& part : GetParam().says) EXPECT_THAT(outcome.errors, HasSubstr(part));
  EXPECT_THAT(folder.names(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(
    Cases, BadCylinderInput,
    testing::Values(
        Case{"NoSize", {"--index", "1.55"}, {"--size-parameter", "--radius"}},
        Case{"NoIndex", {"--x", "10"}, {"--index", "1.55"}},
        Case{"NoIndexWithWavelength", {"--radius", "1um", "--wavelength", "500nm"}, {"--index", "1.55"}},
        Case{"TooLarge", {"--x", "1e6", "--index", "1.55"}, {"1e-6..1e5"}},
        Case{"NoCylinder", {"--x", "1", "--index", "1"}, {"index 1"}},
        Case{"Amplifies", {"--x", "1", "--index", "1.55-1e-3i"}, {"--index", "k"}},
        Case{"AlongTheAxis", {"--x", "1", "--index", "1.55", "--tilt", "90deg"}, {"--tilt", "90", "89.9deg"}},
        Case{"TiltWithoutNumber", {"--x", "1", "--index", "1.55", "--tilt", "much"}, {"--tilt", "much"}},
        Case{"AngleBeyond", {"--x", "1", "--index", "1.55", "--angles", "0,361"}, {"--angles", "361"}},
        Case{"Orders", {"--x", "1", "--index", "1.55", "--orders", "few"}, {"--orders", "few"}},
        Case{"OrderBeyond", {"--x", "1", "--index", "1.55", "--orders", "1001"}, {"--orders", "1001"}},
        Case{"Extension", {"--x", "1", "--index", "1.55", "--output", "a.txt"}, {"a.txt", ".csv"}},
        Case{"Folder", {"--x", "1", "--index", "1.55", "--output", "/no/such/a.csv"}, {"/no/such"}}),
    [](const auto& test) { return std::string(test.param.name); });

} // namespace
