#include "cases.hpp"
#include <scatter/fiber/ray_section.hpp>
#include <scatter/fiber/wave_section.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/scene/plot.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace scatter::validation {

namespace {

using nlohmann::ordered_json;

constexpr double wavelength_m = 550e-9;
constexpr double width_deg = 5; ///< standard deviation of the average over azimuth
constexpr double step_deg = 0.5;
constexpr int last_order = 5; ///< of the rays that are added up

struct Fiber {
  const char *name, *title;
  double eta, radius_m; ///< the radius it has in life
};
constexpr Fiber fibers[] = {
    {"silk", "silk, η = 1.345", 1.345, 5e-6},
    {"silk-dense", "silk, η = 1.54", 1.54, 5e-6},
    {"hair", "hair, η = 1.55", 1.55, 40e-6},
};

/// What is compared: an order, or the sum of all of them, over some azimuths.
struct Lobe {
  const char *name, *title;
  int order;     ///< -1: all
  double to_deg; ///< from 0; 0: wherever averaged rays are 10 % of their maximum or more
};
constexpr Lobe lobes[] = {
    {"R", "R, |φ| ≤ 120°", 0, 120},
    {"TT", "TT", 1, 0},
    {"TRT", "TRT with its caustic", 2, 0},
    {"all", "all orders together, |φ| ≤ 120°", -1, 120},
};
constexpr std::size_t lobe_count = std::size(lobes);

std::vector<double> azimuths_deg() {
  std::vector<double> phi;
  for (double p = 0; p <= 180; p += step_deg) phi.push_back(p);
  return phi;
}

/// Averaged profiles of one fibre's lobes over azimuths_deg().
using Profiles = std::array<std::vector<double>, lobe_count>;

Profiles by_rays(double eta, double theta_d, fiber::Polarisation polarisation) {
  const fiber::RaySection section(eta, 0, polarisation);
  const double width = width_deg * radians_per_degree;
  Profiles profiles;
  for (const double phi : azimuths_deg()) {
    double all = 0;
    for (int order = 0; order <= last_order; ++order) {
      const double N = section.averaged(order, theta_d, phi * radians_per_degree, width);
      if (order < 3) profiles[static_cast<std::size_t>(order)].push_back(N);
      all += N;
    }
    profiles[3].push_back(all);
  }
  return profiles;
}

Profiles by_waves(double eta, double theta_d, double radius_m) {
  const std::vector<int> orders{0, 1, 2};
  const auto waves = fiber::wave_profiles(eta, 0, 2 * pi * radius_m / wavelength_m, theta_d, orders);
  const double width = width_deg * radians_per_degree;
  Profiles profiles;
  for (const double phi : azimuths_deg()) {
    for (std::size_t p = 0; p < 3; ++p)
      profiles[p].push_back(waves.orders[p](phi * radians_per_degree, width));
    profiles[3].push_back(waves.whole(phi * radians_per_degree, width));
  }
  return profiles;
}

/// rms of the difference over the lobe, as a share of the truth's rms there.
double error_of(const Lobe& lobe, const std::vector<double>& found, const std::vector<double>& truth) {
  const auto phi = azimuths_deg();
  const double least = lobe.to_deg > 0 ? 0 : 0.1 * std::ranges::max(truth);
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < phi.size(); ++i) {
    if ((lobe.to_deg > 0 && phi[i] > lobe.to_deg) || truth[i] < least) continue;
    difference += (found[i] - truth[i]) * (found[i] - truth[i]);
    size += truth[i] * truth[i];
  }
  return std::sqrt(difference / size);
}

/// One fibre at one inclination against its radius.
struct Series {
  const Fiber* fiber = nullptr;
  double theta_d_deg = 0;
  std::vector<double> radius_m;
  std::array<std::vector<double>, lobe_count> error; ///< of rays against waves
  std::array<double, lobe_count>
      mean_reflectivity{}; ///< of rays that take mean reflectivities, against tracked ones
};

/// The radius [m] from which on the error stays below the bound; nothing if it does not within the series.
std::optional<double> trusted_from(const Series& series, std::size_t lobe, double bound) {
  const auto& error = series.error[lobe];
  std::size_t first = error.size();
  while (first > 0 && error[first - 1] <= bound) --first;
  if (first == error.size()) return std::nullopt;
  if (first == 0) return series.radius_m[0];
  // Errors fall as powers of the radius.
  const double share = std::log(error[first - 1] / bound) / std::log(error[first - 1] / error[first]);
  return series.radius_m[first - 1] * std::pow(series.radius_m[first] / series.radius_m[first - 1], share);
}

