// scatter info and scatter plot: what they tell and draw of tables that the library wrote.
#include "../table/example_table.hpp"
#include "run.hpp"
#include <scatter/table/files.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <fstream>
#include <sstream>
#include <string>

namespace {

namespace table = scatter::table;
using scatter::test::Outcome;
using scatter::test::run;
using scatter::test::TemporaryFolder;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

std::string write_example(const TemporaryFolder& folder, const std::string& name, bool matrix) {
  table::TableHeader head = table::example::header(12, 721, 36);
  head.matrix = matrix;
  table::example::write(*table::make_file_sink(folder.file(name), head), head);
  return folder.file(name);
}

std::string text_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

TEST(InfoVerb, TellsInWordsWhatIsInside) {
  const TemporaryFolder folder;
  const std::pair<const char*, const char*> formats[] = {
      {"a.nc", "netCDF-4"}, {"a.exr", "OpenEXR"}, {"a.json", "JSON"}};
  for (const auto& [name, format] : formats) {
    const Outcome outcome = run({"info", write_example(folder, name, false)});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    EXPECT_THAT(
        outcome.output,
        AllOf(
            HasSubstr(format), HasSubstr("beard-chuang, radius 0.4 mm"),
            HasSubstr("721, 0 .. 180 deg, every 0.25"), HasSubstr("36, 0 .. 350 deg, every 10 deg"),
            HasSubstr("patches, 1000 x 1000 rays"), HasSubstr("p = 5"), HasSubstr("sun elevation = 20 deg"),
            HasSubstr("in 12.3 s"), HasSubstr("over the sphere (1 = normalised)"),
            HasSubstr("at theta 1 deg, phi 0 deg, 380 nm")));
  }
}

TEST(InfoVerb, RoundsTheAxisRatioOfADrop) {
  const TemporaryFolder folder;
  const std::string file = folder.file("drop.json");
  ASSERT_EQ(
      run({"phase", "--radius", "0.5mm", "--sun", "20deg", "--wavelength", "650nm", "--rays", "50", "--theta",
           "130:150:5deg", "--phi", "0deg", "--output", file})
          .exit_code,
      0);
  EXPECT_THAT(run({"info", file}).output, HasSubstr("radius 0.5 mm, height/width 0.987674\n"));
}

TEST(InfoVerb, TellsMachinesTheSame) {
  const TemporaryFolder folder;
  const Outcome outcome = run({"info", "--json", write_example(folder, "a.nc", true)});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto json = nlohmann::json::parse(outcome.output);
  EXPECT_EQ(json.at("wavelength_m").size(), 12u);
  EXPECT_EQ(json.at("matrix"), true);
  EXPECT_EQ(json.at("orders"), nlohmann::json({0, 1, 2, 5}));
  EXPECT_EQ(json.at("theta_deg").at("last"), 180);
  EXPECT_NEAR(json.at("integral").at(3).get<double>(), 1, 2e-3);
  EXPECT_EQ(json.at("seconds"), 12.345678901234567);
  EXPECT_EQ(json.at("provenance").at("constants").at("radius_m"), "0.0004");
}

TEST(PlotVerb, DrawsCurvesBandsAndColours) {
  const TemporaryFolder folder;
  const std::string source = write_example(folder, "a.nc", false);
  const Outcome outcome = run({"plot", source, "--output", folder.file("a.svg")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.output + outcome.errors, "");
  EXPECT_THAT(
      text_of(folder.file("a.svg")),
      AllOf(
          HasSubstr("Beard-Chuang, radius 0.4 mm, φ = 0° (patches, 1000 x 1000 rays)"),
          HasSubstr("scattering angle (°)"), HasSubstr("phase function (sr⁻¹)"), HasSubstr("λ = 460 nm"),
          HasSubstr("unpolarised"), Not(HasSubstr("perpendicular")), HasSubstr("fill-opacity")));
}

TEST(PlotVerb, DrawsAStripForEveryPolarisationWhereTheTableKnowsThem) {
  const TemporaryFolder folder;
  for (const char* name : {"a.nc", "a.exr"}) {
    const std::string source = write_example(folder, name, true);
    ASSERT_EQ(run({"plot", source, "--phi", "41", "--output", folder.file("a.svg")}).exit_code, 0);
    EXPECT_THAT(
        text_of(folder.file("a.svg")), AllOf(
                                           HasSubstr("perpendicular"), HasSubstr("parallel"),
                                           HasSubstr("unpolarised"), HasSubstr("φ = 40°")));
  }
}

TEST(PlotVerb, DrawsWhatIsAskedFor) {
  const TemporaryFolder folder;
  const std::string source = write_example(folder, "a.json", false);
  ASSERT_EQ(
      run({"plot", source, "--wavelength", "500nm", "--from", "120", "--to", "150deg", "--no-strip",
           "--width", "600", "--height", "400", "--output", folder.file("a.svg")})
          .exit_code,
      0);
  EXPECT_THAT(
      text_of(folder.file("a.svg")), AllOf(
                                         HasSubstr("viewBox=\"0 0 600 400\""), HasSubstr("λ = 486.667 nm"),
                                         Not(HasSubstr("λ = 460 nm")), Not(HasSubstr("unpolarised"))));
  ASSERT_EQ(run({"plot", source, "--output", folder.file("a.png")}).exit_code, 0);
  EXPECT_THAT(text_of(folder.file("a.png")), StartsWith("\x89PNG"));
}

TEST(PlotVerb, DrawsWhatAFiberSendsAround) {
  const TemporaryFolder folder;
  for (const bool polar : {false, true}) {
    const std::string picture = folder.file(polar ? "polar.svg" : "plain.svg");
    std::vector<std::string> arguments{"plot",        "--azimuthal", "--sigma-a",
                                       "0.2,0.3,0.5", "--output",    picture};
    if (polar) arguments.emplace_back("--polar");
    const Outcome outcome = run(arguments);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
    std::ifstream file(picture);
    const std::string svg((std::istreambuf_iterator<char>(file)), {});
    for (const char* const words : {"η = 1.55", "TT, σ = 0.3", "TRT, σ = 0.5", "150"})
      EXPECT_THAT(svg, HasSubstr(words));
    EXPECT_EQ(svg.find("nan"), std::string::npos);
  }
}

TEST(PlotVerb, RefusesAzimuthalFiguresOfNothing) {
  const TemporaryFolder folder;
  const std::string picture = folder.file("a.png");
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"--azimuthal", "--eta", "1"}, "--eta"},
      {{"--azimuthal", "--sigma-a", "0.2,-1,0"}, "--sigma-a"},
      {{"--azimuthal", "--sigma-a", "0.2,0.3"}, "--sigma-a"},
      {{"--azimuthal", "--theta-d", "90deg"}, "--theta-d"},
      {{"--azimuthal", "--fiber-orders", "0..8"}, "--fiber-orders"},
      {{"--azimuthal", "--average", "0.01deg"}, "--average"},
      {{"--azimuthal", "--lee"}, "--azimuthal"},
      {{"--azimuthal", "table.nc"}, "FILE"},
      {{"--polar"}, "--polar: belongs to an azimuthal figure"},
  };
  for (const auto& [arguments, says] : cases) {
    std::vector<std::string> all{"plot", "--output", picture};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const Outcome outcome = run(all);
    EXPECT_EQ(outcome.exit_code, 2) << says;
    EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
    EXPECT_THAT(outcome.errors, HasSubstr(says));
  }
  EXPECT_TRUE(folder.names().empty());
}

