#pragma once

#include <scatter/exact/extended_complex.hpp>

/// Internal to scatter::exact: constants and elementary functions of 32 digits.
namespace scatter::exact {

inline constexpr Extended extended_pi{3.141592653589793116, 1.224646799147353207e-16};
/// Euler's constant.
inline constexpr Extended extended_egamma{5.772156649015328655e-01, -4.942915152430645e-18};
/// 1 / sqrt(2)
inline constexpr Extended extended_diagonal{7.071067811865475727e-01, -4.833646656726456726e-17};

/// sin and cos, to 1e-31 absolutely for |a| up to 1e8.
struct SineCosine {
  Extended sine, cosine;
};
[[nodiscard]] SineCosine sine_cosine(Extended a);

/// exp(-a) = value * 2^exponent, to 1e-33 (40 + |a|) relatively.
struct ScaledExtended {
  Extended value;
  long exponent = 0;
};
[[nodiscard]] ScaledExtended exponential_of_minus(Extended a);

/// The root with Re >= 0, to 1e-31 relatively; 0 of 0.
[[nodiscard]] ExtendedComplex sqrt(const ExtendedComplex& a);

/// The logarithm with |Im| <= pi, to 1e-31 (1 + |log a|) absolutely; a != 0, 1e-300 < |a| < 1e300.
[[nodiscard]] ExtendedComplex log(const ExtendedComplex& a);

} // namespace scatter::exact
