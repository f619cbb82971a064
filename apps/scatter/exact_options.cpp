#include "exact_options.hpp"

#include <scatter/optics/refractive_index.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/optics/version.hpp>

#include <fmt/chrono.h>

#include <ctime>
#include <iostream>

namespace scatter::app {
namespace {

double positive(const char* option, const std::string& text, double (*reader)(std::string_view)) {
  const double value = read(option, text, reader);
  if (!(value > 0)) throw InputError(std::string(option) + ": " + quote(text) + " is not positive");
  return value;
}

/// UTC now, ISO 8601.
std::string now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

} // namespace

void BodyTexts::add_to(
    CLI::App& verb, const std::string& group, const std::string& size_limits, const std::string& index_help) {
  const auto add = [&](const char* name, auto& text, const char* type, const std::string& description) {
    verb.add_option(name, text, description)->type_name(type)->group(group);
  };
  add("--size-parameter,--x", size_parameter, "X", "2 pi radius / wavelength, " + size_limits);
  add("--radius", radius, "LENGTH", "Radius, such as 0.4mm; needs --wavelength");
  add("--wavelength", wavelength, "LENGTH", "Wavelength in vacuum, such as 650nm");
  add("--index", index, "INDEX", index_help);
}

Constants Body::constants() const {
  Constants constants{{"index", index_source}};
  if (radius_m) constants.emplace_back("radius_m", fmt::format("{}", *radius_m));
  if (wavelength_m) constants.emplace_back("wavelength_m", fmt::format("{}", *wavelength_m));
  return constants;
}

Body read_body(const BodyTexts& texts, bool water) {
  Body body;
  if (texts.size_parameter) {
    if (texts.radius)
      throw InputError("--radius: --size-parameter says the size already; give one of the two");
    body.size_parameter = positive("--size-parameter", *texts.size_parameter, parse_number);
  } else if (!texts.radius || !texts.wavelength) {
    throw InputError(
        "the size is missing: use --size-parameter 1000, or --radius 0.4mm with --wavelength 650nm");
  }
  if (texts.wavelength) body.wavelength_m = positive("--wavelength", *texts.wavelength, parse_length);
  if (texts.radius) {
    body.radius_m = positive("--radius", *texts.radius, parse_length);
    body.size_parameter = 2 * pi * (*body.radius_m / *body.wavelength_m);
  }

  if (!texts.index && !water) throw InputError("--index is missing: use a number such as 1.55 or 1.55+1e-4i");
  if (!texts.index && !body.wavelength_m)
    throw InputError(
        "--index is missing: use a number such as 1.333 or 1.33+1e-9i, or say the --wavelength for water's");
  const IndexSource source = read("--index", texts.index.value_or("iapws"), parse_index_source);
  if (source.kind != IndexSource::Kind::given && !body.wavelength_m)
    throw InputError(
        "--index: " + quote(*texts.index) +
        " needs --wavelength, such as 650nm, or use a number such as 1.333");
  // A given index holds at every wavelength; the argument then does not matter.
  try {
    body.index = refractive_index(source, body.wavelength_m.value_or(0));
  } catch (const InputError& error) {
    throw InputError(std::string("--wavelength: ") + error.what());
  }
  body.index_source = index_source_name(source);
  return body;
}

std::string size_text(const Body& body) {
  return fmt::format(
      "{} {:.9g}", body.radius_m ? "--radius: the size parameter" : "--size-parameter", body.size_parameter);
}

void tell_not_validated(
    std::string_view verb, std::string_view what, double limit, std::string_view results, int digits) {
  std::cerr << fmt::format(
      "scatter {}: {} is beyond {}, up to which {} were compared with {} digits; computed the same way\n",
      verb, what, limit, results, digits);
}

ExactOutput::ExactOutput(const std::string& output) {
  if (output == "-") return;
  csv_ = output.ends_with(".csv");
  if (!csv_ && !output.ends_with(".json"))
    throw InputError(
        "--output: " + quote(output) +
        " has no known extension; use FILE.json, FILE.csv or - (JSON to standard output)");
  file_.emplace(output);
}

void ExactOutput::write(const std::string& text) {
  if (!file_) {
    std::cout << text; // main() checks that it arrived
    return;
  }
  table::FileWriter out(file_->descriptor(), file_->name().string());
  out.write(text);
  out.flush();
  file_->commit();
}

nlohmann::ordered_json complex_pairs(const std::vector<std::complex<double>>& values) {
  auto list = nlohmann::ordered_json::array();
  for (const auto& value : values) list.push_back({value.real(), value.imag()});
  return list;
}

std::string finish_json(nlohmann::ordered_json json, const Constants& constants, const std::string& command) {
  auto list = nlohmann::ordered_json::array();
  for (const auto& [name, value] : constants) list.push_back({{"name", name}, {"value", value}});
  json["provenance"] = {
      {"command", command},
      {"version", version()},
      {"device", "host"},
      {"created", now()},
      {"constants", list}};
  // A command line may hold bytes that are no UTF-8.
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string csv_provenance(const Constants& constants, double seconds, const std::string& command) {
  std::string one_line = command;
  for (char& c : one_line)
    if (c == '\n' || c == '\r') c = ' ';
  std::string text = fmt::format(
      "# command: {}\n# version: scatter {}\n# created: {}\n# seconds: {}\n", one_line, version(), now(),
      seconds);
  for (const auto& [name, value] : constants) text += fmt::format("# {}: {}\n", name, value);
  return text;
}

} // namespace scatter::app
