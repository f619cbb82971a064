#include <scatter/optics/units.hpp>
#include <scatter/wavefront/bow_edge.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace scatter::wavefront {

namespace {

/// f(s, t) to second order about the middle of a 3 x 3 stencil.
struct Quadratic {
  double value = 0, s = 0, t = 0, ss = 0, st = 0, tt = 0;

  Quadratic(const std::array<double, 9>& f, double h)
      : value(f[4]), s((f[5] - f[3]) / (2 * h)), t((f[7] - f[1]) / (2 * h)),
        ss((f[5] - 2 * f[4] + f[3]) / (h * h)), st((f[8] - f[6] - f[2] + f[0]) / (4 * h * h)),
        tt((f[7] - 2 * f[4] + f[1]) / (h * h)) {}
  [[nodiscard]] double at(double x, double y) const {
    return value + s * x + t * y + 0.5 * (ss * x * x + tt * y * y) + st * x * y;
  }
  [[nodiscard]] double slope_s(double x, double y) const { return s + ss * x + st * y; }
  [[nodiscard]] double slope_t(double x, double y) const { return t + st * x + tt * y; }
};

/// A seed on its way.
struct Approach {
  std::size_t seed = 0;
  double radial_u = 1, radial_v = 0; ///< direction of s; t is a quarter turn on
  int round = 0;
  bool mirrored = false;
};

constexpr double coarse = 4e-3, fine = 4e-4; ///< between rays of a stencil
constexpr int most_rounds = 6;
/// From the seed. Bow curves follow the edge to 0.01 a.
constexpr double farthest = 0.1;

Amplitude scaled(Amplitude j, double factor) {
  return {factor * j.S1, factor * j.S2, factor * j.S3, factor * j.S4};
}

/// One round: true when the search has ended, found or not.
bool refine(
    Approach& search, const BowEdgeSeed& seed, double h, std::span<const std::vector<TracedRay>> rays,
    BowEdge& edge) {
  if (!search.mirrored && rays[4][seed.order].valid) {
    // The column's ray may be the seed's image in the plane of the sun.
    const auto& d = rays[4][seed.order].direction;
    const auto off = [&](double y) {
      return std::abs(std::remainder(std::atan2(y, d[0]) - seed.phi_deg * radians_per_degree, 2 * pi));
    };
    search.mirrored = true;
    if (off(-d[1]) < off(d[1]) - 1e-9) {
      edge.v = -edge.v;
      search.radial_v = -search.radial_v;
      return false;
    }
  }
  std::array<double, 9> theta{}, phi{};
  const double c = std::cos(seed.phi_deg * radians_per_degree),
               s = std::sin(seed.phi_deg * radians_per_degree);
  for (std::size_t i = 0; i < 9; ++i) {
    const TracedRay& ray = rays[i][seed.order];
    if (!ray.valid) return true;
    const auto& [x, y, z] = ray.direction;
    theta[i] = std::atan2(std::hypot(x, y), z);
    phi[i] = std::atan2(y * c - x * s, x * c + y * s);
    if (std::sin(theta[i]) < std::sin(radians_per_degree) || std::abs(phi[i]) > pi / 2) return true;
  }
  const Quadratic a(theta, h), b(phi, h);
  // phi = 0 and no area: a Newton iteration on the quadratics.
  double x = 0, y = 0;
  for (int step = 0; step < 8; ++step) {
    const double as = a.slope_s(x, y), at = a.slope_t(x, y), bs = b.slope_s(x, y), bt = b.slope_t(x, y);
    const double azimuth = b.at(x, y), area = as * bt - at * bs;
    const double area_s = a.ss * bt + as * b.st - a.st * bs - at * b.ss;
    const double area_t = a.st * bt + as * b.tt - a.tt * bs - at * b.st;
    const double determinant = bs * area_t - bt * area_s;
    x -= (azimuth * area_t - area * bt) / determinant;
    y -= (area * bs - azimuth * area_s) / determinant;
  }
  const double move = std::hypot(x, y);
  const double bt = b.slope_t(x, y), bs = b.slope_s(x, y);
  const double before_u = edge.u, before_v = edge.v;
  edge.u += search.radial_u * x - search.radial_v * y;
  edge.v += search.radial_v * x + search.radial_u * y;
  if (!(std::hypot(edge.u - seed.u, std::abs(edge.v) - std::abs(seed.v)) < farthest)) {
    edge.state = BowEdge::State::none;
    return true;
  }
  ++search.round;
  if (h > fine || move > 0.1 * fine) return search.round >= most_rounds;

  // Along the column, s as the parameter.
  const double slope = -bs / bt, bend = -(b.ss + 2 * b.st * slope + b.tt * slope * slope) / bt;
  const double curvature = a.ss + 2 * a.st * slope + a.tt * slope * slope + a.slope_t(x, y) * bend;
  const double radius = std::hypot(before_u, before_v);
  // Where lines of equal azimuth run along the rim, s is no parameter.
  if (!(std::abs(bt) * radius > 0.05 && std::abs(slope) < 3 && std::abs(curvature) > 1e-3)) return true;
  const double theta_edge = a.at(x, y);
  edge.theta_deg = theta_edge / radians_per_degree;
  edge.side = curvature > 0 ? 1 : -1;
  edge.curvature = std::abs(curvature);
  const double turn = a.slope_s(x, y) / (a.ss + a.st * slope);
  edge.focal_offset = 0.5 * edge.curvature * turn * turn;
  // A sheet at b has |T|^2 a^2 / (sin theta |dphi/dt| |dtheta/ds|) and dtheta/ds = sqrt(2 curvature x).
  edge.amplitude = scaled(
      rays[4][seed.order].jones,
      std::sqrt(std::sqrt(2 / edge.curvature) / (std::abs(bt) * std::sin(theta_edge))));
  edge.state = BowEdge::State::found;
  return true;
}

} // namespace

