// The program as a whole: what it prints, how it fails while running, how it dies.
#include "run.hpp"
#include <scatter/optics/version.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <chrono>
#include <csignal>
#include <string>
#include <thread>

namespace {

using scatter::test::Outcome;
using scatter::test::run;
using scatter::test::Running;
using scatter::test::shell;
using scatter::test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

TEST(Program, SaysItsVersion) {
  const Outcome outcome = run({"--version"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_EQ(outcome.output, std::string("scatter ") + scatter::version() + "\n");
}

TEST(Program, WithoutAVerbShowsItsVerbs) {
  const Outcome outcome = run({});
  EXPECT_EQ(outcome.exit_code, 0);
  for (const char* const verb : {"mie", "phase", "validate", "info", "plot"})
    EXPECT_THAT(outcome.output, HasSubstr(verb));
}

TEST(Program, HelpOfEveryVerbListsItsOptions) {
  for (const char* const verb : {"mie", "phase", "validate", "info", "plot"}) {
    const Outcome outcome = run({verb, "--help"});
    EXPECT_EQ(outcome.exit_code, 0) << verb;
    EXPECT_THAT(outcome.output, HasSubstr("--verbose")) << verb;
    EXPECT_EQ(outcome.errors, "") << verb;
  }
}

TEST(Phase, TellsWhereMieIsBeyondItsValidatedDomain) {
  const auto sphere = [](const char* wavelengths, const char* method) {
    std::vector<std::string> words{"phase",     "--shape", "sphere", "--radius", "5mm", "--wavelengths",
                                   wavelengths, "--theta", "90",     "--method", method};
    if (method == std::string("patches")) words.insert(words.end(), {"--rays", "40"});
    return run(words);
  };
  const Outcome beyond = sphere("700nm,500nm,600nm", "mie"); // the shortest of them is what counts
  EXPECT_EQ(beyond.exit_code, 0);
  EXPECT_EQ(
      beyond.errors, "scatter phase: --radius: the largest size parameter 62831.8531 is beyond 50000, up to "
                     "which results were compared with 60 digits; computed the same way\n");
  EXPECT_EQ(nlohmann::json::parse(beyond.output).at("wavelength_m").size(), 3u);
  const Outcome within = sphere("700nm", "mie");
  EXPECT_EQ(within.exit_code, 0);
  EXPECT_EQ(within.errors, "");
  EXPECT_THAT(sphere("500nm", "patches").errors, Not(HasSubstr("50000"))) << "Mie has no part in rays";
}

TEST(Phase, WritesJsonToStandardOutputByDefaultAndNothingElse) {
  const Outcome outcome =
      run({"phase", "--shape", "sphere", "--radius", "20um", "--wavelengths", "450nm,650nm"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.errors, "");
  const auto table = nlohmann::json::parse(outcome.output);
  EXPECT_EQ(table.at("wavelength_m").size(), 2u);
  EXPECT_EQ(table.at("theta_deg").size(), 181u);
  EXPECT_EQ(table.at("phi_deg").size(), 1u) << "a sphere needs one azimuth";
  EXPECT_EQ(table.at("phase_function").at(1).at(180).size(), 1u);
  EXPECT_THAT(table.at("method").get<std::string>(), HasSubstr("mie"));
}

TEST(Phase, SphereByPatchesGoesThroughTheKernelOfAnyDrop) {
  const Outcome outcome = run(
      {"phase", "--shape", "sphere", "--radius", "0.4mm", "--wavelength", "650nm", "--method", "patches",
       "--rays", "200", "--theta", "130:150:1"});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  const auto table = nlohmann::json::parse(outcome.output);
  EXPECT_THAT(table.at("method").get<std::string>(), HasSubstr("patches"));
  for (const auto& row : table.at("phase_function").at(0)) EXPECT_GE(row.at(0).get<double>(), 0);
}

TEST(Phase, WhatOnlyPatchesHaveIsNotDroppedSilentlyOnASphere) {
  const auto method = [](const char* option, const char* value) {
    const Outcome outcome = run(
        {"phase", "--shape", "sphere", "--radius", "50um", "--wavelength", "650nm", "--theta", "134,140deg",
         option, value});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    return nlohmann::json::parse(outcome.output).at("method").get<std::string>();
  };
  EXPECT_THAT(method("--orders", "2"), HasSubstr("orders 2,"));
  EXPECT_THAT(method("--diffraction", "none"), HasSubstr("diffraction none"));
  EXPECT_THAT(method("--rays", "40"), HasSubstr("40 x 40 rays"));
  EXPECT_THAT(method("--focal-lines", "rule"), HasSubstr("by rule"));
  EXPECT_THAT(method("--method", "auto"), HasSubstr("mie"));
}

TEST(Phase, ResultsDoNotDependOnThreads) {
  const auto table = [](const char* search, const char* threads) {
    const Outcome outcome =
        run({"phase",  "--radius", "0.5mm",   "--sun",        "20deg",     "--wavelength", "650nm",
             "--rays", "150",      "--theta", "130:150:0.5",  "--phi",     "0:360:20",     "--diffraction",
             "none",   "--search", search,    "--amplitudes", "--threads", threads});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
    EXPECT_EQ(outcome.errors, "");
    const auto json = nlohmann::json::parse(outcome.output, nullptr, false);
    if (!json.is_object()) return "nothing, with " + std::string(threads);
    return json.at("phase_function").dump() + json.at("amplitude").dump();
  };
  EXPECT_EQ(table("raster", "1"), table("raster", "2"));
  EXPECT_EQ(table("tree", "1"), table("tree", "2"));
}

TEST(Phase, ExplainsWithoutComputing) {
  const Outcome outcome = run(
      {"phase", "--radius", "0.5mm", "--wavelengths", "380:700:10nm", "--rays", "3000", "--theta",
       "0:180:0.05", "--phi", "0:360:0.5", "--explain"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, HasSubstr("patches"));
  EXPECT_THAT(outcome.output, HasSubstr("predicted: error"));
  EXPECT_EQ(std::ranges::count(outcome.output, '\n'), 2);
}

TEST(Phase, ChoosesByToleranceAndSaysWhatItCameTo) {
  const Outcome outcome = run(
      {"phase", "--radius", "0.5mm", "--wavelength", "650nm", "--theta", "130:150:0.5", "--phi", "0:180:45",
       "--tolerance", "40%", "--explain", "--output", "none"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_THAT(outcome.output, HasSubstr("considered for 40 %"));
  EXPECT_THAT(outcome.output, HasSubstr("chosen"));
  EXPECT_THAT(outcome.output, HasSubstr("predicted: error"));
  EXPECT_THAT(outcome.output, HasSubstr("achieved: error"));
}

TEST(Phase, OutputNoneComputesAndWritesNothing) {
  const Outcome outcome = run(
      {"phase", "--radius", "0.5mm", "--wavelength", "650nm", "--rays", "100", "--theta", "138", "--phi", "0",
       "--output", "none", "--verbose"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_EQ(outcome.output, "");
  EXPECT_THAT(outcome.errors, HasSubstr("1 wavelengths x 1 theta x 1 phi"));
}

TEST(Phase, FileRemembersTheCommand) {
  const TemporaryFolder folder;
  const std::string file = folder.file("a drop.json");
  const Outcome outcome =
      run({"phase", "--shape", "sphere", "--radius", "5um", "--wavelength", "650nm", "--output", file});
  ASSERT_EQ(outcome.exit_code, 0) << outcome.errors;
  EXPECT_THAT(folder.names(), ElementsAre("a drop.json"));
  EXPECT_THAT(
      shell("cat '" + file + "'").output,
      HasSubstr("scatter phase --shape sphere --radius 5um --wavelength 650nm --output '"));
}

// What can go wrong while running: exit status 1 and one line.

void expect_one_line_of_failure(const Outcome& outcome) {
  EXPECT_EQ(outcome.exit_code, 1) << "signal " << outcome.signal;
  EXPECT_EQ(outcome.error_lines(), 1) << outcome.errors;
  EXPECT_THAT(outcome.errors, StartsWith("scatter"));
}

const char* const small_job = "phase --shape sphere --radius 5um --wavelength 650nm";

TEST(Failure, FullDiskBehindStandardOutput) {
  expect_one_line_of_failure(
      run({"phase", "--shape", "sphere", "--radius", "5um", "--wavelength", "650nm"}, {}, "/dev/full"));
  expect_one_line_of_failure(run({"--help"}, {}, "/dev/full"));
}

TEST(Failure, ReaderOfStandardOutputGone) {
  expect_one_line_of_failure(
      shell("code=$({ { sleep 0.2; $SCATTER --help; echo $? >&3; } | true; } 3>&1); exit $code"));
}

TEST(Failure, StandardOutputClosed) {
  expect_one_line_of_failure(shell(std::string("$SCATTER ") + small_job + " >&-"));
}

class FullDisk : public testing::TestWithParam<const char*> {};

TEST_P(FullDisk, LeavesNoFile) {
  const TemporaryFolder folder;
  const std::string file = folder.file(std::string("drop") + GetParam());
  // A limit on the size of files fails the write as a full disk does.
  const Outcome outcome = shell(
      "ulimit -f 64; exec $SCATTER phase --shape sphere --radius 5um --wavelengths 400:700:10nm --theta "
      "0:180:0.01 --output " +
      file);
  expect_one_line_of_failure(outcome);
  EXPECT_THAT(outcome.errors, HasSubstr(file));
  EXPECT_THAT(folder.names(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Formats, FullDisk, testing::Values(".nc", ".exr", ".json"), [](const auto& kind) {
  return std::string(kind.param + 1);
});

class Killed : public testing::TestWithParam<int> {};

TEST_P(Killed, LeavesNoFileAndDiesOfTheSignal) {
  const TemporaryFolder folder;
  Running job(
      {SCATTER_PROGRAM, "phase", "--radius", "0.5mm", "--wavelengths", "380:700:1nm", "--rays", "2000",
       "--theta", "0:180:0.1", "--phi", "0:360:1", "--output", folder.file("drop.nc")});
  // Wait until its part file is there, so that there is something to clean up.
  for (int i = 0; i < 3000 && folder.names().empty(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_THAT(folder.names(), Not(IsEmpty())) << "the job never began to write";
  ASSERT_EQ(::kill(job.pid(), GetParam()), 0);
  const Outcome outcome = job.wait();
  EXPECT_EQ(outcome.signal, GetParam()) << "exit " << outcome.exit_code << " " << outcome.errors;
  EXPECT_THAT(folder.names(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(
    Signals, Killed, testing::Values(SIGINT, SIGTERM, SIGHUP, SIGXCPU),
    [](const auto& kind) { return std::string("signal") + std::to_string(kind.param); });

} // namespace