double error_at(const Series& series, std::size_t lobe, double radius_m) {
  for (std::size_t i = 1; i < series.radius_m.size(); ++i)
    if (series.radius_m[i] >= radius_m * (1 - 1e-9)) {
      const double share =
          (radius_m - series.radius_m[i - 1]) / (series.radius_m[i] - series.radius_m[i - 1]);
      return series.error[lobe][i - 1] + share * (series.error[lobe][i] - series.error[lobe][i - 1]);
    }
  return series.error[lobe].back();
}

std::string percent(double value) {
  return value < 0.0995 ? fmt::format("{:.1f} %", 100 * value) : fmt::format("{:.0f} %", 100 * value);
}

std::string micrometres(const std::optional<double>& radius_m, const Series& series) {
  if (!radius_m) return fmt::format("> {:.3g} µm", series.radius_m.back() * 1e6);
  if (*radius_m <= series.radius_m[0]) return fmt::format("≤ {:.3g} µm", series.radius_m[0] * 1e6);
  return fmt::format("{:.2g} µm", *radius_m * 1e6);
}

std::vector<double> radii(bool quick) {
  std::vector<double> list;
  const int count = quick ? 9 : 45;
  for (int i = 0; i < count; ++i) list.push_back(1e-6 * std::pow(80.0, static_cast<double>(i) / (count - 1)));
  for (const Fiber& fiber : fibers) list.push_back(fiber.radius_m);
  std::ranges::sort(list);
  list.erase(std::unique(list.begin(), list.end()), list.end());
  return list;
}

scene::Curve level(const char* label, double value, double from, double to) {
  scene::Curve curve;
  curve.label = label;
  curve.x = {from, to};
  curve.y = {value, value};
  curve.colour = "#888888";
  curve.dashed = true;
  curve.width = 1;
  return curve;
}

scene::Curve curve_of(const std::string& label, const std::vector<double>& x, const std::vector<double>& y) {
  scene::Curve curve;
  curve.label = label;
  curve.x = x;
  curve.y = y;
  return curve;
}

/// The glint at some radii, and what rays say.
Figure caustic_figure() {
  scene::Plot plot;
  plot.title = fmt::format("TRT of hair (η = 1.55, 550 nm), averaged over σ = {:g}°", width_deg);
  plot.x_label = "azimuth φ from the light (°)";
  plot.y_label = "N_TRT (1/rad)";
  plot.x_range = {{0, 60}};
  const auto rays = by_rays(1.55, 0, fiber::Polarisation::tracked),
             mean = by_rays(1.55, 0, fiber::Polarisation::mean);
  plot.curves.push_back(curve_of("rays", azimuths_deg(), rays[2]));
  plot.curves.back().colour = "#000000";
  plot.curves.back().width = 2.2;
  plot.curves.push_back(curve_of("rays, mean reflectivity", azimuths_deg(), mean[2]));
  plot.curves.back().colour = "#000000";
  plot.curves.back().dashed = true;
  for (const double radius : {1e-6, 2.5e-6, 5e-6, 40e-6})
    plot.curves.push_back(
        curve_of(fmt::format("wave, {:g} µm", radius * 1e6), azimuths_deg(), by_waves(1.55, 0, radius)[2]));
  return {
      scene::draw(plot, scene::PictureFormat::svg), "The glint as waves make it. A thin fibre spreads it far "
                                                    "beyond the caustic, into what rays leave dark."};
}

