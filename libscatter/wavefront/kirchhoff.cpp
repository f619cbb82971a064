#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/fourier_grid.hpp>
#include <scatter/wavefront/integral_taper.hpp>
#include <scatter/wavefront/kirchhoff.hpp>
#include <scatter/wavefront/outline.hpp>
#include <scatter/wavefront/side_by_side.hpp>

#include <embedded/kernel_kirchhoff.hpp>
#include <embedded/kernel_outline.hpp>

#include <algorithm>
#include <cmath>
#include <map>

namespace scatter::wavefront {
namespace {

using compute::OpenCL;
using compute::with_arguments;
using Vector = std::array<double, 3>;

/// Change of momentum per angle between rays, at most.
constexpr double steepest_momentum = 1.5;
constexpr double window_deg = 12;
/// Theta and phi fail at the poles: the integral's share grows from nothing to all between these angles from
/// them.
constexpr double polar_cap_deg = 12, polar_cap_end_deg = 15;

double inner(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Vector along(const Vector& a, double t, const Vector& b) {
  return {a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]};
}
double norm(const Vector& a) {
  return std::sqrt(inner(a, a));
}
Vector direction(double theta_deg, double phi_deg) {
  return {sin_deg(theta_deg) * cos_deg(phi_deg), sin_deg(theta_deg) * sin_deg(phi_deg), cos_deg(theta_deg)};
}

} // namespace

CoarseRays::CoarseRays(RayProgram& rays, const Light& light, int last)
    : nodes_(static_cast<std::size_t>(last + 1) * (alphas + 1) * azimuths) {
  const auto outline = outline_series(rays.tracing.shape, rays.tracing.sun_elevation_deg);
  std::vector<double> u, v;
  for (int a = 0; a <= alphas; ++a)
    for (int j = 0; j < azimuths; ++j) {
      const double alpha = std::min(0.5 * pi * a / alphas, 0.5 * pi - 1e-5), psi = 2 * pi * j / azimuths;
      // Off the axis, where azimuths lose their meaning.
      const double b = series_value(outline.radius, std::cos(psi)) * std::max(std::sin(alpha), 1e-6);
      u.push_back(b * std::cos(psi));
      v.push_back(b * std::sin(psi));
    }
  const RawRays raw = rays.trace_raw(light, u, v, last, true);
  for (int p = 0; p <= last; ++p)
    for (std::size_t i = 0; i < u.size(); ++i) {
      Node& node = nodes_[static_cast<std::size_t>(p) * u.size() + i];
      const auto vector = [&](int f) {
        return Vector{raw.field(p, f, i), raw.field(p, f + 1, i), raw.field(p, f + 2, i)};
      };
      node.valid = raw.field(p, 0, i) == 1;
      node.tunnels = raw.field(p, 0, i) == 2;
      node.direction = vector(1);
      node.point = vector(14);
      node.point_slope = {vector(17), vector(20)};
      node.direction_slope = {vector(23), vector(26)};
      node.turn = inner(node.direction, cross(node.direction_slope[0], node.direction_slope[1]));
      node.foci = static_cast<int>(raw.field(p, 30, i));
    }
}

namespace {

/// Some of an ascending list, at least `spacing` apart, with its ends; and where every one of the list lies.
struct Knots {
  struct Place {
    std::size_t knot; ///< at or below
    double part;      ///< of the way to the next
  };
  std::vector<double> values;
  std::vector<Place> place;
};

Knots knots(std::span<const double> list, double spacing) {
  Knots made;
  std::vector<std::size_t> at;
  for (std::size_t i = 0; i < list.size(); ++i)
    if (i == 0 || i + 1 == list.size() || list[i] - made.values.back() >= spacing * (1 - 1e-9)) {
      made.values.push_back(list[i]);
      at.push_back(i);
    }
  for (std::size_t i = 0, knot = 0; i < list.size(); ++i) {
    while (knot + 1 < at.size() && at[knot + 1] <= i) ++knot;
    const bool between = i > at[knot];
    made.place.push_back(
        {knot, between ? (list[i] - made.values[knot]) / (made.values[knot + 1] - made.values[knot]) : 0.0});
  }
  return made;
}

} // namespace

IntegralShare integral_share(
    const CoarseRays& coarse, const Light& light, double radius_m, int order, const Layout& layout,
    Columns columns, const IntegralZone& zone) {
  const double ka = 2 * pi * radius_m / light.wavelength_m;
  struct Caustic {
    Caustic(const Vector& d, double from, double to)
        : direction(d), inner(from), outer(to), inner_cosine(std::cos(from)), outer_cosine(std::cos(to)),
          farthest_across(std::sin(std::min(to, 1.5))) {}
    Vector direction;
    double inner, outer; ///< reach of the integral around it [rad]
    double inner_cosine, outer_cosine, farthest_across;
  };
  std::vector<Caustic> caustics;
  const auto foot = [](const CoarseRays::Node& n) {
    return along(n.point, -inner(n.point, n.direction), n.direction);
  };
  // Where the solid angle of a tube of rays changes sign between neighbours.
  const auto look = [&](int a, int j, int step_a, int step_j) {
    const auto& before = coarse.node(order, a - step_a, j - step_j);
    const auto& here = coarse.node(order, a, j);
    const auto& there = coarse.node(order, a + step_a, j + step_j);
    if (!before.valid || !here.valid || !there.valid || (here.turn < 0) == (there.turn < 0)) return;
    const double share = here.turn / (here.turn - there.turn);
    Vector d = along(here.direction, share, along(there.direction, -1, here.direction));
    const double length = norm(d);
    for (double& c : d) c /= length;
    // Directions bend by kappa X^2 / 2 about the fold, X across the wavefront.
    Vector bend, X;
    const Vector X0 = foot(before), X1 = foot(there);
    for (int c = 0; c < 3; ++c) {
      bend[c] = before.direction[c] - 2 * here.direction[c] + there.direction[c];
      X[c] = 0.5 * (X1[c] - X0[c]);
    }
    const double kappa = norm(bend) / std::max(inner(X, X), 1e-12);
    double width = std::cbrt(0.5 * kappa) * std::pow(ka, -2.0 / 3);
    // A focus along the axis has the width of a Bessel function instead.
    const double rho = norm(foot(here));
    if (std::hypot(d[0], d[1]) < 0.1) width = std::max(width, 2.5 / (ka * std::max(rho, 0.05)));
    width = std::min(width, 0.1);
    caustics.emplace_back(d, zone.inner * width, zone.outer * width);
  };
  for (int a = 1; a < CoarseRays::alphas; ++a)
    for (int j = 0; j < CoarseRays::azimuths; ++j) {
      look(a, j, 1, 0);
      look(a, j, 0, 1);
    }
  // Grazing rays, whose patches end abruptly: with the directions around, as far as light leaks.
  if (order > 0) {
    const double grazing = std::sqrt(zone.grazing) * std::cbrt(2 / ka), leak = 2 * std::cbrt(2 / ka);
    for (int a = CoarseRays::alphas; a > 0 && std::cos(0.5 * pi * a / CoarseRays::alphas) < grazing; --a)
      for (int j = 0; j < CoarseRays::azimuths; ++j) {
        const auto& here = coarse.node(order, a, j);
        const auto& next = coarse.node(order, a - 1, j);
        if (!here.goes_out() || !next.goes_out()) continue;
        const double gap =
            std::max(norm(along(here.direction, -1, next.direction)), 2 * pi / CoarseRays::azimuths);
        const double reach = std::max(gap, a == CoarseRays::alphas ? leak : 0.0);
        caustics.emplace_back(here.direction, reach, 1.5 * reach);
      }
  }
  // The blend is smooth: some rows and columns are enough, the others lie between them.
  const Knots rows = knots(layout.theta_deg, 0.05),
              azimuths = knots(std::span(layout.phi_deg).subspan(columns.first, columns.count()), 0.5);
  std::vector<double> sin_theta, cos_theta;
  for (const double theta : rows.values) {
    sin_theta.push_back(sin_deg(theta));
    cos_theta.push_back(cos_deg(theta));
  }
  std::vector<float> at_knots(rows.values.size() * azimuths.values.size(), 0.0F);
  bool any = false;
  for (std::size_t column = 0; column < azimuths.values.size(); ++column) {
    const double cos_phi = cos_deg(azimuths.values[column]), sin_phi = sin_deg(azimuths.values[column]);
    float* const share = at_knots.data() + column * rows.values.size();
    for (const Caustic& caustic : caustics) {
      // The nearest the column comes.
      const Vector& d = caustic.direction;
      if (std::abs(d[0] * sin_phi - d[1] * cos_phi) > caustic.farthest_across) continue;
      const double theta = std::acos(std::clamp(d[2], -1.0, 1.0)) / radians_per_degree;
      const double reach = caustic.outer / radians_per_degree;
      const auto first = std::ranges::upper_bound(rows.values, std::max(theta - reach, polar_cap_deg));
      const auto end = std::ranges::lower_bound(rows.values, std::min(theta + reach, 180 - polar_cap_deg));
      const double along_column = d[0] * cos_phi + d[1] * sin_phi;
      for (auto t = first; t < end; ++t) {
        const std::size_t row = t - rows.values.begin();
        const double cosine = along_column * sin_theta[row] + d[2] * cos_theta[row];
        if (share[row] == 1 || cosine < caustic.outer_cosine) continue;
        any = true;
        share[row] =
            cosine >= caustic.inner_cosine
                ? 1.0F
                : std::max(
                      share[row],
                      static_cast<float>(smooth_step(std::acos(cosine), caustic.inner, caustic.outer)));
      }
    }
  }
  if (!any) return {};
  const std::size_t count = layout.theta_deg.size();
  IntegralShare share(count * columns.count());
  for (int column = 0; column < columns.count(); ++column) {
    const auto [left, right_part] = azimuths.place[column];
    const float* const before = at_knots.data() + left * rows.values.size();
    const float* const after = before + (right_part > 0 ? rows.values.size() : 0);
    for (std::size_t row = 0; row < count; ++row) {
      const double theta = layout.theta_deg[row];
      const auto [below, part] = rows.place[row];
      const std::size_t above = part > 0 ? below + 1 : below;
      const double off_the_poles =
          smooth_step(-std::min(theta, 180 - theta), -polar_cap_end_deg, -polar_cap_deg);
      const double value = (1 - right_part) * ((1 - part) * before[below] + part * before[above]) +
                           right_part * ((1 - part) * after[below] + part * after[above]);
      share[column * count + row] = static_cast<float>(off_the_poles * value);
    }
  }
  return share;
}

namespace {

/// Layout of window_t in kernels/kirchhoff.cl.
struct Window {
  Vector r0, e1, e2, f0, f1, f2;
  double latitude = 0;
  double shear = 0;
  std::array<Taper, 2> taper{}; ///< along phi, along theta
  std::array<double, 2> centre{}, xi_per_length{}, points_per_xi{};
  double tap_shape = 0;
  std::array<double, 2> modes_per_radian{};
  double alpha_step = 0, psi_step = 0, height_step = 0;
  std::array<int, 2> points{}, modes{};
  int alphas = 0, azimuths = 0, heights = 0, rim_cell = CoarseRays::alphas, order = 0, outline_terms = 0;
};
static_assert(sizeof(Window) == 360);

struct Cell {
  int alpha, azimuth, index, unused;
};
struct Target {
  int column, row;
  double weight;
};

/// Everything that is known of a window before its rays are traced.
struct WindowPlan {
  Window window;
  std::vector<Cell> cells;
  std::vector<Target> targets;
};

/// A ray in the coordinates of a window: see kernels/kirchhoff.cl.
struct Momentum {
  std::array<double, 2> rho{}, X{};
  double A = 0;     ///< det of the momentum's change by the impact point
  double scale = 0; ///< of its terms, which may cancel
  int negative = 0; ///< eigenvalues
};

Momentum momentum(const Window& w, const CoarseRays::Node& n) {
  const Vector& d = n.direction;
  const double towards = inner(d, w.f0), east = inner(d, w.f1), sin_2 = inner(d, w.f2);
  const double cos_2 = std::sqrt(std::max(towards * towards + east * east, 1e-12));
  const double cos_1 = towards / cos_2, sin_1 = east / cos_2;
  Vector middle, side, t1, t2;
  for (int c = 0; c < 3; ++c) {
    middle[c] = cos_1 * w.f0[c] + sin_1 * w.f1[c];
    side[c] = -sin_1 * w.f0[c] + cos_1 * w.f1[c];
    t1[c] = cos_2 * side[c];
    t2[c] = cos_2 * w.f2[c] - sin_2 * middle[c];
  }
  Momentum m;
  m.rho = {std::atan2(east, towards), std::asin(std::clamp(sin_2, -1.0, 1.0)) - w.latitude};
  m.X = {inner(n.point, t1) - w.shear * m.rho[0], inner(n.point, t2)};
  std::array<std::array<double, 2>, 2> rho_slope{}, X_slope{};
  const double on_d = inner(n.point, d), on_middle = inner(n.point, middle), on_side = inner(n.point, side);
  for (int q = 0; q < 2; ++q) {
    rho_slope[q] = {inner(n.direction_slope[q], t1) / (cos_2 * cos_2), inner(n.direction_slope[q], t2)};
    X_slope[q] = {
        inner(n.point_slope[q], t1) - (cos_2 * on_middle + w.shear) * rho_slope[q][0] -
            sin_2 * on_side * rho_slope[q][1],
        inner(n.point_slope[q], t2) - sin_2 * on_side * rho_slope[q][0] - on_d * rho_slope[q][1]};
  }
  m.A = X_slope[0][0] * X_slope[1][1] - X_slope[1][0] * X_slope[0][1];
  m.scale = std::hypot(X_slope[0][0], X_slope[1][0]) * std::hypot(X_slope[0][1], X_slope[1][1]);
  const double turn = rho_slope[0][0] * rho_slope[1][1] - rho_slope[1][0] * rho_slope[0][1];
  double trace = 0;
  for (int q = 0; q < 2; ++q)
    for (int axis = 0; axis < 2; ++axis) trace += X_slope[q][axis] * rho_slope[q][axis];
  m.negative = (m.A < 0) != (turn < 0) ? 1 : trace < 0 ? 2 : 0;
  return m;
}

WindowPlan plan_window(
    const CoarseRays& coarse, int order, double ka, std::vector<Target> targets, const Layout& layout,
    Columns columns, const Vector& centre, int outline_terms) {
  WindowPlan made;
  made.targets = std::move(targets);
  Window& w = made.window;
  w.r0 = centre;
  w.order = order;
  w.outline_terms = outline_terms;
  // Axes along theta and phi. Planes of incidence cut a sphere's directions along meridians.
  const double sine = std::hypot(centre[0], centre[1]), c = centre[0] / sine, s = centre[1] / sine;
  w.e1 = {centre[2] * c, centre[2] * s, -sine};
  w.e2 = cross(w.r0, w.e1);
  w.f0 = {c, s, 0};
  w.f1 = {s, -c, 0};
  w.f2 = {0, 0, -1};
  w.latitude = -std::asin(centre[2]);
  std::array<double, 2> half{1e-4, 1e-4};
  for (const Target& target : made.targets) {
    const Vector r = direction(layout.theta_deg[target.row], layout.phi_deg[columns.first + target.column]);
    half[0] = std::max(half[0], std::abs(std::atan2(inner(r, w.f1), inner(r, w.f0))));
    half[1] = std::max(half[1], std::abs(std::asin(std::clamp(inner(r, w.f2), -1.0, 1.0)) - w.latitude));
  }
  const double fresnel = fresnel_width(order, ka);
  std::vector<RimAngles> rim;
  for (int j = 0; j < CoarseRays::azimuths; ++j) {
    const CoarseRays::Node& last = coarse.node(order, CoarseRays::alphas, j);
    const CoarseRays::Node& before = coarse.node(order, CoarseRays::alphas - 1, j);
    if (order == 0 || !last.goes_out() || !before.goes_out()) continue;
    const Momentum at_rim = momentum(w, last);
    if (std::abs(at_rim.rho[0]) <= half[0] + taper_end * fresnel)
      rim.push_back({at_rim.rho[1], momentum(w, before).rho[1]});
  }
  w.taper[0] = {
      {-std::min(half[0] + taper_begin * fresnel, 1.2), std::min(half[0] + taper_begin * fresnel, 1.2)},
      {-std::min(half[0] + taper_end * fresnel, 1.5), std::min(half[0] + taper_end * fresnel, 1.5)}};
  w.taper[1] = theta_taper(order, ka, w.latitude + 0.5 * pi, half[1], rim);
  // Cells of rays that may leave within the taper, and those at the rim with their continuation beyond it.
  std::vector<const CoarseRays::Node*> corners;
  for (int a = 0; a < CoarseRays::alphas; ++a)
    for (int j = 0; j < CoarseRays::azimuths; ++j) {
      const CoarseRays::Node* nodes[] = {
          &coarse.node(order, a, j), &coarse.node(order, a + 1, j), &coarse.node(order, a, j + 1),
          &coarse.node(order, a + 1, j + 1)};
      std::array<double, 2> low{1e9, 1e9}, high{-1e9, -1e9};
      int valid = 0;
      double towards = -1;
      for (const auto* node : nodes) {
        if (!node->goes_out()) continue;
        ++valid;
        const Momentum m = momentum(w, *node);
        towards = std::max(towards, inner(node->direction, w.r0));
        for (int axis = 0; axis < 2; ++axis) {
          low[axis] = std::min(low[axis], m.rho[axis]);
          high[axis] = std::max(high[axis], m.rho[axis]);
        }
      }
      if (valid == 0 || towards < -0.2) continue;
      // Half-way round the longitude jumps.
      bool misses = high[0] - low[0] > pi;
      for (int axis = 0; axis < 2; ++axis) {
        const double margin = 0.3 * (high[axis] - low[axis]) + 0.01;
        misses = misses || low[axis] - margin > w.taper[axis].none[1] ||
                 high[axis] + margin < w.taper[axis].none[0];
      }
      if (misses) continue;
      made.cells.push_back({a, j, 0, 0});
      for (const auto* node : nodes)
        if (node->goes_out()) corners.push_back(node);
      if (a == CoarseRays::alphas - 1 && order > 0 && nodes[1]->goes_out())
        made.cells.push_back({CoarseRays::alphas, j, 0, 0});
    }
  if (made.cells.empty() || corners.empty()) {
    made.cells.clear();
    return made;
  }
  // Shear across the plane of scattering, where A would vanish without: on a sphere the momentum about the
  // light is 0. Plane waves have -sin(theta) cos(theta) X_theta of it in these coordinates, which
  // makes the sum good to the next order of 1 / (k a); its sign is what counts.
  const auto clearance = [&](double shear) {
    w.shear = shear;
    double least = 1;
    for (const auto* n : corners) {
      const Momentum m = momentum(w, *n);
      bool inside = true;
      for (int axis = 0; axis < 2; ++axis)
        inside = inside && m.rho[axis] > 0.5 * (w.taper[axis].full[0] + w.taper[axis].none[0]) &&
                 m.rho[axis] < 0.5 * (w.taper[axis].full[1] + w.taper[axis].none[1]);
      if (inside) least = std::min(least, std::abs(m.A) / m.scale);
    }
    return least;
  };
  double turning = 0;
  for (const auto* n : corners) {
    const Momentum m = momentum(w, *n);
    if (std::abs(m.rho[0]) < half[0] + fresnel && std::abs(m.rho[1]) < half[1] + fresnel) turning += m.X[1];
  }
  const double sign = turning * centre[2] < 0 ? 1 : -1;
  double shear = 0.5 * sign, best = clearance(shear);
  if (best < 0.1)
    for (const double candidate : {-0.5, 0.4, -0.4, 0.8, -0.8})
      if (const double here = clearance(candidate * sign); here > 1.5 * best) {
        best = here;
        shear = candidate * sign;
      }
  w.shear = shear;
  std::array<double, 2> low{1e9, 1e9}, high{-1e9, -1e9};
  for (const auto* n : corners) {
    const Momentum m = momentum(w, *n);
    for (int axis = 0; axis < 2; ++axis) {
      low[axis] = std::min(low[axis], m.X[axis]);
      high[axis] = std::max(high[axis], m.X[axis]);
    }
  }
  // Phase between neighbouring rays: k (rho - r) . dX.
  const std::array<double, 2> spread{
      half[0] + std::max(w.taper[0].none[1], -w.taper[0].none[0]),
      half[1] + std::max(w.taper[1].none[1], -w.taper[1].none[0])};
  double step_alpha = 0, step_psi = 0;
  for (Cell& cell : made.cells) {
    const auto side = [&](const CoarseRays::Node& a, const CoarseRays::Node& b) {
      if (!a.goes_out() || !b.goes_out()) return 0.0;
      const Momentum from = momentum(w, a), to = momentum(w, b);
      return std::abs(to.X[0] - from.X[0]) * spread[0] + std::abs(to.X[1] - from.X[1]) * spread[1];
    };
    // Rays that tunnel in or out keep the index of the last one that did not.
    for (int a = std::min(cell.alpha + 1, CoarseRays::alphas); a > 0; --a)
      if (const CoarseRays::Node& node = coarse.node(order, a, cell.azimuth); node.valid) {
        cell.index = node.foci - momentum(w, node).negative;
        break;
      }
    if (cell.alpha == CoarseRays::alphas) continue;
    const auto& n00 = coarse.node(order, cell.alpha, cell.azimuth);
    const auto& n10 = coarse.node(order, cell.alpha + 1, cell.azimuth);
    const auto& n01 = coarse.node(order, cell.alpha, cell.azimuth + 1);
    const auto& n11 = coarse.node(order, cell.alpha + 1, cell.azimuth + 1);
    step_alpha = std::max({step_alpha, side(n00, n10), side(n01, n11)});
    step_psi = std::max({step_psi, side(n00, n01), side(n10, n11)});
  }
  // Momenta change by about the angles that rays are apart; next to the rim, out of the plane of scattering,
  // their derivatives have no bound, but their weight vanishes.
  const auto rays_for = [&](double step, double cell) {
    const double bounded = std::min(step, steepest_momentum * cell * (spread[0] + spread[1]));
    return std::max(2, static_cast<int>(std::ceil(ka * bounded / (pi * phase_step))));
  };
  w.alphas = rays_for(step_alpha, 0.5 * pi / CoarseRays::alphas);
  w.azimuths = rays_for(step_psi, 2 * pi / CoarseRays::azimuths);
  w.alpha_step = 0.5 * pi / CoarseRays::alphas / w.alphas;
  w.psi_step = 2 * pi / CoarseRays::azimuths / w.azimuths;
  // Beyond the rim waves die out within some Airy widths.
  const double reach_beyond = rim_reach * std::cbrt(0.5 / (ka * ka));
  w.heights = std::max(
      24, static_cast<int>(std::ceil(ka * reach_beyond * (spread[0] + spread[1]) / (pi * 0.5 * phase_step))));
  w.height_step = reach_beyond / w.heights;
  w.tap_shape = tap_shape;
  for (int axis = 0; axis < 2; ++axis) {
    w.centre[axis] = 0.5 * (low[axis] + high[axis]);
    const double reach = 0.5 * (high[axis] - low[axis]) * 1.1 + 0.02 + 2 * reach_beyond;
    // Modes lie so close that the extent of X' is 1 / oversampling of their period.
    const double mode = pi / (oversampling * ka * reach);
    w.xi_per_length[axis] = ka * mode;
    w.modes_per_radian[axis] = 1 / mode;
    w.modes[axis] = static_cast<int>(half[axis] / mode) + taps;
    w.points[axis] = quick_size(2 * oversampling * w.modes[axis]);
    w.points_per_xi[axis] = w.points[axis] / (2 * pi);
  }
  return made;
}

/// Directions with a share, sorted into windows: the most expensive first, so that none is left for the end.
std::vector<WindowPlan> plan_windows(
    const CoarseRays& coarse, int order, double ka, const IntegralShare& share, const Layout& layout,
    Columns columns, int outline_terms, std::size_t workers) {
  const int rows = static_cast<int>(layout.theta_deg.size());
  std::map<std::pair<int, int>, std::vector<Target>> groups;
  for (int column = 0; column < columns.count(); ++column)
    for (int row = 0; row < rows; ++row) {
      const float weight = share[static_cast<std::size_t>(column) * rows + row];
      if (weight == 0) continue;
      const double theta = layout.theta_deg[row], phi = layout.phi_deg[columns.first + column];
      const int band = static_cast<int>(theta / window_deg);
      const double wide = window_deg / sin_deg((band + 0.5) * window_deg);
      const int sector = static_cast<int>(std::floor(phi / wide));
      groups[{band, sector}].push_back({column, row, weight});
    }
  std::vector<std::vector<Target>> windows;
  for (auto& [cell, targets] : groups) windows.push_back(std::move(targets));
  std::vector<WindowPlan> plans(windows.size());
  side_by_side(workers, windows.size(), [&](std::size_t, std::size_t i) {
    std::array<double, 2> low{1e9, 1e9}, high{-1e9, -1e9};
    for (const Target& t : windows[i]) {
      const double at[] = {layout.theta_deg[t.row], layout.phi_deg[columns.first + t.column]};
      for (int axis = 0; axis < 2; ++axis) {
        low[axis] = std::min(low[axis], at[axis]);
        high[axis] = std::max(high[axis], at[axis]);
      }
    }
    const Vector centre = direction(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]));
    plans[i] = plan_window(coarse, order, ka, std::move(windows[i]), layout, columns, centre, outline_terms);
  });
  std::erase_if(plans, [](const WindowPlan& plan) { return plan.cells.empty(); });
  std::ranges::stable_sort(plans, std::ranges::greater{}, [](const WindowPlan& plan) {
    return static_cast<double>(plan.cells.size()) * plan.window.alphas * plan.window.azimuths;
  });
  return plans;
}

} // namespace

