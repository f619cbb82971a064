#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <memory>
#include <string>
#include <variant>
#include <vector>

/// What validation found, for machines and for people.
namespace scatter::validation {

/// Text with its own <b>, <i>, <code> and nothing else of HTML; escape() whatever comes from outside.
struct Paragraph {
  std::string html;
};
struct Heading {
  std::string text;
};
/// Cells are plain text; those of the first column name their row.
struct Table {
  std::string caption;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
  bool folded = false; ///< shown when the reader opens it
};
struct Figure {
  std::string svg; ///< a whole SVG document
  std::string caption;
};
using Block = std::variant<Paragraph, Heading, Table, Figure>;

/// A claim with a bound that was published before the numbers were known.
struct Check {
  std::string name;
  double value = 0, bound = 0; ///< holds while value <= bound
  std::string unit;
  [[nodiscard]] bool holds() const { return value <= bound; }
};

struct ExtraFile {
  std::string name, text;
};

/// One case's findings.
struct CaseReport {
  std::string name, title;
  std::vector<Block> blocks;
  std::vector<Check> checks;
  std::vector<std::string> findings; ///< conclusions in one sentence each, as Paragraph::html, for the top
  nlohmann::ordered_json numbers;    ///< every number, with what it belongs to
  std::vector<ExtraFile> files;      ///< written beside the report
  double seconds = 0;
};

struct Report {
  std::string command, version, device, created;
  bool quick = false;
  nlohmann::ordered_json settings;
  std::vector<CaseReport> cases;
  double seconds = 0;
};

[[nodiscard]] std::string escape(const std::string& text);
/// report.json. Keys: command, version, device, created, quick, settings, seconds, cases[]: name, title,
/// seconds, checks[], and what the case measured.
[[nodiscard]] std::string to_json(const Report& report);
/// index.html: one file, no script, nothing that a browser would fetch.
[[nodiscard]] std::string to_html(const Report& report);

/// A folder for a report. Made (if it is not there) and proved writable at construction, before any work;
/// write() replaces the report's files and no others, each only when all of them are complete on disk.
class ReportFolder {
public:
  /// Throws InputError if the path is a file or its parent does not exist, RunError if it may not be written.
  explicit ReportFolder(const std::filesystem::path& path);
  ~ReportFolder();
  ReportFolder(const ReportFolder&) = delete;
  ReportFolder& operator=(const ReportFolder&) = delete;

  /// Throws RunError when the disk fails; the folder is then as it was.
  void write(const Report& report);

private:
  std::filesystem::path path_;
  bool made_ = false, written_ = false;
};

} // namespace scatter::validation
