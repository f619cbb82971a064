#pragma once

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace scatter::table {

/// A folder of the test's own, removed with everything in it. After share(), the process of a death test,
/// which runs the test again from its beginning, gets the same folder.
class TemporaryFolder {
public:
  TemporaryFolder() {
    if (const char* shared = std::getenv(variable)) {
      path_ = shared;
      owned_ = false;
      return;
    }
    std::string pattern = (std::filesystem::temp_directory_path() / "scatter-test-XXXXXX").string();
    if (!::mkdtemp(pattern.data())) throw std::runtime_error("no temporary folder");
    path_ = pattern;
  }
  ~TemporaryFolder() {
    if (!owned_) return;
    ::unsetenv(variable);
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  void share() const { ::setenv(variable, path_.c_str(), 1); }
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::vector<std::string> entries() const {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(path_))
      names.push_back(entry.path().filename());
    return names;
  }

private:
  static constexpr const char* variable = "SCATTER_TEST_FOLDER";
  std::filesystem::path path_;
  bool owned_ = true;
};

} // namespace scatter::table
