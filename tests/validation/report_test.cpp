// `scatter validate` as a user meets it: a quick run of every case, and what it refuses.
#include <app/run.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <string>
#include <tuple>

namespace scatter::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// One quick run serves all tests of its report.
class QuickReport : public testing::Test {
protected:
  static void SetUpTestSuite() {
    folder = new TemporaryFolder;
    outcome = new Outcome(run({"validate", "--quick", "--output", folder->file("report")}));
    if (outcome->exit_code != 0) return;
    json = new nlohmann::json(nlohmann::json::parse(contents(folder->file("report/report.json"))));
    html = new std::string(contents(folder->file("report/index.html")));
  }
  static void TearDownTestSuite() {
    delete html;
    delete json;
    delete outcome;
    delete folder;
  }
  void SetUp() override { ASSERT_EQ(outcome->exit_code, 0) << outcome->errors; }

  static const nlohmann::json& find(const std::string& name) {
    for (const auto& one : (*json)["cases"])
      if (one["name"] == name) return one;
    throw std::out_of_range("no case " + name);
  }

  inline static TemporaryFolder* folder = nullptr;
  inline static Outcome* outcome = nullptr;
  inline static nlohmann::json* json = nullptr;
  inline static std::string* html = nullptr;
};

TEST_F(QuickReport, HoldsEveryCaseAndSaysThatItIsQuick) {
  EXPECT_THAT(std::filesystem::exists(folder->file("report/patches-accuracy.csv")), testing::IsTrue());
  EXPECT_THAT(folder->names(), ElementsAre("report"));
  EXPECT_EQ((*json)["quick"], true);
  EXPECT_THAT(*html, HasSubstr("A quick run."));
  std::vector<std::string> names;
  for (const auto& one : (*json)["cases"]) names.push_back(one["name"]);
  EXPECT_THAT(names, ElementsAre("sphere", "figure-3.12", "figure-3.7", "energy", "bow-angles"));
  EXPECT_THAT(outcome->errors, IsEmpty());
}

TEST_F(QuickReport, PublishedBoundsHold) {
  std::size_t checks = 0;
  for (const auto& one : (*json)["cases"])
    for (const auto& check : one["checks"]) {
      ++checks;
      const double value = check["value"], bound = check["bound"];
      EXPECT_EQ(check["holds"].get<bool>(), value <= bound) << check;
      EXPECT_LE(value, bound) << one["name"] << " " << check;
    }
  EXPECT_GE(checks, 27U); // 20 bows, 4 orders' energies, 3 maxima
}

TEST_F(QuickReport, SphereErrorsAreThoseOfTheMethod) {
  std::map<std::tuple<double, double, std::string>, nlohmann::json> found;
  for (const auto& entry : find("sphere")["summary"])
    if (entry["average"] == "sun-disc")
      found[{entry["radius_m"], entry["region_deg"][0], entry["diffraction"]}] = entry;
  ASSERT_EQ(found.size(), 2U * 6 * 2);
  const auto rms = [&](double radius, double from, const char* diffraction) {
    return found.at({radius, from, diffraction})["intensity_rms"].get<double>();
  };
  // Orders 0..3 alone, with perfect amplitudes, leave 13.7 % in Alexander's band at 0.4 mm: a smaller error
  // would mean that something is compared with itself.
  EXPECT_GT(rms(0.4e-3, 130, "none"), 0.1);
  EXPECT_LT(rms(0.4e-3, 130, "none"), 0.4);
  // Away from bows and poles rays are good, and better for larger spheres.
  EXPECT_GT(rms(0.4e-3, 30, "none"), 0.02);
  EXPECT_LT(rms(0.4e-3, 30, "none"), 0.1);
  EXPECT_LT(rms(0.1e-3, 30, "none"), 0.2);
  EXPECT_LT(rms(0.4e-3, 150, "none"), 0.12);
  EXPECT_LT(rms(0.4e-3, 30, "none"), rms(0.1e-3, 30, "none"));
  // The filter acts on the bows and nowhere else.
  EXPECT_EQ(rms(0.4e-3, 30, "none"), rms(0.4e-3, 30, "gaussian"));
  EXPECT_NE(rms(0.4e-3, 137, "none"), rms(0.4e-3, 137, "gaussian"));
  for (const auto& [key, entry] : found) {
    EXPECT_GT(entry["intensity_rms"].get<double>(), 0.01) << entry;
    EXPECT_LT(entry["intensity_rms"].get<double>(), 1) << entry;
    EXPECT_LT(entry["polarisation_rms"].get<double>(), 0.3) << entry;
    EXPECT_GE(entry["intensity_max"].get<double>(), entry["intensity_rms"].get<double>());
    EXPECT_LE(std::abs(entry["intensity_bias"].get<double>()), entry["intensity_rms"].get<double>());
  }
  // Twice the shadow is short of the exact cross section by about x^(-2/3).
  for (const auto& entry : find("sphere")["cross_sections"]) {
    const double x = 2 * 3.14159265 * entry["radius_m"].get<double>() / entry["wavelength_m"].get<double>();
    EXPECT_NEAR(entry["relative_difference"].get<double>(), -std::pow(x, -2.0 / 3), std::pow(x, -2.0 / 3));
  }
}

