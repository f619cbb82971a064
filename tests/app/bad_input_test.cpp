// Every wrong request: exit status 2, nothing on standard output, and one line on standard error that names
// the option and quotes what was written.
#include "run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace {

using scatter::test::run;
using testing::HasSubstr;
using testing::StartsWith;

struct Case {
  const char* name;
  std::vector<std::string> arguments;
  std::vector<std::string> says; ///< each stands somewhere in the line
};

void PrintTo(const Case& bad, std::ostream* stream) {
  *stream << bad.name;
}

class BadInput : public testing::TestWithParam<Case> {};

TEST_P(BadInput, IsRefusedInOneLineThatNamesIt) {
  const auto outcome = run(GetParam().arguments);
  EXPECT_EQ(outcome.exit_code, 2) << "signal " << outcome.signal;
  EXPECT_EQ(outcome.output, "");
  EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
  EXPECT_THAT(outcome.errors, StartsWith("scatter"));
  for (const std::string& part : GetParam().says) EXPECT_THAT(outcome.errors, HasSubstr(part));
}

/// A request that is right but for what is added. Later options would be "given more than once", so a key of
/// `changed` replaces the standard value and an empty one removes it.
std::vector<std::string>
phase(std::vector<std::pair<std::string, std::string>> changed, std::vector<std::string> added = {}) {
  std::vector<std::pair<std::string, std::string>> options{{"--radius", "0.5mm"}, {"--wavelengths", "650nm"},
                                                           {"--theta", "138"},    {"--phi", "0"},
                                                           {"--rays", "50"},      {"--output", "none"}};
  for (const auto& [key, value] : changed) {
    std::erase_if(options, [&](const auto& option) { return option.first == key; });
    if (!value.empty()) options.emplace_back(key, value);
  }
  std::vector<std::string> arguments{"phase"};
  for (const auto& [key, value] : options) {
    arguments.push_back(key);
    arguments.push_back(value);
  }
  arguments.insert(arguments.end(), added.begin(), added.end());
  return arguments;
}

std::string name_of(const testing::TestParamInfo<Case>& info) {
  return info.param.name;
}

INSTANTIATE_TEST_SUITE_P(
    CommandLine, BadInput,
    testing::Values(
        Case{"UnknownVerb", {"phas"}, {"phas", "did you mean phase?"}},
        Case{"UnknownVerbFarFromAny", {"teleport"}, {"teleport", "scatter --help"}},
        Case{
            "UnknownOption",
            {"phase", "--radus", "1mm"},
            {"scatter phase: ", "--radus", "did you mean --radius?"}},
        Case{"UnknownOptionWithValue", {"phase", "--wavelenght=1nm"}, {"--wavelenght", "--wavelength"}},
        Case{"UnknownShortOption", {"phase", "-q"}, {"-q", "scatter phase --help"}},
        Case{"UnknownProgramOption", {"--verbos"}, {"--verbos", "--verbose"}},
        Case{"StrayArgument", phase({}, {"stray"}), {"stray"}},
        Case{"ControlCharactersStayOnOneLine", {"phase", "--ra\ndius"}, {"scatter phase: "}},
        Case{"MissingValue", {"phase", "--radius"}, {"--radius needs a value"}},
        Case{"GivenTwice", phase({}, {"--radius", "1mm"}), {"--radius is given more than once"}}),
    name_of);

std::vector<std::string> fiber_azimuth(const std::vector<std::string>& added) {
  std::vector<std::string> arguments{"fiber", "azimuth"};
  arguments.insert(arguments.end(), added.begin(), added.end());
  return arguments;
}

