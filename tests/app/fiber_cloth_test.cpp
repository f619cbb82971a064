// scatter fiber cloth and thread: what they write equals what the library computes, to the last bit, and
// wrong files are refused by name and field.
#include "run.hpp"
#include <scatter/fiber/fabric.hpp>
#include <scatter/fiber/weave.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace {

using nlohmann::json;
using scatter::test::Outcome;
using scatter::test::run;
using scatter::test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;
namespace fiber = scatter::fiber;

constexpr const char* two_pairs =
    R"([{"light": [0, 0, 1], "view": [0.6, 0, 0.8]}, {"light": [-0.36, 0.48, 0.8], "view": [0, -0.28, 0.96]}])";
constexpr const char* linen_thread =
    R"({"eta": 1.46, "kd": 0.3, "gamma_s_deg": 12, "gamma_v_deg": 24, "albedo": [0.2, 0.8, 1], "albedo_scale": 0.3})";
constexpr const char* plain_fabric = R"({
  "source": "made up",
  "threads": [
    {"eta": 1.5, "kd": 0.25, "gamma_s_deg": 10, "gamma_v_deg": 20, "albedo": [0.5, 0.25, 0.125],
     "coverage": 0.5, "offsets_deg": [-20, 20], "lengths": [1]},
    {"eta": 1.4, "kd": 0.5, "gamma_s_deg": 10, "gamma_v_deg": 20, "albedo": [0.5, 0.25, 0.125],
     "coverage": 0.25, "offsets_deg": [0, 30, -30, 0], "lengths": [1, 0, 1]}]})";

