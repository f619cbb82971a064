// What happens when a table cannot be finished: no file, one clear line, no trace.

#include "example_table.hpp"
#include "temporary_folder.hpp"
#include <scatter/optics/errors.hpp>
#include <scatter/table/files.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <fstream>
#include <limits>

namespace scatter::table {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

template <class Error, class Action>
std::string message(const Action& action) {
  try {
    static_cast<void>(action());
  } catch (const Error& error) {
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

class Formats : public testing::TestWithParam<std::string> {
protected:
  TemporaryFolder folder;
  std::string path = folder.file("table" + GetParam());
};

TEST_P(Formats, WithoutFinishLeaveNoFile) {
  const TableHeader head = example::header(2, 31, 12);
  {
    const auto sink = make_file_sink(path, head);
    EXPECT_EQ(folder.entries().size(), 1u);
    sink->begin(head);
    sink->write(0, example::slab(head, 0));
  }
  EXPECT_THAT(folder.entries(), IsEmpty());
}

TEST_P(Formats, WithoutFinishKeepTheFileThatWasThere) {
  std::ofstream(path) << "old";
  const TableHeader head = example::header(2, 31, 12);
  {
    const auto sink = make_file_sink(path, head);
    sink->begin(head);
    sink->write(0, example::slab(head, 0));
  }
  EXPECT_THAT(folder.entries(), ElementsAre("table" + GetParam()));
  EXPECT_EQ(std::filesystem::file_size(path), 3u);
  example::write(*make_file_sink(path, head), head);
  EXPECT_EQ(read_table(path).slabs.size(), 2u);
}

TEST_P(Formats, WriteThroughALinkToItsTarget) {
  const TableHeader head = example::header(1, 3, 2);
  std::filesystem::create_directory(folder.path() / "elsewhere");
  const std::filesystem::path target = folder.path() / "elsewhere" / ("real" + GetParam());
  std::ofstream(target) << "old";
  std::filesystem::create_symlink(target, path);
  example::write(*make_file_sink(path, head), head);
  EXPECT_TRUE(std::filesystem::is_symlink(path));
  EXPECT_EQ(read_table(target).slabs.size(), 1u);
}

TEST_P(Formats, RefuseValuesThatAreNotFiniteAndLeaveNoFile) {
  TableHeader head = example::header(2, 31, 12);
  head.matrix = GetParam() != ".exr";
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    {
      const auto sink = make_file_sink(path, head);
      sink->begin(head);
      sink->write(0, example::slab(head, 0));
      Slab slab = example::slab(head, 1);
      slab.phase_function[4 * 12 + 3] = bad;
      EXPECT_THAT(
          message<RunError>([&] { sink->write(1, slab); }),
          AllOf(
              HasSubstr("phase_function is not finite"), HasSubstr("540"), HasSubstr("theta 24 deg"),
              HasSubstr("phi 90 deg"), Not(HasSubstr("\n"))));
      EXPECT_THROW(sink->finish(1), std::logic_error);
    }
    EXPECT_THAT(folder.entries(), IsEmpty());
    if (head.matrix) {
      const auto sink = make_file_sink(path, head);
      sink->begin(head);
      Slab slab = example::slab(head, 0);
      slab.phase_matrix[16 * (12 * 30 + 11) + 5] = bad;
      EXPECT_THAT(
          message<RunError>([&] { sink->write(0, slab); }),
          AllOf(HasSubstr("phase_matrix"), HasSubstr("theta 180 deg"), HasSubstr("phi 330 deg")));
    }
    const auto sink = make_file_sink(path, head);
    sink->begin(head);
    Slab slab = example::slab(head, 0);
    slab.extinction_cross_section = bad;
    EXPECT_THAT(message<RunError>([&] { sink->write(0, slab); }), HasSubstr("extinction_cross_section"));
  }
}

TEST_P(Formats, RefuseSlabsOutOfOrderOrOfTheWrongSize) {
  const TableHeader head = example::header(2, 31, 12);
  const auto sink = make_file_sink(path, head);
  EXPECT_THROW(sink->write(0, example::slab(head, 0)), std::logic_error);
  sink->begin(head);
  EXPECT_THROW(sink->write(1, example::slab(head, 1)), std::logic_error);
  EXPECT_THROW(sink->finish(1), std::logic_error);
  Slab slab = example::slab(head, 0);
  slab.error_estimate.pop_back();
  EXPECT_THROW(sink->write(0, slab), std::logic_error);
}

TEST_P(Formats, KilledLeaveNothingUnderTheFinalName) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  folder.share();
  const TableHeader head = example::header(2, 31, 12);
  const auto be_killed = [&] {
    const auto sink = make_file_sink(path, head);
    sink->begin(head);
    sink->write(0, example::slab(head, 0));
    ::raise(SIGKILL);
  };
  EXPECT_EXIT(be_killed(), testing::KilledBySignal(SIGKILL), "");
  EXPECT_THAT(folder.entries(), ElementsAre(HasSubstr(".part-"))); // it got that far
}

TEST_P(Formats, InterruptedLeaveNothingAtAllWhenTheHandlerRemovesThem) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  folder.share();
  const TableHeader head = example::header(2, 31, 12);
  const auto be_interrupted = [&] {
    std::signal(SIGTERM, [](int) {
      remove_unfinished_files();
      ::_exit(7);
    });
    const auto sink = make_file_sink(path, head);
    sink->begin(head);
    sink->write(0, example::slab(head, 0));
    if (folder.entries().size() == 1) ::raise(SIGTERM);
  };
  EXPECT_EXIT(be_interrupted(), testing::ExitedWithCode(7), "");
  EXPECT_THAT(folder.entries(), IsEmpty());
}

