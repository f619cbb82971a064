#include <scatter/optics/units.hpp>
#include <scatter/wavefront/rim_bends.hpp>
#include <scatter/wavefront/vectors.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace scatter::wavefront {

std::vector<RimBend> rim_bends(const CoarseRays& coarse, int order, double ka) {
  constexpr double cell = 0.5 * pi / CoarseRays::alphas;
  /// Determinants of (momentum, azimuth) and (theta, azimuth) by the impact point.
  struct Change {
    double of_momentum, of_theta;
  };
  const auto change = [](const CoarseRays::Node& n) {
    const Vector& d = n.direction;
    const double sine = std::max(std::hypot(d[0], d[1]), 1e-12), c = d[0] / sine, s = d[1] / sine;
    const Vector along_theta{d[2] * c, d[2] * s, -sine}, along_phi{-s, c, 0};
    std::array<double, 2> theta{}, phi{}, X{};
    for (int q = 0; q < 2; ++q) {
      theta[q] = inner(n.direction_slope[q], along_theta);
      phi[q] = inner(n.direction_slope[q], along_phi) / sine;
      // Its change with azimuth drops out.
      X[q] = inner(n.point_slope[q], along_theta) - inner(n.point, d) * theta[q];
    }
    return Change{X[0] * phi[1] - X[1] * phi[0], theta[0] * phi[1] - theta[1] * phi[0]};
  };
  const auto azimuth = [](const CoarseRays::Node& n) { return std::atan2(n.direction[1], n.direction[0]); };
  constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  std::vector<RimBend> found;
  for (int j = 0; j < CoarseRays::azimuths; ++j) {
    const CoarseRays::Node& rim = coarse.node(order, CoarseRays::alphas, j);
    if (!rim.goes_out()) continue;
    double bend = nothing;
    if (rim.valid) {
      const Change at_rim = change(rim);
      bend = at_rim.of_momentum / at_rim.of_theta;
    } else {
      // Of the first rays that do not tunnel out: momenta over directions are a line there.
      double last = -1;
      LineFit fit;
      for (int a = CoarseRays::alphas - 1; a > 0; --a) {
        const CoarseRays::Node& n = coarse.node(order, a, j);
        if (!n.valid) continue;
        const double from_rim = 0.5 * pi - a * cell;
        if (last < 0) last = from_rim;
        const double from_grazing = std::sqrt(from_rim * from_rim - last * last);
        if (from_grazing < std::cbrt(1 / ka)) continue;
        if (from_grazing > off_the_rim) break;
        const auto &before = coarse.node(order, a, j - 1), &after = coarse.node(order, a, j + 1);
        if (!before.valid || !after.valid) break;
        double turning = azimuth(after) - azimuth(before);
        turning -= 2 * pi * std::rint(turning / (2 * pi));
        if (std::abs(turning) < 1e-9) continue;
        const Change here = change(n);
        // By angle of incidence, in units of what the momentum changes by on a sphere.
        const double unit = std::sin(a * cell) / turning;
        fit.add(unit * here.of_theta, unit * here.of_momentum);
      }
      bend = fit.slope().value_or(nothing);
    }
    found.push_back({azimuth(rim), std::acos(std::clamp(rim.direction[2], -1.0, 1.0)), bend, !rim.valid});
  }
  // Where rays begin to tunnel out quotients have poles: medians of those that do likewise pass them by.
  std::vector<RimBend> bends = found;
  const auto count = static_cast<std::ptrdiff_t>(found.size()),
             reach = std::min<std::ptrdiff_t>(6, count / 2);
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    std::vector<double> nearby;
    for (std::ptrdiff_t k = i - reach; k <= i + reach; ++k)
      if (const RimBend& other = found[(k + count) % count];
          other.tunnels == found[i].tunnels && std::isfinite(other.bend))
        nearby.push_back(other.bend);
    if (nearby.empty()) nearby.push_back(0);
    const auto middle = nearby.begin() + static_cast<std::ptrdiff_t>(nearby.size() / 2);
    std::ranges::nth_element(nearby, middle);
    bends[i].bend = *middle;
  }
  return bends;
}

} // namespace scatter::wavefront
