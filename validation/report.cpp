#include "report.hpp"

#include <scatter/optics/errors.hpp>
#include <scatter/table/atomic_file.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace scatter::validation {

namespace fs = std::filesystem;

std::string escape(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
    case '&':
      escaped += "&amp;";
      break;
    case '<':
      escaped += "&lt;";
      break;
    case '>':
      escaped += "&gt;";
      break;
    case '"':
      escaped += "&quot;";
      break;
    default:
      escaped += c;
    }
  }
  return escaped;
}

std::string to_json(const Report& report) {
  nlohmann::ordered_json json{
      {"command", report.command}, {"version", report.version},
      {"device", report.device},   {"created", report.created},
      {"quick", report.quick},     {"settings", report.settings},
      {"seconds", report.seconds}, {"cases", nlohmann::ordered_json::array()},
  };
  for (const CaseReport& one : report.cases) {
    nlohmann::ordered_json entry{{"name", one.name}, {"title", one.title}, {"seconds", one.seconds}};
    entry["checks"] = nlohmann::ordered_json::array();
    for (const Check& check : one.checks)
      entry["checks"].push_back(
          {{"name", check.name},
           {"value", check.value},
           {"bound", check.bound},
           {"unit", check.unit},
           {"holds", check.holds()}});
    entry.update(one.numbers);
    json["cases"].push_back(std::move(entry));
  }
  return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

namespace {

constexpr const char* style = R"(
:root { color-scheme: light; }
body { font: 16px/1.5 "DejaVu Sans", Verdana, sans-serif; color: #1c2530; background: #fff; margin: 0 auto;
       padding: 1.5rem; max-width: 64rem; }
h1 { font-size: 1.7rem; margin: 0 0 .3rem; }
h2 { font-size: 1.3rem; margin: 2.8rem 0 .5rem; padding-top: .8rem; border-top: 2px solid #1f5f8b; }
h3 { font-size: 1.05rem; margin: 1.8rem 0 .3rem; }
p, li { max-width: 52rem; }
.quiet { color: #5a6672; font-size: .88rem; }
.warning { background: #fff4d6; border-left: 4px solid #d39b00; padding: .6rem .9rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .88rem; margin: .6rem 0 1rem; }
caption { text-align: left; font-weight: bold; padding-bottom: .35rem; caption-side: top; }
th, td { padding: .22rem .5rem; border-bottom: 1px solid #d9dfe5; text-align: right; white-space: nowrap;
         font-variant-numeric: tabular-nums; }
thead th { border-bottom: 2px solid #8796a5; vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; }
tbody tr:nth-child(even) { background: #f5f8fa; }
td.good { color: #19692c; font-weight: bold; }
td.bad { color: #a11b1b; font-weight: bold; }
summary { cursor: pointer; font-size: .88rem; font-weight: bold; padding: .2rem 0; }
figure { margin: 1rem 0; }
figure svg { width: 100%; height: auto; display: block; }
figcaption { font-size: .9rem; color: #3b4855; max-width: 52rem; }
code { background: #eef2f5; padding: 0 .25em; border-radius: 3px; overflow-wrap: anywhere; }
)";

/// An SVG document as HTML takes it inline: without prolog and document type, and without a title, which a
/// browser would show wherever the mouse rests.
std::string inline_svg(const std::string& svg) {
  const std::size_t start = svg.find("<svg");
  const std::size_t end = svg.rfind("</svg>");
  if (start == svg.npos || end == svg.npos) throw RunError("the plotting program wrote no SVG");
  std::string text = svg.substr(start, end + 6 - start);
  const std::size_t title = text.find("<title>"), first_shape = text.find("<g");
  if (title < first_shape) text.erase(title, text.find("</title>", title) + 8 - title);
  return text;
}

void add_table(std::string& html, const Table& table) {
  if (table.folded) html += "<details><summary>" + escape(table.caption) + "</summary>";
  html += "<div class=\"scroll\"><table>";
  if (!table.folded) html += "<caption>" + escape(table.caption) + "</caption>";
  html += "<thead><tr>";
  for (const std::string& column : table.columns) html += "<th scope=\"col\">" + escape(column) + "</th>";
  html += "</tr></thead><tbody>\n";
  for (const auto& row : table.rows) {
    html += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i) {
      const char* mark = row[i] == "yes" ? " class=\"good\"" : row[i] == "NO" ? " class=\"bad\"" : "";
      html += i == 0 ? "<th scope=\"row\">" + escape(row[i]) + "</th>"
                     : fmt::format("<td{}>{}</td>", mark, escape(row[i]));
    }
    html += "</tr>\n";
  }
  html += "</tbody></table></div>";
  html += table.folded ? "</details>\n" : "\n";
}

void add_block(std::string& html, const Block& block) {
  if (const auto* paragraph = std::get_if<Paragraph>(&block))
    html += "<p>" + paragraph->html + "</p>\n";
  else if (const auto* heading = std::get_if<Heading>(&block))
    html += "<h3>" + escape(heading->text) + "</h3>\n";
  else if (const auto* table = std::get_if<Table>(&block))
    add_table(html, *table);
  else if (const auto* figure = std::get_if<Figure>(&block))
    html += "<figure>" + inline_svg(figure->svg) + "\n<figcaption>" + figure->caption +
            "</figcaption></figure>\n";
}

Table checks_table(const CaseReport& one) {
  Table table{"Published values and the bounds set for them", {"check", "found", "bound", "holds"}, {}};
  for (const Check& check : one.checks)
    table.rows.push_back(
        {check.name, fmt::format("{:.3g} {}", check.value, check.unit),
         fmt::format("{:.3g} {}", check.bound, check.unit), check.holds() ? "yes" : "NO"});
  // A long list of what holds is for those who want it; what does not must be seen.
  constexpr std::size_t long_list = 40;
  table.folded = table.rows.size() > long_list &&
                 std::ranges::all_of(one.checks, [](const Check& c) { return c.holds(); });
  if (table.folded) table.caption += fmt::format(" ({} of {} hold)", table.rows.size(), table.rows.size());
  return table;
}

} // namespace

std::string to_html(const Report& report) {
  std::string html = "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
                     "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
                     "<title>scatter: validation report</title>\n<style>";
  html += style;
  html += "</style></head><body>\n<h1>How far <i>scatter</i> is from the exact theory</h1>\n";
  html += fmt::format(
      "<p class=\"quiet\">Made by <code>{}</code>, version {}, on {}, at {}, in {:.0f} s.</p>\n",
      escape(report.command), escape(report.version), escape(report.device), escape(report.created),
      report.seconds);
  if (report.quick)
    html +=
        "<p class=\"warning\"><b>A quick run.</b> Fewer rays, radii and wavelengths than the full report: it "
        "shows that everything works, and its numbers are rougher than what the program reaches.</p>\n";
  html +=
      "<p>Every number here comes out of this run, good or bad; <code>report.json</code> beside this page "
      "holds all of them. Times are wall-clock times on this machine with whatever else it was doing.</p>\n";
  html += "<h3>In short</h3>\n<ul>\n";
  for (const CaseReport& one : report.cases)
    for (const std::string& finding : one.findings) html += "<li>" + finding + "</li>\n";
  html += "</ul>\n";
  for (const CaseReport& one : report.cases) {
    html += fmt::format(
        "<h2 id=\"{0}\">{1}</h2>\n<p class=\"quiet\">Case <code>{0}</code>, {2:.1f} s.</p>\n",
        escape(one.name), escape(one.title), one.seconds);
    for (const Block& block : one.blocks) add_block(html, block);
    if (!one.checks.empty()) add_table(html, checks_table(one));
  }
  html += "</body></html>\n";
  return html;
}

ReportFolder::ReportFolder(const fs::path& path) : path_(fs::absolute(path).lexically_normal()) {
  if (!path_.has_filename()) path_ = path_.parent_path(); // written with a slash at its end
  std::error_code error;
  if (fs::exists(path_, error) && !fs::is_directory(path_, error))
    throw InputError(
        fmt::format("--output: {} is not a folder; name a folder for the report", path_.string()));
  if (!fs::exists(path_, error)) {
    const fs::path parent = path_.parent_path();
    if (!fs::is_directory(parent, error))
      throw InputError(fmt::format(
          "--output: {}: there is no folder {}; create it first", path_.string(), parent.string()));
    made_ = fs::create_directory(path_, error);
    if (error) throw RunError(fmt::format("cannot make the folder {}: {}", path_.string(), error.message()));
  }
  try {
    const table::PartFile proof(path_ / "report.json");
  } catch (...) {
    if (made_) fs::remove(path_, error);
    throw;
  }
}

ReportFolder::~ReportFolder() {
  std::error_code ignored;
  if (made_ && !written_) fs::remove(path_, ignored); // only when empty
}

void ReportFolder::write(const Report& report) {
  std::vector<ExtraFile> files{{"report.json", to_json(report)}};
  for (const CaseReport& one : report.cases) files.insert(files.end(), one.files.begin(), one.files.end());
  files.push_back({"index.html", to_html(report)});
  std::vector<std::unique_ptr<table::PartFile>> parts;
  for (const ExtraFile& file : files) {
    parts.push_back(std::make_unique<table::PartFile>(path_ / file.name));
    table::FileWriter out(parts.back()->descriptor(), parts.back()->name().string());
    out.write(file.text);
    out.flush();
  }
  for (const auto& part : parts) part->commit();
  written_ = true;
}

} // namespace scatter::validation
