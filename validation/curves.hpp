#pragma once

#include "metrics.hpp"
#include <scatter/optics/refractive_index.hpp>
#include <scatter/phase/request.hpp>

#include <functional>
#include <string>
#include <vector>

/// Differential scattering cross sections of spheres, by rays and exactly, in one unit: the geometric cross
/// section pi a^2 per steradian. Unlike phase functions they do not mix the error of the total cross section
/// into that of the shape.
namespace scatter::validation {

/// done in [0, 1].
using Progress = std::function<void(double done)>;

struct Curves {
  std::vector<Curve> curves;                 ///< one per wavelength
  std::vector<double> scattering_efficiency; ///< total cross section over pi a^2, per wavelength
  std::vector<double> seconds;               ///< wall time per wavelength
};

/// Lorenz-Mie. Wavelengths one after the other, each on all threads.
[[nodiscard]] Curves exact_sphere(
    double radius_m, const std::vector<double>& wavelength_m, const IndexSource& index, const ThetaGrid& grid,
    int threads, const Progress& progress = {});

/// A sphere traced as any drop, one azimuth. The job runs wavelengths together: their time is the job's,
/// shared evenly, without the compilation of kernels.
[[nodiscard]] Curves
traced_sphere(phase::Request request, const ThetaGrid& grid, const Progress& progress = {});

} // namespace scatter::validation
