#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace scatter::test {

/// What a finished program left behind.
struct Outcome {
  int exit_code = -1; ///< -1 when a signal ended it
  int signal = 0;
  std::string output; ///< standard output
  std::string errors; ///< standard error
  [[nodiscard]] long error_lines() const;
};

/// A folder of its own, removed with everything in it.
class TemporaryFolder {
public:
  TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder();
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Path of a file in the folder, as an argument for a program.
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  [[nodiscard]] std::vector<std::string> names() const;

private:
  std::filesystem::path path_;
};

/// A program under way; its output goes to files, so it never waits for us.
class Running {
public:
  /// environment: "NAME=value" entries that are added to ours. output: where standard output goes; empty:
  /// captured.
  Running(
      const std::vector<std::string>& command, const std::vector<std::string>& environment = {},
      const std::string& output = {});
  Outcome wait();
  [[nodiscard]] pid_t pid() const { return pid_; }

private:
  TemporaryFolder folder_;
  pid_t pid_ = -1;
};

/// Runs `scatter` with these arguments.
Outcome
run(const std::vector<std::string>& arguments, const std::vector<std::string>& environment = {},
    const std::string& output = {});
/// Runs a line of shell in which $SCATTER is the program.
Outcome shell(const std::string& line);

} // namespace scatter::test
