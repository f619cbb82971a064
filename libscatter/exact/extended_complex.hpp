#pragma once

#include <scatter/exact/double_double.hpp>

#include <cmath>

/// Internal to scatter::exact: real and complex numbers of 32 digits. As double_double.hpp, only for sources
/// compiled with -ffp-contract=off.
namespace scatter::exact {

using Extended = DoubleDouble<double>;
inline constexpr double extended_epsilon = 0x1p-104;

inline Extended number(double a) {
  return {a, 0};
}

struct ExtendedComplex {
  Extended re, im;
};
inline ExtendedComplex operator+(const ExtendedComplex& a, const ExtendedComplex& b) {
  return {a.re + b.re, a.im + b.im};
}
inline ExtendedComplex operator-(const ExtendedComplex& a, const ExtendedComplex& b) {
  return {a.re - b.re, a.im - b.im};
}
inline ExtendedComplex operator-(const ExtendedComplex& a) {
  return {-a.re, -a.im};
}
inline ExtendedComplex operator*(const ExtendedComplex& a, const ExtendedComplex& b) {
  return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
inline ExtendedComplex operator*(const Extended& a, const ExtendedComplex& b) {
  return {a * b.re, a * b.im};
}
inline ExtendedComplex times(const ExtendedComplex& a, double b) {
  return {times(a.re, b), times(a.im, b)};
}
inline Extended inverse(const Extended& a) {
  return number(1) / a;
}
inline ExtendedComplex inverse(const ExtendedComplex& a) {
  const Extended scale = inverse(a.re * a.re + a.im * a.im);
  return {scale * a.re, -(scale * a.im)};
}
/// a times 2^exponent; 0 where that is too small to matter to anything it could be added to.
inline ExtendedComplex scaled(const ExtendedComplex& a, double power) {
  return {{a.re.hi * power, a.re.lo * power}, {a.im.hi * power, a.im.lo * power}};
}
inline ExtendedComplex operator/(const ExtendedComplex& a, const ExtendedComplex& b) {
  return a * inverse(b);
}
/// i a
inline ExtendedComplex times_i(const ExtendedComplex& a) {
  return {-a.im, a.re};
}
/// |a|^2
inline Extended norm(const ExtendedComplex& a) {
  return a.re * a.re + a.im * a.im;
}
inline double abs(const ExtendedComplex& a) {
  return std::hypot(a.re.hi, a.im.hi);
}

} // namespace scatter::exact
