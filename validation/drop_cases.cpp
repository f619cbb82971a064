#include "cases.hpp"
#include <scatter/compute/device.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/phase/job.hpp>
#include <scatter/table/grid.hpp>
#include <scatter/wavefront/far_field.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <optional>

namespace scatter::validation {

namespace {

using nlohmann::ordered_json;

std::vector<double> even(double last, int steps) {
  std::vector<double> values;
  for (int i = 0; i <= steps; ++i) values.push_back(last * i / steps);
  return values;
}

} // namespace

CaseReport run_energy(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "energy";
  report.title = "Energy of every order of a falling drop";
  const double radius_m = 0.5e-3, sun_deg = 20, wavelength_m = 650e-9;
  const std::vector<int> rays = settings.quick ? std::vector<int>{250, 500} : std::vector<int>{500, 1000};
  const int theta_steps = settings.quick ? 3600 : 7200, phi_steps = settings.quick ? 180 : 720;
  struct Row {
    int order, rays;
    double integral, carried, seconds;
    [[nodiscard]] double error() const { return integral / carried - 1; }
  };
  std::vector<Row> rows;
  for (const int count : rays)
    for (const int order : settings.orders) {
      phase::Request request;
      request.shape = drop::beard_chuang(radius_m);
      request.sun_elevation_deg = sun_deg;
      request.wavelength_m = {wavelength_m};
      request.index = settings.index;
      request.theta_deg = even(180, theta_steps);
      request.phi_deg = even(180, phi_steps);
      request.rays = count;
      request.orders = {order};
      request.method = phase::Method::patches;
      request.diffraction = phase::Diffraction::none;
      request.interference = false;
      request.threads = settings.threads;
      const auto start = std::chrono::steady_clock::now();
      const table::PhaseTable table = phase::compute(request);
      const table::Slab& slab = table.slabs.front();
      const std::optional<double> integral =
          table::sphere_integral(request.theta_deg, request.phi_deg, slab.phase_function);
      if (!integral) throw RunError("energy: the grid of directions does not cover the sphere");
      // The extinction cross section is twice the shadow, which the carried energy is a share of.
      const double shadow = slab.extinction_cross_section / 2;
      rows.push_back(
          {order, count, *integral * slab.scattering_cross_section / shadow, slab.order_energy.front(),
           std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count()});
      progress(static_cast<double>(rows.size()) / static_cast<double>(rays.size() * settings.orders.size()));
    }

  report.numbers["shape"] = "beard-chuang";
  report.numbers["radius_m"] = radius_m;
  report.numbers["sun_elevation_deg"] = sun_deg;
  report.numbers["wavelength_m"] = wavelength_m;
  report.numbers["directions"] = {theta_steps + 1, phi_steps + 1};
  report.numbers["rows"] = ordered_json::array();
  Table table{
      "Share of the energy that meets the drop",
      {"order p", "rays", "in the rays", "over all directions", "relative difference", "time"},
      {}};
  double worst = 0;
  for (const Row& row : rows) {
    report.numbers["rows"].push_back(
        {{"p", row.order},
         {"rays", row.rays},
         {"order_energy", row.carried},
         {"solid_angle_integral", row.integral},
         {"relative_difference", row.error()},
         {"seconds", row.seconds}});
    table.rows.push_back(
        {fmt::format("{}", row.order), fmt::format("{}", row.rays), fmt::format("{:.6f}", row.carried),
         fmt::format("{:.6f}", row.integral), fmt::format("{:+.2e}", row.error()),
         fmt::format("{:.2f} s", row.seconds)});
    report.checks.push_back(
        {fmt::format("p = {}, {} x {} rays", row.order, row.rays, row.rays), std::abs(row.error()), 1e-3,
         ""});
    worst = std::max(worst, std::abs(row.error()));
  }
  report.blocks.emplace_back(Paragraph{fmt::format(
      "A Beard-Chuang drop of 0.5 mm under a sun at 20 deg, 650 nm, without interference and diffraction. "
      "Every order's intensity is integrated over {} x {} directions (0 to 180 deg each way; the other half "
      "is "
      "its mirror image) and held against the energy that the patches of that order carry. Patches that "
      "fold, "
      "wrap around a pole or straddle the seam would show as energy lost or counted twice. The integral "
      "itself "
      "samples a function with infinite, integrable edges, and cannot be much better than this.",
      theta_steps + 1, phi_steps + 1)});
  report.blocks.emplace_back(std::move(table));
  report.findings.push_back(fmt::format(
      "Energy of a 0.5 mm raindrop: every order's integral over all directions agrees with what its rays "
      "carried "
      "to {:.1e}, at worst.",
      worst));
  return report;
}

namespace {

/// A bow's published angle: the top of the bow (phi = 0), n = 1.333.
struct PublishedBow {
  const char* what;
  const char* source;
  drop::Shape shape;
  double sun_deg;
  int order;
  double theta_deg;
};

std::vector<PublishedBow> published_bows() {
  constexpr double primary = 137.9219, secondary = 129.1092; // Descartes' rays
  const char* const descartes = "Descartes";
  const char* const spheroid = "finite spheroid (Moebius' shift, all orders)";
  const char* const chuang = "Chuang & Beard 1990, table 1";
  const char* const beard = "dissertation, table 3.1";
  std::vector<PublishedBow> all{
      {"sphere", descartes, drop::sphere(1e-3), 0, 2, primary},
      {"sphere", descartes, drop::sphere(1e-3), 0, 3, secondary},
  };
  const double shifts[2][3] = {{5.46, 6.92, 4.95}, {0.999, 1.331, 1.031}};
  for (const int thin : {0, 1})
    for (const int sun : {0, 1, 2})
      all.push_back(
          {thin == 0 ? "spheroid, axis ratio 0.95" : "spheroid, axis ratio 0.99", spheroid,
           drop::spheroid(1e-3, thin == 0 ? 0.95 : 0.99), 20.0 * sun, 2, primary + shifts[thin][sun]});
  // Deviations of the secondary are counted on beyond 180 deg.
  const auto add_drop = [&](const char* what, const char* source, const drop::Shape& shape, double sun_deg,
                            double first, double second) {
    all.push_back({what, source, shape, sun_deg, 2, first});
    all.push_back({what, source, shape, sun_deg, 3, 360 - second});
  };
  add_drop("drop, D = 1.0 mm", chuang, drop::chuang_beard(0.5e-3), 0, 138.943, 233.763);
  add_drop("drop, D = 1.0 mm", chuang, drop::chuang_beard(0.5e-3), 20, 140.175, 231.699);
  add_drop("drop, D = 1.5 mm", chuang, drop::chuang_beard(0.75e-3), 0, 140.516, 239.560);
  add_drop("drop, D = 1.5 mm", chuang, drop::chuang_beard(0.75e-3), 20, 143.967, 232.667);
  add_drop("drop, D = 2.0 mm", beard, drop::beard_chuang(1e-3), 0, 142.803, 246.417);
  add_drop("drop, D = 2.0 mm", beard, drop::beard_chuang(1e-3), 20, 149.705, 232.684);
  return all;
}

/// The top of the bow among the points of a bow's curve. They come in the order of the azimuth of incidence:
/// the primary's top is made by rays that enter at the drop's top (the last), the secondary's by rays that
/// enter below (the first).
double top_of_bow(const std::vector<std::array<double, 2>>& curve, int order) {
  constexpr double on_top_deg = 1e-3;
  if (curve.size() == 1) return curve.front()[0]; // a sphere: every azimuth is alike
  std::optional<double> first, last;
  for (const auto& [theta, phi] : curve) {
    if (phi > on_top_deg) continue;
    if (!first) first = theta;
    last = theta;
  }
  if (!first) throw RunError("bow-angles: no bow in the plane of symmetry");
  return order % 2 == 0 ? *last : *first;
}

} // namespace

CaseReport run_bow_angles(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "bow-angles";
  report.title = "Geometric bow angles";
  const double index = 1.333, bound_deg = 0.05;
  report.numbers["index"] = index;
  report.numbers["rows"] = ordered_json::array();
  Table table{
      "Scattering angle at the top of the bow, n = 1.333",
      {"drop", "source", "sun", "order p", "published", "traced", "difference"},
      {}};
  const compute::Device device(settings.threads);
  const std::vector<PublishedBow> all = published_bows();
  double worst = 0;
  for (const PublishedBow& bow : all) {
    wavefront::Tracing tracing;
    tracing.shape = bow.shape;
    tracing.sun_elevation_deg = bow.sun_deg;
    tracing.orders = {bow.order};
    const auto start = std::chrono::steady_clock::now();
    wavefront::Tracer tracer(tracing, device);
    const double theta = top_of_bow(tracer.bow_curve({650e-9, index}, bow.order), bow.order);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const double difference = theta - bow.theta_deg;
    worst = std::max(worst, std::abs(difference));
    report.numbers["rows"].push_back(
        {{"drop", bow.what},
         {"source", bow.source},
         {"shape", bow.shape.name},
         {"radius_m", bow.shape.radius_m},
         {"sun_elevation_deg", bow.sun_deg},
         {"p", bow.order},
         {"published_deg", bow.theta_deg},
         {"traced_deg", theta},
         {"difference_deg", difference},
         {"seconds", seconds}});
    table.rows.push_back(
        {bow.what, bow.source, fmt::format("{:.0f} deg", bow.sun_deg), fmt::format("{}", bow.order),
         fmt::format("{:.4g}", bow.theta_deg), fmt::format("{:.4f}", theta),
         fmt::format("{:+.4f} deg", difference)});
    table.rows.back()[4] = fmt::format("{:.3f}", bow.theta_deg);
    report.checks.push_back(
        {fmt::format("{}, sun {:.0f} deg, p = {}", bow.what, bow.sun_deg, bow.order), std::abs(difference),
         bound_deg, "deg"});
    progress(static_cast<double>(report.checks.size()) / static_cast<double>(all.size()));
  }
  report.blocks.emplace_back(Paragraph{"Where the deflection of an order is stationary, geometric optics has "
                                       "its bow. The angle at the top of the "
                                       "bow (the azimuth phi = 0) is traced with the same kernel as "
                                       "everything else and held against published "
                                       "values. Real drops are not spheroids: their flat underside pushes "
                                       "the secondary bow's top far from where a "
                                       "spheroid would."});
  report.blocks.emplace_back(std::move(table));
  report.findings.push_back(fmt::format(
      "Bow angles of {} published spheres, spheroids and raindrops are met to {:.4f} deg, at worst.",
      all.size(), worst));
  return report;
}

} // namespace scatter::validation