/// What goes straight on: the p = 0 term beside the rays' R lobe.
Figure diffraction_figure(double& share_within) {
  const double radius = 5e-6, x = 2 * pi * radius / wavelength_m;
  const std::vector<int> orders{0, 1};
  const auto waves = fiber::wave_profiles(1.345, 0, x, 0, orders);
  const fiber::WaveSection section(1.345, 0, x, 0);
  const fiber::RaySection rays(1.345, 0, fiber::Polarisation::tracked);
  scene::Plot plot;
  plot.title = "Straight on through silk (5 µm, η = 1.345, 550 nm), not averaged";
  plot.x_label = "azimuth φ from the light (°)";
  plot.y_label = "N (1/rad)";
  plot.log_y = true;
  plot.x_range = {{140, 180}};
  plot.y_range = {{1e-3, 30}};
  std::vector<double> phi, wave, strip, R, TT, wave_TT;
  for (double p = 140; p <= 180.0001; p += 0.05) {
    const double angle = std::min(p, 180.0) * radians_per_degree;
    phi.push_back(p);
    wave.push_back(waves.orders[0](angle, 0));
    strip.push_back(section.diffraction(0, angle));
    R.push_back(rays.distribution(0, 0, angle));
    TT.push_back(rays.distribution(1, 0, angle));
    wave_TT.push_back(waves.orders[1](angle, 0));
  }
  plot.curves = {
      curve_of("order 0: reflection and diffraction", phi, wave),
      curve_of("a strip's diffraction", phi, strip), curve_of("R, rays", phi, R),
      curve_of("order 1", phi, wave_TT), curve_of("TT, rays", phi, TT)};
  plot.curves[1].dashed = plot.curves[2].dashed = plot.curves[4].dashed = true;
  const double first_zero = std::asin(wavelength_m / (2 * radius));
  share_within = 2 * waves.orders[0].energy_between(pi - first_zero, pi, 0);
  return {
      scene::draw(plot, scene::PictureFormat::svg),
      fmt::format(
          "Forward diffraction: as much light as falls on the fibre, which no ray carries. {:.0f} % of that "
          "lies within "
          "{:.1f}° of straight on, the first zero of a strip as wide as the fibre. It leaves R alone beyond.",
          100 * share_within, first_zero / radians_per_degree)};
}

} // namespace

