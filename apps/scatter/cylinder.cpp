#include "exact_options.hpp"
#include "verbs.hpp"
#include <scatter/exact/cylinder.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace scatter::app {
namespace {

/// The options as typed.
struct Texts {
  BodyTexts body;
  std::optional<std::string> orders;
  std::string tilt = "0deg", angles = "0:180:1deg", output = "-", threads = "0";
};

/// What one `scatter cylinder` asks for.
struct Request {
  Body body;
  double tilt_deg = 0;
  std::vector<double> theta_deg;
  std::vector<int> orders;
  int threads = 0;
};

Request parse(const Texts& texts) {
  Request request;
  request.body = read_body(texts.body, false);
  request.tilt_deg = read("--tilt", texts.tilt, parse_angle_deg);
  if (!(std::abs(request.tilt_deg) <= 89.9))
    throw InputError(fmt::format(
        "--tilt: {} deg is outside -89.9deg..89.9deg; 0deg is light at right angles to the axis",
        request.tilt_deg));
  request.theta_deg = read("--angles", texts.angles, parse_angles_deg);
  for (const double angle : request.theta_deg)
    if (!(angle >= -360 && angle <= 360))
      throw InputError(fmt::format("--angles: {} deg is outside -360deg..360deg", angle));
  if (texts.orders) request.orders = read("--orders", *texts.orders, parse_orders);
  request.threads = thread_count(texts.threads);
  return request;
}

void put_amplitudes(nlohmann::ordered_json& json, const exact::CylinderAmplitudes& amplitudes) {
  json["T1"] = complex_pairs(amplitudes.T1);
  json["T2"] = complex_pairs(amplitudes.T2);
  json["T3"] = complex_pairs(amplitudes.T3);
  json["T4"] = complex_pairs(amplitudes.T4);
}

/// Whether all of it is within what was compared with 50 digits; says so if not.
bool check_validated(const Request& request) {
  if (request.body.size_parameter > exact::cylinder_validated_size_parameter)
    tell_not_validated(
        "cylinder", size_text(request.body), exact::cylinder_validated_size_parameter, "results", 50);
  else if (std::abs(request.tilt_deg) > exact::cylinder_validated_tilt_deg)
    tell_not_validated(
        "cylinder", fmt::format("--tilt: {} deg", std::abs(request.tilt_deg)),
        exact::cylinder_validated_tilt_deg, "results", 50);
  else
    return true;
  return false;
}

std::string json_text(
    const Request& request, const exact::CylinderResult& result, bool validated, double seconds,
    const std::string& command) {
  const auto by_case = [](const exact::ByCase& values) {
    return nlohmann::ordered_json{{"I", values.I}, {"II", values.II}};
  };
  nlohmann::ordered_json json;
  json["x"] = result.size_parameter;
  json["m"] = {result.index.real(), result.index.imag()};
  json["tilt_deg"] = result.tilt_deg;
  json["Qext"] = by_case(result.Qext);
  json["Qsca"] = by_case(result.Qsca);
  json["Qabs"] = by_case(result.Qabs);
  json["theta_deg"] = request.theta_deg;
  put_amplitudes(json, result.amplitudes);
  if (!request.orders.empty()) {
    auto list = nlohmann::ordered_json::array();
    for (const auto& order : result.orders) {
      nlohmann::ordered_json term;
      term["p"] = order.p;
      put_amplitudes(term, order.amplitudes);
      term["error_estimate"] = order.error_estimate;
      list.push_back(std::move(term));
    }
    json["orders"] = std::move(list);
    put_amplitudes(json["remainder"], result.remainder);
  }
  json["error_estimate"] = result.error_estimate;
  json["validated"] = validated;
  json["method"] = "Lorenz-Mie, infinite cylinder";
  json["seconds"] = seconds;
  return finish_json(std::move(json), request.body.constants(), command);
}

std::string csv_text(
    const Request& request, const exact::CylinderResult& result, double seconds, const std::string& command) {
  fmt::memory_buffer text;
  const auto add = [&]<typename... Values>(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text), format, std::forward<Values>(values)...);
  };
  add("# Scattering by an infinite circular cylinder; amplitudes of Bohren & Huffman 8.34, time factor "
      "exp(-i omega "
      "t)\n");
  add("{}", csv_provenance(request.body.constants(), seconds, command));
  add("# x: {}\n# m: {} {}\n# tilt_deg: {}\n", result.size_parameter, result.index.real(),
      result.index.imag(), result.tilt_deg);
  const auto by_case = [&](const char* name, const exact::ByCase& values) {
    add("# {}: {} (case I), {} (case II)\n", name, values.I, values.II);
  };
  by_case("Qext", result.Qext);
  by_case("Qsca", result.Qsca);
  by_case("Qabs", result.Qabs);
  add("# error_estimate: {}\n", result.error_estimate);
  add("# theta_deg: azimuth about the axis, 0 straight on; T4 = -T3; columns _pN: Debye term N, _rest: what "
      "the terms "
      "leave out\n");
  add("theta_deg");
  const auto head = [&](const std::string& suffix) {
    for (const char* name : {"T1", "T2", "T3"}) add(",{0}{1}_re,{0}{1}_im", name, suffix);
  };
  head("");
  for (const auto& order : result.orders) head(fmt::format("_p{}", order.p));
  if (!result.orders.empty()) head("_rest");
  add("\n");
  for (std::size_t i = 0; i < request.theta_deg.size(); ++i) {
    add("{}", request.theta_deg[i]);
    const auto row = [&](const exact::CylinderAmplitudes& amplitudes) {
      for (const auto* T : {&amplitudes.T1, &amplitudes.T2, &amplitudes.T3})
        add(",{},{}", (*T)[i].real(), (*T)[i].imag());
    };
    row(result.amplitudes);
    for (const auto& order : result.orders) row(order.amplitudes);
    if (!result.orders.empty()) row(result.remainder);
    add("\n");
  }
  return fmt::to_string(text);
}

