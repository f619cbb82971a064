#include "cases.hpp"
#include <scatter/compute/device.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/job.hpp>
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

/// A band of scattering angles and how finely it is sampled.
struct Band {
  double from_deg, to_deg, step_deg, phi_step_deg;
};

/// Centres of the cells of an even division.
std::vector<double> midpoints(double from, double to, double step) {
  const auto count = static_cast<int>(std::llround((to - from) / step));
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(from + (to - from) * (i + 0.5) / count);
  return values;
}

/// Bands that cover 0 to 180 deg, fine where the intensity of an order has infinite, integrable edges: around
/// its bow, wherever in azimuth that is, and up to 8 deg away, where other caustics of a deformed drop end.
/// External reflection rises steeply towards the forward direction.
std::vector<Band> bands_of(int order, const phase::Request& request, const compute::Device& device) {
  if (order == 0) return {{0, 16, 0.025, 0.125}, {16, 180, 0.05, 0.5}};
  if (order == 1) return {{0, 180, 0.05, 0.5}};
  wavefront::Tracing tracing;
  tracing.shape = request.shape;
  tracing.sun_elevation_deg = request.sun_elevation_deg;
  tracing.orders = {order};
  const double wavelength = request.wavelength_m.front();
  wavefront::Tracer tracer(tracing, device);
  double low = 180, high = 0;
  for (const auto& [theta, phi] :
       tracer.bow_curve({wavelength, refractive_index(request.index, wavelength)}, order)) {
    low = std::min(low, theta);
    high = std::max(high, theta);
  }
  if (low > high) return {{0, 180, 0.0125, 0.25}};
  low = std::clamp(std::floor(low - 8), 0.0, 180.0);
  high = std::clamp(std::ceil(high + 8), 0.0, 180.0);
  std::vector<Band> bands;
  if (low > 0) bands.push_back({0, low, 0.05, 0.5});
  bands.push_back({low, high, 0.0025, 0.0625});
  if (high < 180) bands.push_back({high, 180, 0.025, 0.5});
  return bands;
}

} // namespace

CaseReport run_energy(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "energy";
  report.title = "Energy of every order of a falling drop";
  const double radius_m = 0.5e-3, sun_deg = 20, wavelength_m = 650e-9;
  const std::vector<int> rays = settings.quick ? std::vector<int>{500} : std::vector<int>{500, 1000};
  struct Row {
    int order, rays;
    double integral, carried, seconds;
    std::size_t directions;
    [[nodiscard]] double error() const { return integral / carried - 1; }
  };
  std::vector<Row> rows;
  const compute::Device device(settings.threads);
  for (const int count : rays)
    for (const int order : settings.orders) {
      phase::Request request;
      request.shape = drop::beard_chuang(radius_m);
      request.sun_elevation_deg = sun_deg;
      request.wavelength_m = {wavelength_m};
      request.index = settings.index;
      request.rays = count;
      request.orders = {order};
      request.method = phase::Method::patches;
      request.diffraction = phase::Diffraction::none;
      request.interference = false;
      request.threads = settings.threads;
      const auto start = std::chrono::steady_clock::now();
      Row row{order, count, 0, 0, 0, 0};
      wavefront::Tracing tracing;
      tracing.shape = request.shape;
      tracing.sun_elevation_deg = request.sun_elevation_deg;
      const double radius = request.shape.radius_m;
      const double shadow = wavefront::Tracer(tracing, device).shadow_area() * radius * radius;
      for (const Band& band : bands_of(order, request, device)) {
        request.theta_deg = midpoints(band.from_deg, band.to_deg, band.step_deg);
        request.phi_deg = midpoints(0, 180, band.phi_step_deg);
        const table::PhaseTable table = phase::compute(request);
        const table::Slab& slab = table.slabs.front();
        const std::size_t columns = request.phi_deg.size();
        double sum = 0;
        for (std::size_t t = 0; t < request.theta_deg.size(); ++t) {
          double mean = 0;
          for (std::size_t f = 0; f < columns; ++f) mean += slab.phase_function[t * columns + f];
          sum += mean / static_cast<double>(columns) * std::sin(request.theta_deg[t] * radians_per_degree);
        }
        // The carried energy is a share of what meets the drop.
        row.integral +=
            sum * 2 * pi * band.step_deg * radians_per_degree * slab.scattering_cross_section / shadow;
        row.carried = slab.order_energy.front();
        row.directions += slab.phase_function.size();
      }
      row.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      rows.push_back(row);
      progress(static_cast<double>(rows.size()) / static_cast<double>(rays.size() * settings.orders.size()));
    }

  report.numbers["shape"] = "beard-chuang";
  report.numbers["radius_m"] = radius_m;
  report.numbers["sun_elevation_deg"] = sun_deg;
  report.numbers["wavelength_m"] = wavelength_m;
  report.numbers["rows"] = ordered_json::array();
  Table table{
      "Share of the energy that meets the drop",
      {"order p", "rays", "directions", "in the rays", "over all directions", "relative difference", "time"},
      {}};
  for (const Row& row : rows) {
    report.numbers["rows"].push_back(
        {{"p", row.order},
         {"rays", row.rays},
         {"directions", row.directions},
         {"order_energy", row.carried},
         {"solid_angle_integral", row.integral},
         {"relative_difference", row.error()},
         {"seconds", row.seconds}});
    table.rows.push_back(
        {fmt::format("{}", row.order), fmt::format("{}", row.rays),
         fmt::format("{:.1f} million", static_cast<double>(row.directions) / 1e6),
         fmt::format("{:.6f}", row.carried), fmt::format("{:.6f}", row.integral),
         fmt::format("{:+.2e}", row.error()), fmt::format("{:.2f} s", row.seconds)});
    report.checks.push_back(
        {fmt::format("p = {}, {} x {} rays", row.order, row.rays, row.rays), std::abs(row.error()), 1e-3,
         ""});
  }
  report.blocks.emplace_back(Paragraph{
      "A Beard-Chuang drop of 0.5 mm under a sun at 20 deg, 650 nm, without interference and diffraction. "
      "Every "
      "order's intensity is integrated over all directions and held against the energy that the patches of "
      "that "
      "order carry. Patches that fold, wrap around a pole or straddle the seam would show as energy lost or "
      "counted twice. Directions lie closest around the bows (0.0025 deg by 0.0625 deg), whose edges are "
      "infinitely bright: what is left of the difference is how well points meet the slivers there."});
  report.blocks.emplace_back(std::move(table));
  const auto worst = std::ranges::max_element(
      rows, {}, [&](const Row& row) { return row.rays == rays.back() ? std::abs(row.error()) : 0; });
  report.findings.push_back(fmt::format(
      "Energy of a 0.5 mm raindrop, {0} x {0} rays: every order's integral over all directions agrees with "
      "what "
      "its rays carried to {1:.1e} or better; order {2} is the worst.",
      worst->rays, std::abs(worst->error()), worst->order));
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
