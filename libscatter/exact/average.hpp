#pragma once

#include <complex>
#include <cstddef>
#include <functional>
#include <vector>

/// Averages of the exact sphere: over sizes, over a band of wavelengths, over the sun's disc, or any of them
/// together. What spheres scatter independently adds as cross sections, not as amplitudes.
namespace scatter::exact {

/// Which radii there are, and how many of each: a list, or a density.
struct Radii {
  /// A list [m] with numbers of spheres in any unit; where it is not empty the rest does not count.
  std::vector<double> radius_m, number;
  /// Otherwise: spheres per metre of radius, as a share of all spheres (its integral over all radii is 1),
  /// for smallest_m <= radius <= largest_m. What is left out beyond them counts as spheres without effect.
  std::function<double(double)> density;
  double smallest_m = 0, largest_m = 0;
  /// Whether r^3 density(r) has faded to nothing at the two ends; if not, the ends are treated as edges.
  bool fades = true;
};

/// Wavelengths in vacuum [m]: one (first = last), or a band with a weight per metre of wavelength.
struct Band {
  double first_m = 0, last_m = 0;
  std::function<double(double)> weight; ///< positive, any unit, smooth; empty: all alike
};

struct AverageRequest {
  Radii radii;
  Band band;
  std::function<std::complex<double>(double)> index; ///< by wavelength in vacuum [m]
  double sun_disc_deg = 0;                           ///< angular diameter; 0: a point
  std::vector<double> theta_deg;                     ///< [0, 180], any order
  /// Wanted error: of the matrix elements against S11 of the same angle, and of the bulk.
  double tolerance = 1e-3;
  std::size_t most_spheres = 200000; ///< stop there, even if the tolerance is not reached
  int threads = 0;                   ///< 0: all cores; results do not depend on it, bit for bit
  /// Told after every refinement: spheres so far and the error estimate (infinite before there is one).
  std::function<void(std::size_t, double)> progress;
};

struct Average {
  double C_ext = 0, C_sca = 0, C_abs = 0; ///< mean cross sections per sphere [m^2]
  double Q_ext = 0, Q_sca = 0, Q_abs = 0; ///< over the mean geometric cross section
  double g = 0;                           ///< mean cosine, weighted with the scattered power
  double geometric_m2 = 0;                ///< mean of pi r^2
  /// Hansen & Travis (1974), eqs. 2.53, 2.54: <r^3>/<r^2> [m] and <(r - r_eff)^2 r^2>/(r_eff^2 <r^2>).
  double effective_radius_m = 0, effective_variance = 0;
  /// Bulk: relative error of the cross sections, absolute error of g.
  double bulk_error = 0;
  /// sr^-1 and per asked angle: the mean Mueller matrix, normalised so that S11 (the phase function) has the
  /// integral 1 over the sphere. Bohren & Huffman (1983), eq. 4.77: S22 = S11, S44 = S33, S43 = -S34. Over
  /// the sun's disc each direction counts with its own scattering plane: within about a diameter of 0 and 180
  /// deg, where these planes turn, S12, S33 and S34 are not those of one fixed plane.
  std::vector<double> S11, S12, S33, S34;
  /// Error of any of the four, as a share of S11, per asked angle.
  std::vector<double> error_estimate;
  double largest_error = 0; ///< largest of error_estimate and bulk_error
  std::size_t spheres = 0;  ///< how many were computed
  bool converged = false;   ///< largest_error <= tolerance
};

/// Averages sphere by sphere with exact::mie_at_degrees.
///
/// Method: the radius runs along ln r where a density fades at both ends, and the trapezoid rule converges
/// faster than any power once it resolves the ripple; edges (a cut density, a band of wavelengths) are first
/// smoothed by Sidi's substitution t - sin(2 pi t) / (2 pi). Radius and wavelength together take a rank-1
/// lattice (generator 461943), so that the two are resolved with one set of points and not with their
/// product. Points double until the interleaved halves agree to the tolerance; then a third set, shifted by
/// an irrational share of the step, must agree with their mean. The third set sees the ripple that happens to
/// be in step with both halves. Before the ripple is resolved the sets behave like independent samples.
///
/// Error estimate: the larger of both disagreements at the angle, or its root mean square over 17
/// neighbouring angles if that is larger, so that no angle agrees by chance (angles between are added where
/// few are asked for); plus what the spheres' own estimates and the sun's disc say. In tests against direct
/// quadrature it stayed above the error.
///
/// Cost: spheres x (coefficients + partial waves x angles). Transparent spheres have resonances far narrower
/// than the ripple, which the error at the worst angle (near 90 and 180 deg) must wait for: a log-normal of
/// median 5 um and sigma 1.2 at 600 nm (x up to 156) takes 3e3 spheres for 2 % at every angle of 0:180:1deg,
/// 1.2e4 for 0.7 %, 5e4 for 0.2 %; cross sections and g are then good to 1e-4. With a sun's disc the angles
/// are those of a grid fine enough for the largest ripple of each sphere (SunDisc).
///
/// Throws InputError for empty or impossible radii, bands, angles, tolerance outside [1e-10, 1], size
/// parameters outside what mie() takes, and what index and SunDisc throw.
[[nodiscard]] Average average(const AverageRequest& request);

} // namespace scatter::exact
