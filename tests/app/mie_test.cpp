// scatter mie: what it writes equals what the library computes, to the last bit, and wrong requests leave
// nothing.
#include "run.hpp"
#include <scatter/exact/debye.hpp>
#include <scatter/exact/mie.hpp>
#include <scatter/optics/refractive_index.hpp>
#include <scatter/optics/units.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace {

using scatter::test::Outcome;
using scatter::test::run;
using scatter::test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::vector<double> angles{0, 42.5, 90, 137.9, 180};

TEST(MieVerb, JsonRoundTripsEveryBit) {
  const Outcome outcome =
      run({"mie", "--size-parameter", "1000.1", "--index", "1.33+1e-9i", "--angles", "0,42.5,90,137.9,180"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  const auto json = nlohmann::json::parse(outcome.output);
  const auto expected = scatter::exact::mie_at_degrees(1000.1, {1.33, 1e-9}, angles);
  EXPECT_EQ(json.at("x"), 1000.1);
  EXPECT_THAT(json.at("m"), ElementsAre(1.33, 1e-9));
  EXPECT_EQ(json.at("Qext"), expected.Qext);
  EXPECT_EQ(json.at("Qsca"), expected.Qsca);
  EXPECT_EQ(json.at("Qabs"), expected.Qabs);
  EXPECT_EQ(json.at("Qback"), expected.Qback);
  EXPECT_EQ(json.at("g"), expected.g);
  EXPECT_EQ(json.at("error_estimate"), expected.error_estimate);
  EXPECT_EQ(json.at("Qback_error_estimate"), expected.Qback_error_estimate);
  EXPECT_EQ(json.at("validated"), true);
  EXPECT_EQ(json.at("theta_deg"), nlohmann::json(angles));
  EXPECT_EQ(json.at("phase_function"), nlohmann::json(expected.phase_function));
  for (std::size_t i = 0; i < angles.size(); ++i) {
    EXPECT_THAT(json.at("S1").at(i), ElementsAre(expected.S1[i].real(), expected.S1[i].imag()));
    EXPECT_THAT(json.at("S2").at(i), ElementsAre(expected.S2[i].real(), expected.S2[i].imag()));
  }
  ASSERT_EQ(json.at("mueller").size(), 4U);
  for (std::size_t i = 0; i < angles.size(); ++i) {
    // Bohren & Huffman 4.77, from the amplitudes that stand there.
    const auto amplitude = [&](const char* name) {
      const auto& pair = json.at(name).at(i);
      return std::complex<double>(pair.at(0).get<double>(), pair.at(1).get<double>());
    };
    const auto element = [&](const char* name) { return json.at("mueller").at(name).at(i).get<double>(); };
    const std::complex<double> S1 = amplitude("S1"), S2 = amplitude("S2");
    const double S11 = (std::norm(S2) + std::norm(S1)) / 2, room = 1e-14 * S11;
    EXPECT_NEAR(element("S11"), S11, room);
    EXPECT_NEAR(element("S12"), (std::norm(S2) - std::norm(S1)) / 2, room);
    EXPECT_NEAR(element("S33"), (std::conj(S2) * S1 + S2 * std::conj(S1)).real() / 2, room);
    EXPECT_NEAR(
        element("S34"), (std::complex<double>(0, 0.5) * (S1 * std::conj(S2) - S2 * std::conj(S1))).real(),
        room);
  }
  EXPECT_THAT(json.at("provenance").at("command").get<std::string>(), HasSubstr("--size-parameter 1000.1"));
  EXPECT_FALSE(json.contains("orders"));
}

TEST(MieVerb, CsvHoldsAmplitudesAndMuellerMatrix) {
  const TemporaryFolder folder;
  const std::string path = folder.file("sphere.csv");
  const Outcome outcome =
      run({"mie", "--x", "25", "--index", "1.5+0.01i", "--angles", "0,42.5,90,137.9,180", "--output", path});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.output, "");
  EXPECT_THAT(folder.names(), ElementsAre("sphere.csv"));
  const auto expected = scatter::exact::mie_at_degrees(25, {1.5, 0.01}, angles);

  std::ifstream file(path);
  std::string line, comments;
  while (std::getline(file, line) && line.starts_with('#')) comments += line + '\n';
  EXPECT_THAT(comments, HasSubstr("# command: scatter mie"));
  EXPECT_THAT(comments, HasSubstr("\n# Qext: "));
  EXPECT_EQ(line, "theta_deg,S1_re,S1_im,S2_re,S2_im,S11,S12,S33,S34,phase_function,polarization");
  for (std::size_t i = 0; i < angles.size(); ++i) {
    ASSERT_TRUE(std::getline(file, line));
    std::vector<double> v;
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');) v.push_back(std::stod(field));
    ASSERT_EQ(v.size(), 11U);
    const auto S1 = expected.S1[i], S2 = expected.S2[i];
    EXPECT_EQ(v[0], angles[i]);
    EXPECT_EQ(v[1], S1.real());
    EXPECT_EQ(v[2], S1.imag());
    EXPECT_EQ(v[3], S2.real());
    EXPECT_EQ(v[4], S2.imag());
    EXPECT_EQ(v[9], expected.phase_function[i]);
    // Bohren & Huffman 4.77, and the identity of a pure Mueller matrix.
    const double S11 = (std::norm(S2) + std::norm(S1)) / 2;
    EXPECT_NEAR(v[5], S11, 1e-14 * S11);
    EXPECT_NEAR(v[6], (std::norm(S2) - std::norm(S1)) / 2, 1e-14 * S11);
    EXPECT_NEAR(v[7], (std::conj(S2) * S1 + S2 * std::conj(S1)).real() / 2, 1e-14 * S11);
    EXPECT_NEAR(
        v[8], (std::complex<double>(0, 0.5) * (S1 * std::conj(S2) - S2 * std::conj(S1))).real(), 1e-14 * S11);
    EXPECT_NEAR(std::hypot(v[6], v[7], v[8]), S11, 1e-14 * S11);
    EXPECT_NEAR(v[10], -v[6] / v[5], 1e-14);
  }
  EXPECT_FALSE(std::getline(file, line));
}

TEST(MieVerb, TellsWhatIsBeyondTheValidatedDomain) {
  const auto mie = [](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "mie");
    arguments.insert(arguments.end(), {"--index", "1.333", "--angles", "90"});
    return run(arguments);
  };
  const auto validated = [](const Outcome& outcome) {
    return nlohmann::json::parse(outcome.output).at("validated").get<bool>();
  };
  const Outcome beyond = mie({"--size-parameter", "60000"});
  EXPECT_EQ(beyond.exit_code, 0);
  EXPECT_EQ(
      beyond.errors, "scatter mie: --size-parameter 60000 is beyond 50000, up to which results were compared "
                     "with 60 digits; computed the same way\n");
  EXPECT_FALSE(validated(beyond));
  const Outcome radius = mie({"--radius", "5mm", "--wavelength", "0.5um"});
  EXPECT_EQ(radius.exit_code, 0);
  EXPECT_EQ(radius.error_lines(), 1);
  EXPECT_THAT(radius.errors, HasSubstr("--radius: the size parameter 62831.8"));
  EXPECT_FALSE(validated(radius));

  // Debye terms have a domain of their own.
  const Outcome within = mie({"--x", "20001"}), orders = mie({"--x", "20001", "--orders", "0"});
  EXPECT_EQ(within.errors, "");
  EXPECT_TRUE(validated(within));
  EXPECT_EQ(orders.exit_code, 0);
  EXPECT_EQ(orders.error_lines(), 1);
  EXPECT_THAT(orders.errors, HasSubstr("beyond 20000, up to which Debye terms"));
  EXPECT_FALSE(validated(orders));
  for (const char* x : {"100", "50000"}) {
    const Outcome silent = mie({"--x", x});
    EXPECT_EQ(silent.errors, "") << x;
    EXPECT_TRUE(validated(silent)) << x;
  }
}

