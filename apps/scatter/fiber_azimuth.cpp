#include "exact_options.hpp"
#include "fiber.hpp"
#include <scatter/fiber/ray_section.hpp>
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
  std::optional<std::string> eta;
  std::string sigma_a = "0", theta_d = "0deg", orders = "0..2", phi = "0:180:1deg", polarisation = "mean",
              output = "-";
};

/// What one `scatter fiber azimuth` asks for.
struct Request {
  double eta = 0, sigma_a = 0, theta_d_deg = 0;
  std::vector<int> orders;
  std::vector<double> phi_deg;
  fiber::Polarisation polarisation = fiber::Polarisation::mean;
};

Request parse(const Texts& texts) {
  Request request;
  if (!texts.eta)
    throw InputError("--eta is missing: the fibre's index over that of its surroundings, such as 1.55");
  request.eta = read("--eta", *texts.eta, parse_number);
  if (!(request.eta > 1))
    throw InputError("--eta: " + quote(*texts.eta) + " is not greater than 1; use a number such as 1.55");
  request.sigma_a = read("--sigma-a", texts.sigma_a, parse_number);
  if (!(request.sigma_a >= 0))
    throw InputError(
        "--sigma-a: " + quote(texts.sigma_a) +
        " is negative; absorption per radius is 0 or more, such as 0.2");
  request.theta_d_deg = read("--theta-d", texts.theta_d, parse_angle_deg);
  if (!(std::abs(request.theta_d_deg) < 90) || !(std::abs(request.theta_d_deg * radians_per_degree) < pi / 2))
    throw InputError(
        "--theta-d: " + quote(texts.theta_d) +
        " is not between -90deg and 90deg; at the ends no light falls on the fibre");
  request.orders = read("--orders", texts.orders, parse_orders);
  request.phi_deg = read("--phi", texts.phi, parse_angles_deg);
  for (const double phi : request.phi_deg)
    if (!(phi >= -360 && phi <= 360))
      throw InputError(fmt::format("--phi: {} deg is outside -360deg..360deg", phi));
  if (texts.polarisation == "tracked")
    request.polarisation = fiber::Polarisation::tracked;
  else if (texts.polarisation != "mean")
    throw InputError("--polarisation: " + quote(texts.polarisation) + " is unknown; use mean or tracked");
  return request;
}

/// A phi that is a caustic to the last bit has no finite N; JSON has no infinity either.
double finite(double N, int order, double phi_deg) {
  if (std::isfinite(N)) return N;
  throw InputError(fmt::format(
      "--phi: {} deg is on the caustic of order {}, where rays have no finite density; step beside it",
      phi_deg, order));
}

