#include "mie_average.hpp"
#include "verbs.hpp"
#include <scatter/exact/mie.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/refractive_index.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/optics/version.hpp>
#include <scatter/table/atomic_file.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include <charconv>
#include <chrono>
#include <cmath>
#include <ctime>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace scatter::app {
namespace {

/// The options as typed.
struct Texts {
  std::optional<std::string> size_parameter, radius, wavelength, index, orders;
  std::string angles = "0:180:1deg", output = "-", threads = "0";
};

/// What one `scatter mie` asks for.
struct Request {
  double size_parameter = 0;
  std::complex<double> index;
  std::string index_source;
  std::optional<double> radius_m, wavelength_m;
  std::vector<double> theta_deg;
  int threads = 0;
};

/// Reads one option's text; whatever is wrong with it then names the option.
template <typename Reader>
auto read(const char* option, const std::string& text, Reader&& reader) {
  try {
    return reader(text);
  } catch (const InputError& error) {
    throw InputError(std::string(option) + ": " + error.what());
  }
}

double positive(const char* option, const std::string& text, double (*reader)(std::string_view)) {
  const double value = read(option, text, reader);
  if (!(value > 0)) throw InputError(std::string(option) + ": " + quote(text) + " is not positive");
  return value;
}

int thread_count(const std::string& text) {
  int count = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
  if (error != std::errc{} || end != text.data() + text.size() || count < 0 || count > 4096)
    throw InputError("--threads: " + quote(text) + " is not a number of threads; use 0 (all cores) to 4096");
  return count;
}

Request parse(const Texts& texts) {
  if (texts.orders)
    throw InputError(
        "--orders: Debye terms are not available in this version; leave it out for the whole sum");
  Request request;
  if (texts.size_parameter) {
    if (texts.radius)
      throw InputError("--radius: --size-parameter says the size already; give one of the two");
    request.size_parameter = positive("--size-parameter", *texts.size_parameter, parse_number);
  } else if (!texts.radius || !texts.wavelength) {
    throw InputError(
        "the size is missing: use --size-parameter 1000, or --radius 0.4mm with --wavelength 650nm");
  }
  if (texts.wavelength) request.wavelength_m = positive("--wavelength", *texts.wavelength, parse_length);
  if (texts.radius) {
    request.radius_m = positive("--radius", *texts.radius, parse_length);
    request.size_parameter = 2 * pi * (*request.radius_m / *request.wavelength_m);
  }

  if (!texts.index && !request.wavelength_m)
    throw InputError(
        "--index is missing: use a number such as 1.333 or 1.33+1e-9i, or say the --wavelength for water's");
  const IndexSource source = read("--index", texts.index.value_or("iapws"), parse_index_source);
  if (source.kind != IndexSource::Kind::given && !request.wavelength_m)
    throw InputError(
        "--index: " + quote(*texts.index) +
        " needs --wavelength, such as 650nm, or use a number such as 1.333");
  // A given index holds at every wavelength; the argument then does not matter.
  try {
    request.index = refractive_index(source, request.wavelength_m.value_or(0));
  } catch (const InputError& error) {
    throw InputError(std::string("--wavelength: ") + error.what());
  }
  request.index_source = index_source_name(source);

  request.theta_deg = read("--angles", texts.angles, parse_angles_deg);
  for (const double angle : request.theta_deg)
    if (!(angle >= 0 && angle <= 180))
      throw InputError(fmt::format("--angles: {} deg is outside 0deg..180deg", angle));
  request.threads = thread_count(texts.threads);
  return request;
}

enum class Format { json, csv };

Format format_of(const std::string& output) {
  if (output == "-" || output.ends_with(".json")) return Format::json;
  if (output.ends_with(".csv")) return Format::csv;
  throw InputError(
      "--output: " + quote(output) +
      " has no known extension; use FILE.json, FILE.csv or - (JSON to standard output)");
}

/// UTC now, ISO 8601.
std::string now() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

using Constants = std::vector<std::pair<std::string, std::string>>;

Constants constants_of(const Request& request) {
  Constants constants{{"index", request.index_source}};
  if (request.radius_m) constants.emplace_back("radius_m", fmt::format("{}", *request.radius_m));
  if (request.wavelength_m) constants.emplace_back("wavelength_m", fmt::format("{}", *request.wavelength_m));
  return constants;
}

std::string json_text(
    const Request& request, const exact::MieResult& result, double seconds, const std::string& command) {
  const auto pairs = [](const std::vector<std::complex<double>>& values) {
    auto list = nlohmann::ordered_json::array();
    for (const auto& value : values) list.push_back({value.real(), value.imag()});
    return list;
  };
  auto constants = nlohmann::ordered_json::array();
  for (const auto& [name, value] : constants_of(request))
    constants.push_back({{"name", name}, {"value", value}});
  nlohmann::ordered_json json;
  json["x"] = result.size_parameter;
  json["m"] = {result.index.real(), result.index.imag()};
  json["Qext"] = result.Qext;
  json["Qsca"] = result.Qsca;
  json["Qabs"] = result.Qabs;
  json["Qback"] = result.Qback;
  json["g"] = result.g;
  json["theta_deg"] = request.theta_deg;
  json["S1"] = pairs(result.S1);
  json["S2"] = pairs(result.S2);
  json["phase_function"] = result.phase_function;
  json["error_estimate"] = result.error_estimate;
  json["method"] = "Lorenz-Mie";
  json["seconds"] = seconds;
  json["provenance"] = {
      {"command", command},
      {"version", version()},
      {"device", "host"},
      {"created", now()},
      {"constants", constants}};
  // A command line may hold bytes that are no UTF-8.
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::string
csv_text(const Request& request, const exact::MieResult& result, double seconds, const std::string& command) {
  std::string one_line = command;
  for (char& c : one_line)
    if (c == '\n' || c == '\r') c = ' ';
  fmt::memory_buffer text;
  const auto add = [&]<typename... Values>(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text), format, std::forward<Values>(values)...);
  };
  add("# Lorenz-Mie scattering by a sphere; amplitudes of Bohren & Huffman, time factor exp(-i omega t)\n");
  add("# command: {}\n# version: scatter {}\n# created: {}\n# seconds: {}\n", one_line, version(), now(),
      seconds);
  for (const auto& [name, value] : constants_of(request)) add("# {}: {}\n", name, value);
  add("# x: {}\n# m: {} {}\n", result.size_parameter, result.index.real(), result.index.imag());
  add("# Qext: {}\n# Qsca: {}\n# Qabs: {}\n# Qback: {}\n# g: {}\n", result.Qext, result.Qsca, result.Qabs,
      result.Qback, result.g);
  add("# error_estimate: {}\n", result.error_estimate);
  add("# phase_function in sr^-1, integral over the sphere 1; polarization = -S12/S11 for unpolarised "
      "light\n");
  add("theta_deg,S1_re,S1_im,S2_re,S2_im,S11,S12,S33,S34,phase_function,polarization\n");
  for (std::size_t i = 0; i < request.theta_deg.size(); ++i) {
    const auto S1 = result.S1[i], S2 = result.S2[i];
    const double perpendicular = std::norm(S1), parallel = std::norm(S2);
    const double S11 = (parallel + perpendicular) / 2;
    // The difference of squares as a product: it keeps its digits where the two are nearly equal.
    const double S12 = (std::abs(S2) - std::abs(S1)) * (std::abs(S2) + std::abs(S1)) / 2;
    const auto cross = S2 * std::conj(S1);
    add("{},{},{},{},{},{},{},{},{},{},{}\n", request.theta_deg[i], S1.real(), S1.imag(), S2.real(),
        S2.imag(), S11, S12, cross.real(), cross.imag(), result.phase_function[i],
        S11 > 0 ? (0 - S12) / S11 : 0.0);
  }
  return fmt::to_string(text);
}

