#pragma once

#include <scatter/fiber/cross_section.hpp>

#include <vector>

namespace scatter::fiber {

/// Rays through a smooth dielectric cylinder of elliptical section, such as human hair's, traced one by one.
///
/// The section has no symmetry about the light's direction, so its functions take the azimuth of the light,
/// phi_i, from the long axis [rad, any], and are not even in phi; phi is as elsewhere, the azimuth of the
/// view less phi_i: 0 back toward the light. It is therefore no CrossSection. As for a circle, directions
/// across see the index eta' = sqrt(eta^2 - sin^2 theta_d) / cos theta_d whatever the section (Bravais), and
/// Fresnel's values are those in three dimensions, the mean of both polarisations at every surface. Unlike in
/// a circle, light inside may be reflected totally. Lengths are in units of the radius of the circle of the
/// same area. N is the share of what falls on the section, as wide as it looks from phi_i.
///
/// Reciprocity: width(phi_i) N(phi_i -> phi_o) = width(phi_o) N(phi_o -> phi_i), each order.
///
/// Accuracy, orders up to 8: N_p relative 1e-12 and what one rounding of the inputs to long double does to
/// it: beside a caustic about 1e-19 / |phi - caustic| for each surface. Moments 1e-12 of the order's energy.
/// With the energies of the orders before, residual_energy adds up to 1 to 1e-12 without absorption; with it,
/// it is the sum of its orders to 1e-10. Rays that pass the foci are spread (1 + e) / (1 - e) times wider at
/// every chord, e the eccentricity: what is narrower than rounding after many chords is lost, and small.
///
/// All functions throw InputError for |theta_d| >= pi/2, azimuths that are not finite and orders outside
/// 0..64.
class EllipticalSection {
public:
  /// axis_ratio: short axis over long axis, 0.1..1. eta > 1, sigma_a >= 0 (per radius). Throws InputError.
  EllipticalSection(double eta, double sigma_a, double axis_ratio);

  [[nodiscard]] double distribution(int order, double theta_d, double phi_i, double phi) const;
  /// The weight of `forward` is |phi| / pi, that of forward_half 1 where |phi| >= pi/2.
  [[nodiscard]] OrderMoments moments(int order, double theta_d, double phi_i) const;
  /// Of all orders from first_order on. With the energies of the orders before it adds up to 1 without
  /// absorption.
  [[nodiscard]] double residual_energy(int first_order, double theta_d, double phi_i) const;
  /// Azimuths phi, -pi..pi, where N_p has a caustic; increasing.
  [[nodiscard]] std::vector<double> caustics(int order, double theta_d, double phi_i) const;
  /// Half the width that the section shows toward phi_i, in radii of the circle of the same area.
  [[nodiscard]] double width(double phi_i) const;

private:
  double eta_, sigma_a_, axis_ratio_;
};

} // namespace scatter::fiber