void run(const Texts& texts, const Context& context) {
  const Request request = parse(texts);
  ExactOutput output(texts.output);

  const auto start = std::chrono::steady_clock::now();
  const auto result = exact::cylinder_at_degrees(
      request.body.size_parameter, request.body.index, request.tilt_deg, request.theta_deg, request.orders,
      request.threads);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  spdlog::info(
      "x = {}, m = {} + {}i ({}), tilt {} deg, {} angles, {:.3g} s, error estimate {:.1e}",
      result.size_parameter, result.index.real(), result.index.imag(), request.body.index_source,
      result.tilt_deg, request.theta_deg.size(), seconds, result.error_estimate);
  const bool validated = check_validated(request);
  output.write(
      output.is_csv() ? csv_text(request, result, seconds, context.command_line)
                      : json_text(request, result, validated, seconds, context.command_line));
}

} // namespace

void add_cylinder(CLI::App& app, Context& context) {
  CLI::App* const verb =
      app.add_subcommand("cylinder", "Exact scattering by an infinite cylinder, at any tilt");
  const auto texts = std::make_shared<Texts>();
  const auto add = [&](const char* name, auto& text, const char* type, const char* group,
                       const std::string& description) {
    verb->add_option(name, text, description)->type_name(type)->group(group);
  };
  texts->body.add_to(
      *verb, "Cylinder", "1e-6 to 1e5",
      "Refractive index: a number such as 1.55 or 1.55+1e-4i, or with --wavelength iapws, daimon-masumura, "
      "hale-querry");
  add("--tilt", texts->tilt, "ANGLE", "Cylinder",
      "Between the light and the plane across the axis: 0deg is at right angles to the axis, 90deg along it; "
      "-89.9deg "
      "to 89.9deg [" +
          texts->tilt + "]");
  add("--angles", texts->angles, "ANGLES", "Directions",
      "Azimuths about the axis, 0deg straight on, -360deg to 360deg, in any order [" + texts->angles + "]");
  add("--orders", texts->orders, "ORDERS", "Method",
      "Debye terms to give beside the sum, such as 2, 0,2 or 0..8: 0 is external reflection with "
      "diffraction");
  add("--threads", texts->threads, "N", "Method",
      "Threads to use, 0 for all cores; results do not depend on it [0]");
  add("--output", texts->output, "FILE", "Output", "FILE.json, FILE.csv or - (JSON to standard output) [-]");
  verb->footer(
      "Amplitudes T1..T4 follow Bohren & Huffman 8.34 (time factor exp(-i omega t), zeta = 90 deg - tilt, "
      "Theta = the\n"
      "angles here); case I: E in the plane of axis and light. Efficiencies are over the diameter.\n"
      "Example: scatter cylinder --radius 40um --wavelength 550nm --index 1.55 --tilt 30deg --orders 0..3");
  verb->callback([texts, &context] { run(*texts, context); });
}

} // namespace scatter::app