TEST(MieVerb, RadiusAndWavelengthGiveTheSizeAndWatersIndex) {
  const Outcome outcome = run({"mie", "--radius", "0.1mm", "--wavelength", "500nm", "--angles", "138"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto json = nlohmann::json::parse(outcome.output);
  EXPECT_NEAR(json.at("x").get<double>(), 400 * scatter::pi, 1e-12 * 400 * scatter::pi);
  EXPECT_EQ(json.at("m").at(0), scatter::refractive_index({}, 500e-9).real());
  const Outcome named =
      run({"mie", "--radius", "0.1mm", "--wavelength", "500nm", "--angles", "138", "--index", "hale-querry"});
  EXPECT_EQ(nlohmann::json::parse(named.output).at("m").at(0), 1.335);
}

TEST(MieVerb, FilesEqualStandardOutput) {
  const TemporaryFolder folder;
  const std::string path = folder.file("sphere.json");
  const std::vector<std::string> request{"mie", "--x", "10", "--index", "1.33", "--threads", "3"};
  auto with_file = request;
  with_file.insert(with_file.end(), {"--output", path});
  ASSERT_EQ(run(with_file).exit_code, 0);
  auto from_file = nlohmann::json::parse(std::ifstream(path)),
       printed = nlohmann::json::parse(run(request).output);
  for (auto* json : {&from_file, &printed})
    for (const char* key : {"seconds", "provenance"}) json->erase(key);
  EXPECT_EQ(from_file, printed);
}

TEST(MieVerb, OrdersAddDebyeTerms) {
  const Outcome outcome = run(
      {"mie", "--x", "300.5", "--index", "1.333", "--angles", "0,42.5,90,137.9,180", "--orders", "0,2..3"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto json = nlohmann::json::parse(outcome.output);
  const auto whole = scatter::exact::mie_at_degrees(300.5, 1.333, angles);
  const auto expected = scatter::exact::debye_at_degrees(300.5, 1.333, std::vector<int>{0, 2, 3}, angles);
  const auto same = [&](const nlohmann::json& one, const std::vector<std::complex<double>>& S1,
                        const std::vector<std::complex<double>>& S2) {
    ASSERT_EQ(one.at("S1").size(), angles.size());
    ASSERT_EQ(one.at("S2").size(), angles.size());
    for (std::size_t i = 0; i < angles.size(); ++i) {
      EXPECT_THAT(one.at("S1").at(i), ElementsAre(S1[i].real(), S1[i].imag()));
      EXPECT_THAT(one.at("S2").at(i), ElementsAre(S2[i].real(), S2[i].imag()));
    }
  };
  same(json, whole.S1, whole.S2); // as without --orders
  ASSERT_EQ(json.at("orders").size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& order = json.at("orders").at(k);
    EXPECT_EQ(order.at("p"), expected.orders[k].p);
    EXPECT_EQ(order.at("error_estimate"), expected.orders[k].error_estimate);
    same(order, expected.orders[k].S1, expected.orders[k].S2);
  }
  EXPECT_EQ(json.at("partial_sum").at("last_p"), 3);
  same(json.at("partial_sum"), expected.partial_sum.S1, expected.partial_sum.S2);
  EXPECT_EQ(json.at("remainder").at("after_p"), 3);
  EXPECT_EQ(json.at("remainder").at("error_estimate"), expected.remainder.error_estimate);
  same(json.at("remainder"), expected.remainder.S1, expected.remainder.S2);
}

TEST(MieVerb, CsvHasColumnsForEveryOrder) {
  const TemporaryFolder folder;
  const std::string path = folder.file("sphere.csv");
  const Outcome outcome = run(
      {"mie", "--x", "25", "--index", "1.5+0.01i", "--angles", "0,42.5,90,137.9,180", "--orders", "1,4",
       "--output", path});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto expected = scatter::exact::debye_at_degrees(25, {1.5, 0.01}, std::vector<int>{1, 4}, angles);
  std::ifstream file(path);
  std::string line, comments;
  while (std::getline(file, line) && line.starts_with('#')) comments += line + '\n';
  EXPECT_THAT(comments, HasSubstr("# error_estimate of p4: "));
  EXPECT_THAT(comments, HasSubstr("orders 0..4"));
  EXPECT_EQ(
      line, "theta_deg,S1_re,S1_im,S2_re,S2_im,S11,S12,S33,S34,phase_function,polarization,"
            "p1_S1_re,p1_S1_im,p1_S2_re,p1_S2_im,p4_S1_re,p4_S1_im,p4_S2_re,p4_S2_im,"
            "partial_sum_S1_re,partial_sum_S1_im,partial_sum_S2_re,partial_sum_S2_im,"
            "remainder_S1_re,remainder_S1_im,remainder_S2_re,remainder_S2_im");
  const scatter::exact::DebyeTerm* const terms[] = {
      &expected.orders[0], &expected.orders[1], &expected.partial_sum, &expected.remainder};
  for (std::size_t i = 0; i < angles.size(); ++i) {
    ASSERT_TRUE(std::getline(file, line));
    std::vector<double> v;
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');) v.push_back(std::stod(field));
    ASSERT_EQ(v.size(), 27U);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(v[11 + 4 * k], terms[k]->S1[i].real());
      EXPECT_EQ(v[12 + 4 * k], terms[k]->S1[i].imag());
      EXPECT_EQ(v[13 + 4 * k], terms[k]->S2[i].real());
      EXPECT_EQ(v[14 + 4 * k], terms[k]->S2[i].imag());
    }
  }
}

struct Case {
  const char* name;
  std::vector<std::string> arguments;
  std::vector<std::string> says;
};

void PrintTo(const Case& bad, std::ostream* stream) {
  *stream << bad.name;
}

class BadMieInput : public testing::TestWithParam<Case> {};

TEST_P(BadMieInput, IsRefusedInOneLineAndLeavesNothing) {
  const TemporaryFolder folder;
  std::vector<std::string> arguments{"mie"};
  arguments.insert(arguments.end(), GetParam().arguments.begin(), GetParam().arguments.end());
  const bool has_output = std::find(arguments.begin(), arguments.end(), "--output") != arguments.end();
  if (!has_output) arguments.insert(arguments.end(), {"--output", folder.file("sphere.json")});
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 2) << "signal " << outcome.signal;
  EXPECT_EQ(outcome.output, "");
  EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
  for (const auto& part : GetParam().says) EXPECT_THAT(outcome.errors, HasSubstr(part));
  EXPECT_THAT(folder.names(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(
    Cases, BadMieInput,
    testing::Values(
        Case{"NoSize", {}, {"--size-parameter", "--radius"}},
        Case{"NoWavelength", {"--radius", "0.4mm"}, {"--wavelength"}},
        Case{"TwoSizes", {"--x", "10", "--radius", "1mm", "--index", "1.33"}, {"--radius", "one of the two"}},
        Case{"NoIndex", {"--x", "10"}, {"--index", "1.333"}},
        Case{"WaterWithoutWavelength", {"--x", "10", "--index", "iapws"}, {"iapws", "--wavelength"}},
        Case{
            "OutsideIndexData",
            {"--radius", "1um", "--wavelength", "10um"},
            {"--wavelength", "200..1100 nm"}},
        Case{"NegativeRadius", {"--radius=-1mm", "--wavelength", "500nm"}, {"--radius", "-1mm"}},
        Case{"RadiusWithoutUnit", {"--radius", "0.4", "--wavelength", "500nm"}, {"--radius", "0.4mm"}},
        Case{"TooLarge", {"--x", "1e6", "--index", "1.33"}, {"1e-6..5e5"}},
        Case{"TooSmall", {"--x", "1e-7", "--index", "1.33"}, {"1e-6..5e5"}},
        Case{"NotANumber", {"--x", "nan", "--index", "1.33"}, {"--size-parameter", "nan"}},
        Case{"Amplifies", {"--x", "1", "--index", "1.33-1e-3i"}, {"--index", "k"}},
        Case{"NoSphere", {"--x", "1", "--index", "1"}, {"index 1"}},
        Case{"AngleBeyond", {"--x", "1", "--index", "1.33", "--angles", "0,181"}, {"--angles", "181"}},
        Case{"EmptyAngles", {"--x", "1", "--index", "1.33", "--angles", ""}, {"--angles", "empty"}},
        Case{"InvertedRange", {"--x", "1", "--index", "1.33", "--angles", "10:0:1"}, {"--angles", "10:0:1"}},
        Case{"OrdersNegative", {"--x", "1", "--index", "1.33", "--orders=-1"}, {"--orders", "-1", "0..3"}},
        Case{"OrdersInverted", {"--x", "1", "--index", "1.33", "--orders", "3..0"}, {"--orders", "3..0"}},
        Case{"OrdersTooHigh", {"--x", "1", "--index", "1.33", "--orders", "0..1001"}, {"--orders", "1000"}},
        Case{"OrdersEmpty", {"--x", "1", "--index", "1.33", "--orders", ""}, {"--orders", "empty"}},
        Case{"OrdersNoNumber", {"--x", "1", "--index", "1.33", "--orders", "all"}, {"--orders", "all"}},
        Case{"Threads", {"--x", "1", "--index", "1.33", "--threads", "many"}, {"--threads", "many"}},
        Case{"Extension", {"--x", "1", "--index", "1.33", "--output", "sphere.txt"}, {"sphere.txt", ".csv"}},
        Case{"Folder", {"--x", "1", "--index", "1.33", "--output", "/no/such/a.csv"}, {"/no/such"}}),
    [](const auto& test) { return std::string(test.param.name); });

} // namespace
