#pragma once

#include <cmath>
#include <complex>
#include <limits>

/// Arithmetic of the coefficients, which set all the digits that a result has: long double (a mantissa of 64
/// bits where there is one), and complex numbers without the special cases of std::complex for infinities,
/// which cost more than the arithmetic.
namespace scatter::exact {

using real = long double;
inline constexpr real real_epsilon = std::numeric_limits<real>::epsilon();

struct LongComplex {
  real re = 0, im = 0;
};
inline LongComplex operator+(LongComplex a, LongComplex b) {
  return {a.re + b.re, a.im + b.im};
}
inline LongComplex operator-(LongComplex a, LongComplex b) {
  return {a.re - b.re, a.im - b.im};
}
inline LongComplex operator-(LongComplex a) {
  return {-a.re, -a.im};
}
inline LongComplex operator*(LongComplex a, LongComplex b) {
  return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
inline LongComplex operator*(real a, LongComplex b) {
  return {a * b.re, a * b.im};
}
inline real norm(LongComplex a) {
  return a.re * a.re + a.im * a.im;
}
inline real abs(LongComplex a) {
  return std::sqrt(norm(a)); // a long double's square does not overflow here; hypot costs far more
}
inline LongComplex conj(LongComplex a) {
  return {a.re, -a.im};
}
inline LongComplex inverse(LongComplex a) {
  const real scale = 1 / norm(a);
  return {a.re * scale, -a.im * scale};
}
inline LongComplex operator/(LongComplex a, LongComplex b) {
  return a * inverse(b);
}
/// i a
inline LongComplex times_i(LongComplex a) {
  return {-a.im, a.re};
}
/// The root with Re >= 0.
inline LongComplex sqrt(LongComplex a) {
  const auto root = std::sqrt(std::complex<real>(a.re, a.im));
  return {root.real(), root.imag()};
}

} // namespace scatter::exact