/// In a process of its own: files may hold `limit` bytes, as on a disk that fills up there. Exits 0 if
/// RunError came with one line, no file is there, and the process ends like any other.
void write_on_a_small_disk(
    const std::string& path, const TableHeader& head, const FileOptions& options, double limit) {
  std::signal(SIGXFSZ, SIG_IGN);
  const auto bytes = static_cast<rlim_t>(limit);
  const rlimit small{bytes, bytes};
  int code = 3;
  if (::setrlimit(RLIMIT_FSIZE, &small) == 0) try {
      example::write(*make_file_sink(path, head, options), head);
      code = 1;
    } catch (const RunError& error) {
      const std::string text = error.what();
      code = text.find("cannot write " + path) == 0 && text.find('\n') == std::string::npos ? 0 : 2;
    }
  if (!std::filesystem::is_empty(std::filesystem::path(path).parent_path())) code = 4;
  std::exit(code); // with everything that libraries do at exit
}

TEST_P(Formats, OnAFullDiskThrowRunErrorAndLeaveNoFile) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  folder.share();
  TableHeader head = example::header(4, 301, 24);
  std::vector<FileOptions> all{{}};
  if (GetParam() != ".json") all.push_back({.compression = Compression::deflate});
  for (const FileOptions& options : all) {
    // The process of the death test comes through here too, in the same folder: it must leave the folder
    // empty.
    example::write(*make_file_sink(path, head, options), head);
    const auto size = static_cast<double>(std::filesystem::file_size(path));
    std::filesystem::remove(path);
    ASSERT_GT(size, 1e5);
    // From nothing at all over the headers and the middle to the very last bytes.
    for (const double limit : {0.0, 100.0, 0.01 * size, 0.3 * size, 0.7 * size, 0.97 * size, size - 1}) {
      SCOPED_TRACE(limit);
      EXPECT_EXIT(
          write_on_a_small_disk(path, head, options, limit), testing::ExitedWithCode(0), testing::Eq(""));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Files, Formats, testing::Values(".nc", ".exr", ".json"), [](const auto& test) {
  return test.param.substr(1);
});

TEST(StandardOutput, ThatIsFullIsARunError) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto write = [] {
    const bool redirected = std::freopen("/dev/full", "w", stdout) != nullptr;
    int code = 2;
    const TableHeader head = example::header(1, 3, 2);
    if (redirected) try {
        example::write(*make_file_sink("-", head), head);
        code = 1;
      } catch (const RunError& error) {
        code = std::string(error.what()).find("the disk is full") != std::string::npos ? 0 : 3;
      }
    ::_exit(code);
  };
  EXPECT_EXIT(write(), testing::ExitedWithCode(0), "");
}

