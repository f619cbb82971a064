#include <scatter/exact/extended_functions.hpp>

#include <cmath>
#include <complex>

namespace scatter::exact {

SineCosine sine_cosine(Extended a) {
  // Off by k quarter turns, in three parts (the third of pi / 2 is -1.5e-33).
  const double k = std::nearbyint(a.hi / (extended_pi.hi / 2));
  Extended r = a - times(Extended{extended_pi.hi / 2, 0}, k);
  r = r - times(Extended{extended_pi.lo / 2, 0}, k);
  r = r - Extended{-1.497384904859169777e-33 * k, 0};
  // Taylor's series; |r| <= pi / 4: 28! 1e-30 stands for 32 digits.
  const Extended square = r * r;
  Extended sine = r, cosine{1, 0}, sine_term = r, cosine_term{1, 0};
  for (int i = 1; i <= 14; ++i) {
    cosine_term = -(cosine_term * square / Extended{(2.0 * i - 1) * (2.0 * i), 0});
    sine_term = -(sine_term * square / Extended{(2.0 * i) * (2.0 * i + 1), 0});
    cosine = cosine + cosine_term;
    sine = sine + sine_term;
  }
  switch (static_cast<long long>(k) & 3) {
  case 0:
    return {sine, cosine};
  case 1:
    return {cosine, -sine};
  case 2:
    return {-sine, -cosine};
  default:
    return {-cosine, sine};
  }
}

ScaledExtended exponential_of_minus(Extended a) {
  constexpr Extended log_2{6.931471805599452862e-01, 2.319046813846299558e-17};
  const double k = std::nearbyint(a.hi / log_2.hi);
  Extended r = times(Extended{log_2.hi, 0}, k) - a;
  r = r + times(Extended{log_2.lo, 0}, k);
  Extended sum = number(1), term = number(1);
  for (int i = 1; i <= 26; ++i) { // |r| <= 0.35
    term = term * r / number(i);
    sum = sum + term;
  }
  return {sum, -static_cast<long>(k)};
}

// Newton's method doubles the digits of a double: one step.

ExtendedComplex sqrt(const ExtendedComplex& a) {
  const auto near = std::sqrt(std::complex<double>(a.re.hi, a.im.hi));
  if (near == 0.0) return {};
  const ExtendedComplex root{number(near.real()), number(near.imag())};
  return times(root + a / root, 0.5);
}

ExtendedComplex log(const ExtendedComplex& a) {
  const auto near = std::log(std::complex<double>(a.re.hi, a.im.hi));
  const ExtendedComplex first{number(near.real()), number(near.imag())};
  // a exp(-first) - 1 is small: log(1 + d) = d - d^2 / 2.
  const auto size = exponential_of_minus(first.re);
  const auto turn = sine_cosine(first.im);
  const double power = std::ldexp(1, static_cast<int>(size.exponent));
  const ExtendedComplex change = scaled(a, power) * (size.value * ExtendedComplex{turn.cosine, -turn.sine}) -
                                 ExtendedComplex{number(1), {}};
  return first + change - times(change * change, 0.5);
}

} // namespace scatter::exact