TEST(PlotVerb, DrawsALeeDiagramThatThreadsDoNotChange) {
  const TemporaryFolder folder;
  for (const char* threads : {"1", "3"}) {
    const Outcome outcome = run(
        {"plot", "--lee", "--radii", "10:30um", "--angles", "120:150", "--size", "100x120",
         "--sample-wavelengths", "400:700:50nm", "--threads", threads, "--output",
         folder.file(std::string("lee") + threads + ".png")});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    EXPECT_EQ(outcome.output + outcome.errors, "");
  }
  const std::string one = text_of(folder.file("lee1.png"));
  EXPECT_THAT(one, StartsWith("\x89PNG"));
  EXPECT_EQ(one, text_of(folder.file("lee3.png")));
  for (const char* how : {"chromaticity", "common"}) {
    ASSERT_EQ(
        run({"plot", "--lee", "--radii", "10:30um", "--size", "100x120", "--sample-wavelengths",
             "400:700:50nm", "--normalise", how, "--output", folder.file("other.png")})
            .exit_code,
        0);
    EXPECT_NE(one, text_of(folder.file("other.png"))) << how;
  }
}

TEST(InfoAndPlotVerbs, RefuseWrongRequestsInOneLineAndLeaveNoFile) {
  const TemporaryFolder folder;
  const std::string source = write_example(folder, "a.json", false), picture = folder.file("a.svg");
  const std::vector<std::pair<std::vector<std::string>, const char*>> wrong{
      {{"info", folder.file("b.nc")}, "no such file"},
      {{"info", folder.path().string()}, "names no format"},
      {{"info"}, "FILE"},
      {{"plot", source}, "--output"},
      {{"plot", source, "--output", folder.file("a.pdf")}, ".png or .svg"},
      {{"plot", source, "--output", folder.file("no/a.svg")}, "no folder"},
      {{"plot", source, "--output", picture, "--wavelength", "900nm"}, "380 .. 673.333 nm"},
      {{"plot", source, "--output", picture, "--wavelength", "900"}, "900"},
      {{"plot", source, "--output", picture, "--phi", "500"}, "0 .. 350 deg"},
      {{"plot", source, "--output", picture, "--from", "150", "--to", "120"}, "a curve needs two"},
      {{"plot", source, "--output", picture, "--width", "10"}, "300 to 10000"},
      {{"plot", source, "--output", picture, "--exposure", "nan"}, "stops"},
      {{"plot", "--output", picture}, "FILE is missing"},
      {{"plot", source, "--output", picture, "--radii", "1:2um"}, "--radii: belongs to a Lee diagram"},
      {{"plot", source, "--lee", "--output", picture}, "FILE: a Lee diagram"},
      {{"plot", "--lee", "--output", folder.file("a.pdf")}, ".png or .svg"},
      {{"plot", "--lee", "--output", folder.file("no/a.png")}, "no folder"},
      {{"plot", "--lee", "--output", picture, "--exposure", "nan"}, "stops"},
      {{"plot", "--lee", "--output", picture, "--radii", "10um"}, "--radii: \"10um\" is not first:last"},
      {{"plot", "--lee", "--output", picture, "--radii", "1mm:10um"}, "ends before it starts"},
      {{"plot", "--lee", "--output", picture, "--radii", "1mm:1m"}, "size parameter"},
      {{"plot", "--lee", "--output", picture, "--angles", "120:190"}, "0deg..180deg"},
      {{"plot", "--lee", "--output", picture, "--size", "400"}, "RADIIxANGLES"},
      {{"plot", "--lee", "--output", picture, "--size", "4x4"}, "100 to 10000"},
      {{"plot", "--lee", "--output", picture, "--sun-disc", "0"}, "--sun-disc"},
      {{"plot", "--lee", "--output", picture, "--sample-wavelengths", "50nm"}, "--sample-wavelengths"},
      {{"plot", "--lee", "--output", picture, "--normalise", "loud"}, "radius, chromaticity or common"},
      {{"plot", "--lee", "--output", picture, "--spheres", "0"}, "--spheres"}};
  for (const auto& [arguments, part] : wrong) {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << part;
    EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
    EXPECT_THAT(outcome.errors, HasSubstr(part));
  }
  EXPECT_THAT(folder.names(), ElementsAre("a.json"));
}

} // namespace
