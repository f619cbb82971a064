#include "verbs.hpp"
#include <scatter/optics/errors.hpp>
#include <scatter/table/atomic_file.hpp>
#include <scatter/table/summary.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace scatter::app {
namespace {

using table::Extreme;
using table::find_constant;
using table::Source;
using table::Summary;
using table::TableHeader;

std::string nanometres(double wavelength_m) {
  return fmt::format("{:.6g} nm", wavelength_m * 1e9);
}

std::string format_name(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  return extension == ".nc" ? "netCDF-4" : extension == ".exr" ? "OpenEXR" : "JSON";
}

/// "33, 380 .. 700 nm, every 10 nm": the list in words, in units of `scale`.
std::string list_in_words(const std::vector<double>& values, double scale, const char* unit) {
  if (values.size() == 1) return fmt::format("{:.9g} {}", values[0] * scale, unit);
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  std::string words =
      fmt::format("{}, {:.9g} .. {:.9g} {}", values.size(), *low * scale, *high * scale, unit);
  const double step = (values.back() - values.front()) / static_cast<double>(values.size() - 1);
  bool even = values.size() > 2;
  for (std::size_t i = 1; i < values.size(); ++i)
    even &= std::abs(values[i] - values[i - 1] - step) < 1e-6 * std::abs(step);
  if (even) words += fmt::format(", every {:.6g} {}", std::abs(step) * scale, unit);
  return words;
}

/// "1.2 to 1.4": one number when it is the same all over.
std::string range_in_words(const std::vector<double>& values, const char* unit) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  const std::string first = fmt::format("{:.6g}", *low), last = fmt::format("{:.6g}", *high);
  return first == last ? fmt::format("{}{}", first, unit) : fmt::format("{} to {}{}", first, last, unit);
}

std::string place_in_words(const Extreme& at) {
  return fmt::format(
      "{:.6g} sr-1 at theta {:.6g} deg, phi {:.6g} deg, {}", at.value, at.theta_deg, at.phi_deg,
      nanometres(at.wavelength_m));
}

std::string index_in_words(const std::complex<double>& m) {
  return m.imag() == 0 ? fmt::format("{:.8g}", m.real()) : fmt::format("{:.8g}+{:.4g}i", m.real(), m.imag());
}

std::string drop_in_words(const TableHeader& head) {
  const auto shape = find_constant(head.provenance, "shape"),
             radius = find_constant(head.provenance, "radius_m"),
             ratio = find_constant(head.provenance, "axis_ratio");
  std::string words = shape.value_or("of unknown shape");
  // Constants are text, and other people's files may hold any.
  const auto number = [](const std::string& text, double unit, const char* name) {
    try {
      return fmt::format("{:.6g}{}", std::stod(text) * unit, name);
    } catch (const std::exception&) {
      return text;
    }
  };
  if (radius) words += ", radius " + number(*radius, 1e3, " mm");
  if (ratio && *ratio != "1") words += ", height/width " + number(*ratio, 1, "");
  return words;
}

std::string in_words(const std::filesystem::path& path, const Source& source, const Summary& all) {
  const TableHeader& head = source.header();
  const auto& made = head.provenance;
  std::string text = fmt::format(
      "{}: phase function of a drop, {}, {}\n", path.string(), format_name(path),
      table::bytes_in_words(static_cast<double>(std::filesystem::file_size(path))));
  const auto line = [&](const char* name, const std::string& words) {
    text += fmt::format("  {:<17}{}\n", name, words);
  };
  // Constants that have words of their own; the others follow as they are.
  std::set<std::string> told{"shape",        "radius_m", "axis_ratio", "sun_elevation_deg",
                             "index_source", "orders"};
  line("drop", drop_in_words(head));
  if (const auto sun = find_constant(made, "sun_elevation_deg")) line("sun", *sun + " deg above the horizon");
  line("wavelengths", list_in_words(head.wavelength_m, 1e9, "nm"));
  if (!head.index.empty()) {
    std::string words = index_in_words(head.index.front());
    if (head.index.size() > 1)
      words += fmt::format(
          " at {} to {} at {}", nanometres(head.wavelength_m.front()), index_in_words(head.index.back()),
          nanometres(head.wavelength_m.back()));
    if (const auto from = find_constant(made, "index_source")) words += " (" + *from + ")";
    line("refractive index", words);
  }
  line("theta", list_in_words(head.theta_deg, 1, "deg") + " (scattering angle)");
  line("phi", list_in_words(head.phi_deg, 1, "deg") + " (azimuth about the sunlight, 0 = most downward)");
  std::string contents = "phase function";
  if (head.matrix) contents += ", 4x4 phase matrix";
  if (head.stokes) contents += ", Stokes parameters for unpolarised light";
  if (head.amplitudes) contents += ", 2x2 amplitude matrix";
  if (head.per_order) contents += ", 2x2 amplitude matrix of every order";
  line("holds", contents);
  line("method", made.method);
  line("smallest", place_in_words(all.smallest));
  line("largest", place_in_words(all.largest));
  line(
      "integral", all.integral.empty() ? "not known: the grid does not cover the sphere"
                                       : range_in_words(all.integral, " over the sphere (1 = normalised)"));
  line("scattering", range_in_words(all.scattering_cross_section, " m2"));
  line("extinction", range_in_words(all.extinction_cross_section, " m2"));
  line(
      "error estimate", fmt::format(
                            "{:.3g} % (median), at most {:.3g} % at theta {:.6g} deg, {}",
                            100 * all.median_error, 100 * all.largest_error.value,
                            all.largest_error.theta_deg, nanometres(all.largest_error.wavelength_m)));
  for (std::size_t p = 0; p < head.orders.size(); ++p)
    line(
        p == 0 ? "energy by order" : "",
        fmt::format(
            "p = {}: {:.4f} % of the light that meets the drop", head.orders[p], 100 * all.order_energy[p]));
  bool first = true;
  for (const auto& [name, value] : made.constants)
    if (!told.contains(name)) {
      line(first ? "settings" : "", name + " = " + value);
      first = false;
    }
  line(
      "made",
      fmt::format(
          "{} by scatter {} on {}, in {:.3g} s", made.created, made.version, made.device, source.seconds()));
  line("command", made.command);
  return text;
}

