#include <scatter/optics/units.hpp>
#include <scatter/wavefront/integral_share.hpp>
#include <scatter/wavefront/integral_taper.hpp>
#include <scatter/wavefront/vectors.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::wavefront {
namespace {

/// Theta and phi fail at the poles: the integral's share grows from nothing to all between these angles from
/// them.
constexpr double polar_cap_deg = 12, polar_cap_end_deg = 15;

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

} // namespace scatter::wavefront