CaseReport run_fiber_waves(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "fiber-waves";
  report.title = "Fibres: the lobes of rays against the exact cylinder";
  const std::vector<double> tilts = settings.quick ? std::vector<double>{0} : std::vector<double>{0, 30};
  const auto radius_m = radii(settings.quick);

  std::vector<Series> all;
  double done = 0;
  const double work = static_cast<double>(std::size(fibers) * tilts.size() * radius_m.size());
  for (const Fiber& fiber : fibers)
    for (const double tilt : tilts) {
      Series series;
      series.fiber = &fiber;
      series.theta_d_deg = tilt;
      series.radius_m = radius_m;
      const double theta_d = tilt * radians_per_degree;
      const Profiles rays = by_rays(fiber.eta, theta_d, fiber::Polarisation::tracked),
                     mean = by_rays(fiber.eta, theta_d, fiber::Polarisation::mean);
      for (std::size_t k = 0; k < lobe_count; ++k)
        series.mean_reflectivity[k] = error_of(lobes[k], mean[k], rays[k]);
      for (const double radius : radius_m) {
        const Profiles waves = by_waves(fiber.eta, theta_d, radius);
        for (std::size_t k = 0; k < lobe_count; ++k)
          series.error[k].push_back(error_of(lobes[k], rays[k], waves[k]));
        progress(++done / work);
      }
      all.push_back(std::move(series));
    }

  report.blocks.emplace_back(Paragraph{fmt::format(
      "How far rays in a smooth round fibre are from Maxwell's equations, order by order: Debye's terms of "
      "the exact "
      "cylinder at {:.0f} nm, no absorption, averaged over azimuth by a Gaussian with a standard deviation "
      "of {:g}&deg; "
      "as the rays are. Error: rms of the difference over the lobe, relative to the wave's rms there (TT and "
      "TRT: where "
      "the wave has 10 % of its maximum or more). Each ray's polarisation is tracked; the common shortcut of "
      "multiplying mean reflectivities has an error of its own that no radius removes, in the last column.",
      wavelength_m * 1e9, width_deg)});

  Table table{
      "From which radius on rays may be trusted, 550 nm",
      {"", "lobe", "10 % from", "5 % from", "error at its own radius", "mean reflectivities add"},
      {}};
  std::vector<double> micrometre, size_parameter;
  for (const double radius : radius_m) {
    micrometre.push_back(radius * 1e6);
    size_parameter.push_back(2 * pi * radius / wavelength_m);
  }
  report.numbers["wavelength_m"] = wavelength_m;
  report.numbers["width_deg"] = width_deg;
  report.numbers["series"] = ordered_json::array();
  for (const Series& series : all) {
    ordered_json json{{"fiber", series.fiber->name},       {"eta", series.fiber->eta},
                      {"theta_d_deg", series.theta_d_deg}, {"own_radius_m", series.fiber->radius_m},
                      {"radius_m", series.radius_m},       {"size_parameter", size_parameter},
                      {"lobes", ordered_json::object()}};
    for (std::size_t k = 0; k < lobe_count; ++k) {
      const auto ten = trusted_from(series, k, 0.1), five = trusted_from(series, k, 0.05);
      const double own = error_at(series, k, series.fiber->radius_m);
      table.rows.push_back(
          {fmt::format(
               "{}, tilt {:g}°, {:g} µm", series.fiber->title, series.theta_d_deg,
               series.fiber->radius_m * 1e6),
           lobes[k].title, micrometres(ten, series), micrometres(five, series), percent(own),
           percent(series.mean_reflectivity[k])});
      json["lobes"][lobes[k].name] = {
          {"error", series.error[k]},
          {"ten_percent_from_m", ten ? ordered_json(*ten) : ordered_json()},
          {"five_percent_from_m", five ? ordered_json(*five) : ordered_json()},
          {"error_at_own_radius", own},
          {"mean_reflectivity_error", series.mean_reflectivity[k]}};
    }
    report.numbers["series"].push_back(std::move(json));
  }
  report.blocks.emplace_back(std::move(table));

  for (std::size_t k = 0; k < lobe_count; ++k) {
    scene::Plot plot;
    plot.title = fmt::format("Error of rays: {}", lobes[k].title);
    plot.x_label = fmt::format("radius (µm); size parameter {:.1f} per µm", 2 * pi * 1e-6 / wavelength_m);
    plot.y_label = "rms error (%)";
    plot.log_y = true;
    plot.height = 480;
    for (const Series& series : all) {
      auto curve = curve_of(
          fmt::format("{}, tilt {:g}°", series.fiber->title, series.theta_d_deg), micrometre,
          series.error[k]);
      for (double& y : curve.y) y *= 100;
      curve.dashed = series.theta_d_deg != 0;
      plot.curves.push_back(std::move(curve));
    }
    plot.curves.push_back(level("5 % and 10 %", 5, micrometre.front(), micrometre.back()));
    plot.curves.push_back(level("", 10, micrometre.front(), micrometre.back()));
    report.blocks.emplace_back(Figure{
        scene::draw(plot, scene::PictureFormat::svg),
        k == 3
            ? "All orders together, whose waves interfere: R and TRT arrive from nearly the same direction."
            : "One order alone, averaged over azimuth."});
  }
  report.blocks.emplace_back(caustic_figure());
  double within = 0;
  report.blocks.emplace_back(diffraction_figure(within));
  report.numbers["diffraction_within_first_zero"] = within;

  const auto find = [&](const char* name) -> const Series& {
    return *std::ranges::find_if(
        all, [&](const Series& s) { return s.fiber->name == std::string_view(name); });
  };
  const Series &hair = find("hair"), &silk = find("silk"), &dense = find("silk-dense");
  report.checks.push_back({"hair, 40 um: R", 100 * error_at(hair, 0, 40e-6), 5, "%"});
  report.checks.push_back({"hair, 40 um: TT", 100 * error_at(hair, 1, 40e-6), 5, "%"});
  report.checks.push_back({"hair, 40 um: TRT caustic", 100 * error_at(hair, 2, 40e-6), 10, "%"});
  report.findings.push_back(fmt::format(
      "Fibres at 550 nm, averaged over {:g}&deg; of azimuth: for hair (40 &micro;m) rays are off by {} in R, "
      "{} in TT and "
      "{} in the TRT caustic; for silk (5 &micro;m) by {}, {} and {} (&eta; = 1.345) or {}, {} and {} (&eta; "
      "= 1.54). Do "
      "not trust TRT of rays to 10 % below a radius of {} (&eta; = 1.345) or {} (&eta; = 1.54), nor TT below "
      "{} or {}.",
      width_deg, percent(error_at(hair, 0, 40e-6)), percent(error_at(hair, 1, 40e-6)),
      percent(error_at(hair, 2, 40e-6)), percent(error_at(silk, 0, 5e-6)), percent(error_at(silk, 1, 5e-6)),
      percent(error_at(silk, 2, 5e-6)), percent(error_at(dense, 0, 5e-6)), percent(error_at(dense, 1, 5e-6)),
      percent(error_at(dense, 2, 5e-6)), micrometres(trusted_from(silk, 2, 0.1), silk),
      micrometres(trusted_from(dense, 2, 0.1), dense), micrometres(trusted_from(silk, 1, 0.1), silk),
      micrometres(trusted_from(dense, 1, 0.1), dense)));
  return report;
}

} // namespace scatter::validation
