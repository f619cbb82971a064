#pragma once

#include <fftw3.h>

#include <vector>

/// Internal to scatter::wavefront: Fourier transforms from any places to any frequencies (type 3), through a
/// grid and an FFT, with Kaiser-Bessel kernels of six points; good to 1e-5 of the largest amplitude.
namespace scatter::wavefront {

constexpr int taps = 6, tap_degree = 12; ///< TAPS, TAP_DEGREE in kernels/kirchhoff.cl
constexpr double oversampling = 2;       ///< of both grids

/// The Kaiser-Bessel kernel's shape for this oversampling (Jackson et al. 1991, IEEE Trans. Med. Imaging 10,
/// 473).
constexpr double tap_shape = 3.14159265358979323846 * taps * (1 - 1 / (2 * oversampling));

/// Taps at the six grid points around a place as polynomials in z = 2 (first - place) - 1, first the first
/// grid point at place or beyond: [tap][power].
[[nodiscard]] const std::vector<double>& tap_polynomials();

/// Fourier transform of that kernel at xi, |xi| < 2 tap_shape / taps.
[[nodiscard]] double tap_transform(double xi);

/// tap_transform(xi) = tap_shape' / y sinh(y) as kernels compute its inverse: y / (exp(y) - exp(-y)) times
/// this.
[[nodiscard]] double inverse_transform_scale();

/// The sign and transform that spreading onto `points` points puts on modes -modes..modes.
[[nodiscard]] std::vector<double> mode_corrections(int modes, int points);

/// The next even number from `at_least` on (16 at the least) whose prime factors are 2, 3 and 5.
[[nodiscard]] int quick_size(double at_least);

/// Forward transforms in place over [y][x][8], four complex numbers with their real parts before their
/// imaginary ones.
class GridTransform {
public:
  /// For this size and data of this alignment; `data` keeps its values. Throws RunError.
  GridTransform(int nx, int ny, double* data);
  ~GridTransform();
  GridTransform(const GridTransform&) = delete;
  GridTransform& operator=(const GridTransform&) = delete;
  void run(double* data) const;

private:
  fftw_plan plan_;
};

} // namespace scatter::wavefront
