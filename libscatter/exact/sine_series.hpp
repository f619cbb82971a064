#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

/// Internal to scatter::exact: from Legendre to Fourier series, in so many steps as both have coefficients
/// squared. Method and its count of operations: sine_series.cpp.
namespace scatter::exact {

/// Real series that are worked on together: real and imaginary parts of S1 and S2.
constexpr std::size_t series_count = 4;

/// s_n of sum s_n P_n(cos theta), n = 0 first.
struct LegendreSeries {
  std::array<std::vector<double>, series_count> s;
};

/// b_l of sum b_l sin(l theta), l = 0..orders, as doubles that miss nothing but roundings.
struct SineSeries {
  std::array<std::vector<double>, series_count> b;
  /// Sum of squares of what the largest l of each P_n comes to: with the sum of b_l^2, a measure of what was
  /// added up.
  std::array<double, series_count> leading_square{};
};

/// The series of sin(theta) sum_{n < orders} s_n P_n(cos theta), one per set of at least `orders` numbers
/// each. cost and threads: see in_parallel; threads change no bits.
[[nodiscard]] std::vector<SineSeries>
sine_series(std::span<const LegendreSeries> sets, std::size_t orders, double cost, int threads);

} // namespace scatter::exact
