#pragma once

#include <scatter/exact/extended_complex.hpp>

#include <complex>
#include <span>
#include <vector>

/// Internal to scatter::exact: the Fourier sums over the azimuth in 32 digits, for amplitudes that are what
/// remains when much larger partial waves cancel.
namespace scatter::exact {

/// Coefficients of one order n, from n = 0: T1 and T2 of cos(n theta), T3 of sin(n theta).
struct ExtendedAzimuthWave {
  ExtendedComplex T1, T2, T3;
};

struct ExtendedAzimuthSums {
  std::vector<std::complex<double>> T1, T2, T3; ///< one per angle
};

/// theta in radians, |theta| <= 2 pi. Rounded once from an error of about 2^-104 (12 + 2 n) of sqrt(sum
/// |c_n|^2), n the number of waves. An angle's sums depend on the coefficients and that angle alone, bit for
/// bit. threads = 0: all cores.
[[nodiscard]] ExtendedAzimuthSums
sum_over_azimuth(std::span<const ExtendedAzimuthWave> waves, std::span<const Extended> theta, int threads);

} // namespace scatter::exact
