#pragma once

#include <cstddef>
#include <span>
#include <vector>

/// The mean of a function of the scattering angle over the sun's disc.
namespace scatter::exact {

/// Mean angular diameter of the sun seen from the Earth [deg].
inline constexpr double sun_diameter_deg = 0.533;

/// Half the arc [rad] that the cone at polar angle t has in common with the disc of radius r about polar
/// angle c, all in radians: pi where the cone lies in the disc, 0 where they do not meet. Half-angle formula
/// of the spherical triangle.
[[nodiscard]] double half_arc(double t, double c, double r);

/// Averages functions f(theta) of the scattering angle over uniform discs on the sphere of directions: the
/// mean at theta is that over all directions within half the diameter of one direction at theta. This is what
/// a sphere in sunlight scatters there. Discs that reach over 0 or 180 deg are no special case.
///
/// f is wanted on a regular grid, of which each disc uses a stretch; the mean is a weighted sum over it.
/// Exact up to rounding for f of degree 0; smooth f with the shortest period p have an error of about
/// 5e-5 (2 pi step / p)^12 of that period's amplitude.
///
/// Method: a cone of half-angle t about the forward direction cuts the disc in an arc of 2 psi(t), so the
/// mean is the integral of f(t) 2 psi(t) sin t dt over the disc's solid angle, with psi from the half-angle
/// formula of the spherical triangle; t = middle - half cos(alpha) makes it smooth in alpha for
/// Gauss-Legendre's rule. Values of f at the rule's nodes come from the grid by 12-point Lagrange
/// interpolation, f being even about 0 and 180 deg.
class SunDisc {
public:
  /// theta_deg: centres, [0, 180], any order. The grid's step is 2.8125 deg / 2^level. coarse_check: apply()
  /// can also use every second point only, for an error estimate.
  /// Throws InputError unless 0 < diameter_deg <= 60 and level is in 0..16.
  SunDisc(std::span<const double> theta_deg, double diameter_deg, int level, bool coarse_check = false);

  /// The coarsest level that resolves |S|^2 of a sphere: 6 points at least in the shortest period of the
  /// angle, which has the frequency 2 (x + 4 x^(1/3) + 2).
  [[nodiscard]] static int level_for(double size_parameter);

  /// Where f is wanted [deg], increasing.
  [[nodiscard]] const std::vector<double>& grid_deg() const { return grid_deg_; }
  /// Number of centres.
  [[nodiscard]] std::size_t size() const { return fine_.size(); }
  /// The mean about centre i of f given at grid_deg().
  [[nodiscard]] double mean(std::size_t i, std::span<const double> f) const;
  /// The same from every second point; only with coarse_check.
  [[nodiscard]] double coarse_mean(std::size_t i, std::span<const double> f) const;

private:
  struct Row {
    std::size_t position = 0; ///< of its first point in grid_deg_
    std::size_t first_weight = 0, count = 0;
  };
  std::vector<double> grid_deg_;
  std::vector<Row> fine_, coarse_;
  std::vector<double> fine_weight_, coarse_weight_;
};

} // namespace scatter::exact