TEST(WrongRequests, AreRefusedBeforeWorkInOneLineThatSaysWhatWouldBeRight) {
  const TemporaryFolder folder;
  const TableHeader head = example::header(2, 31, 12);
  const auto refusal = [&](const std::string& name, const TableHeader& h, const FileOptions& options = {}) {
    return message<InputError>([&] { return make_file_sink(name, h, options); });
  };
  EXPECT_THAT(
      refusal(folder.file("a.csv"), head), AllOf(HasSubstr("'.csv'"), HasSubstr(".nc"), HasSubstr(".exr")));
  EXPECT_THAT(refusal(folder.file("a"), head), HasSubstr("(none)"));
  EXPECT_THAT(
      refusal(folder.file("no/such/a.nc"), head), AllOf(HasSubstr("no folder"), HasSubstr("no/such")));
  std::filesystem::create_directory(folder.path() / "b.nc");
  EXPECT_THAT(refusal(folder.file("b.nc"), head), HasSubstr("it is a folder"));
  EXPECT_THAT(refusal(folder.file("a.nc"), head, {.compression = Compression::piz}), HasSubstr("deflate"));
  EXPECT_THAT(refusal(folder.file("a.json"), head, {.compression = Compression::deflate}), HasSubstr("none"));

  TableHeader amplitudes = head;
  amplitudes.amplitudes = true;
  EXPECT_THAT(refusal(folder.file("a.exr"), amplitudes), AllOf(HasSubstr("amplitudes"), HasSubstr(".nc")));
  TableHeader twins = head;
  twins.wavelength_m[1] = twins.wavelength_m[0] + 1e-17;
  EXPECT_THAT(refusal(folder.file("a.exr"), twins), HasSubstr("380,000000nm is there twice"));
  const TableHeader huge = example::header(300, 721, 180);
  EXPECT_THAT(refusal(folder.file("a.json"), huge), AllOf(HasSubstr("too many for JSON"), HasSubstr(".nc")));
  TableHeader wide = head;
  wide.phi_deg.clear();
  for (int i = 0; i < 34000000; ++i) wide.phi_deg.push_back(i * 1e-5);
  EXPECT_THAT(
      refusal(folder.file("a.exr"), wide, {.compression = Compression::piz}),
      HasSubstr("too many for OpenEXR"));

  TableHeader empty = head;
  empty.theta_deg.clear();
  EXPECT_THAT(refusal(folder.file("a.nc"), empty), HasSubstr("no theta"));
  TableHeader falling = head;
  std::swap(falling.phi_deg[2], falling.phi_deg[3]);
  EXPECT_THAT(refusal(folder.file("a.nc"), falling), HasSubstr("phi must increase"));
  EXPECT_THAT(message<InputError>([] { return parse_compression("gzip"); }), HasSubstr("pxr24"));
  EXPECT_THAT(folder.entries(), ElementsAre("b.nc"));
}

TEST(WrongRequests, ThatNoDiskCanHoldAreRefusedBeforeWork) {
  const TemporaryFolder folder;
  TableHeader head = example::header(1, 2, 2);
  head.matrix = true;
  head.theta_deg.resize(2000000);
  for (std::size_t i = 0; i < head.theta_deg.size(); ++i) head.theta_deg[i] = static_cast<double>(i) * 9e-5;
  head.phi_deg.resize(3000000);
  for (std::size_t i = 0; i < head.phi_deg.size(); ++i) head.phi_deg[i] = static_cast<double>(i) * 1e-4;
  for (const char* name : {"a.nc", "a.exr"})
    EXPECT_THAT(
        message<RunError>([&] { return make_file_sink(folder.file(name), head); }),
        AllOf(HasSubstr("needs"), HasSubstr("free")));
  EXPECT_THAT(folder.entries(), IsEmpty());
}

TEST(FoldersThatMayNotBeWritten, AreRefusedBeforeWork) {
  // /proc takes no files from anybody, the administrator included.
  const TableHeader head = example::header(1, 3, 2);
  EXPECT_THAT(
      message<RunError>([&] { return make_file_sink("/proc/a.nc", head); }),
      HasSubstr("cannot write /proc/a.nc"));
}

TEST(FilesThatAreNoTables, AreRefusedWithTheirNameAndReason) {
  const TemporaryFolder folder;
  const TableHeader head = example::header(2, 31, 12);
  for (const char* extension : {".nc", ".exr", ".json"}) {
    SCOPED_TRACE(extension);
    const std::string path = folder.file(std::string("a") + extension);
    EXPECT_THAT(
        message<InputError>([&] { return read_table(path); }),
        AllOf(HasSubstr(path), HasSubstr("no such file")));
    std::ofstream(path) << "something else";
    EXPECT_THAT(
        message<InputError>([&] { return read_table(path); }), AllOf(HasSubstr(path), Not(HasSubstr("\n"))));
    example::write(*make_file_sink(path, head), head);
    const auto size = std::filesystem::file_size(path);
    for (const double share : {0.0, 0.05, 0.5, 0.9}) {
      std::filesystem::resize_file(path, static_cast<std::uintmax_t>(share * static_cast<double>(size)));
      EXPECT_THAT(message<InputError>([&] { return read_table(path); }), HasSubstr(path)) << share;
      example::write(*make_file_sink(path, head), head);
    }
  }
  EXPECT_THAT(
      message<InputError>([&] { return open_table(folder.file("a.txt")); }), HasSubstr("names no format"));
  EXPECT_THAT(message<InputError>([&] { return open_table(folder.path()); }), HasSubstr("names no format"));
  std::ofstream(folder.file("c.json")) << "{\"wavelength_m\": [1e-7],\n\n \"theta_deg\": }";
  EXPECT_THAT(
      message<InputError>([&] { return read_table(folder.file("c.json")); }), HasSubstr("line 3, column 15"));
  std::ofstream(folder.file("d.json")) << "{\"wavelength_m\": [1e-7]}";
  EXPECT_THAT(message<InputError>([&] { return read_table(folder.file("d.json")); }), HasSubstr("theta_deg"));
}

} // namespace
} // namespace scatter::table
