#pragma once

#include <scatter/phase/request.hpp>
#include <scatter/phase/truncation.hpp>

#include <array>
#include <complex>
#include <span>
#include <vector>

/// How wrong a table made with rays is.
namespace scatter::phase {

/// Width of the dissertation's Gaussian diffraction filter [deg] for a drop's radius: table 3.3, linear
/// between its rows 0.1 .. 1.0 mm; beyond them it goes on as radius^(-2/3), as Airy's theory and the table
/// itself do.
[[nodiscard]] double gaussian_filter_width_deg(double radius_m);

/// Predicts relative errors of the intensity averaged over the sun's disc, per scattering angle, at one
/// wavelength: root of the sum of squares of
/// - what leaving orders out costs, on the exact sphere of equal volume (Truncation), at bows shifted as the
///   drop's may be;
/// - what the method costs, as measured on spheres against exact theory, per region of scattering angle and
///   radius (tables/accuracy, from `scatter validate`);
/// - what the spacing of rays costs.
/// Errors of single tables without the sun's disc are larger where fringes are finer than it.
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
  std::vector<double> in_tables_; ///< error of table_orders
};

[[nodiscard]] double root_mean_square(std::span<const double> values);

} // namespace scatter::phase
