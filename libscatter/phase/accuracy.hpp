#pragma once

#include <scatter/phase/request.hpp>
#include <scatter/phase/truncation.hpp>

#include <array>
#include <complex>
#include <span>
#include <vector>

/// Guesses how wrong a table made with rays will be.
namespace scatter::phase {

/// Width of the dissertation's Gaussian diffraction filter [deg] for a drop's radius: table 3.3, linear
/// between its rows 0.1 .. 1.0 mm; beyond them it goes on as radius^(-2/3), as Airy's theory and the table
/// itself do.
[[nodiscard]] double gaussian_filter_width_deg(double radius_m);

/// How far a drop's bows may lie from the sphere's [deg]: Moebius's shift of the primary (Moebius 1910), for
/// its axis ratio; 15 at most.
[[nodiscard]] double bow_shift_deg(const drop::Shape& shape);

/// Guesses relative errors of the intensity averaged over the sun's disc, per scattering angle, at one
/// wavelength, for many settings at once: it ranks them, and SphereTrial judges the one that is chosen. Root
/// of the sum of squares of
/// - what leaving orders out costs, on the exact sphere of equal volume (Truncation), at bows shifted as the
///   drop's may be; orders of small drops that the integral cannot make count as left out;
/// - what the method costs, as measured on spheres of water against exact theory, per region of scattering
///   angle and radius (tables/accuracy, from `scatter validate`); without the integral also the forward peak,
///   which is then absent;
/// - what the spacing of rays costs where patches carry light: with the integral, away from bows and grazing
///   rays.
///
/// What is the same for all settings is left out: the cross section by rays, edges of drops that hardly bend
/// light, the average over the disc. It overestimates errors of drops that absorb, whose bows are faint.
class ErrorModel {
public:
  /// last_order: the highest that estimate() may be asked about.
  ErrorModel(const Request& request, double wavelength_m, std::complex<double> index, int last_order);

  /// [theta], of the request's angles.
  [[nodiscard]] std::vector<double>
  estimate(Diffraction diffraction, int rays, std::span<const int> orders) const;

private:
  /// Of the runs behind tables/accuracy/patches.csv.
  static constexpr std::array<int, 4> table_orders{0, 1, 2, 3};
  double radius_m_;
  std::vector<double> theta_deg_;
  double size_parameter_;
  Truncation truncation_;
  std::vector<double> in_tables_;               ///< error of table_orders
  std::vector<std::vector<double>> by_patches_; ///< [order]: share of the light, with the integral
  std::vector<double> no_peak_;                 ///< of leaving forward diffraction out
};

[[nodiscard]] double root_mean_square(std::span<const double> values);

} // namespace scatter::phase