INSTANTIATE_TEST_SUITE_P(
    FiberAzimuth, BadInput,
    testing::Values(
        Case{"FiberAlone", {"fiber"}, {"scatter fiber: ", "verb is missing", "scatter fiber --help"}},
        Case{"FiberUnknownVerb", {"fiber", "azimut"}, {"scatter fiber: ", "azimut", "did you mean azimuth?"}},
        Case{
            "FiberUnknownOption",
            fiber_azimuth({"--etta", "1.5"}),
            {"scatter fiber azimuth: ", "--etta", "did you mean --eta?"}},
        Case{
            "FiberMissingValue",
            fiber_azimuth({"--eta"}),
            {"scatter fiber azimuth: ", "--eta needs a value", "scatter fiber azimuth --help"}},
        Case{"FiberStray", fiber_azimuth({"--eta", "1.5", "stray"}), {"scatter fiber azimuth: ", "stray"}},
        Case{"EtaMissing", fiber_azimuth({}), {"scatter fiber azimuth: ", "--eta is missing", "1.55"}},
        Case{"EtaOne", fiber_azimuth({"--eta", "1"}), {"--eta", "\"1\"", "greater than 1"}},
        Case{"EtaThin", fiber_azimuth({"--eta", "0.7"}), {"--eta", "0.7"}},
        Case{"EtaNaN", fiber_azimuth({"--eta", "nan"}), {"--eta", "nan"}},
        Case{"EtaInfinite", fiber_azimuth({"--eta", "1e999"}), {"--eta", "1e999"}},
        Case{"EtaComplex", fiber_azimuth({"--eta", "1.5+1i"}), {"--eta", "1.5+1i"}},
        Case{
            "SigmaNegative",
            fiber_azimuth({"--eta", "1.5", "--sigma-a", "-0.1"}),
            {"--sigma-a", "-0.1", "negative"}},
        Case{"SigmaNaN", fiber_azimuth({"--eta", "1.5", "--sigma-a", "nan"}), {"--sigma-a", "nan"}},
        Case{
            "ThetaDRight",
            fiber_azimuth({"--eta", "1.5", "--theta-d", "90deg"}),
            {"--theta-d", "90deg", "-90deg"}},
        Case{"ThetaDLeft", fiber_azimuth({"--eta", "1.5", "--theta-d=-90"}), {"--theta-d", "-90"}},
        Case{"ThetaDNaN", fiber_azimuth({"--eta", "1.5", "--theta-d", "nan"}), {"--theta-d", "nan"}},
        Case{"FiberPhiFar", fiber_azimuth({"--eta", "1.5", "--phi", "361"}), {"--phi", "361"}},
        Case{"FiberPhiNaN", fiber_azimuth({"--eta", "1.5", "--phi", "nan"}), {"--phi", "nan"}},
        Case{"FiberOrders", fiber_azimuth({"--eta", "1.5", "--orders", "-1"}), {"--orders", "-1"}},
        Case{"FiberOrdersMany", fiber_azimuth({"--eta", "1.5", "--orders", "1001"}), {"--orders", "1001"}},
        Case{
            "FiberPolarisation",
            fiber_azimuth({"--eta", "1.5", "--polarisation", "s"}),
            {"--polarisation", "\"s\"", "tracked"}},
        Case{
            "FiberOutput",
            fiber_azimuth({"--eta", "1.5", "--output", "a.txt"}),
            {"--output", "a.txt", "json"}},
        Case{
            "FiberCsv",
            fiber_azimuth({"--eta", "1.5", "--output", "none.csv"}),
            {"--output", "none.csv", "json"}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Quantities, BadInput,
    testing::Values(
        Case{"RadiusMissing", phase({{"--radius", ""}}), {"--radius is missing", "0.5mm"}},
        Case{"RadiusWithoutUnit", phase({{"--radius", "0.5"}}), {"--radius", "\"0.5\"", "mm"}},
        Case{"RadiusUnknownUnit", phase({{"--radius", "0.5furlong"}}), {"--radius", "furlong", "mm"}},
        Case{"RadiusNegative", phase({{"--radius", "-0.5mm"}}), {"--radius", "-0.5mm", "greater than zero"}},
        Case{"RadiusZero", phase({{"--radius", "0mm"}}), {"--radius", "0mm"}},
        Case{"RadiusNaN", phase({{"--radius", "nanmm"}}), {"--radius", "nanmm"}},
        Case{"RadiusInfinite", phase({{"--radius", "infmm"}}), {"--radius", "infmm"}},
        Case{"RadiusOverflow", phase({{"--radius", "1e999mm"}}), {"--radius", "1e999mm"}},
        Case{"RadiusTrailing", phase({{"--radius", "0.5mmm"}}), {"--radius", "0.5mmm"}},
        Case{"RadiusDecimalComma", phase({{"--radius", "0,5mm"}}), {"--radius", "0,5mm"}},
        Case{"WavelengthsMissing", phase({{"--wavelengths", ""}}), {"--wavelengths is missing", "nm"}},
        Case{
            "WavelengthsEmpty",
            phase({{"--wavelengths", ""}}, {"--wavelengths", ""}),
            {"--wavelengths", "empty"}},
        Case{
            "WavelengthsHoleInList",
            phase({{"--wavelengths", "650nm,,600nm"}}),
            {"--wavelengths", "650nm,,600nm"}},
        Case{
            "WavelengthsInverted",
            phase({{"--wavelengths", "700:380:10nm"}}),
            {"--wavelengths", "700:380:10nm"}},
        Case{"WavelengthsZeroStep", phase({{"--wavelengths", "380:700:0nm"}}), {"--wavelengths", "step"}},
        Case{
            "WavelengthsAbsurdlyMany",
            phase({{"--wavelengths", "380:700:1e-9nm"}}),
            {"--wavelengths", "10 million"}},
        Case{"WavelengthsOutsideIndexData", phase({{"--wavelengths", "2um"}}), {"2000", "nm"}},
        Case{
            "WavelengthsOutsideTable32",
            phase({{"--wavelengths", "300nm"}, {"--index", "hale-querry"}}),
            {"300", "380"}},
        Case{"SunBelowHorizon", phase({{"--sun", "-5deg"}}), {"--sun", "-5", "90"}},
        Case{"SunPastZenith", phase({{"--sun", "91deg"}}), {"--sun", "91", "90"}},
        Case{"SunNaN", phase({{"--sun", "nan"}}), {"--sun", "nan"}},
        Case{"SunUnknownUnit", phase({{"--sun", "20grad"}}), {"--sun", "grad", "deg"}},
        Case{"SunDiscNegative", phase({}, {"--sun-disc", "-1deg"}), {"--sun-disc", "-1"}},
        Case{"ThetaNegative", phase({{"--theta", "-1"}}), {"--theta", "-1", "180"}},
        Case{"ThetaPast180", phase({{"--theta", "0:181:1"}}), {"--theta", "181", "180"}},
        Case{"ThetaNotIncreasing", phase({{"--theta", "10,5"}}), {"--theta", "increas"}},
        Case{"ThetaRepeated", phase({{"--theta", "10,10"}}), {"--theta", "increas"}},
        Case{"ThetaInverted", phase({{"--theta", "180:0:1"}}), {"--theta", "180:0:1"}},
        Case{"ThetaEmpty", phase({{"--theta", ""}}, {"--theta", ""}), {"--theta", "empty"}},
        Case{"PhiNotIncreasing", phase({{"--phi", "90,0"}}), {"--phi", "increas"}},
        Case{"PhiPast360", phase({{"--phi", "0:361:1"}}), {"--phi", "361", "360"}},
        Case{"IndexWithGain", phase({{"--index", "1.33-0.1i"}}), {"--index", "1.33-0.1i", "k < 0"}},
        Case{"IndexZero", phase({{"--index", "0"}}), {"--index", "\"0\""}},
        Case{"IndexNaN", phase({{"--index", "nan"}}), {"--index", "nan"}},
        Case{"IndexOne", phase({{"--index", "1"}}), {"--index"}},
        Case{"IndexUnknown", phase({{"--index", "whiskey"}}), {"--index", "whiskey", "iapws"}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Drop, BadInput,
    testing::Values(
        Case{"ShapeUnknown", phase({{"--shape", "cube"}}), {"--shape", "cube", "beard-chuang"}},
        Case{
            "RadiusPastBeardChuang",
            phase({{"--radius", "10mm"}}),
            {"--radius", "10 mm", "beard-chuang", "3 mm"}},
        Case{
            "RadiusPastChuangBeard",
            phase({{"--radius", "5mm"}, {"--shape", "chuang-beard"}}),
            {"--radius", "5 mm", "chuang-beard", "3 mm"}},
        Case{"AxisRatioMissing", phase({{"--shape", "spheroid"}}), {"--axis-ratio", "spheroid"}},
        Case{
            "AxisRatioForSphere",
            phase({{"--shape", "sphere"}, {"--axis-ratio", "0.9"}}),
            {"--axis-ratio", "sphere"}},
        Case{"AxisRatioForBeardChuang", phase({{"--axis-ratio", "0.9"}}), {"--axis-ratio", "beard-chuang"}},
        Case{
            "AxisRatioNegative",
            phase({{"--shape", "spheroid"}, {"--axis-ratio", "-0.9"}}),
            {"--axis-ratio", "-0.9"}},
        Case{
            "AxisRatioNaN",
            phase({{"--shape", "spheroid"}, {"--axis-ratio", "nan"}}),
            {"--axis-ratio", "nan"}},
        Case{
            "AxisRatioTooFlat",
            phase({{"--shape", "spheroid"}, {"--axis-ratio", "0.01"}}),
            {"--axis-ratio", "0.01", "0.2"}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Method, BadInput,
    testing::Values(
        Case{"OneRay", phase({{"--rays", "1"}}), {"--rays", "1"}},
        Case{"NegativeRays", phase({{"--rays", "-5"}}), {"--rays", "-5"}},
        Case{"AbsurdlyManyRays", phase({{"--rays", "2000000000"}}), {"--rays", "2000000000"}},
        Case{"RaysOverflow", phase({{"--rays", "99999999999"}}), {"--rays", "99999999999"}},
        Case{"RaysNotWhole", phase({{"--rays", "10.5"}}), {"--rays", "10.5"}},
        Case{"NegativeThreads", phase({{"--threads", "-1"}}), {"--threads", "-1"}},
        Case{"OrdersNegative", phase({{"--orders", "-1"}}), {"--orders", "-1", "0..3"}},
        Case{"OrdersInverted", phase({{"--orders", "3..0"}}), {"--orders", "3..0"}},
        Case{"OrdersEmpty", phase({}, {"--orders", ""}), {"--orders", "empty"}},
        Case{"MethodUnknown", phase({{"--method", "magic"}}), {"--method", "magic", "patches"}},
        Case{
            "MieWithOrders",
            phase({{"--shape", "sphere"}, {"--method", "mie"}, {"--orders", "0..3"}}),
            {"--method mie", "--orders", "patches"}},
        Case{
            "MieWithDiffraction",
            phase({{"--shape", "sphere"}, {"--method", "mie"}, {"--diffraction", "none"}}),
            {"--method mie", "--diffraction", "patches"}},
        Case{
            "MieWithRays",
            phase({{"--shape", "sphere"}, {"--method", "mie"}, {"--rays", "1000"}}),
            {"--method mie", "--rays", "patches"}},
        Case{
            "MieWithFocalLines",
            phase({{"--shape", "sphere"}, {"--method", "mie"}, {"--focal-lines", "exact"}, {"--rays", ""}}),
            {"--method mie", "--focal-lines", "patches"}},
        Case{"MieForADrop", phase({{"--method", "mie"}}), {"--method", "mie", "sphere"}},
        Case{
            "DiffractionUnknown",
            phase({{"--diffraction", "airy"}}),
            {"--diffraction", "airy", "gaussian", "integral", "none"}},
        Case{
            "IntegralByTheRule",
            phase({{"--diffraction", "integral"}, {"--focal-lines", "rule"}}),
            {"--diffraction integral", "--focal-lines exact"}},
        Case{
            "IntegralOfIntensities",
            phase({{"--diffraction", "integral"}}, {"--no-interference"}),
            {"--diffraction integral", "--no-interference"}},
        Case{"FocalLinesUnknown", phase({{"--focal-lines", "all"}}), {"--focal-lines", "all", "exact"}},
        Case{
            "IntegralOfADust",
            phase(
                {{"--shape", "spheroid"},
                 {"--axis-ratio", "0.9"},
                 {"--radius", "1um"},
                 {"--diffraction", "integral"}}),
            {"--diffraction integral", "too small", "20"}},
        Case{
            "ToleranceOutOfReach",
            phase({{"--theta", "120:150:1"}, {"--phi", "0"}, {"--tolerance", "1e-6"}}),
            {"--tolerance", "out of reach", "--orders"}},
        Case{
            "ToleranceWithoutTheIntegral",
            phase(
                {{"--theta", "137:139:1"}, {"--phi", "0"}, {"--tolerance", "5%"}, {"--focal-lines", "rule"}}),
            {"--tolerance", "out of reach", "drop --focal-lines"}},
        Case{
            "ToleranceOfIntensities",
            phase({{"--theta", "137:139:1"}, {"--phi", "0"}, {"--tolerance", "5%"}}, {"--no-interference"}),
            {"--tolerance", "out of reach", "drop --no-interference"}},
        Case{"ToleranceOfAll", phase({{"--tolerance", "100%"}}), {"--tolerance", "100%", "0.01"}},
        Case{"ToleranceNegative", phase({{"--tolerance", "-1%"}}), {"--tolerance", "-1%"}},
        Case{"ToleranceWord", phase({{"--tolerance", "good"}}), {"--tolerance", "good"}},
        Case{
            "RasterOfUnevenAngles",
            phase({{"--theta", "1,2,4"}, {"--search", "raster"}}),
            {"--search", "raster", "tree"}},
        Case{"SearchUnknown", phase({{"--search", "grep"}}), {"--search", "grep", "tree"}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Output, BadInput,
    testing::Values(
        Case{"UnknownExtension", phase({{"--output", "drop.docx"}}), {"drop.docx", ".nc"}},
        Case{"NoExtension", phase({{"--output", "drop"}}), {"drop", ".nc"}},
        Case{"EmptyName", phase({{"--output", ""}}, {"--output", ""}), {"--output", "empty"}},
        Case{"FolderNotThere", phase({{"--output", "/nowhere/at/all/drop.nc"}}), {"/nowhere/at/all"}},
        Case{"CompressionUnknown", phase({{"--compression", "lzma"}}), {"--compression", "lzma", "deflate"}},
        Case{"PrecisionUnknown", phase({{"--precision", "half"}}), {"--precision", "half", "single"}},
        Case{
            "MoreMemoryThanThereIs",
            phase(
                {{"--theta", "0:180:0.001deg"}, {"--phi", "0:360:0.001deg"}, {"--output", "none"}},
                {"--matrix"}),
            {"memory", "GB"}}),
    name_of);

TEST(BadMachine, WithoutOpenClIsRefusedInOneLine) {
  const auto outcome = run(phase({}), {"OCL_ICD_VENDORS=/nonexistent"});
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
  EXPECT_THAT(outcome.errors, HasSubstr("OpenCL"));
}

/// A `scatter mie` for water drops of 10 um at 650 nm in the sun, with more options.
std::vector<std::string> average(std::vector<std::string> more, bool radius = true, bool wavelength = true) {
  std::vector<std::string> arguments{"mie", "--angles", "138"};
  if (radius) arguments.insert(arguments.end(), {"--radius", "10um"});
  if (wavelength) arguments.insert(arguments.end(), {"--wavelength", "650nm"});
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}
std::vector<std::string> sizes(const std::string& distribution) {
  return average({"--distribution", distribution}, false);
}

INSTANTIATE_TEST_SUITE_P(
    Averages, BadInput,
    testing::Values(
        Case{"DistributionUnknown", sizes("poisson:mean=3"), {"--distribution", "poisson", "lognormal:"}},
        Case{"DistributionEmpty", sizes(""), {"--distribution", "lognormal:"}},
        Case{"MedianMissing", sizes("lognormal:sigma=1.3"), {"--distribution", "median is missing"}},
        Case{"MedianWithoutUnit", sizes("lognormal:median=10,sigma=1.3"), {"median", "\"10\" has no unit"}},
        Case{"SigmaOfOne", sizes("lognormal:median=10um,sigma=1"), {"sigma 1", "geometric"}},
        Case{"SigmaNaN", sizes("lognormal:median=10um,sigma=nan"), {"sigma", "nan"}},
        Case{"PartTwice", sizes("lognormal:median=1um,median=2um,sigma=2"), {"\"median\" is given twice"}},
        Case{"PartUnknown", sizes("lognormal:median=1um,sigma=2,tail=3"), {"unknown name \"tail\""}},
        Case{"PartWithoutValue", sizes("lognormal:median"), {"\"median\" is no name=value"}},
        Case{"MuTooSmall", sizes("gamma:mu=-1,lambda=3/mm"), {"mu -1", "above -1"}},
        Case{"LambdaWithoutUnit", sizes("gamma:mu=1,lambda=3"), {"lambda", "3/mm"}},
        Case{"LambdaNegative", sizes("gamma:mu=1,lambda=-3/mm"), {"lambda", "not positive"}},
        Case{"VarianceTooLarge", sizes("gamma:effective-radius=1um,effective-variance=0.5"), {"0.5"}},
        Case{"RateWithoutUnit", sizes("marshall-palmer:rate=5"), {"rate", "mm/h"}},
        Case{"RateZero", sizes("marshall-palmer:rate=0mm/h"), {"rate", "not positive"}},
        Case{"CutInverted", sizes("marshall-palmer:rate=5mm/h,from=2mm,to=1mm"), {"from", "smaller than to"}},
        Case{"CutWithoutDrops", sizes("lognormal:median=1um,sigma=1.1,from=1mm"), {"no drops between"}},
        Case{"ListWithoutFile", sizes("list:"), {"list:FILE"}},
        Case{"ListNotThere", sizes("list:/no/such/file.csv"), {"/no/such/file.csv", "cannot be read"}},
        Case{"DropsTooLarge", sizes("lognormal:median=1m,sigma=1.1"), {"--distribution", "size parameter"}},
        Case{"RadiusAndDistribution", average({"--distribution", "list:x"}), {"--radius", "--distribution"}},
        Case{"NoSizeForTheDisc", average({"--sun-disc", "0.5"}, false), {"--radius", "--distribution"}},
        Case{
            "NoWavelengthForTheDisc",
            average({"--sun-disc", "0.5"}, true, false),
            {"--wavelength", "--band"}},
        Case{
            "DiscOfSizeParameter",
            {"mie", "--x", "10", "--index", "1.3", "--sun-disc", "1"},
            {"--size-parameter"}},
        Case{"DiscZero", average({"--sun-disc", "0deg"}), {"--sun-disc", "0.533deg"}},
        Case{"DiscHuge", average({"--sun-disc", "90deg"}), {"--sun-disc", "90deg"}},
        Case{"BandAndWavelength", average({"--band", "500:600nm"}), {"--wavelength", "--band"}},
        Case{"BandOfOne", average({"--band", "500nm"}, true, false), {"--band", "first:last"}},
        Case{"BandInverted", average({"--band", "600:500nm"}, true, false), {"--band", "ends before"}},
        Case{"BandPastTheIndex", average({"--band", "500nm:2um"}, true, false), {"--band", "1100"}},
        Case{
            "BandWeightUnknown",
            average({"--band", "500:600nm", "--band-weight", "moon"}, true, false),
            {"--band-weight", "moon", "sunlight"}},
        Case{"BandWeightAlone", average({"--band-weight", "uniform"}), {"--band-weight", "--band"}},
        Case{"ToleranceZero", average({"--tolerance", "0"}), {"--tolerance", "\"0\""}},
        Case{"ToleranceNaN", average({"--tolerance", "nan"}), {"--tolerance", "nan"}},
        Case{"SpheresNotWhole", average({"--spheres", "1.5"}), {"--spheres", "1.5"}},
        Case{"OrdersOfAnAverage", average({"--sun-disc", "0.5", "--orders", "2"}), {"--orders"}},
        Case{"IndexOneAveraged", average({"--sun-disc", "0.5", "--index", "1"}), {"--index", "1"}},
        Case{
            "AnglePastTheBackAveraged",
            {"mie", "--radius", "1um", "--wavelength", "1um", "--index", "1.3", "--sun-disc", "1", "--angles",
             "181"},
            {"--angles", "181"}},
        Case{
            "AverageToUnknownFormat",
            average({"--sun-disc", "0.5", "--output", "a.nc"}),
            {"--output", "a.nc", ".csv"}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Cloth, BadInput,
    testing::Values(
        Case{
            "FabricUnknown",
            {"fiber", "cloth", "--fabric", "velvte", "--directions", "-"},
            {"--fabric", "velvte", "did you mean velvet?"}},
        Case{
            "FabricFarFromAny",
            {"fiber", "cloth", "--fabric", "chainmail", "--directions", "-"},
            {"--fabric", "chainmail", "linen-plain"}},
        Case{
            "FabricFileNotThere",
            {"fiber", "cloth", "--fabric", "/no/such.json", "--directions", "-"},
            {"--fabric", "/no/such.json", "cannot be read"}},
        Case{
            "ClothVariantUnknown",
            {"fiber", "cloth", "--fabric", "velvet", "--directions", "-", "--variant", "corrected"},
            {"--variant", "corrected", "energy-true"}},
        Case{
            "ClothSamplesZero",
            {"fiber", "cloth", "--fabric", "velvet", "--directions", "-", "--samples", "0"},
            {"--samples", "\"0\"", "100000"}},
        Case{
            "DirectionsNotThere",
            {"fiber", "cloth", "--fabric", "velvet", "--directions", "/no/such.json"},
            {"--directions", "/no/such.json", "cannot be read"}},
        Case{
            "ThreadFileNotThere",
            {"fiber", "thread", "--params", "/no/such.json", "--directions", "-"},
            {"--params", "/no/such.json", "cannot be read"}}),
    name_of);

} // namespace
