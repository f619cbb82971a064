#pragma once

/// Internal to scatter::exact: numbers of 106 bits as sums of two doubles, scalars or vectors of them (Dekker
/// 1971, Numer. Math. 18, 224; error bounds: Joldes, Muller & Popescu 2017, ACM Trans. Math. Softw. 44, 15).
/// Only for sources compiled with -ffp-contract=off: the roundings that the algorithms catch must be those
/// written.
#ifdef __FAST_MATH__
#error "pairs of doubles need IEEE arithmetic: compile without -ffast-math"
#endif

namespace scatter::exact {

#define SCATTER_INLINE [[gnu::always_inline]] inline

/// T: double, or a vector of doubles. |lo| <= ulp(hi) / 2. No care for infinities, nor for |hi| > 1e300.
template <typename T>
struct DoubleDouble {
  T hi{}, lo{};
};

/// Whether T has fused_rest(a, b, p) = a b - p in one instruction.
template <typename T>
inline constexpr bool is_fused = false;

namespace twofold {

/// a + b exactly.
template <typename T>
SCATTER_INLINE DoubleDouble<T> sum(const T& a, const T& b) {
  const T s = a + b, rest = s - a;
  return {s, (a - (s - rest)) + (b - rest)};
}

/// The same for |a| >= |b|.
template <typename T>
SCATTER_INLINE DoubleDouble<T> ordered_sum(const T& a, const T& b) {
  const T s = a + b;
  return {s, b - (s - a)};
}

/// a as two halves of 26 bits.
template <typename T>
SCATTER_INLINE DoubleDouble<T> halves(const T& a) {
  const T scaled = 134217729.0 * a, high = scaled - (scaled - a);
  return {high, a - high};
}

/// a b exactly, from the halves of both.
template <typename T, typename U>
SCATTER_INLINE DoubleDouble<T>
product(const T& a, const DoubleDouble<T>& a_halves, const U& b, const DoubleDouble<U>& b_halves) {
  const T p = a * b;
  return {
      p, ((a_halves.hi * b_halves.hi - p) + a_halves.hi * b_halves.lo + a_halves.lo * b_halves.hi) +
             a_halves.lo * b_halves.lo};
}

/// a b exactly.
template <typename T, typename U>
SCATTER_INLINE DoubleDouble<T> product(const T& a, const U& b) {
  if constexpr (is_fused<T>) {
    const T p = a * b;
    return {p, fused_rest(a, b, p)};
  } else {
    return product(a, halves(a), b, halves(b));
  }
}

} // namespace twofold

template <typename T>
SCATTER_INLINE DoubleDouble<T> operator-(const DoubleDouble<T>& a) {
  return {-a.hi, -a.lo};
}

template <typename T>
SCATTER_INLINE DoubleDouble<T> operator+(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  const auto high = twofold::sum(a.hi, b.hi), low = twofold::sum(a.lo, b.lo);
  const auto first = twofold::ordered_sum<T>(high.hi, high.lo + low.hi);
  return twofold::ordered_sum<T>(first.hi, first.lo + low.lo);
}

template <typename T>
SCATTER_INLINE DoubleDouble<T> operator-(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  return a + (-b);
}

/// a + b to within 2^-104 of |a| + |b|, for half the work: enough where both carry roundings of their own.
template <typename T>
SCATTER_INLINE DoubleDouble<T> quick_sum(const DoubleDouble<T>& a, const DoubleDouble<T>& b) {
  const auto high = twofold::sum(a.hi, b.hi);
  return twofold::ordered_sum<T>(high.hi, high.lo + (a.lo + b.lo));
}

/// U: T, or double as the same factor for every lane.
template <typename T, typename U>
SCATTER_INLINE DoubleDouble<T> operator*(const DoubleDouble<T>& a, const DoubleDouble<U>& b) {
  const auto p = twofold::product(a.hi, b.hi);
  return twofold::ordered_sum<T>(p.hi, p.lo + (a.hi * b.lo + a.lo * b.hi));
}

/// a times a plain number.
template <typename T>
SCATTER_INLINE DoubleDouble<T> times(const DoubleDouble<T>& a, double b) {
  const auto p = twofold::product(a.hi, b);
  return twofold::ordered_sum<T>(p.hi, p.lo + a.lo * b);
}

SCATTER_INLINE DoubleDouble<double> operator/(const DoubleDouble<double>& a, const DoubleDouble<double>& b) {
  const double first = a.hi / b.hi;
  const auto rest = a - times(b, first);
  const double second = rest.hi / b.hi;
  const auto last = rest - times(b, second);
  const auto quotient = twofold::ordered_sum(first, second);
  return quotient + DoubleDouble<double>{last.hi / b.hi, 0};
}

} // namespace scatter::exact