void run(const Texts& texts, const Context& context) {
  const Request request = parse(texts);
  const Format format = format_of(texts.output);
  // The file is opened before the work: a folder that is not there is told at once.
  std::optional<table::PartFile> file;
  if (texts.output != "-") file.emplace(texts.output);

  const auto start = std::chrono::steady_clock::now();
  const auto result =
      exact::mie_at_degrees(request.size_parameter, request.index, request.theta_deg, request.threads);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  spdlog::info(
      "x = {}, m = {} + {}i ({}), {} angles, {:.3g} s, error estimate {:.1e}", request.size_parameter,
      request.index.real(), request.index.imag(), request.index_source, request.theta_deg.size(), seconds,
      result.error_estimate);

  const std::string text = format == Format::csv ? csv_text(request, result, seconds, context.command_line)
                                                 : json_text(request, result, seconds, context.command_line);
  if (!file) {
    std::cout << text; // main() checks that it arrived
    return;
  }
  table::FileWriter out(file->descriptor(), file->name().string());
  out.write(text);
  out.flush();
  file->commit();
}

} // namespace

void add_mie(CLI::App& app, Context& context) {
  CLI::App* const verb = app.add_subcommand("mie", "Exact scattering by a sphere (Lorenz-Mie)");
  const auto texts = std::make_shared<Texts>();
  const auto add = [&](const char* name, auto& text, const char* type, const char* group,
                       const std::string& description) {
    verb->add_option(name, text, description)->type_name(type)->group(group);
  };
  add("--size-parameter,--x", texts->size_parameter, "X", "Sphere", "2 pi radius / wavelength, 1e-6 to 5e5");
  add("--radius", texts->radius, "LENGTH", "Sphere", "Radius, such as 0.4mm; needs --wavelength");
  add("--wavelength", texts->wavelength, "LENGTH", "Sphere", "Wavelength in vacuum, such as 650nm");
  add("--index", texts->index, "INDEX", "Sphere",
      "Refractive index: a number such as 1.333 or 1.33+1e-9i, or with --wavelength iapws, daimon-masumura, "
      "hale-querry [iapws]");
  add("--angles", texts->angles, "ANGLES", "Directions",
      "Scattering angles, 0deg to 180deg, in any order [" + texts->angles + "]");
  add("--threads", texts->threads, "N", "Method",
      "Threads to use, 0 for all cores; results do not depend on it [0]");
  add("--output", texts->output, "FILE", "Output", "FILE.json, FILE.csv or - (JSON to standard output) [-]");
  add("--orders", texts->orders, "ORDERS", "", "Not available in this version"); // no group: not in the help
  verb->footer(
      "Amplitudes follow Bohren & Huffman (time factor exp(-i omega t)); efficiencies are over pi radius^2.\n"
      "Example: scatter mie --radius 0.4mm --wavelength 650nm --angles 137:143:0.1deg --output bow.csv");
  const auto average = std::make_shared<AverageTexts>();
  add_average_options(*verb, *average);
  verb->callback([texts, average, &context] {
    if (!average->wanted()) return run(*texts, context);
    run_average(
        *average,
        {texts->size_parameter, texts->radius, texts->wavelength, texts->index, texts->orders, texts->angles,
         texts->output, texts->threads},
        context);
  });
}

} // namespace scatter::app
