#pragma once

#include <bit>
#include <cstdint>

// Inlined wherever it is called, or the loop around is not vectorised.
#if defined(__GNUC__)
#define SCATTER_LANE inline __attribute__((always_inline))
#else
#define SCATTER_LANE inline
#endif

/// Internal to scatter::fiber: functions without branches or calls, for loops over lanes that the compiler
/// turns into vectors. Polynomials are Chebyshev interpolants, computed with 60 digits, and
/// summed in pairs: a chain of additions would wait for each of them.
namespace scatter::fiber::lane {

SCATTER_LANE double larger(double a, double b) {
  return a > b ? a : b;
}
SCATTER_LANE double smaller(double a, double b) {
  return a < b ? a : b;
}

/// 1 / sqrt(x), relative error below 1e-14; x positive and normal. A guess from the exponent, then series:
/// on wide vectors twice as fast as square root and division.
SCATTER_LANE double inverse_root(double x) {
  double y = std::bit_cast<double>(INT64_C(0x5fe6eb50c7b537a9) - (std::bit_cast<std::int64_t>(x) >> 1));
  // Newton's step with constants for the guess's error of -3.4 .. 3.4 %, which leaves 0.09 %.
  y = y * (1.5012972 - 0.5004203 * (x * y) * y);
  const double rest = 1 - (x * y) * y;
  return y + (y * rest) * ((0.5 + 0.375 * rest) + (rest * rest) * (0.3125 + 0.2734375 * rest));
}

/// 2^x, relative error below 4e-16 for -700 <= x <= 0; below that 2^-700: products with it stay clear of
/// denormal numbers.
SCATTER_LANE double power_of_two(double x) {
  x = larger(x, -700);
  constexpr double rounding = 0x1.8p52; // its last bit is one: adding it rounds to a whole number
  const double shifted = x + rounding;
  const double r = x - (shifted - rounding);
  const double r2 = r * r, r4 = r2 * r2;
  const double low = (1 + r * 0.6931471805599453) + r2 * (0.2402265069591016 + r * 0.055504108664821625);
  const double middle = (0.009618129107587223 + r * 0.0013333558146406453) +
                        r2 * (0.00015403530463766596 + r * 1.5252733841579287e-05);
  const double high = (1.3215432514189648e-06 + r * 1.017805707615539e-07) +
                      r2 * (7.074198158791346e-09 + r * 4.4558199665721414e-10);
  const double sum = low + r4 * (middle + r4 * high);
  const std::int64_t bits = std::bit_cast<std::int64_t>(shifted) << 52; // to the exponent's place
  return std::bit_cast<double>(std::bit_cast<std::int64_t>(sum) + bits);
}

/// acos(1 - q)^2 for 0 <= q <= 1, relative error below 4e-16: smooth in q, so that no arc function and no
/// root are needed.
SCATTER_LANE double arc_squared(double q) {
  const double q2 = q * q, q4 = q2 * q2, q8 = q4 * q4;
  const double a = (2 + q * 0.333333333333282) + q2 * (0.08888888889502397 + q * 0.028571428281146307);
  const double b = (0.010158737392892294 + q * 0.003847894241024964) +
                   q2 * (0.0015233862260891284 + q * 0.0006139002339487316);
  const double c = (0.00029911862942596476 - q * 3.660638043319457e-05) +
                   q2 * (0.0004673594277794059 - q * 0.0008858891738586373);
  const double d = (0.0015026173389976688 - q * 0.0018565469501516333) +
                   q2 * (0.0017296726274879507 - q * 0.0011604728347193714);
  const double e = (0.0005362465522457653 - q * 0.00015266200803959538) + q2 * 2.069444019768993e-05;
  const double sum = (a + q4 * b) + q8 * ((c + q4 * d) + q8 * e);
  return q * sum;
}

} // namespace scatter::fiber::lane