void add_integral(
    RayProgram& rays, const CoarseRays& coarse, const Light& light, int order, const IntegralShare& share,
    const Layout& layout, Columns columns, const DirectionBuffers& directions, cl::Buffer& sums) {
  if (std::ranges::all_of(share, [](float value) { return value == 0; })) return;
  OpenCL& opencl = rays.cl();
  const Outline outline = outline_series(rays.tracing.shape, rays.tracing.sun_elevation_deg);
  const Job job = rays.make_job(light, 2, order);
  const double ka = pi * job.wave;
  const std::size_t workers = rays.device.info().compute_units;
  const auto plans = plan_windows(
      coarse, order, ka, share, layout, columns, static_cast<int>(outline.radius.size()), workers);
  if (plans.empty()) return;
  const std::string_view sources[] = {embedded::kernel_outline, embedded::kernel_kirchhoff};
  cl::Program& program = rays.build(light, sources, true, " -DUNIFORM -DBEYOND");
  const cl::Buffer job_data = rays.job_buffer(job), outline_data = opencl.upload(outline.both());
  const cl::Buffer taps_data = opencl.upload(tap_polynomials());
  const int rows = static_cast<int>(layout.theta_deg.size());
  const double scale = 0.5 * job.wave * inverse_transform_scale() * inverse_transform_scale();

  const auto work = [&](std::size_t lane, const WindowPlan& plan, bool only_compile) {
    const Window& w = plan.window;
    cl::CommandQueue& queue = opencl.lane(lane);
    const std::size_t size = 8 * static_cast<std::size_t>(w.points[0]) * w.points[1];
    const cl::Buffer window_data = opencl.upload(std::span<const Window>(&w, 1));
    const cl::Buffer cell_data = opencl.upload(plan.cells), target_data = opencl.upload(plan.targets);
    const cl::Buffer corrections_x = opencl.upload(mode_corrections(w.modes[0], w.points[0]));
    const cl::Buffer corrections_y = opencl.upload(mode_corrections(w.modes[1], w.points[1]));
    std::vector<double> grid(only_compile ? 8 : size);
    std::vector<int> lost{0};
    const cl::Buffer lost_data(
        opencl.context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR, sizeof(int), lost.data());
    const cl::Buffer grid_data(
        opencl.context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR, grid.size() * sizeof(double), grid.data());
    const int cells = only_compile ? 0 : static_cast<int>(plan.cells.size());
    const int targets = only_compile ? 0 : static_cast<int>(plan.targets.size());
    queue.enqueueNDRangeKernel(
        with_arguments(
            cl::Kernel(program, "spread_rays"), rays.surface_buffer, job_data, window_data, outline_data,
            taps_data, cell_data, cells, grid_data, lost_data),
        cl::NullRange, cl::NDRange(1), cl::NDRange(1));
    if (!only_compile) {
      auto* mapped = static_cast<double*>(
          queue.enqueueMapBuffer(grid_data, CL_TRUE, CL_MAP_READ | CL_MAP_WRITE, 0, size * sizeof(double)));
      GridTransform(w.points[0], w.points[1], mapped).run(mapped);
      queue.enqueueUnmapMemObject(grid_data, mapped);
    }
    queue.enqueueNDRangeKernel(
        with_arguments(
            cl::Kernel(program, "gather_directions"), job_data, window_data, grid_data, corrections_x,
            corrections_y, taps_data, target_data, 0, targets, directions.sin_theta, directions.cos_theta,
            directions.cos_phi, directions.sin_phi, rows, scale, sums),
        cl::NullRange, cl::NDRange(1), cl::NDRange(1));
    queue.enqueueReadBuffer(lost_data, CL_TRUE, 0, sizeof(int), lost.data());
    queue.finish();
    if (lost[0] != 0)
      throw RunError(
          "diffraction integral: " + std::to_string(lost[0]) + " rays of order " + std::to_string(order) +
          " fell outside their window or are not numbers");
  };
  // Kernels are compiled at their first launch, which must not happen on several queues at once.
  work(0, plans.front(), true);
  side_by_side(workers, plans.size(), [&](std::size_t lane, std::size_t i) { work(lane, plans[i], false); });
}

} // namespace scatter::wavefront
