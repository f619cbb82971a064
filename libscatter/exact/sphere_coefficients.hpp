#pragma once

#include <scatter/exact/extended_partial_waves.hpp>
#include <scatter/exact/partial_waves.hpp>

#include <complex>

/// Internal to scatter::exact: all of Lorenz-Mie that does not depend on the angle.
namespace scatter::exact {

struct SphereCoefficients {
  PartialWaves waves;
  double Qext = 0, Qsca = 0, Qabs = 0, Qback = 0, g = 0;
  /// Of a_n and b_n, against the largest of them, before they are rounded: noticed on the narrowest
  /// resonances alone.
  double relative_error = 0;
  double back_error = 0; ///< of Qback, relative
};

/// For arguments that check_sphere() lets pass, and |m| >= 1e-6. exact: where the coefficients go with 32
/// digits, or nowhere; with them Qback has all its digits too, however much its partial waves cancel. The
/// same bits on every machine.
[[nodiscard]] SphereCoefficients
sphere_coefficients(double x, std::complex<double> m, ExtendedWaves* exact = nullptr);

} // namespace scatter::exact
