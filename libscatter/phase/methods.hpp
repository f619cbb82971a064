#pragma once

#include <scatter/phase/job.hpp>

/// The two ways to compute a table, behind plan() and run().
namespace scatter::phase {

/// Width of the dissertation's Gaussian diffraction filter [deg] for a drop's radius: table 3.3, linear
/// between its rows 0.1 .. 1.0 mm; beyond them it goes on as radius^(-2/3), as Airy's theory and the table
/// itself do.
[[nodiscard]] double gaussian_filter_width_deg(double radius_m);

/// Relative rms error of the sun-disc averaged intensity that the patches method made on spheres against
/// Lorenz-Mie, per region of scattering angle, interpolated in the logarithm of the radius
/// (tables/accuracy/patches.csv, from `scatter validate`). theta in degrees. Between the regions and beyond
/// 178 deg: the larger neighbour, at least 1.
[[nodiscard]] double patches_error_estimate(double radius_m, Diffraction diffraction, double theta_deg);

/// The same of the diffraction integral (tables/accuracy/integral.csv): of orders 0..8 if they are all there,
/// else of 0..3; 1 where those are not, either, and outside the angles that were compared.
[[nodiscard]] double
integral_error_estimate(double radius_m, const std::vector<int>& orders, double theta_deg);

/// The index that a request asks for at one wavelength, with its switches applied.
[[nodiscard]] std::complex<double> index_at(const Request& request, double wavelength_m);

[[nodiscard]] wavefront::Tracing tracing_of(const Request& request);
[[nodiscard]] wavefront::Wanted wanted_of(const Request& request);

void run_patches(const Plan& plan, table::Sink& sink, const Progress& progress);
void run_mie(const Plan& plan, table::Sink& sink, const Progress& progress);

} // namespace scatter::phase