TEST_F(QuickReport, EveryEntryHasItsTimes) {
  const auto& entries = find("sphere")["entries"];
  EXPECT_EQ(entries.size(), 2U * 3 * 6 * 2 * 2); // radii, wavelengths, regions, filters, averages
  for (const auto& entry : entries) {
    EXPECT_GT(entry["seconds_rays"].get<double>(), 0);
    EXPECT_GT(entry["seconds_exact"].get<double>(), 0);
  }
}

TEST_F(QuickReport, MoreRaysComeNearerToTheLimit) {
  std::map<double, std::map<int, double>> to_finest;
  for (const auto& row : find("sphere")["convergence"]["rows"])
    to_finest[row["region_deg"][0]][row["rays"]] = row["to_finest"]["intensity_rms"];
  EXPECT_EQ(to_finest.size(), 6U);
  for (const auto& [region, errors] : to_finest)
    // In the dark band hardly anything depends on the grid: there both are small.
    EXPECT_LT(errors.rbegin()->second, std::max(errors.begin()->second, 0.005)) << region;
}

TEST_F(QuickReport, InterferenceMakesTheSupernumeraries) {
  std::map<std::pair<std::string, double>, double> rms;
  for (const auto& row : find("figure-3.12")["rows"])
    rms[{row["stage"], row["region_deg"][0]}] = row["sun_disc_intensity_rms"];
  EXPECT_LT((rms.at({"interference", 120})), 0.5 * rms.at({"geometric", 120}));
}

TEST_F(QuickReport, PageIsWholeAndFetchesNothing) {
  EXPECT_THAT(*html, testing::StartsWith("<!DOCTYPE html>"));
  EXPECT_THAT(*html, testing::EndsWith("</body></html>\n"));
  // Names of XML's name spaces look like addresses; nothing fetches them.
  const std::string page =
      std::regex_replace(*html, std::regex(R"(xmlns(:xlink)?="http://www\.w3\.org/[^"]*")"), "");
  for (const char* const what :
       {"http:", "https:", "//www", "<script", "<link", "<img", "<iframe", "<object", "src=", "@import",
        "@font-face", "url("})
    EXPECT_EQ(page.find(what), std::string::npos) << what;
  std::size_t figures = 0;
  for (std::size_t at = page.find("<svg"); at != std::string::npos; at = page.find("<svg", at + 1)) ++figures;
  EXPECT_EQ(figures, 5U);
  for (std::size_t at = page.find("href="); at != std::string::npos; at = page.find("href=", at + 1))
    EXPECT_EQ(page[at + 6], '#') << page.substr(at, 60);
  for (const char* const nonsense : {"nan", "inf "})
    EXPECT_EQ(page.find(std::string(">") + nonsense), std::string::npos);
}

TEST(Validate, ListsItsCases) {
  const Outcome outcome = run({"validate", "--list"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.output, HasSubstr("figure-3.12"));
  EXPECT_THAT(outcome.output, HasSubstr("bow-angles"));
}

class Refused : public testing::TestWithParam<std::tuple<std::vector<std::string>, const char*>> {};

TEST_P(Refused, InOneLineBeforeWorkStarts) {
  const TemporaryFolder folder;
  std::vector<std::string> arguments{"validate", "--output", folder.file("report")};
  const auto& [more, message] = GetParam();
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 2) << outcome.errors;
  EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
  EXPECT_THAT(outcome.errors, HasSubstr(message));
  EXPECT_THAT(folder.names(), IsEmpty());
}

using Arguments = std::vector<std::string>;
INSTANTIATE_TEST_SUITE_P(
    Options, Refused,
    testing::Values(
        std::tuple(Arguments{"--case", "cube"}, "sphere, figure-3.12"),
        std::tuple(Arguments{"--radius", "1um"}, "0.005mm to 3mm"),
        std::tuple(Arguments{"--radius", "-1mm"}, "--radius"),
        std::tuple(Arguments{"--wavelengths", "150nm"}, "--wavelengths"),
        std::tuple(Arguments{"--wavelengths", "2um"}, "--wavelengths"),
        std::tuple(Arguments{"--index", "hale-querry", "--wavelengths", "300nm"}, "--wavelengths"),
        std::tuple(Arguments{"--wavelengths", "300nm"}, "380nm to 780nm"),
        std::tuple(Arguments{"--rays", "1"}, "--rays"), std::tuple(Arguments{"--orders", "-1"}, "--orders"),
        std::tuple(Arguments{"--threads", "many"}, "--threads"),
        std::tuple(Arguments{"--output", "/nowhere/at/all"}, "--output")));

TEST(Validate, OrdersThatLeaveTheSkyDarkAreReported) {
  const TemporaryFolder folder;
  const Outcome outcome = run(
      {"validate", "--quick", "--case", "sphere,figure-3.12", "--orders", "1,2", "--radius", "0.1mm",
       "--rays", "100", "--output", folder.file("report")});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_THAT(contents(folder.file("report/index.html")), HasSubstr("no light"));
}

TEST(Validate, FullDiskLeavesNothing) {
  const TemporaryFolder folder;
  const Outcome outcome = shell(
      "ulimit -f 8; exec $SCATTER validate --quick --case bow-angles,figure-3.7 --output " +
      folder.file("report"));
  EXPECT_EQ(outcome.exit_code, 1) << outcome.errors;
  EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
  EXPECT_THAT(folder.names(), IsEmpty());
}

} // namespace
} // namespace scatter::test
