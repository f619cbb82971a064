#include <scatter/optics/units.hpp>
#include <scatter/wavefront/bow_curves.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::wavefront {

std::vector<BowCurve> bow_curves(RayProgram& program, const Light& light, int last) {
  constexpr int azimuth_step_deg = 2, samples = 1024;
  const int azimuths = program.axisymmetric ? 1 : 180 / azimuth_step_deg + 1;
  std::vector<double> u, v;
  for (int a = 0; a < azimuths; ++a)
    for (int i = 0; i < samples; ++i) {
      const double b = program.surface.largest_radius * std::sin(0.5 * pi * (i + 0.5) / samples);
      u.push_back(b * cos_deg(a * azimuth_step_deg));
      v.push_back(b * sin_deg(a * azimuth_step_deg));
    }
  const RawRays rays = program.trace_raw(light, u, v, last);
  std::vector<BowCurve> curves(last + 1);
  for (int order = 0; order <= last; ++order)
    for (int a = 0; a < azimuths; ++a) {
      const double c = cos_deg(a * azimuth_step_deg), s = sin_deg(a * azimuth_step_deg);
      // The deflection, counted positive towards the axis and followed continuously along the radius.
      double before = 0, middle = 0, latest = 0;
      int known = 0;
      for (int i = 0; i < samples; ++i) {
        const std::size_t ray = static_cast<std::size_t>(a) * samples + i;
        if (rays.field(order, 0, ray) < 0.5) {
          known = 0;
          continue;
        }
        const double x = rays.field(order, 1, ray), y = rays.field(order, 2, ray),
                     z = rays.field(order, 3, ray);
        double deflection = std::atan2(std::copysign(std::hypot(x, y), -(x * c + y * s)), z);
        if (known > 0) deflection = latest + std::remainder(deflection - latest, 2 * pi);
        before = middle;
        middle = latest;
        latest = deflection;
        if (++known < 3 || (middle - before) * (latest - middle) >= 0) continue;
        // Vertex of the parabola through the three samples, which are even in the angle of incidence.
        const double curvature = before - 2 * middle + latest, slope = 0.5 * (latest - before);
        const double vertex = middle - 0.5 * slope * slope / curvature;
        curves[order].push_back(
            {std::abs(std::remainder(vertex, 2 * pi)) / radians_per_degree,
             std::abs(std::atan2(rays.field(order, 2, ray - 1), rays.field(order, 1, ray - 1))) /
                 radians_per_degree,
             u[ray - 1], v[ray - 1], a});
      }
    }
  return curves;
}

namespace {

/// The point of the next azimuth that continues a curve from `point`: nearest along the radius, and of one
/// bow.
const BowCurvePoint* continuation(const BowCurve& curve, const BowCurvePoint& point, int azimuth) {
  const BowCurvePoint* next = nullptr;
  double nearest = 0.1;
  for (const BowCurvePoint& other : curve) {
    if (other.azimuth != azimuth || std::abs(other.theta_deg - point.theta_deg) > 5 ||
        std::abs(other.phi_deg - point.phi_deg) > 20)
      continue;
    const double apart = std::abs(std::hypot(other.u, other.v) - std::hypot(point.u, point.v));
    if (apart < nearest) {
      nearest = apart;
      next = &other;
    }
  }
  return next;
}

} // namespace

std::vector<BowCrossing>
bow_crossings(RayProgram& program, const Light& light, const Layout& layout, Columns columns) {
  std::vector<BowEdgeSeed> seeds;
  std::vector<BowCrossing> crossings;
  const auto add = [&](int column, double theta, const BowEdgeSeed& seed) {
    crossings.push_back({column, theta, seed, {}});
    seeds.push_back(seed);
  };
  const std::vector<BowCurve> curves = bow_curves(program, light, program.last_order());
  for (const int order : program.tracing.orders) {
    if (order < 2) continue;
    const BowCurve& curve = curves[order];
    if (program.axisymmetric) {
      for (const BowCurvePoint& point : curve)
        add(0, point.theta_deg, {point.u, point.v, point.phi_deg, order});
      continue;
    }
    for (const BowCurvePoint& p : curve) {
      const BowCurvePoint* next = continuation(curve, p, p.azimuth + 1);
      if (next == nullptr || continuation(curve, *next, p.azimuth) != &p) continue;
      const BowCurvePoint& q = *next;
      const auto [low, high] = std::minmax(p.phi_deg, q.phi_deg);
      const auto first = layout.phi_deg.begin() + columns.first, end = layout.phi_deg.begin() + columns.end;
      for (auto phi = std::lower_bound(first, end, low); phi != end && *phi <= high; ++phi) {
        const double f = q.phi_deg == p.phi_deg ? 0 : (*phi - p.phi_deg) / (q.phi_deg - p.phi_deg);
        const auto between = [f](double from, double to) { return from + f * (to - from); };
        add(static_cast<int>(phi - first), between(p.theta_deg, q.theta_deg),
            {between(p.u, q.u), between(p.v, q.v), *phi, order});
      }
    }
  }
  const auto edges = find_bow_edges(
      [&](std::span<const double> u, std::span<const double> v) {
        return program.trace(light, u, v, program.last_order());
      },
      seeds);
  for (std::size_t i = 0; i < edges.size(); ++i) crossings[i].edge = edges[i];
  // Near the axis deflection may turn without any fold, for it is counted from a pole.
  std::erase_if(crossings, [](const BowCrossing& c) { return c.edge.state == BowEdge::State::none; });
  return crossings;
}

} // namespace scatter::wavefront
