#include "exact_options.hpp"
#include "mie_average.hpp"
#include "verbs.hpp"
#include <scatter/exact/debye.hpp>
#include <scatter/exact/mie.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace scatter::app {
namespace {

/// The options as typed.
struct Texts {
  BodyTexts sphere;
  std::optional<std::string> orders;
  std::string angles = "0:180:1deg", output = "-", threads = "0";
};

/// What one `scatter mie` asks for.
struct Request {
  Body sphere;
  std::vector<double> theta_deg;
  std::vector<int> orders; ///< none: the whole sum alone
  int threads = 0;
};

/// What it gets.
struct Answer {
  exact::MieResult mie;
  std::optional<exact::DebyeResult> debye;
  double seconds = 0;
  bool validated = true; ///< all of it within what was compared with 60 digits
};

/// Whether all of it is within what was compared with 60 digits; says so if not.
bool check_validated(const Request& request) {
  const double x = request.sphere.size_parameter;
  const std::string size = size_text(request.sphere);
  if (x > exact::mie_validated_size_parameter)
    tell_not_validated("mie", size, exact::mie_validated_size_parameter, "results", 60);
  else if (!request.orders.empty() && x > exact::debye_validated_size_parameter)
    tell_not_validated("mie", size, exact::debye_validated_size_parameter, "Debye terms", 60);
  else
    return true;
  return false;
}

Request parse(const Texts& texts) {
  Request request;
  request.sphere = read_body(texts.sphere, true);
  request.theta_deg = read("--angles", texts.angles, parse_angles_deg);
  for (const double angle : request.theta_deg)
    if (!(angle >= 0 && angle <= 180))
      throw InputError(fmt::format("--angles: {} deg is outside 0deg..180deg", angle));
  if (texts.orders) request.orders = read("--orders", *texts.orders, parse_orders);
  request.threads = thread_count(texts.threads);
  return request;
}

std::string json_text(const Request& request, const Answer& answer, const std::string& command) {
  const exact::MieResult& result = answer.mie;
  const auto add_term = [&](nlohmann::ordered_json& json, const exact::DebyeTerm& term) {
    json["S1"] = complex_pairs(term.S1);
    json["S2"] = complex_pairs(term.S2);
    json["error_estimate"] = term.error_estimate;
  };
  nlohmann::ordered_json json;
  json["x"] = result.size_parameter;
  json["m"] = {result.index.real(), result.index.imag()};
  json["Qext"] = result.Qext;
  json["Qsca"] = result.Qsca;
  json["Qabs"] = result.Qabs;
  json["Qback"] = result.Qback;
  json["g"] = result.g;
  json["theta_deg"] = request.theta_deg;
  json["S1"] = complex_pairs(result.S1);
  json["S2"] = complex_pairs(result.S2);
  std::vector<double> S11, S12, S33, S34;
  for (std::size_t i = 0; i < result.S1.size(); ++i) {
    const exact::MuellerElements mueller = exact::mueller_elements(result.S1[i], result.S2[i]);
    S11.push_back(mueller.S11);
    S12.push_back(mueller.S12);
    S33.push_back(mueller.S33);
    S34.push_back(mueller.S34);
  }
  json["mueller"] = {{"S11", S11}, {"S12", S12}, {"S33", S33}, {"S34", S34}};
  json["phase_function"] = result.phase_function;
  if (answer.debye) {
    json["orders"] = nlohmann::ordered_json::array();
    for (const auto& order : answer.debye->orders) {
      nlohmann::ordered_json one{{"p", order.p}};
      add_term(one, order);
      json["orders"].push_back(std::move(one));
    }
    const int last = request.orders.back();
    json["partial_sum"] = {{"last_p", last}};
    add_term(json["partial_sum"], answer.debye->partial_sum);
    json["remainder"] = {{"after_p", last}};
    add_term(json["remainder"], answer.debye->remainder);
  }
  json["error_estimate"] = result.error_estimate;
  json["Qback_error_estimate"] = result.Qback_error_estimate;
  json["validated"] = answer.validated;
  json["method"] = answer.debye ? "Lorenz-Mie, Debye series" : "Lorenz-Mie";
  json["seconds"] = answer.seconds;
  return finish_json(std::move(json), request.sphere.constants(), command);
}

std::string csv_text(const Request& request, const Answer& answer, const std::string& command) {
  const exact::MieResult& result = answer.mie;
  std::vector<std::pair<std::string, const exact::DebyeTerm*>> terms;
  if (answer.debye) {
    for (const auto& order : answer.debye->orders) terms.emplace_back(fmt::format("p{}", order.p), &order);
    terms.emplace_back("partial_sum", &answer.debye->partial_sum);
    terms.emplace_back("remainder", &answer.debye->remainder);
  }
  fmt::memory_buffer text;
  const auto add = [&]<typename... Values>(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text), format, std::forward<Values>(values)...);
  };
  add("# Lorenz-Mie scattering by a sphere; amplitudes of Bohren & Huffman, time factor exp(-i omega t)\n");
  add("{}", csv_provenance(request.sphere.constants(), answer.seconds, command));
  add("# x: {}\n# m: {} {}\n", result.size_parameter, result.index.real(), result.index.imag());
  add("# Qext: {}\n# Qsca: {}\n# Qabs: {}\n# Qback: {}\n# g: {}\n", result.Qext, result.Qsca, result.Qabs,
      result.Qback, result.g);
  add("# error_estimate: {}\n# error_estimate of Qback: {}\n", result.error_estimate,
      result.Qback_error_estimate);
  for (const auto& [name, term] : terms) add("# error_estimate of {}: {}\n", name, term->error_estimate);
  if (answer.debye)
    add("# partial_sum: all orders 0..{0}; remainder: all orders after {0}\n", request.orders.back());
  add("# phase_function in sr^-1, integral over the sphere 1; polarization = -S12/S11 for unpolarised "
      "light\n");
  add("theta_deg,S1_re,S1_im,S2_re,S2_im,S11,S12,S33,S34,phase_function,polarization");
  for (const auto& [name, term] : terms) add(",{0}_S1_re,{0}_S1_im,{0}_S2_re,{0}_S2_im", name);
  add("\n");
  for (std::size_t i = 0; i < request.theta_deg.size(); ++i) {
    const auto S1 = result.S1[i], S2 = result.S2[i];
    const auto [S11, S12, S33, S34] = exact::mueller_elements(S1, S2);
    add("{},{},{},{},{},{},{},{},{},{},{}", request.theta_deg[i], S1.real(), S1.imag(), S2.real(), S2.imag(),
        S11, S12, S33, S34, result.phase_function[i], S11 > 0 ? (0 - S12) / S11 : 0.0);
    for (const auto& [name, term] : terms)
      add(",{},{},{},{}", term->S1[i].real(), term->S1[i].imag(), term->S2[i].real(), term->S2[i].imag());
    add("\n");
  }
  return fmt::to_string(text);
}

