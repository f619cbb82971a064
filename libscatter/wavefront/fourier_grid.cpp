#include <scatter/optics/errors.hpp>
#include <scatter/optics/fftw_planner.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/fourier_grid.hpp>

#include <fftw3.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <string>

namespace scatter::wavefront {
namespace {

std::vector<double> make_tap_polynomials() {
  constexpr int terms = tap_degree + 1;
  std::vector<double> coefficients;
  for (int tap = 0; tap < taps; ++tap) {
    // Interpolation in Chebyshev points, then monomials; |z| <= 1 keeps that well-conditioned for so few
    // terms.
    std::array<double, terms> value{}, chebyshev{}, monomial{};
    for (int i = 0; i < terms; ++i) {
      const double z = std::cos(pi * (i + 0.5) / terms), t = -0.5 * taps + tap + 0.5 * (z + 1);
      const double s = 1 - 4 * t * t / (taps * taps);
      value[i] =
          std::cyl_bessel_i(0.0, tap_shape * std::sqrt(std::max(s, 0.0))) / std::cyl_bessel_i(0.0, tap_shape);
    }
    for (int n = 0; n < terms; ++n) {
      for (int i = 0; i < terms; ++i) chebyshev[n] += value[i] * std::cos(pi * n * (i + 0.5) / terms);
      chebyshev[n] *= (n == 0 ? 1.0 : 2.0) / terms;
    }
    std::array<double, terms> before{}, current{};
    before[0] = 1; // T_0
    current[1] = 1;
    for (int i = 0; i < terms; ++i) monomial[i] = chebyshev[0] * before[i] + chebyshev[1] * current[i];
    for (int n = 2; n < terms; ++n) {
      std::array<double, terms> next{};
      for (int i = 0; i + 1 < terms; ++i) next[i + 1] = 2 * current[i];
      for (int i = 0; i < terms; ++i) next[i] -= before[i];
      for (int i = 0; i < terms; ++i) monomial[i] += chebyshev[n] * next[i];
      before = current;
      current = next;
    }
    coefficients.insert(coefficients.end(), monomial.begin(), monomial.end());
  }
  return coefficients;
}

} // namespace

const std::vector<double>& tap_polynomials() {
  static const std::vector<double> polynomials = make_tap_polynomials();
  return polynomials;
}

double tap_transform(double xi) {
  const double y = std::sqrt(tap_shape * tap_shape - 0.25 * taps * taps * xi * xi);
  return taps / std::cyl_bessel_i(0.0, tap_shape) * std::sinh(y) / y;
}

double inverse_transform_scale() {
  return 2 * std::cyl_bessel_i(0.0, tap_shape) / taps;
}

std::vector<double> mode_corrections(int modes, int points) {
  std::vector<double> corrections;
  for (int m = -modes; m <= modes; ++m)
    corrections.push_back((m % 2 == 0 ? 1 : -1) / tap_transform(2 * pi * m / points));
  return corrections;
}

int quick_size(double at_least) {
  for (int n = std::max(2 * static_cast<int>(std::ceil(at_least / 2)), 16);; n += 2) {
    int rest = n;
    for (const int factor : {2, 3, 5})
      while (rest % factor == 0) rest /= factor;
    if (rest == 1) return n;
  }
}

GridTransform::GridTransform(int nx, int ny, double* data) {
  const fftw_iodim64 dimensions[] = {{ny, 8 * nx, 8 * nx}, {nx, 8, 8}}, four[] = {{4, 1, 1}};
  const std::lock_guard lock(fftw_planner());
  // Not measured: the same plan, and so the same bits, every time.
  plan_ = fftw_plan_guru64_split_dft(2, dimensions, 1, four, data, data + 4, data, data + 4, FFTW_ESTIMATE);
  if (plan_ == nullptr)
    throw RunError("FFTW found no plan for " + std::to_string(nx) + " x " + std::to_string(ny));
}

GridTransform::~GridTransform() {
  const std::lock_guard lock(fftw_planner());
  fftw_destroy_plan(plan_);
}

void GridTransform::run(double* data) const {
  fftw_execute_split_dft(plan_, data, data + 4, data, data + 4);
}

} // namespace scatter::wavefront
