#pragma once

#include <vector>

/// What a fibre's cross-section does to light: the azimuthal half of its scattering, per order p: 0 is
/// reflection outside (R), 1 straight through (TT), 2 one reflection inside (TRT). One interface for rays and
/// for waves.
namespace scatter::fiber {

/// Integrals over the azimuth phi of N_p(phi), each finite whatever caustics N_p has.
struct OrderMoments {
  double energy = 0;       ///< integral of N_p over -pi..pi
  double forward = 0;      ///< the same with the weight |phi| / pi
  double forward_half = 0; ///< over pi/2 <= |phi| <= pi
};

/// N_p(phi) [1/rad]: light into the azimuth phi (0 back toward the light, pi straight on) as a share of what
/// falls on the cross-section; unpolarised. theta_d [rad], |theta_d| < pi/2, InputError otherwise: the
/// inclination for which the optics is taken, half the difference of the directions'. Objects do not change:
/// they may be used by many threads.
class CrossSection {
public:
  virtual ~CrossSection() = default;

  /// Even in phi. At a caustic, where the rays' density has no bound, +infinity only if phi is on it to the
  /// last bit.
  [[nodiscard]] virtual double distribution(int order, double theta_d, double phi) const = 0;
  [[nodiscard]] virtual OrderMoments moments(int order, double theta_d) const = 0;
  /// All orders from first_order to infinity together; without absorption moments(0..n-1) and residual(n)
  /// of rays have energies that add up to 1. Those of waves do not: they diffract as well, and interfere.
  [[nodiscard]] virtual OrderMoments residual(int first_order, double theta_d) const = 0;
  /// Azimuths [rad], 0..pi, where N_p has a caustic; increasing, empty if none.
  [[nodiscard]] virtual std::vector<double> caustics(int order, double theta_d) const = 0;
};

} // namespace scatter::fiber