std::vector<BowEdge> find_bow_edges(const TraceRays& trace, std::span<const BowEdgeSeed> seeds) {
  std::vector<BowEdge> edges(seeds.size());
  std::vector<Approach> searches(seeds.size());
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    const double radius = std::hypot(seeds[i].u, seeds[i].v);
    searches[i].seed = i;
    edges[i].u = seeds[i].u;
    edges[i].v = seeds[i].v;
    if (radius > 0) {
      searches[i].radial_u = seeds[i].u / radius;
      searches[i].radial_v = seeds[i].v / radius;
    }
  }
  while (!searches.empty()) {
    std::vector<double> u, v;
    for (const Approach& search : searches) {
      const double h = search.round == 0 ? coarse : fine;
      const BowEdge& edge = edges[search.seed];
      for (int t = -1; t <= 1; ++t)
        for (int s = -1; s <= 1; ++s) {
          u.push_back(edge.u + h * (s * search.radial_u - t * search.radial_v));
          v.push_back(edge.v + h * (s * search.radial_v + t * search.radial_u));
        }
    }
    const auto rays = trace(u, v);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < searches.size(); ++i) {
      Approach search = searches[i];
      const std::span<const std::vector<TracedRay>> stencil(rays.data() + 9 * i, 9);
      if (!refine(search, seeds[search.seed], search.round == 0 ? coarse : fine, stencil, edges[search.seed]))
        searches[kept++] = search;
    }
    searches.resize(kept);
  }
  return edges;
}

double hurwitz_zeta_half(double a) {
  // Euler and Maclaurin from a + 20 on.
  double sum = 0;
  for (int k = 0; k < 20; ++k) sum += 1 / std::sqrt(a + k);
  const double x = a + 20, r = 1 / std::sqrt(x);
  return sum - 2 * std::sqrt(x) + 0.5 * r + r / (24 * x) - r / (384 * x * x * x) +
         r / (1024 * x * x * x * x * x);
}

} // namespace scatter::wavefront
