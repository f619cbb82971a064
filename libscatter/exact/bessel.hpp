#pragma once

#include <scatter/exact/precision.hpp>

#include <cstddef>
#include <vector>

/// Bessel functions of integer order in the forms in which they do not cancel. All arguments z enter with
/// Re z >= 0 and Im z >= 0, or by their square, which may then be any number with Im z^2 >= 0: imaginary z
/// (evanescent waves) need nothing special. Complex: LongComplex or ExtendedComplex.
namespace scatter::exact {

/// q_n(z) = J_{n+1}(z) / (z J_n(z)) = 1 / (2(n+1) - z^2 q_{n+1}(z)), a function of z^2, at two arguments.
template <class Complex>
struct BesselRatios {
  std::vector<RealOf<Complex>> outside; ///< q_n(z1), n = 0..count-1
  std::vector<Complex> inside;          ///< q_n(z2)
  /// q_n(z1) - q_n(z2), by a recurrence of its own: it keeps its digits where the two are nearly equal.
  std::vector<Complex> difference;
};

/// z1 real; difference = z1^2 - z2^2, which the caller may know to more digits than the squares show.
template <class Complex>
[[nodiscard]] BesselRatios<Complex> bessel_ratios(
    const RealOf<Complex>& z1_squared, const Complex& z2_squared, const Complex& difference,
    std::size_t count);

/// Where the upward recurrence of H_n(z) = H_n^(1)(z) begins. H_0(z) = value * 2^exponent: it is of size
/// exp(-Im z), beyond the range of any number for an opaque cylinder.
template <class Complex>
struct HankelStart {
  Complex value;
  long exponent = 0;
  Complex ratio; ///< H_1(z) / H_0(z)
};

/// z != 0. Relative error of value and ratio: some 1e-19 (long double of 64 bits), 1e-30 in 32 digits.
template <class Complex>
[[nodiscard]] HankelStart<Complex> hankel_start(const Complex& z);

} // namespace scatter::exact
