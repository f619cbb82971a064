// scatter fiber assembly, hair and artist-hair: what they write is what the library computes, and wrong
// options and files are refused by name and field.
#include "run.hpp"
#include <scatter/fiber/artist_hair.hpp>
#include <scatter/fiber/assembly.hpp>
#include <scatter/fiber/hair.hpp>
#include <scatter/optics/units.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

namespace {

using nlohmann::json;
using scatter::radians_per_degree;
using scatter::test::Outcome;
using scatter::test::run;
using scatter::test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;
namespace fiber = scatter::fiber;
using fiber::Rgb;

constexpr const char* two_pairs =
    R"([{"light": [0, 0, 1], "view": [0.6, 0, 0.8]}, {"light": [-0.36, 0.48, 0.8], "view": [0, -0.28, -0.96]}])";
const fiber::Angles second_pair = fiber::angles(fiber::Frame{}, {-0.36, 0.48, 0.8}, {0, -0.28, -0.96});

class FiberHair : public testing::Test {
protected:
  Outcome model(
      const std::string& verb, const std::string& params, const std::string& directions = two_pairs,
      std::vector<std::string> more = {}) {
    std::ofstream(folder_.path() / "params.json") << params;
    std::ofstream(folder_.path() / "pairs.json") << directions;
    std::vector<std::string> arguments{
        "fiber", verb, "--params", folder_.file("params.json"), "--directions", folder_.file("pairs.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  TemporaryFolder folder_;
};

TEST_F(FiberHair, AssemblyWritesTheLibrarysAverages) {
  const Outcome outcome = run(
      {"fiber", "assembly", "--eta", "1.5", "--sigma-a", "0.1,0.3,0.6", "--shift", "-6deg", "--width", "8deg",
       "--theta-i", "-60:60:60deg", "--output", "-"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  const json out = json::parse(outcome.output);
  EXPECT_EQ(out.at("theta_i_deg"), json::parse("[-60.0, 0.0, 60.0]"));
  fiber::HairParameters parameters;
  parameters.eta = 1.5;
  parameters.sigma_a = {0.1, 0.3, 0.6};
  parameters.shift = -6 * radians_per_degree;
  parameters.width = 8 * radians_per_degree;
  parameters.residual = false;
  const fiber::HairScattering hair(parameters);
  const auto expected = fiber::assembly_averages(hair, -60 * radians_per_degree);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_EQ(out.at("a_f")[0][c], expected.a_f[c]);
    EXPECT_EQ(out.at("a_b")[0][c], expected.a_b[c]);
    EXPECT_EQ(out.at("A_b")[0][c], expected.A_b[c]);
    EXPECT_EQ(out.at("alpha_f_deg")[0][c], expected.alpha_f[c] / radians_per_degree);
    EXPECT_EQ(out.at("alpha_b_deg")[0][c], expected.alpha_b[c] / radians_per_degree);
    EXPECT_EQ(out.at("beta_f_deg")[0][c], expected.beta_f[c] / radians_per_degree);
    EXPECT_EQ(out.at("beta_b_deg")[0][c], expected.beta_b[c] / radians_per_degree);
    EXPECT_EQ(out.at("Delta_b_deg")[0][c], expected.Delta_b[c] / radians_per_degree);
    EXPECT_EQ(out.at("sigma_b_deg")[0][c], expected.sigma_b[c] / radians_per_degree);
    EXPECT_EQ(out.at("error_estimate")[0][c], 1e-9 / std::pow(1 - expected.a_f[c] * expected.a_f[c], 4));
  }
  EXPECT_EQ(out.at("lobes"), json::parse(R"(["R", "TT", "TRT"])"));
}

TEST_F(FiberHair, AssemblyVariantsAndLobes) {
  const auto averages = [](std::vector<std::string> more) {
    std::vector<std::string> arguments{"fiber", "assembly", "--theta-i", "20"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    return json::parse(outcome.output);
  };
  const json plain = averages({}), printed = averages({"--variant", "printed"}),
             all = averages({"--residual"});
  // The print lacks the 1/2 of the kernels; blue is dark enough not to be clamped.
  EXPECT_NEAR(printed.at("a_b")[0][2].get<double>(), 2 * plain.at("a_b")[0][2].get<double>(), 1e-12);
  EXPECT_GT(all.at("a_f")[0][0], plain.at("a_f")[0][0]);
  EXPECT_EQ(all.at("lobes").size(), 4U);
  const Outcome grey = run({"fiber", "assembly", "--sigma-a", "0.3", "--theta-i", "0"});
  const json one = json::parse(grey.output);
  EXPECT_EQ(one.at("a_f")[0][0], one.at("a_f")[0][2]);
}

TEST_F(FiberHair, HairWritesTheLibrarysValues) {
  const Outcome outcome =
      model("hair", R"({"eta": 1.55, "sigma_a": [0.1, 0.2, 0.4], "shift_deg": -7, "width_deg": 6})");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  const json out = json::parse(outcome.output);
  fiber::HairParameters parameters;
  parameters.sigma_a = {0.1, 0.2, 0.4};
  parameters.shift = -7 * radians_per_degree;
  parameters.width = 6 * radians_per_degree;
  const fiber::HairScattering hair(parameters);
  const Rgb found = out.at("value")[1], expected_one = hair.eval(second_pair);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(found[c], expected_one[c], 1e-13 * expected_one[c]);
  EXPECT_EQ(out.at("theta_i_deg")[1], second_pair.theta_i / radians_per_degree);
  EXPECT_EQ(out.at("phi_deg")[1], second_pair.phi / radians_per_degree);
  EXPECT_EQ(out.at("phi_deg")[0], 0);
  ASSERT_EQ(out.at("error_estimate").size(), 2U);
  for (const double error : out.at("error_estimate")) {
    EXPECT_GE(error, 1e-12);
    EXPECT_LE(error, 1e-10);
  }

  // Melanin: the same as its absorption. Strands: dual scattering, its parts adding up.
  const Outcome brown = model("hair", R"({"melanin": {"eumelanin": 1.3}, "residual": false})");
  const Outcome same = model("hair", R"({"sigma_a": [0.5447, 0.9061, 1.781], "residual": false})");
  ASSERT_EQ(brown.exit_code, 0) << brown.errors;
  for (std::size_t c = 0; c < 3; ++c)
    EXPECT_NEAR(
        json::parse(brown.output).at("value")[0][c].get<double>(),
        json::parse(same.output).at("value")[0][c].get<double>(), 1e-15);
  const Outcome dual = model("hair", "{}", two_pairs, {"--strands", "3.5", "--opacity", "0.5"});
  ASSERT_EQ(dual.exit_code, 0) << dual.errors;
  const json parts = json::parse(dual.output);
  const auto standard = std::make_shared<const fiber::HairScattering>(fiber::HairParameters{});
  const fiber::DualScattering shading(standard, standard);
  const auto expected = shading.eval(second_pair, shading.estimated(second_pair.theta_i, 0.5, 3.5));
  EXPECT_EQ(parts.at("value")[1].get<Rgb>(), expected.sum());
  EXPECT_EQ(parts.at("forward_back")[1].get<Rgb>(), expected.forward_back);
  // Four times the nodes change values by less than what the file says.
  fiber::DualScatteringOptions fine;
  fine.nodes = 721;
  const fiber::DualScattering finer(standard, standard, fine);
  const Rgb better = finer.eval(second_pair, finer.estimated(second_pair.theta_i, 0.5, 3.5)).sum();
  const double error = parts.at("error_estimate")[1];
  EXPECT_LT(error, 1e-2);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(expected.sum()[c], better[c], error * better[c]);
}

TEST_F(FiberHair, ArtistHairWritesTheLibrarysValues) {
  const Outcome outcome = model(
      "artist-hair",
      R"({"primary": {"colour": [1, 0.5, 0.25], "intensity": 0.3, "shift_deg": -4, "width_deg": 9},
          "glint_intensity": 2, "glint_azimuthal_width_deg": 8, "strand": 17, "seed": 3})");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  fiber::ArtistHairParameters parameters;
  parameters.primary = {{1, 0.5, 0.25}, 0.3, -4 * radians_per_degree, 9 * radians_per_degree};
  parameters.glint_intensity = 2;
  parameters.glint_azimuthal_width = 8 * radians_per_degree;
  parameters.glint_half_angle = fiber::glint_half_angle_of(17, 3);
  const fiber::ArtistHair hair(parameters);
  EXPECT_EQ(json::parse(outcome.output).at("value")[1].get<Rgb>(), hair.eval(second_pair));
  const double error = json::parse(outcome.output).at("error_estimate")[1];
  EXPECT_GE(error, 1e-12);
  EXPECT_LE(error, 1e-10);

  // The second set feeds multiple scattering only.
  const std::string linked = R"({"primary": {"intensity": 0.3}})",
                    broken = R"({"primary": {"intensity": 0.3}, "multiple": {"primary": {"intensity": 3}}})";
  const json one = json::parse(model("artist-hair", linked, two_pairs, {"--strands", "2"}).output);
  const json other = json::parse(model("artist-hair", broken, two_pairs, {"--strands", "2"}).output);
  EXPECT_EQ(one.at("single"), other.at("single"));
  EXPECT_NE(one.at("forward"), other.at("forward"));
}

TEST_F(FiberHair, WrongFilesAreRefusedByField) {
  struct Bad {
    const char *verb, *params;
    std::vector<std::string> says;
  };
  const std::vector<Bad> files{
      {"hair", R"({"eta": 1})", {"eta: 1 "}},
      {"hair", R"({"eta": "1.55"})", {"eta", "not a number"}},
      {"hair", R"({"sigma_a": [0.1, -0.2, 0.3]})", {"sigma_a: -0.2"}},
      {"hair", R"({"sigma_a": [0.1, 0.2]})", {"sigma_a", "three numbers"}},
      {"hair", R"({"width_deg": 0})", {"width_deg: 0 deg"}},
      {"hair", R"({"width_deg": 90})", {"width_deg: 90 deg"}},
      {"hair", R"({"shift_deg": 90})", {"shift_deg: 90 deg"}},
      {"hair", R"({"witdh_deg": 5})", {"witdh_deg", "width_deg"}},
      {"hair", R"({"variant": "print"})", {"variant: \"print\"", "corrected"}},
      {"hair", R"({"residual": 1})", {"residual", "true or false"}},
      {"hair", R"({"melanin": {"eumelanin": -1}})", {"melanin.eumelanin: ", "-1"}},
      {"hair", R"({"colour": [0.5, 0.5, 1.5]})", {"colour: 1.5"}},
      {"hair", R"({"colour": 0.5, "sigma_a": 0.1})", {"sigma_a says the absorption already"}},
      {"hair", R"({"multiple_scattering": {"d_f": 2}})", {"multiple_scattering.d_f: 2"}},
      {"hair", "[1]", {"must be an object"}},
      {"hair", R"({"eta": 1.5,})", {"no JSON", "line 1"}},
      {"artist-hair", R"({"primary": {"width_deg": 0}})", {"primary.width_deg: 0 deg"}},
      {"artist-hair", R"({"secondary": {"width_deg": 90}})", {"secondary.width_deg: 90 deg"}},
      {"artist-hair", R"({"primary": {"colour": [1, -1, 1]}})", {"primary.colour: -1"}},
      {"artist-hair", R"({"multiple": {"primary": {"intensity": -2}}})", {"multiple.primary.intensity: -2"}},
      {"artist-hair",
       R"({"transmission_azimuthal_width_deg": 0})",
       {"transmission_azimuthal_width_deg: 0 deg"}},
      {"artist-hair", R"({"glint_azimuthal_width_deg": 95})", {"glint_azimuthal_width_deg: 95 deg"}},
      {"artist-hair",
       R"({"multiple": {"primary": {"shift_deg": 90}}})",
       {"multiple.primary.shift_deg: 90 deg"}},
      {"artist-hair", R"({"glint_half_angle_deg": 181})", {"glint_half_angle_deg: 181 deg"}},
      {"artist-hair", R"({"strand": 1.5})", {"strand: 1.5"}},
      {"artist-hair", R"({"normalisation": "none"})", {"normalisation: \"none\""}},
      {"artist-hair", R"({"primary": {"scale": 2}})", {"primary.", "scale", "intensity"}},
  };
  for (const Bad& bad : files) {
    const Outcome outcome = model(bad.verb, bad.params);
    EXPECT_EQ(outcome.exit_code, 2) << bad.params;
    EXPECT_EQ(outcome.output, "") << bad.params;
    EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
    EXPECT_THAT(outcome.errors, StartsWith("scatter fiber")) << bad.params;
    EXPECT_THAT(outcome.errors, HasSubstr("params.json")) << bad.params;
    for (const std::string& part : bad.says) EXPECT_THAT(outcome.errors, HasSubstr(part)) << bad.params;
  }
  for (const char* const verb : {"hair", "artist-hair"}) {
    const Outcome along = model(verb, "{}", R"([{"light": [0, 0, 1], "view": [-1, 0, 0]}])");
    EXPECT_EQ(along.exit_code, 2);
    EXPECT_THAT(along.errors, HasSubstr("entry 0"));
    EXPECT_THAT(along.errors, HasSubstr("view lies along the fibre (theta = -90 deg)"));
    const Outcome zero = model(verb, "{}", R"([{"light": [0, 0, 0], "view": [0, 0, 1]}])");
    EXPECT_EQ(zero.exit_code, 2);
    EXPECT_THAT(zero.errors, HasSubstr("light"));
    const Outcome stretched = model(verb, "{}", R"([{"light": [0, 0, 5], "view": [0, 0, 1]}])");
    EXPECT_EQ(stretched.exit_code, 0);
    EXPECT_THAT(stretched.errors, HasSubstr("normalised"));
  }
}

TEST_F(FiberHair, WrongOptionsAreRefusedByName) {
  struct Bad {
    std::vector<std::string> options, says;
  };
  const std::vector<Bad> assembly{
      {{"--eta", "1"}, {"--eta: 1 "}},
      {{"--eta", "nan"}, {"--eta", "nan"}},
      {{"--sigma-a", "0.1,-0.2,0.3"}, {"--sigma-a: -0.2"}},
      {{"--sigma-a", "0.1,0.2"}, {"--sigma-a", "three numbers"}},
      {{"--sigma-a", "0.1,x,0.2"}, {"--sigma-a", "\"x\""}},
      {{"--width", "0deg"}, {"--width: 0 deg"}},
      {{"--width", "90deg"}, {"--width: 90 deg"}},
      {{"--shift", "90deg"}, {"--shift: 90 deg"}},
      {{"--theta-i", "90deg"}, {"--theta-i: 90 deg"}},
      {{"--theta-i", "-90:90:45deg"}, {"--theta-i: -90 deg"}},
      {{"--variant", "draft"}, {"--variant", "draft", "corrected"}},
      {{"--output", "out.txt"}, {"--output", "out.txt"}},
  };
  for (const Bad& bad : assembly) {
    std::vector<std::string> arguments{"fiber", "assembly"};
    arguments.insert(arguments.end(), bad.options.begin(), bad.options.end());
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << bad.options[1];
    EXPECT_EQ(outcome.output, "") << bad.options[1];
    EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
    for (const std::string& part : bad.says) EXPECT_THAT(outcome.errors, HasSubstr(part));
  }
  for (const auto& [option, value] :
       {std::pair{"--strands", "-1"}, {"--strands", "many"}, {"--opacity", "1.5"}}) {
    const Outcome outcome = model("hair", "{}", two_pairs, {option, value});
    EXPECT_EQ(outcome.exit_code, 2) << value;
    EXPECT_THAT(outcome.errors, HasSubstr(option));
  }
}

} // namespace
