#pragma once

#include <scatter/exact/extended_functions.hpp>
#include <scatter/exact/long_complex.hpp>

#include <numbers>
#include <type_traits>

/// Internal to scatter::exact: what code needs that is compiled both for long double and for 32 digits
/// (extended_complex.hpp, whose compiler options it needs).
namespace scatter::exact {

/// real of LongComplex, Extended of ExtendedComplex.
template <class Complex>
using RealOf = decltype(Complex::re);

template <class Real>
struct Constants {
  static constexpr Real pi = std::numbers::pi_v<Real>, egamma = std::numbers::egamma_v<Real>,
                        diagonal = 1 / std::numbers::sqrt2_v<Real>; ///< 1 / sqrt(2)
  static constexpr double rounding = real_epsilon / 2;              ///< of one operation, relative
};
template <>
struct Constants<Extended> {
  static constexpr Extended pi = extended_pi, egamma = extended_egamma, diagonal = extended_diagonal;
  static constexpr double rounding = extended_epsilon;
};

/// A double, exactly.
template <class Real>
constexpr Real exactly(double a) {
  if constexpr (std::is_same_v<Real, Extended>)
    return {a, 0};
  else
    return a;
}

/// To long double, for what needs no more: sizes and estimates.
inline real rounded(real a) {
  return a;
}
inline real rounded(const Extended& a) {
  return static_cast<real>(a.hi) + static_cast<real>(a.lo);
}
inline LongComplex rounded(LongComplex a) {
  return a;
}
inline LongComplex rounded(const ExtendedComplex& a) {
  return {rounded(a.re), rounded(a.im)};
}

} // namespace scatter::exact
