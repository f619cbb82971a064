#include "cases.hpp"
#include "words.hpp"
#include <scatter/compute/device.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/job.hpp>
#include <scatter/scene/plot.hpp>
#include <scatter/wavefront/far_field.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>

namespace scatter::validation {

namespace {

using complex = std::complex<double>;
using nlohmann::ordered_json;
using phase::Diffraction;
using phase::Request;
using table::Amplitude;
using wavefront::TracedRay;
using wavefront::Tracer;

constexpr double red_m = 650e-9;
constexpr double infinite = std::numeric_limits<double>::infinity();

std::vector<double> even_angles(double from, double to, double step) {
  std::vector<double> angles;
  const auto count = static_cast<int>(std::llround((to - from) / step));
  for (int i = 0; i <= count; ++i) angles.push_back(from + (to - from) * i / count);
  return angles;
}

Request drop_request(const Settings& settings, double radius_m, double sun_deg, std::vector<int> orders) {
  Request request;
  request.shape = drop::beard_chuang(radius_m);
  request.sun_elevation_deg = sun_deg;
  request.wavelength_m = {red_m};
  request.index = settings.index;
  request.method = phase::Method::patches;
  request.diffraction = Diffraction::integral;
  request.rays = 1000;
  request.orders = std::move(orders);
  request.amplitudes = true;
  request.threads = settings.threads;
  return request;
}

/// NaN must not pass for a small error.
double larger(double a, double b) {
  return std::isnan(a) || std::isnan(b) ? infinite : std::max(a, b);
}

/// Patches of a drop with ever more rays, against the most.
void add_convergence(CaseReport& report, const Settings& settings) {
  Request request = drop_request(settings, 0.5e-3, 20, {0, 1, 2, 3});
  request.diffraction = Diffraction::none;
  request.amplitudes = false;
  const double step = 0.02;
  request.theta_deg = even_angles(29, 121, step);
  request.phi_deg = {0, 60, 120, 180};
  const std::size_t columns = request.phi_deg.size(), rows = request.theta_deg.size();
  const std::vector<int> counts =
      settings.quick ? std::vector<int>{250, 500, 1000} : std::vector<int>{250, 500, 1000, 2000, 4000};
  std::vector<std::vector<double>> found; // [count][column x row], averaged over the sun
  for (const int rays : counts) {
    request.rays = rays;
    const table::PhaseTable table = phase::compute(request);
    std::vector<double> all;
    for (std::size_t f = 0; f < columns; ++f) {
      std::vector<double> column;
      for (std::size_t t = 0; t < rows; ++t)
        column.push_back(table.slabs.front().phase_function[t * columns + f]);
      column = average_disc(column, step, sun_diameter_deg);
      all.insert(all.end(), column.begin() + 50, column.end() - 50);
    }
    found.push_back(std::move(all));
  }
  Table table{
      fmt::format(
          "Patches, orders 0..3, 30..120 deg: rms relative difference from {0} x {0} rays", counts.back()),
      {"rays", "difference", "of it 30..60 deg"},
      {}};
  double previous = 0, last = 0, free = 0, slowest = 0;
  report.numbers["convergence"] = ordered_json::array();
  for (std::size_t i = 0; i + 1 < counts.size(); ++i) {
    double squares = 0, free_squares = 0;
    std::size_t free_angles = 0;
    for (std::size_t k = 0; k < found[i].size(); ++k) {
      const double relative = found[i][k] / found.back()[k] - 1;
      squares += relative * relative;
      if (step * static_cast<double>(k % (found[i].size() / columns)) > 30) continue; // beyond 60 deg
      free_squares += relative * relative;
      ++free_angles;
    }
    last = std::sqrt(squares / static_cast<double>(found[i].size()));
    free = std::sqrt(free_squares / static_cast<double>(free_angles));
    if (i > 0) slowest = larger(slowest, last / previous);
    previous = last;
    report.numbers["convergence"].push_back(
        {{"rays", counts[i]}, {"rms_to_finest", last}, {"rms_to_finest_30_60_deg", free}});
    table.rows.push_back({fmt::format("{}", counts[i]), percent(last), percent(free)});
  }
  report.blocks.emplace_back(Heading{"More rays"});
  report.blocks.emplace_back(std::move(table));
  report.blocks.emplace_back(Paragraph{"Nearly all of the difference is where an order ends, in grazing rays "
                                       "or at a bow (between 65 and 83 deg and "
                                       "beyond 113 deg). Where no order ends rays converge fast."});
  report.checks.push_back(
      {fmt::format(
           "{} and {} rays, 30..60 deg: rms relative difference", counts[counts.size() - 2], counts.back()),
       100 * free, 1, "%"});
  report.checks.push_back(
      {"twice the rays: difference from the finest over what it was before, at worst", slowest, 0.75, ""});
}

/// The integral's bands of angles lie otherwise when other directions are asked for, too.
void add_windows(CaseReport& report, const Settings& settings) {
  struct Range {
    int order;
    double from_deg, end_deg; ///< that both tables have
  };
  Table table{
      "The same directions at the beginning and at the end of a table",
      {"order", "theta", "largest difference", "rms"},
      {}};
  report.numbers["windows"] = ordered_json::array();
  for (const Range& range : {Range{2, 136, 142}, Range{3, 121, 127}}) {
    Request request = drop_request(settings, 0.5e-3, 20, {range.order});
    request.phi_deg = {0, 60, 120, 180};
    const auto at = [&](double from, double to) {
      request.theta_deg = even_angles(from, to, 0.1);
      return phase::compute(request).slabs.front().amplitude;
    };
    const std::vector<Amplitude> one = at(range.from_deg, range.end_deg + 5),
                                 other = at(range.from_deg - 5, range.end_deg);
    double peak = 0, worst = 0, squares = 0;
    int count = 0;
    for (std::size_t t = 0; t <= 60; ++t)
      for (std::size_t f = 0; f < 4; ++f) {
        const Amplitude &a = one[t * 4 + f], &b = other[(t + 50) * 4 + f];
        peak = std::max({peak, std::abs(a.S1), std::abs(a.S2)});
        for (const double error :
             {std::abs(a.S1 - b.S1), std::abs(a.S2 - b.S2), std::abs(a.S3 - b.S3), std::abs(a.S4 - b.S4)}) {
          worst = larger(worst, error);
          squares += error * error;
          ++count;
        }
      }
    worst /= peak;
    const double rms = std::sqrt(squares / count) / peak;
    report.numbers["windows"].push_back(
        {{"p", range.order}, {"max_over_peak", worst}, {"rms_over_peak", rms}});
    table.rows.push_back(
        {fmt::format("{}", range.order), fmt::format("{:g}..{:g} deg", range.from_deg, range.end_deg),
         percent(worst), percent(rms)});
    report.checks.push_back(
        {fmt::format("order {} from two sets of windows: largest difference over the peak", range.order),
         100 * worst, 1, "%"});
  }
  report.blocks.emplace_back(Heading{"Other windows"});
  report.blocks.emplace_back(
      Paragraph{"Orders 2 and 3 by the integral at azimuths 0, 60, 120, 180 deg, once as the beginning and "
                "once as the end of a table, so that bands of angles have other centres and tapers. "
                "Differences of complex amplitudes are over the peak."});
  report.blocks.emplace_back(std::move(table));
}

/// The integral with other numbers of rays, tapers and zones must come to the same.
void add_sampling(CaseReport& report, const Settings& settings) {
  struct Range {
    double radius_m;
    int order;
    double from_deg, to_deg;
  };
  std::vector<Range> ranges{{0.5e-3, 3, 121, 129}};
  if (!settings.quick)
    ranges = {{0.5e-3, 2, 136, 146}, {0.5e-3, 3, 121, 129}, {1e-3, 2, 136, 150}, {1e-3, 3, 119, 131}};
  using wavefront::IntegralSampling;
  struct Variation {
    const char* what;
    std::vector<IntegralSampling> samplings;
  };
  const std::vector<Variation> variations{
      {"0.85 times the rays", {{.rays = 0.85}}},
      {"1.5 times", {{.rays = 1.5}}},
      {"twice", {{.rays = 2}}},
      {"tapers 0.7, 1.4 times as wide", {{.tapers = 0.7}, {.tapers = 1.4}}},
      {"zones 0.7, 1.4 times as wide", {{.zone = 0.7}, {.zone = 1.4}}},
      {"windows in place of lines", {{.by_windows = true}}}};
  Table table{
      "The integral made otherwise: largest and rms difference of amplitudes over the peak of their azimuth",
      {"radius, order, theta"},
      {}};
  for (const Variation& variation : variations) table.columns.emplace_back(variation.what);
  report.numbers["sampling"] = ordered_json::array();
  double worst_small = 0, worst_large = 0, with_rays = 0;
  const compute::Device device(settings.threads);
  for (const Range& range : ranges) {
    wavefront::Tracing tracing;
    tracing.shape = drop::beard_chuang(range.radius_m);
    tracing.sun_elevation_deg = 20;
    tracing.rays = 2000;
    tracing.orders = {range.order};
    Tracer tracer(tracing, device);
    wavefront::Wanted wanted;
    wanted.theta_deg = even_angles(range.from_deg, range.to_deg, 0.1);
    wanted.phi_deg = {0, 60, 120, 180};
    wanted.amplitudes = wanted.integral = true;
    const wavefront::Light light{red_m, refractive_index(settings.index, red_m)};
    const auto compute = [&](const IntegralSampling& sampling) {
      wanted.sampling = sampling;
      std::vector<wavefront::Amplitude> found;
      tracer.far_field(
          {&light, 1}, wanted, [&](std::size_t, wavefront::FarField& field) { found = field.amplitude; });
      return found;
    };
    const std::vector<wavefront::Amplitude> usual = compute({});
    const std::size_t azimuths = wanted.phi_deg.size();
    std::vector<double> peak(azimuths, 0.0);
    for (std::size_t i = 0; i < usual.size(); ++i)
      peak[i % azimuths] = std::max({peak[i % azimuths], std::abs(usual[i].S1), std::abs(usual[i].S2)});
    std::vector<std::string>& row = table.rows.emplace_back();
    row.push_back(fmt::format(
        "{:g} mm, {}, {:g}..{:g} deg", range.radius_m * 1e3, range.order, range.from_deg, range.to_deg));
    for (const Variation& variation : variations) {
      double largest = 0, squares = 0;
      for (const IntegralSampling& sampling : variation.samplings) {
        const std::vector<wavefront::Amplitude> found = compute(sampling);
        for (std::size_t i = 0; i < usual.size(); ++i) {
          const auto &a = usual[i], &b = found[i];
          double difference = 0;
          for (const double error :
               {std::abs(a.S1 - b.S1), std::abs(a.S2 - b.S2), std::abs(a.S3 - b.S3), std::abs(a.S4 - b.S4)})
            difference = larger(difference, error / peak[i % azimuths]);
          largest = larger(largest, difference);
          squares += difference * difference;
        }
      }
      const double rms = std::sqrt(squares / static_cast<double>(usual.size() * variation.samplings.size()));
      row.push_back(fmt::format("{}, {}", percent(largest), percent(rms)));
      report.numbers["sampling"].push_back(
          {{"radius_m", range.radius_m},
           {"p", range.order},
           {"variation", variation.what},
           {"max_over_peak", largest},
           {"rms_over_peak", rms}});
      const bool of_rays = variation.samplings.front().rays != 1;
      if (of_rays) with_rays = larger(with_rays, rms);
      // Nobody gets windows where lines serve.
      if (variation.samplings.front().by_windows) continue;
      if (range.radius_m > 0.5e-3)
        worst_large = larger(worst_large, rms);
      else
        worst_small = larger(worst_small, largest);
    }
  }
  report.blocks.emplace_back(Heading{"The integral made otherwise"});
  report.blocks.emplace_back(Paragraph{
      "Orders 2 and 3 at azimuths 0, 60, 120, 180 deg, with other numbers of rays, other widths of the "
      "tapers "
      "that part the rays of one range of directions from others, and other zones around caustics beyond "
      "which patches carry the light: what is left of a seam shows in the last."});
  report.blocks.emplace_back(std::move(table));
  report.checks.push_back(
      {"integral with 0.85 to 2 times the rays: rms difference over the peak, at worst", 100 * with_rays, 0.5,
       "%"});
  report.checks.push_back(
      {"integral with other rays, tapers, zones, 0.5 mm: largest difference over the peak", 100 * worst_small,
       1, "%"});
  if (settings.quick) return;
  report.checks.push_back(
      {"integral with other rays, tapers, zones, 1 mm: rms difference over the peak, at worst",
       100 * worst_large, 1, "%"});
}

/// What enters along the way out leaves along the way in.
void add_reciprocity(CaseReport& report, const Settings& settings) {
  struct Path {
    int order;
    Diffraction diffraction;
    double theta_deg, phi_deg;
    double radius_m = 0.5e-3;
  };
  std::vector<Path> paths{
      {0, Diffraction::none, 60, 150},
      {0, Diffraction::none, 100, 120},
      {1, Diffraction::none, 60, 150},
      {1, Diffraction::none, 50, 170}};
  if (!settings.quick)
    paths.insert(
        paths.end(), {{2, Diffraction::integral, 140, 100},
                      {2, Diffraction::integral, 141, 150},
                      {2, Diffraction::integral, 143, 180},
                      {3, Diffraction::integral, 125, 90},
                      {3, Diffraction::integral, 126, 120},
                      {3, Diffraction::integral, 126, 150},
                      {3, Diffraction::integral, 127, 175},
                      {2, Diffraction::integral, 141, 90, 1e-3},
                      {2, Diffraction::integral, 140, 150, 1e-3},
                      {2, Diffraction::integral, 142, 175, 1e-3},
                      {3, Diffraction::integral, 127, 80, 1e-3},
                      {3, Diffraction::integral, 128, 100, 1e-3},
                      {3, Diffraction::integral, 126, 120, 1e-3},
                      {3, Diffraction::integral, 128, 140, 1e-3},
                      {3, Diffraction::integral, 130, 160, 1e-3},
                      {3, Diffraction::integral, 132, 175, 1e-3}});
  const double sun_deg = 20;
  Table table{
      "Light along a path and back: complex amplitudes",
      {"radius", "order", "sun", "theta", "phi", "sun on the way back", "phi on the way back", "difference"},
      {}};
  report.numbers["reciprocity"] = ordered_json::array();
  double worst = 0;
  std::vector<double> of_larger_drop;
  for (const Path& path : paths) {
    // Next to a caustic amplitudes have minima: a small difference of a minimum is small beside the maxima.
    const double around = path.diffraction == Diffraction::integral ? 2 : 0;
    const auto compute = [&](double sun, double phi) {
      Request request = drop_request(settings, path.radius_m, sun, {path.order});
      request.diffraction = path.diffraction;
      request.rays = 2000;
      request.theta_deg = {path.theta_deg};
      if (around > 0) request.theta_deg = even_angles(path.theta_deg - around, path.theta_deg + around, 0.1);
      request.phi_deg = {phi};
      return phase::compute(request).slabs.front().amplitude;
    };
    const double theta = path.theta_deg * radians_per_degree, phi = path.phi_deg * radians_per_degree,
                 h = sun_deg * radians_per_degree;
    // Downward components of the way out and, turned round, of the way in.
    const double back = -(std::sin(theta) * std::cos(phi) * std::cos(h) + std::cos(theta) * std::sin(h));
    const double h_back = std::asin(back);
    const double phi_back = std::acos(std::clamp(
        (-std::sin(h) - std::cos(theta) * back) / (std::sin(theta) * std::cos(h_back)), -1.0, 1.0));
    const std::vector<Amplitude> there = compute(sun_deg, path.phi_deg),
                                 again = compute(h_back / radians_per_degree, phi_back / radians_per_degree);
    // S(-s, -i) is the transpose of S up to the signs of the off-diagonal elements, which the mirror turns,
    // too.
    double size = 0;
    for (const Amplitude& a : there) size = std::max({size, std::abs(a.S1), std::abs(a.S2)});
    const Amplitude &a = there[there.size() / 2], &b = again[again.size() / 2];
    double difference = 0;
    for (const double error :
         {std::abs(a.S1 - b.S1), std::abs(a.S2 - b.S2), std::abs(std::abs(a.S3) - std::abs(b.S4)),
          std::abs(std::abs(a.S4) - std::abs(b.S3))})
      difference = larger(difference, error / size);
    if (path.radius_m > 0.5e-3)
      of_larger_drop.push_back(difference);
    else
      worst = larger(worst, difference);
    report.numbers["reciprocity"].push_back(
        {{"radius_m", path.radius_m},
         {"p", path.order},
         {"theta_deg", path.theta_deg},
         {"phi_deg", path.phi_deg},
         {"difference", difference}});
    table.rows.push_back(
        {fmt::format("{:g} mm", path.radius_m * 1e3),
         fmt::format("{}{}", path.order, path.diffraction == Diffraction::integral ? ", integral" : ""),
         fmt::format("{:.1f} deg", sun_deg), fmt::format("{:.0f} deg", path.theta_deg),
         fmt::format("{:.1f} deg", path.phi_deg), fmt::format("{:.1f} deg", h_back / radians_per_degree),
         fmt::format("{:.1f} deg", phi_back / radians_per_degree), percent(difference)});
  }
  report.blocks.emplace_back(Heading{"Reciprocity"});
  report.blocks.emplace_back(
      Paragraph{"The drop is a body of revolution: light that comes in along the "
                "reversed way out is light of another sun, "
                "and leaves along the reversed way in. S1 and S2 must be the same, "
                "phase included, S3 and S4 change places. "
                "No ray of the one computation is a ray of the other. Differences are over the "
                "amplitude, by the integral over the largest within 2 deg."});
  report.blocks.emplace_back(std::move(table));
  report.checks.push_back({"reciprocity: largest difference of an amplitude, 0.5 mm", 100 * worst, 2, "%"});
  if (of_larger_drop.empty()) return;
  std::ranges::sort(of_larger_drop);
  report.blocks.emplace_back(Paragraph{
      "At 1 mm momenta of order 3 fold before the rim, and next to azimuths where rays begin to tunnel out "
      "nothing undoes it. The way back must come from a sun above the horizon, which leaves out azimuths "
      "below 75 deg."});
  report.checks.push_back(
      {"reciprocity at 1 mm: median difference", 100 * of_larger_drop[of_larger_drop.size() / 2], 1, "%"});
  report.checks.push_back({"reciprocity at 1 mm: largest difference", 100 * of_larger_drop.back(), 3, "%"});
}

/// The flattening at which the equatorial plane's bow ray is focused across the plane, too.
void add_umbilic(CaseReport& report, const Settings& settings) {
  const double n = 1.332;
  const compute::Device device(settings.threads);
  const auto bend_across = [&](double flattening) {
    wavefront::Tracing tracing;
    tracing.shape = drop::spheroid(1e-3, 1 / flattening);
    tracing.orders = {2};
    Tracer tracer(tracing, device);
    // The equator is a circle: its bow ray is Descartes' (n^2 - 1 = 3 cos^2 of incidence).
    const double b = std::sqrt((4 - n * n) / 3) * tracing.shape.horizontal_semi_axis;
    const std::vector<double> u{0}, v{b};
    return tracer.trace({red_m, n}, u, v, 2)[0][2].direction_u[0];
  };
  double low = 1.1, high = 1.6;
  const bool there = bend_across(low) * bend_across(high) < 0;
  for (int i = 0; there && i < 40; ++i) {
    const double middle = (low + high) / 2;
    (bend_across(low) * bend_across(middle) > 0 ? low : high) = middle;
  }
  const double found = there ? (low + high) / 2 : infinite;
  report.numbers["umbilic"] = {{"index", n}, {"D_over_H", there ? found : 0}};
  report.blocks.emplace_back(Heading{"The umbilic focus"});
  report.blocks.emplace_back(Paragraph{fmt::format(
      "Where an oblate spheroid is so flat that the bow ray of its equatorial plane is focused across the "
      "plane, too, "
      "the primary bow has a hyperbolic umbilic focus. Dean &amp; Marston (1991) measured it at a diameter "
      "over height of about "
      "1.31; theory says 1.310 for n = 1.332. The derivative of the traced ray's direction vanishes at "
      "{:.4f}.",
      found)});
  report.checks.push_back(
      {"umbilic focus of the primary: D/H off 1.310", std::abs(found - 1.310), 0.005, ""});
}

/// Ai(-z) and Ai'(-z), z > 0, from Bessel functions of orders 1/3 and 2/3 (DLMF 9.6).
std::pair<double, double> airy(double z) {
  const double xi = 2.0 / 3 * z * std::sqrt(z);
  const auto bessel = [xi](double order, bool negative) {
    const double J = std::cyl_bessel_j(order, xi);
    return negative ? std::cos(order * pi) * J - std::sin(order * pi) * std::cyl_neumann(order, xi) : J;
  };
  return {
      std::sqrt(z) / 3 * (bessel(1.0 / 3, false) + bessel(1.0 / 3, true)),
      z / 3 * (bessel(2.0 / 3, false) - bessel(2.0 / 3, true))};
}

/// One bow of a drop where it crosses the vertical plane.
struct PlaneBow {
  int order;
  double phi_deg;                  ///< 0: its top; 180: its bottom
  double from_impact, to_impact;   ///< where along the plane its rays enter, over the drop's semi-axis
  double edge_deg = 0, to_deg = 0; ///< the geometric bow; how far from it was looked
  double rms = 0, largest = 0;     ///< of the difference over the peak
  std::vector<double> theta_deg{}; ///< directions, and S1 there
  std::vector<complex> integral{}, uniform{};
};

/// The bow from its two rays alone, made uniform by Chester, Friedman and Ursell, against the integral.
void run_plane_bow(PlaneBow& bow, const Settings& settings) {
  Request request = drop_request(settings, 0.5e-3, 20, {bow.order});
  request.phi_deg = {bow.phi_deg};
  const double index = refractive_index(settings.index, red_m).real();
  request.index = {IndexSource::Kind::given, index};
  const compute::Device device(settings.threads);
  wavefront::Tracing tracing;
  tracing.shape = request.shape;
  tracing.sun_elevation_deg = request.sun_elevation_deg;
  tracing.orders = request.orders;
  Tracer tracer(tracing, device);
  const auto order = static_cast<std::size_t>(bow.order);
  const double x = 2 * pi * request.shape.radius_m / red_m;
  const auto trace = [&](const std::vector<double>& u) {
    std::vector<TracedRay> rays;
    for (auto& orders : tracer.trace({red_m, index}, u, std::vector<double>(u.size(), 0.0), bow.order))
      rays.push_back(orders[order]);
    return rays;
  };
  const auto theta_of = [](const TracedRay& ray) { return std::acos(ray.direction[2]) / radians_per_degree; };
  // The bow is the end of its rays' angles: below are none of order 2, above none of order 3.
  const double side = bow.order == 2 ? 1 : -1;
  std::vector<double> u = even_angles(bow.from_impact, bow.to_impact, 0.0005);
  std::vector<TracedRay> rays = trace(u);
  std::size_t edge = 0;
  for (std::size_t i = 0; i < rays.size(); ++i)
    if (rays[i].valid && side * theta_of(rays[i]) < side * theta_of(rays[edge])) edge = i;
  bow.edge_deg = theta_of(rays[edge]);
  const double reach = std::min(
      {side * (theta_of(rays.front()) - bow.edge_deg), side * (theta_of(rays.back()) - bow.edge_deg), 3.0});
  for (double off = 0.1; off < reach; off += 0.05) bow.theta_deg.push_back(bow.edge_deg + side * off);
  bow.to_deg = bow.theta_deg.back();
  // Both branches by bisection.
  const std::vector<double>& targets = bow.theta_deg;
  std::array<std::vector<TracedRay>, 2> branches;
  for (const bool second : {false, true}) {
    std::vector<double> near(targets.size(), u[edge]), far(targets.size(), second ? u.back() : u.front());
    std::vector<TracedRay>& found = branches[second ? 1 : 0];
    for (int step = 0; step < 45; ++step) {
      std::vector<double> middle;
      for (std::size_t i = 0; i < targets.size(); ++i) middle.push_back((near[i] + far[i]) / 2);
      found = trace(middle);
      for (std::size_t i = 0; i < targets.size(); ++i)
        (side * theta_of(found[i]) < side * targets[i] ? near : far)[i] = middle[i];
    }
  }
  bool sound = true;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const bool first_less = branches[0][i].foci < branches[1][i].foci;
    const TracedRay &less = branches[first_less ? 0 : 1][i], &more = branches[first_less ? 1 : 0][i];
    const auto size = [](const TracedRay& ray) {
      const auto &d = ray.direction, &du = ray.direction_u, &dv = ray.direction_v;
      const double turn = d[0] * (du[1] * dv[2] - du[2] * dv[1]) + d[1] * (du[2] * dv[0] - du[0] * dv[2]) +
                          d[2] * (du[0] * dv[1] - du[1] * dv[0]);
      return ray.jones.S1 / std::sqrt(std::abs(turn));
    };
    const double xi = x * (more.path - less.path) / 2, mean = x * (more.path + less.path) / 2;
    sound = sound && more.foci == less.foci + 1 && xi > 0;
    const double zeta = std::pow(1.5 * std::abs(xi), 2.0 / 3);
    const auto [value, slope] = airy(zeta);
    const complex few = size(less), many = size(more);
    bow.uniform.push_back(
        x * std::sqrt(pi) * std::polar(1.0, mean) *
        ((many + few) * std::pow(zeta, 0.25) * value +
         complex(0, 1) * (many - few) * std::pow(zeta, -0.25) * slope));
  }
  request.theta_deg = targets;
  if (side < 0) std::ranges::reverse(request.theta_deg);
  const std::vector<Amplitude> found = phase::compute(request).slabs.front().amplitude;
  for (const Amplitude& amplitude : found) bow.integral.push_back(amplitude.S1);
  if (side < 0) std::ranges::reverse(bow.integral);
  // Up to one common phase.
  complex common = 0;
  double peak = 0;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    common += bow.integral[i] * std::conj(bow.uniform[i]);
    peak = std::max(peak, std::abs(bow.integral[i]));
  }
  common /= std::abs(common);
  double squares = 0;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const double error = std::abs(bow.integral[i] - common * bow.uniform[i]) / peak;
    squares += error * error;
    bow.largest = larger(bow.largest, error);
  }
  bow.rms = sound ? std::sqrt(squares / static_cast<double>(targets.size())) : infinite;
}