nlohmann::ordered_json extreme_json(const Extreme& at, bool with_phi) {
  nlohmann::ordered_json json{
      {"value", at.value}, {"wavelength_m", at.wavelength_m}, {"theta_deg", at.theta_deg}};
  if (with_phi) json["phi_deg"] = at.phi_deg;
  return json;
}

std::string as_json(const std::filesystem::path& path, const Source& source, const Summary& all) {
  const TableHeader& head = source.header();
  const auto& made = head.provenance;
  nlohmann::ordered_json json;
  json["file"] = path.string();
  json["format"] = format_name(path);
  json["bytes"] = std::filesystem::file_size(path);
  json["wavelength_m"] = head.wavelength_m;
  auto index = nlohmann::ordered_json::array();
  for (const auto& m : head.index) index.push_back({m.real(), m.imag()});
  json["refractive_index"] = index;
  const auto grid = [](const std::vector<double>& values) {
    return nlohmann::ordered_json{
        {"count", values.size()}, {"first", values.front()}, {"last", values.back()}};
  };
  json["theta_deg"] = grid(head.theta_deg);
  json["phi_deg"] = grid(head.phi_deg);
  json["orders"] = head.orders;
  json["matrix"] = head.matrix;
  json["stokes"] = head.stokes;
  json["amplitudes"] = head.amplitudes;
  json["per_order"] = head.per_order;
  json["smallest"] = extreme_json(all.smallest, true);
  json["largest"] = extreme_json(all.largest, true);
  json["integral"] = all.integral.empty() ? nlohmann::ordered_json() : nlohmann::ordered_json(all.integral);
  json["scattering_cross_section"] = all.scattering_cross_section;
  json["extinction_cross_section"] = all.extinction_cross_section;
  json["order_energy"] = all.order_energy;
  json["median_error_estimate"] = all.median_error;
  json["largest_error_estimate"] = extreme_json(all.largest_error, false);
  json["method"] = made.method;
  json["seconds"] = source.seconds();
  nlohmann::ordered_json constants = nlohmann::ordered_json::object();
  for (const auto& [name, value] : made.constants) constants[name] = value;
  json["provenance"] = {
      {"command", made.command},
      {"version", made.version},
      {"device", made.device},
      {"created", made.created},
      {"constants", constants}};
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

} // namespace

void add_info(CLI::App& app, Context&) {
  struct Options {
    std::string file;
    bool json = false;
  };
  CLI::App* const verb = app.add_subcommand("info", "Tell in words what is in a table");
  const auto options = std::make_shared<Options>();
  verb->add_option("FILE", options->file, "Table made by scatter phase: .nc, .exr or .json")->required();
  verb->add_flag("--json", options->json, "For machines: one JSON object");
  verb->footer("The whole table is read once, one wavelength at a time.\n"
               "Example: scatter info bow.nc");
  verb->callback([options] {
    const auto source = table::open_table(options->file);
    const Summary all = table::summarise(*source);
    // main() checks that it arrived.
    std::cout
        << (options->json ? as_json(options->file, *source, all) : in_words(options->file, *source, all));
  });
}

} // namespace scatter::app
