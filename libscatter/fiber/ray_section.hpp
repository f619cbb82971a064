#pragma once

#include <scatter/fiber/cross_section.hpp>

namespace scatter::fiber {

/// How reflections follow each other for light that is unpolarised when it comes.
enum class Polarisation {
  mean,   ///< every reflection takes the mean of both polarisations, as models of hair do
  tracked ///< each ray's Jones matrix, with the turn of the plane of incidence: what waves tend to
};

/// A ray that leaves toward the azimuth asked for.
struct RayEvent {
  double offset = 0;        ///< h, where it came in, -1..1 in radii
  double cos_incidence = 0; ///< cosine of gamma_i = asin h, in the plane across
  double cos_refracted = 0; ///< cosine of gamma_t = asin(h / eta'), in the plane across
  double spread = 0;        ///< 1 / |2 d phi / d h| [1/rad]; grows without bound at a caustic
  double attenuation = 0;   ///< A_p: what Fresnel and absorption leave of it
};

/// Ray optics of a smooth dielectric cylinder of circular section.
///
/// With theta_d the section is seen as a circle of index eta' = sqrt(eta^2 - sin^2 theta_d) / cos theta_d
/// (Bravais); a ray at the offset h leaves, after p - 1 reflections inside, at the azimuth
///   phi_p(h) = 2 p asin(h / eta') - 2 asin h + p pi,
/// with A_p = (1-F)^2 F^(p-1) exp(-p sigma_a 2 cos gamma_t / cos theta_t), A_0 = F, where F is Fresnel's
/// exact value for the cosine cos theta_d cos gamma_i; N_p is the sum of A_p / |2 d phi_p / d h| over the
/// rays. Source: Marschner et al. (2003), whose path length, printed 2 (1 + cos 2 gamma_t), is 2 cos gamma_t
/// here.
///
/// Accuracy: N_p relative 1e-12, also near caustics as long as phi is 1e-6 rad or more away, and near the
/// rim of the lit azimuths as long as phi is; both change within one rounding of phi or theta_d by more when
/// nearer. Energies 1e-13 of 1. Moments of the residual, which sum orders one by one: 1e-9.
///
/// All functions throw InputError for |theta_d| >= pi/2 or not finite, phi not finite, and orders outside
/// 0..1000.
class RaySection final : public CrossSection {
public:
  /// eta: index of refraction over the surroundings', > 1. sigma_a: absorption per radius, >= 0. Throws
  /// InputError otherwise.
  RaySection(double eta, double sigma_a, Polarisation polarisation = Polarisation::mean);

  [[nodiscard]] double distribution(int order, double theta_d, double phi) const override;
  /// Of distribution(), relative, one rounding of phi included: 1e-12, or 1e-15 over the distance
  /// of phi to the nearest caustic or rim of the lit azimuths [rad] if that is more, but not above 1.
  [[nodiscard]] double error_estimate(int order, double theta_d, double phi) const;
  [[nodiscard]] OrderMoments moments(int order, double theta_d) const override;
  [[nodiscard]] OrderMoments residual(int first_order, double theta_d) const override;
  /// residual()'s energy alone, thirty times faster.
  [[nodiscard]] double residual_energy(int first_order, double theta_d) const;
  /// None for orders 0 and 1; one for p >= 2 while eta' <= p: where (p^2 - 1) h^2 = p^2 - eta'^2.
  [[nodiscard]] std::vector<double> caustics(int order, double theta_d) const override;

  /// Every ray of this order toward phi. For p >= 2 each piece of phi_p(h) between its stationary points and
  /// the rims is concave or convex, so that Newton's method from the piece's outer end cannot miss.
  [[nodiscard]] std::vector<RayEvent> events(int order, double theta_d, double phi) const;
  /// Integral of N_p over from <= phi <= to, for -pi <= from <= to <= pi, whatever caustics lie within.
  [[nodiscard]] double energy_between(int order, double theta_d, double from, double to) const;
  /// N_p averaged over azimuth by a Gaussian of this standard deviation [rad], 1e-3..10: finite at caustics.
  /// Relative to the largest value 1e-10.
  [[nodiscard]] double averaged(int order, double theta_d, double phi, double width) const;

  [[nodiscard]] double eta() const { return eta_; }
  [[nodiscard]] double sigma_a() const { return sigma_a_; }
  [[nodiscard]] Polarisation polarisation() const { return polarisation_; }

private:
  double eta_, sigma_a_;
  Polarisation polarisation_;
};

/// eta' = sqrt(eta^2 - sin^2 theta_d) / cos theta_d, relative 1e-15 however near theta_d is to pi/2.
[[nodiscard]] double bravais_index(double eta, double theta_d);

} // namespace scatter::fiber