void add_uniform(CaseReport& report, const Settings& settings) {
  std::vector<PlaneBow> bows{{2, 0, -0.97, -0.5}};
  if (!settings.quick) {
    bows.push_back({2, 180, 0.5, 0.97});
    bows.push_back({3, 0, 0.85, 0.995});
    bows.push_back({3, 180, -0.995, -0.85});
  }
  Table table{
      "S1 by the integral and from two rays, one common phase taken off",
      {"order", "azimuth", "geometric bow", "looked at to", "rms difference / peak", "largest"},
      {}};
  report.numbers["uniform"] = ordered_json::array();
  for (PlaneBow& bow : bows) {
    run_plane_bow(bow, settings);
    report.numbers["uniform"].push_back(
        {{"p", bow.order},
         {"phi_deg", bow.phi_deg},
         {"geometric_bow_deg", bow.edge_deg},
         {"to_deg", bow.to_deg},
         {"rms_over_peak", std::isfinite(bow.rms) ? bow.rms : -1},
         {"max_over_peak", bow.largest}});
    table.rows.push_back(
        {fmt::format("{}", bow.order), fmt::format("{:.0f} deg", bow.phi_deg),
         fmt::format("{:.2f} deg", bow.edge_deg), fmt::format("{:.1f} deg", bow.to_deg),
         fmt::format("{:.2f} %", 100 * bow.rms), fmt::format("{:.2f} %", 100 * bow.largest)});
    report.checks.push_back(
        {fmt::format(
             "integral against Chester-Friedman-Ursell, order {}, azimuth {:.0f} deg: rms over the peak",
             bow.order, bow.phi_deg),
         100 * bow.rms, 2, "%"});
  }
  report.blocks.emplace_back(Heading{"A second uniform method"});
  report.blocks.emplace_back(Paragraph{"At the top and the bottom of a bow two rays of its order arrive in "
                                       "the vertical plane. From their paths, "
                                       "amplitudes and focal counts alone Chester, Friedman and Ursell's "
                                       "formula has the field on the bright side of "
                                       "the edge."});
  report.blocks.emplace_back(std::move(table));
  for (const PlaneBow& bow : bows) {
    scene::Plot plot;
    scene::Curve by_integral, by_rays;
    by_integral.label = "integral";
    by_rays.label = "Chester-Friedman-Ursell, two rays";
    by_rays.dashed = true;
    for (std::size_t i = 0; i < bow.theta_deg.size(); ++i) {
      by_integral.x.push_back(bow.theta_deg[i]);
      by_integral.y.push_back(std::abs(bow.integral[i]));
      by_rays.x.push_back(bow.theta_deg[i]);
      by_rays.y.push_back(std::abs(bow.uniform[i]));
    }
    plot.title = fmt::format(
        "Order {} at azimuth {:.0f} deg of the bow of a 0.5 mm drop, sun 20 deg, 650 nm", bow.order,
        bow.phi_deg);
    plot.x_label = "scattering angle [deg]";
    plot.y_label = "|S1|";
    plot.height = 380;
    plot.curves = {std::move(by_integral), std::move(by_rays)};
    report.blocks.emplace_back(
        Figure{scene::draw(plot, scene::PictureFormat::svg), "Two methods that share nothing but the rays."});
  }
}

