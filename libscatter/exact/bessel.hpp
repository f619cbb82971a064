#pragma once

#include <scatter/exact/long_complex.hpp>

#include <cstddef>
#include <vector>

/// Bessel functions of integer order in the forms in which they do not cancel. All arguments z enter with
/// Re z >= 0 and Im z >= 0, or by their square, which may then be any number with Im z^2 >= 0: imaginary z
/// (evanescent waves) need nothing special.
namespace scatter::exact {

/// q_n(z) = J_{n+1}(z) / (z J_n(z)) = 1 / (2(n+1) - z^2 q_{n+1}(z)), a function of z^2, at two arguments.
struct BesselRatios {
  std::vector<real> outside;       ///< q_n(z1), n = 0..count-1
  std::vector<LongComplex> inside; ///< q_n(z2)
  /// q_n(z1) - q_n(z2), by a recurrence of its own: it keeps its digits where the two are nearly equal.
  std::vector<LongComplex> difference;
};

/// z1 real; difference = z1^2 - z2^2, which the caller may know to more digits than the squares show.
[[nodiscard]] BesselRatios
bessel_ratios(real z1_squared, LongComplex z2_squared, LongComplex difference, std::size_t count);

/// Where the upward recurrence of H_n(z) = H_n^(1)(z) begins. H_0(z) = value * 2^exponent: it is of size
/// exp(-Im z), beyond the range of any number for an opaque cylinder.
struct HankelStart {
  LongComplex value;
  long exponent = 0;
  LongComplex ratio; ///< H_1(z) / H_0(z)
};

/// z != 0. Relative error of value and ratio: some 1e-19 (long double of 64 bits).
[[nodiscard]] HankelStart hankel_start(LongComplex z);

} // namespace scatter::exact