void run(const Texts& texts, const Context& context) {
  const Request request = parse(texts);
  ExactOutput output(texts.output);
  if (output.is_csv())
    throw InputError(
        "--output: " + quote(texts.output) + " has no form for lists of unequal length; use FILE.json or -");
  const auto start = std::chrono::steady_clock::now();
  const fiber::RaySection section(request.eta, request.sigma_a, request.polarisation);
  const double theta_d = request.theta_d_deg * radians_per_degree;

  nlohmann::ordered_json json;
  json["eta"] = request.eta;
  json["sigma_a"] = request.sigma_a;
  json["theta_d_deg"] = request.theta_d_deg;
  json["polarisation"] = texts.polarisation;
  json["eta_prime"] = fiber::bravais_index(request.eta, theta_d);
  json["orders"] = request.orders;
  json["phi_deg"] = request.phi_deg;
  auto rows = nlohmann::ordered_json::array(), errors = nlohmann::ordered_json::array();
  for (const double phi_deg : request.phi_deg) {
    // Whole turns go while the angle is exact, in degrees.
    const double phi = std::remainder(phi_deg, 360) * radians_per_degree;
    auto row = nlohmann::ordered_json::array(), row_errors = nlohmann::ordered_json::array();
    for (const int order : request.orders) {
      row.push_back(finite(section.distribution(order, theta_d, phi), order, phi_deg));
      row_errors.push_back(section.error_estimate(order, theta_d, phi));
    }
    rows.push_back(std::move(row));
    errors.push_back(std::move(row_errors));
  }
  json["N"] = std::move(rows);
  auto energy = nlohmann::ordered_json::array();
  auto caustics = nlohmann::ordered_json::array(), caustic_orders = nlohmann::ordered_json::array();
  // What is not listed: the gaps below the highest order one by one, everything above it by its closed sum,
  // so that nothing is a difference of large numbers.
  double rest = section.residual_energy(request.orders.back() + 1, theta_d);
  for (int order = 0, next = 0; order <= request.orders.back(); ++order) {
    if (order != request.orders[static_cast<std::size_t>(next)]) {
      rest += section.moments(order, theta_d).energy;
      continue;
    }
    ++next;
    energy.push_back(section.moments(order, theta_d).energy);
    for (const double caustic : section.caustics(order, theta_d)) {
      caustics.push_back(caustic / radians_per_degree);
      caustic_orders.push_back(order);
    }
  }
  json["energy"] = std::move(energy);
  json["residual_energy"] = rest;
  json["caustic_phi_deg"] = std::move(caustics);
  json["caustic_order"] = std::move(caustic_orders);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  json["error_estimate"] = std::move(errors);
  json["method"] = "rays, circular section";
  json["seconds"] = seconds;
  spdlog::info(
      "eta' = {}, {} azimuths, {:.3g} s", json["eta_prime"].get<double>(), request.phi_deg.size(), seconds);
  output.write(finish_json(std::move(json), {}, context.command_line));
}

} // namespace

void add_fiber_azimuth(CLI::App& fiber, Context& context) {
  CLI::App* const verb =
      fiber.add_subcommand("azimuth", "Where a smooth fibre sends light around its axis, order by order");
  const auto texts = std::make_shared<Texts>();
  const auto add = [&](const char* name, auto& text, const char* type, const char* group,
                       const std::string& description) {
    verb->add_option(name, text, description)->type_name(type)->group(group);
  };
  add("--eta", texts->eta, "INDEX", "Fibre", "Index of the fibre over its surroundings', greater than 1");
  add("--sigma-a", texts->sigma_a, "NUMBER", "Fibre",
      "Absorption per radius, 0 or more [" + texts->sigma_a + "]");
  add("--theta-d", texts->theta_d, "ANGLE", "Directions",
      "Half the difference of the inclinations of view and light, between -90deg and 90deg [" +
          texts->theta_d + "]");
  add("--phi", texts->phi, "ANGLES", "Directions",
      "Azimuths, 0deg back toward the light, 180deg straight on; -360deg to 360deg, in any order [" +
          texts->phi + "]");
  add("--orders", texts->orders, "ORDERS", "Method",
      "0 is reflection (R), 1 transmission (TT), 2 with one reflection inside (TRT), and on [" +
          texts->orders + "]");
  add("--polarisation", texts->polarisation, "NAME", "Method",
      "mean: each reflection takes the mean of both; tracked: each ray's polarisation is followed [" +
          texts->polarisation + "]");
  add("--output", texts->output, "FILE", "Output",
      "FILE.json or - (JSON to standard output) [" + texts->output + "]");
  verb->footer(
      "N [per radian]: one row per azimuth with a value per order; light into that azimuth as a share of "
      "what falls on\n"
      "the fibre. energy: its integral over all azimuths, per order; residual_energy: that of all orders not "
      "listed.\n"
      "caustic_phi_deg: azimuths, 0deg to 180deg, where the orders in caustic_order have unbounded N. "
      "error_estimate:\nof each N, relative; energies are good to 1e-13.\n"
      "Example: scatter fiber azimuth --eta 1.55 --sigma-a 0.2 --theta-d 30deg --orders 0..2 --phi "
      "0:180:1deg");
  verb->callback([texts, &context] { run(*texts, context); });
}

} // namespace scatter::app
