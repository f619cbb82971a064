#pragma once

#include <scatter/wavefront/integral_taper.hpp>
#include <scatter/wavefront/kirchhoff.hpp>

#include <optional>
#include <vector>

/// Internal to scatter::wavefront: which directions the diffraction integral along lines of constant azimuth
/// sums together. See papers/kirchhoff-method.md.
namespace scatter::wavefront {

/// What a stretch's momenta refer to: X' = X - dW/dtheta, W = bend t^2 / 2 + twist t^3 / 6, t = theta less
/// the rim's. Stationary phase does not depend on W. Rays that come in at the rim turn with the angle that
/// they come in at; where that changes a drop's momenta, too, X would have a fold there that no caustic
/// belongs to. bend undoes that, twist what comes next. On a sphere both are 0.
struct Reference {
  double theta = 0, bend = 0, twist = 0;
  [[nodiscard]] double path(double other) const {
    const double t = other - theta;
    return t * t * (0.5 * bend + twist * t / 6);
  }
  [[nodiscard]] double momentum(double other) const {
    const double t = other - theta;
    return t * (bend + 0.5 * twist * t);
  }
  [[nodiscard]] double slope(double other) const { return bend + twist * (other - theta); }
};

/// Directions of one column and band, and which rays they take.
struct Stretch {
  int column = 0, first = 0, end = 0; ///< rows
  double middle = 0, half = 0;        ///< theta [rad]
  std::vector<RimAngles> rim;         ///< near this azimuth, theta [rad]
  Taper taper;
  std::optional<Reference> reference; ///< none: it is left to others
  [[nodiscard]] double from() const { return middle + taper.none[0]; }
  [[nodiscard]] double to() const { return middle + taper.none[1]; }

  /// Sets the range of directions.
  void take_rows(int from_row, int to_row, const Layout& layout) {
    first = from_row;
    end = to_row;
    const double low = layout.theta_deg[first], high = layout.theta_deg[end - 1];
    middle = 0.5 * (low + high) * radians_per_degree;
    half = std::max(0.5 * (high - low) * radians_per_degree, 1e-4);
  }
  /// Sets the taper, which ends within these scattering angles; by so much wider than usual.
  void lay_taper(int order, double ka, std::array<double, 2> ends, double wider) {
    std::vector<RimAngles> from_middle = rim;
    for (RimAngles& angles : from_middle) {
      angles.last -= middle;
      angles.before -= middle;
    }
    taper = theta_taper(order, ka, half, from_middle, {middle - ends[0], ends[1] - middle}, wider);
  }
};

/// Of a block of columns wherever `share` is not 0, column by column; with tapers, by so much wider than
/// usual.
[[nodiscard]] std::vector<Stretch> stretches(
    const CoarseRays& coarse, int order, double ka, const IntegralShare& share, const Layout& layout,
    Columns columns, double wider);

} // namespace scatter::wavefront