/// Two showers of drops of two sizes: the smaller are spheres, the larger are flat.
void add_twinned_bow(CaseReport& report, const Settings& settings) {
  scene::Plot plot;
  plot.title =
      "Twinned bow: orders 2 and 3 of drops of 0.4 and 0.45 mm at the top of the bow, sun 20 deg, 550 nm";
  plot.x_label = "scattering angle [deg]";
  plot.y_label = "mean |S|^2 over the sun's disc, scaled";
  plot.height = 420;
  std::vector<double> both;
  std::array<std::array<double, 2>, 2> peaks{}; // [drop][primary, secondary]
  const double step = 0.02;
  const std::vector<double> angles = even_angles(125, 144, step);
  for (const int which : {0, 1}) {
    const double radius_m = which == 0 ? 0.4e-3 : 0.45e-3;
    Request request = drop_request(settings, radius_m, 20, {2, 3});
    request.wavelength_m = {550e-9};
    request.phi_deg = {0};
    request.theta_deg = angles;
    const std::vector<Amplitude> found = phase::compute(request).slabs.front().amplitude;
    std::vector<double> intensity;
    for (const Amplitude& a : found)
      intensity.push_back((std::norm(a.S1) + std::norm(a.S2) + std::norm(a.S3) + std::norm(a.S4)) / 2);
    intensity = average_disc(intensity, step, sun_diameter_deg);
    both.resize(angles.size());
    scene::Curve curve;
    curve.label = fmt::format("{:g} mm", radius_m * 1e3);
    curve.dashed = true;
    for (std::size_t i = 0; i < angles.size(); ++i) {
      curve.x.push_back(angles[i]);
      curve.y.push_back(intensity[i] / 1e6);
      both[i] += intensity[i] / 1e6;
    }
    for (const int bow : {0, 1}) {
      double best = 0;
      for (std::size_t i = 0; i < angles.size(); ++i)
        if ((bow == 0) == (angles[i] > 134) && intensity[i] > best) {
          best = intensity[i];
          peaks[static_cast<std::size_t>(which)][static_cast<std::size_t>(bow)] = angles[i];
        }
    }
    plot.curves.push_back(std::move(curve));
  }
  scene::Curve sum;
  sum.label = "both together";
  sum.x = angles;
  sum.y = both;
  sum.width = 2.5;
  plot.curves.push_back(std::move(sum));
  const double primary = std::abs(peaks[1][0] - peaks[0][0]), secondary = std::abs(peaks[1][1] - peaks[0][1]);
  report.numbers["twinned_bow"] = {
      {"primary_separation_deg", primary}, {"secondary_separation_deg", secondary}};
  report.blocks.emplace_back(Heading{"The twinned bow"});
  report.blocks.emplace_back(Figure{
      scene::draw(plot, scene::PictureFormat::svg),
      fmt::format(
          "As many drops of the one size as of the other. Their primaries peak {:.2f} deg apart, more than "
          "the sun's "
          "disc, and are seen as two; their secondaries {:.2f} deg, within the disc and the width of the "
          "bow.",
          primary, secondary)});
  report.checks.push_back(
      {"twinned bow: the sun's diameter over the separation of the primaries", sun_diameter_deg / primary, 1,
       ""});
  report.checks.push_back(
      {"twinned bow: separation of the secondaries over the sun's diameter", secondary / sun_diameter_deg, 1,
       ""});
}

} // namespace

