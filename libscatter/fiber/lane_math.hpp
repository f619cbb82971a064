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
/// turns into vectors. Polynomials are Chebyshev interpolants, computed with 60 digits.
namespace scatter::fiber::lane {

SCATTER_LANE double larger(double a, double b) {
  return a > b ? a : b;
}
SCATTER_LANE double smaller(double a, double b) {
  return a < b ? a : b;
}

/// 1 / sqrt(x), relative error below 4e-16; x positive and normal. A guess from the exponent, then Newton:
/// on wide vectors twice as fast as square root and division.
SCATTER_LANE double inverse_root(double x) {
  double y = std::bit_cast<double>(INT64_C(0x5fe6eb50c7b537a9) - (std::bit_cast<std::int64_t>(x) >> 1));
  const double half = 0.5 * x;
  y = y * (1.5 - half * y * y);
  y = y * (1.5 - half * y * y);
  y = y * (1.5 - half * y * y);
  const double rest = 0.5 - half * y * y; // written so that the last step rounds once
  return y + y * rest;
}

/// exp(x), relative error below 4e-16 for -700 <= x <= 0; below that exp(-700).
SCATTER_LANE double exponential(double x) {
  x = larger(x, -700);
  constexpr double rounding = 0x1.8p52; // its last bit is one: adding it rounds to a whole number
  const double shifted = x * 1.4426950408889634 + rounding;
  const double k = shifted - rounding;
  const double r = (x - k * 0.6931471803691238) - k * 1.9082149292705877e-10;
  double sum = 2.5110049204818658e-08;
  sum = sum * r + 2.763265472252779e-07;
  sum = sum * r + 2.755724088722987e-06;
  sum = sum * r + 2.4801485441561313e-05;
  sum = sum * r + 0.00019841269890076403;
  sum = sum * r + 0.0013888888952352863;
  sum = sum * r + 0.008333333333319589;
  sum = sum * r + 0.04166666666648795;
  sum = sum * r + 0.1666666666666668;
  sum = sum * r + 0.5000000000000019;
  sum = sum * r + 1;
  sum = sum * r + 1;
  const std::int64_t bits = std::bit_cast<std::int64_t>(shifted) << 52; // k in the exponent's place
  return std::bit_cast<double>(std::bit_cast<std::int64_t>(sum) + bits);
}

/// acos(1 - q)^2 for 0 <= q <= 1, relative error below 4e-16: smooth in q, so that no arc function and no
/// root are needed.
SCATTER_LANE double arc_squared(double q) {
  double sum = 2.069444019768993e-05;
  sum = sum * q - 0.00015266200803959538;
  sum = sum * q + 0.0005362465522457653;
  sum = sum * q - 0.0011604728347193714;
  sum = sum * q + 0.0017296726274879507;
  sum = sum * q - 0.0018565469501516333;
  sum = sum * q + 0.0015026173389976688;
  sum = sum * q - 0.0008858891738586373;
  sum = sum * q + 0.0004673594277794059;
  sum = sum * q - 3.660638043319457e-05;
  sum = sum * q + 0.00029911862942596476;
  sum = sum * q + 0.0006139002339487316;
  sum = sum * q + 0.0015233862260891284;
  sum = sum * q + 0.003847894241024964;
  sum = sum * q + 0.010158737392892294;
  sum = sum * q + 0.028571428281146307;
  sum = sum * q + 0.08888888889502397;
  sum = sum * q + 0.333333333333282;
  sum = sum * q + 2;
  return q * sum;
}

} // namespace scatter::fiber::lane