void run(const Texts& texts, const Context& context) {
  const Request request = parse(texts);
  ExactOutput output(texts.output);

  const auto start = std::chrono::steady_clock::now();
  Answer answer;
  answer.mie = exact::mie_at_degrees(
      request.sphere.size_parameter, request.sphere.index, request.theta_deg, request.threads);
  if (!request.orders.empty())
    answer.debye = exact::debye_at_degrees(
        request.sphere.size_parameter, request.sphere.index, request.orders, request.theta_deg,
        request.threads);
  answer.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  spdlog::info(
      "x = {}, m = {} + {}i ({}), {} angles, {:.3g} s, error estimate {:.1e}", answer.mie.size_parameter,
      answer.mie.index.real(), answer.mie.index.imag(), request.sphere.index_source, request.theta_deg.size(),
      answer.seconds, answer.mie.error_estimate);
  if (answer.debye)
    for (const auto& order : answer.debye->orders)
      spdlog::info("p = {}: error estimate {:.1e}", order.p, order.error_estimate);
  answer.validated = check_validated(request);
  output.write(
      output.is_csv() ? csv_text(request, answer, context.command_line)
                      : json_text(request, answer, context.command_line));
}

} // namespace

void add_mie(CLI::App& app, Context& context) {
  CLI::App* const verb = app.add_subcommand("mie", "Exact scattering by a sphere (Lorenz-Mie)");
  const auto texts = std::make_shared<Texts>();
  const auto add = [&](const char* name, auto& text, const char* type, const char* group,
                       const std::string& description) {
    verb->add_option(name, text, description)->type_name(type)->group(group);
  };
  texts->sphere.add_to(
      *verb, "Sphere", "1e-6 to 5e5",
      "Refractive index: a number such as 1.333 or 1.33+1e-9i, or with --wavelength iapws, daimon-masumura, "
      "hale-querry [iapws]");
  add("--angles", texts->angles, "ANGLES", "Directions",
      "Scattering angles, 0deg to 180deg, in any order [" + texts->angles + "]");
  add("--orders", texts->orders, "ORDERS", "Method",
      "Debye terms p too, such as 0..8 or 0,2: 0 external reflection and diffraction, 1 transmission, p - 1 "
      "internal reflections; with the sum of all up to the last and the remainder");
  add("--threads", texts->threads, "N", "Method",
      "Threads to use, 0 for all cores; results do not depend on it [0]");
  add("--output", texts->output, "FILE", "Output", "FILE.json, FILE.csv or - (JSON to standard output) [-]");
  verb->footer(
      "Amplitudes follow Bohren & Huffman (time factor exp(-i omega t)); efficiencies are over pi radius^2.\n"
      "Example: scatter mie --radius 0.4mm --wavelength 650nm --angles 137:143:0.1deg --output bow.csv");
  const auto average = std::make_shared<AverageTexts>();
  add_average_options(*verb, *average);
  verb->callback([texts, average, &context] {
    if (!average->wanted()) return run(*texts, context);
    run_average(
        *average, {texts->sphere, texts->orders, texts->angles, texts->output, texts->threads}, context);
  });
}

} // namespace scatter::app