CaseReport run_drops(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "drops";
  report.title = "Falling drops: consistency instead of truth";
  report.blocks.emplace_back(Paragraph{"No exact theory judges a deformed drop. What can be held to "
                                       "something: answers that must not depend on how they "
                                       "were computed, symmetries, focal points found by others, and a "
                                       "second method. Energy of every order and "
                                       "the angles of bows are cases <code>energy</code> and "
                                       "<code>bow-angles</code>. Drops are Beard-Chuang's of 0.5 "
                                       "mm, 650 nm, unless something else is said."});
  using Part = void (*)(CaseReport&, const Settings&);
  std::vector<Part> parts{add_convergence, add_sampling, add_reciprocity, add_umbilic, add_uniform};
  if (!settings.quick) parts.insert(parts.end(), {add_windows, add_twinned_bow});
  for (std::size_t i = 0; i < parts.size(); ++i) {
    progress(static_cast<double>(i) / static_cast<double>(parts.size()));
    parts[i](report, settings);
  }
  const auto held = std::ranges::count_if(report.checks, [](const Check& check) { return check.holds(); });
  report.findings.push_back(fmt::format(
      "Falling drops, which no exact theory judges: {} of {} tests of consistency hold (rays, tapers, "
      "windows, "
      "reciprocity, the "
      "umbilic focus, a second uniform method, the twinned bow).",
      held, report.checks.size()));
  return report;
}

} // namespace scatter::validation