class FiberCloth : public testing::Test {
protected:
  std::string write(const std::string& name, const std::string& text) {
    std::ofstream(folder_.path() / name) << text;
    return folder_.file(name);
  }
  Outcome
  cloth(const std::string& fabric, const std::string& directions, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"fiber", "cloth",        "--fabric",
                                       fabric,  "--directions", write("pairs.json", directions)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  Outcome
  thread(const std::string& params, const std::string& directions, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"fiber",        "thread",
                                       "--params",     write("thread.json", params),
                                       "--directions", write("pairs.json", directions)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  TemporaryFolder folder_;
};

TEST_F(FiberCloth, JsonOnStandardOutputIsTheLibrarys) {
  for (const std::string& name : fiber::fabric_names()) {
    const Outcome outcome = cloth(name, two_pairs, {"--output", "-"});
    ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
    EXPECT_THAT(outcome.errors, IsEmpty());
    const json out = json::parse(outcome.output);
    std::vector<fiber::Rgb> expected(2);
    const std::vector<glm::dvec3> lights{{0, 0, 1}, {-0.36, 0.48, 0.8}},
        views{{0.6, 0, 0.8}, {0, -0.28, 0.96}};
    fiber::Cloth(fiber::load_fabric(name).weave).eval(lights, views, expected);
    EXPECT_EQ(out.at("value").get<std::vector<fiber::Rgb>>(), expected);
    EXPECT_EQ(out.at("fabric"), name);
    EXPECT_EQ(out.at("variant"), "printed");
    EXPECT_EQ(out.at("samples"), 64);
    ASSERT_EQ(out.at("error_estimate").size(), 2U);
    EXPECT_GE(out.at("error_estimate")[1].get<double>(), 2e-12);
    EXPECT_THAT(
        out.at("provenance").at("command").get<std::string>(), HasSubstr("fiber cloth --fabric " + name));
    EXPECT_GT(expected[0][0], 0);
  }
}

TEST_F(FiberCloth, FamiliesHideEachOtherWhenAsked) {
  const std::string low =
      R"([{"light": [0.9, 0.3, 0.31622776601683794], "view": [-0.3, 0.9, 0.31622776601683794]}])";
  const auto value = [&](const std::string& masking) {
    const Outcome outcome = cloth("linen-plain", low, {"--family-masking", masking, "--output", "-"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    const json out = json::parse(outcome.output);
    EXPECT_EQ(out.at("family_masking"), masking);
    return out.at("value").at(0).get<fiber::Rgb>();
  };
  const fiber::Rgb none = value("none"), crowns = value("crowns");
  EXPECT_GT(crowns[0], 0);
  EXPECT_LT(crowns[0], none[0]);
  const Outcome wrong = cloth("linen-plain", two_pairs, {"--family-masking", "all", "--output", "-"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(
      wrong.errors, HasSubstr("--family-masking: \"all\" is no masking of families: use none or crowns"));
}

TEST_F(FiberCloth, OwnFabricWithOptionsAndCsv) {
  const std::string file = write("own.json", plain_fabric), table = folder_.file("out.csv");
  const Outcome outcome =
      cloth(file, two_pairs, {"--samples", "7", "--variant", "energy-true", "--output", table});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, IsEmpty());
  const fiber::Cloth own(fiber::parse_fabric(plain_fabric, "own").weave, 7, fiber::SurfaceLobe::energy_true);
  const std::vector<glm::dvec3> lights{{0, 0, 1}, {-0.36, 0.48, 0.8}}, views{{0.6, 0, 0.8}, {0, -0.28, 0.96}};
  std::vector<fiber::Rgb> expected(2);
  own.eval(lights, views, expected);
  std::ifstream stream(table);
  std::vector<std::string> rows;
  for (std::string line; std::getline(stream, line);)
    if (line[0] != '#') rows.push_back(line);
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[0], "light_x,light_y,light_z,view_x,view_y,view_z,gap,red,green,blue");
  for (std::size_t k = 0; k < 2; ++k) {
    std::vector<double> numbers;
    std::stringstream row(rows[k + 1]);
    for (std::string field; std::getline(row, field, ',');) numbers.push_back(std::stod(field));
    ASSERT_EQ(numbers.size(), 10u);
    EXPECT_EQ(numbers[0], lights[k].x);
    EXPECT_EQ(numbers[6], own.open(views[k]));
    for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(numbers[7 + c], expected[k][c]);
  }
}

TEST_F(FiberCloth, ThreadAloneIsTheLibrarys) {
  const Outcome outcome = thread(linen_thread, two_pairs);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const json out = json::parse(outcome.output);
  const fiber::Thread linen(fiber::parse_thread(linen_thread, "linen"));
  const auto at = fiber::thread_angles(fiber::Frame{}, {-0.36, 0.48, 0.8}, {0, -0.28, 0.96});
  EXPECT_EQ(out.at("value").at(1).get<fiber::Rgb>(), linen.eval(at));
  EXPECT_NEAR(out.at("theta_o_deg").at(0).get<double>(), std::asin(0.6) * 180 / 3.141592653589793, 1e-12);
  EXPECT_EQ(out.at("phi_deg").at(0), 0);
  EXPECT_EQ(out.at("error_estimate"), json::parse("[1e-12, 1e-12]"));
  // A hundred times as much 0.01 deg from the thread.
  const Outcome steep =
      thread(linen_thread, R"([{"light": [0, 0, 1], "view": [1, 0, 1.7453292519943296e-4]}])");
  EXPECT_NEAR(json::parse(steep.output).at("error_estimate").at(0).get<double>(), 1e-10, 1e-16);
}

TEST_F(FiberCloth, DirectionsOfAnyLengthAreNormalisedWithOneLine) {
  const Outcome unit = cloth("velvet", R"([{"light": [0, 0, 1], "view": [0.6, 0, 0.8]}])");
  const Outcome stretched = cloth("velvet", R"([{"light": [0, 0, 1e300], "view": [3, 0, 4]}])");
  ASSERT_EQ(stretched.exit_code, 0);
  EXPECT_EQ(json::parse(stretched.output).at("value"), json::parse(unit.output).at("value"));
  EXPECT_EQ(stretched.error_lines(), 1);
  EXPECT_THAT(stretched.errors, HasSubstr("2 of 2 directions"));
  EXPECT_THAT(stretched.errors, HasSubstr("light of entry 0"));
  const Outcome view = cloth(
      "velvet", R"([{"light": [0, 0, 1], "view": [0.6, 0, 0.8]}, {"light": [0, 0, 1], "view": [3, 0, 4]}])");
  EXPECT_THAT(view.errors, HasSubstr("1 of 4 directions"));
  EXPECT_THAT(view.errors, HasSubstr("view of entry 1 (counted from 0)"));
}

TEST_F(FiberCloth, NeverNotANumber) {
  // Along threads, in the cloth's plane, from below, beside poles.
  json pairs = json::array();
  const std::vector<std::array<double, 3>> axes{{1, 0, 0},  {0, 1, 0},      {0, 0, 1},          {-1, 0, 0},
                                                {0, 0, -1}, {1, 0, 1e-300}, {1e-170, 1, 1e-170}};
  for (const auto& light : axes)
    for (const auto& view : axes) pairs.push_back({{"light", light}, {"view", view}});
  for (const std::string& name : fiber::fabric_names()) {
    const Outcome outcome = cloth(name, pairs.dump());
    ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
    EXPECT_EQ(outcome.output.find("null"), std::string::npos) << outcome.output; // as JSON writes NaN
    for (const auto& row : json::parse(outcome.output).at("value"))
      for (const double value : row) EXPECT_GE(value, 0);
  }
  const Outcome alone = thread(linen_thread, pairs.dump());
  ASSERT_EQ(alone.exit_code, 0);
  EXPECT_EQ(alone.output.find("null"), std::string::npos) << alone.output;
}

/// A text with one part replaced.
std::string changed(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, text.npos) << from;
  return text.replace(at, from.size(), to);
}

TEST_F(FiberCloth, WrongFilesAreRefusedByField) {
  struct Bad {
    std::string what, from, to;
    std::vector<std::string> says;
  };
  const std::vector<Bad> fabrics{
      {"eta of one", R"("eta": 1.4)", R"("eta": 1)", {"thread 2: eta: 1"}},
      {"eta below one", R"("eta": 1.5)", R"("eta": 0.9)", {"thread 1: eta: 0.9"}},
      {"kd", R"("kd": 0.5)", R"("kd": 1.5)", {"thread 2: kd: 1.5", "0 to 1"}},
      {"negative kd", R"("kd": 0.25)", R"("kd": -0.1)", {"thread 1: kd: -0.1"}},
      {"no width", R"("gamma_s_deg": 10)", R"("gamma_s_deg": 0)", {"thread 1: gamma_s_deg: 0", "90"}},
      {"wide", R"("gamma_v_deg": 20)", R"("gamma_v_deg": 90)", {"thread 1: gamma_v_deg: 90"}},
      {"coverage", R"("coverage": 0.25)", R"("coverage": 0.75)", {"coverage", "1.25"}},
      {"negative coverage", R"("coverage": 0.5)", R"("coverage": -0.5)", {"thread 1: coverage: -0.5"}},
      {"lengths",
       R"("lengths": [1, 0, 1])",
       R"("lengths": [1, 1])",
       {"thread 2: lengths: 2", "4 offsets", "3"}},
      {"negative length", R"("lengths": [1, 0, 1])", R"("lengths": [1, -1, 1])", {"thread 2: lengths: -1"}},
      {"no length", R"("lengths": [1])", R"("lengths": [0])", {"thread 1: lengths", "above 0"}},
      {"one offset", R"([-20, 20])", R"([20])", {"thread 1: offsets_deg: 1", "two or more"}},
      {"steep offset", R"([-20, 20])", R"([-20, 91])", {"thread 1: offsets_deg: 91"}},
      {"overflow", R"("eta": 1.5)", R"("eta": 1e999)", {"own.json", "1e999"}},
      {"text", R"("eta": 1.5)", R"("eta": "1.5")", {"thread 1: eta", "not a number"}},
      {"unknown name",
       R"("gamma_s_deg": 10)",
       R"("gama_s_deg": 10)",
       {"gama_s_deg", "did you mean gamma_s_deg?"}},
      {"far name", R"("source")", R"("weaver")", {"weaver", "known are", "threads"}},
      {"missing", R"("kd": 0.5, )", "", {"thread 2: kd is missing"}},
      {"repeated", R"("kd": 0.5, )", R"("kd": 0.5, "kd": 0.4, )", {"\"kd\" stands twice"}},
      {"two colours", R"([0.5, 0.25, 0.125])", R"([0.5, 0.25])", {"thread 1: albedo: 2", "three"}},
      {"bright", R"([0.5, 0.25, 0.125])", R"([1.5, 0.25, 0.125])", {"thread 1: albedo: 1.5"}},
      {"masking", R"("source": "made up")", R"("masking_deg": 0)", {"masking_deg: 0", "15 to 25"}},
      {"no JSON", R"("threads": [)", R"("threads": [,)", {"own.json", "line 3"}},
  };
  for (const Bad& bad : fabrics) {
    const Outcome outcome = cloth(write("own.json", changed(plain_fabric, bad.from, bad.to)), two_pairs);
    EXPECT_EQ(outcome.exit_code, 2) << bad.what;
    EXPECT_EQ(outcome.output, "") << bad.what;
    EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
    EXPECT_THAT(outcome.errors, StartsWith("scatter fiber")) << bad.what;
    EXPECT_THAT(outcome.errors, HasSubstr("own.json")) << bad.what;
    for (const std::string& part : bad.says) EXPECT_THAT(outcome.errors, HasSubstr(part)) << bad.what;
  }
  const std::vector<Bad> directions{
      {"zero", "[0, 0, 1]", "[0, 0, 0]", {"entry 0", "light", "no direction"}},
      {"zero later", "[0, -0.28, 0.96]", "[0, 0, 0]", {"entry 1", "view", "no direction"}},
      {"two numbers", "[0, 0, 1]", "[0, 1]", {"entry 0", "light", "three numbers"}},
      {"text", "[0, 0, 1]", R"(["a", 0, 1])", {"entry 0", "three numbers"}},
      {"null", "[0, 0, 1]", "[null, 0, 1]", {"entry 0", "three numbers"}},
      {"no view", R"(, "view": [0.6, 0, 0.8])", "", {"entry 0", "view is missing"}},
      {"other field", R"("view": [0.6)", R"("eye": [0.6)", {"entry 0", "eye"}},
      {"overflow", "[0, 0, 1]", "[0, 0, 1e999]", {"pairs.json", "1e999"}},
      {"broken", "]}, {", "]} {", {"pairs.json", "no JSON", "line 1"}},
  };
  for (const Bad& bad : directions) {
    const std::string text = changed(two_pairs, bad.from, bad.to);
    for (const Outcome& outcome : {cloth("velvet", text), thread(linen_thread, text)}) {
      EXPECT_EQ(outcome.exit_code, 2) << bad.what;
      EXPECT_EQ(outcome.output, "") << bad.what;
      EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
      EXPECT_THAT(outcome.errors, HasSubstr("--directions")) << bad.what;
      for (const std::string& part : bad.says) EXPECT_THAT(outcome.errors, HasSubstr(part)) << bad.what;
    }
  }
  const Outcome outcome = thread(changed(linen_thread, "1.46", "1"), two_pairs);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.errors, HasSubstr("thread.json: eta: 1 "));
}

TEST_F(FiberCloth, IsDrawnInThePlaneOfIncidence) {
  const std::string file =
      write("own.json", changed(plain_fabric, "{", R"({"description": "Sack & ashes",)"));
  const std::string picture = folder_.file("own.svg");
  const Outcome outcome =
      run({"plot", "--cloth", file, "--light", "0,45", "--plane", "90deg", "--output", picture});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  std::stringstream drawn;
  drawn << std::ifstream(picture).rdbuf();
  for (const char* const part :
       {"<svg", "Sack &amp; ashes", "plane at 90", "light at 0", "light at 45", "BRDF"})
    EXPECT_THAT(drawn.str(), HasSubstr(part));
  EXPECT_EQ(
      run({"plot", "--cloth", file, "--thread", "2", "--output", folder_.file("thread.png")}).exit_code, 0);
}

TEST_F(FiberCloth, WrongPicturesAreRefused) {
  const std::string picture = folder_.file("a.png");
  const std::vector<std::pair<std::vector<std::string>, std::string>> bad{
      {{"--cloth", "silk", "--output", picture}, "--cloth: \"silk\""},
      {{"--cloth", "velvet", "--output", folder_.file("a.gif")}, ".png or .svg"},
      {{"--cloth", "velvet", "--output", picture, "--light", "90"}, "--light: 90"},
      {{"--cloth", "velvet", "--output", picture, "--light", "0:40:10"}, "--light: 5 angles"},
      {{"--cloth", "velvet", "--output", picture, "--thread", "3"}, "--thread: \"3\""},
      {{"--cloth", "velvet", "--output", picture, "--samples", "0"}, "--samples"},
      {{"--cloth", "velvet", "--output", picture, "--phi", "0"}, "--phi: a fabric's plot"},
      {{"--cloth", "velvet", "--output", picture, "--lee"}, "--cloth"},
      {{"--light", "0", "--output", picture}, "add --cloth"},
      {{"--output", picture}, "FILE is missing"}};
  for (const auto& [arguments, says] : bad) {
    std::vector<std::string> line{"plot"};
    line.insert(line.end(), arguments.begin(), arguments.end());
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.exit_code, 2) << says;
    EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
    EXPECT_THAT(outcome.errors, HasSubstr(says));
  }
  EXPECT_THAT(folder_.names(), IsEmpty());
}

} // namespace
