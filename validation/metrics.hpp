#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

/// How far one curve over scattering angle is from another.
namespace scatter::validation {

/// The sun's mean angular diameter, 31.99 arcmin [deg].
inline constexpr double sun_diameter_deg = 31.99 / 60;

/// Scattering angles in [from, to] degrees.
struct Region {
  double from_deg = 0, to_deg = 0;
  [[nodiscard]] std::string name() const; ///< "130..137"
};

/// Forward peak, what is next to it, sky between peak and bows, secondary bow, Alexander's band, primary bow,
/// the rest up to the glory (which begins at 178 deg and which rays do not know).
[[nodiscard]] const std::vector<Region>& regions();

/// An even grid of scattering angles, from 0 to 180 degrees or a part of that, both ends included.
struct ThetaGrid {
  double step_deg = 0;
  std::vector<double> theta_deg;
};

/// Four or more angles per period of the ripple, which is 180 deg / x in theta, and at least `coarsest_deg`.
/// Ends are multiples of half a degree.
[[nodiscard]] ThetaGrid
ripple_grid(double largest_size_parameter, double coarsest_deg, double from_deg = 0, double to_deg = 180);

/// Intensity of unpolarised light and what it is polarised by, in units that both sides share.
struct Curve {
  std::vector<double> s11, s12;
};

/// Average over a uniform disc of this diameter across the scattering angle: chords of the disc as weights,
/// each integrated exactly over the grid's cells. The curve is continued evenly beyond its ends, which is
/// right at 0 and 180 deg: elsewhere keep half a disc away from them. A chord is taken as straight in theta:
/// wrong by diameter^2 / 16 / tan(theta) of theta, 2e-4 deg at 5 deg from a pole.
[[nodiscard]] std::vector<double>
average_disc(std::span<const double> values, double step_deg, double diameter_deg);
[[nodiscard]] Curve average_disc(const Curve& curve, double step_deg, double diameter_deg);

/// Errors of the intensity relative to the truth, angle by angle, and of the degree of linear polarisation
/// -S12 / S11, over one region.
struct Errors {
  double rms = 0;              ///< root of the mean square relative error
  double largest = 0;          ///< largest relative error, without sign
  double bias = 0;             ///< mean relative error: positive when too bright
  double rms_over_mean = 0;    ///< rms difference over the mean intensity: deep minima do not dominate it
  double polarisation_rms = 0; ///< rms difference of the degree of polarisation
  double polarisation_largest = 0;
  std::size_t angles = 0;
};

/// Both curves on the same even grid. Throws std::invalid_argument when the sizes differ, the
/// region holds no angle, or the truth is not positive there.
[[nodiscard]] Errors
compare(const Curve& computed, const Curve& truth, const ThetaGrid& grid, const Region& region);

/// Root of the mean of squares.
[[nodiscard]] double root_mean_square(std::span<const double> values);

} // namespace scatter::validation
