#include "bow_peaks.hpp"

#include <scatter/exact/debye.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <cmath>
#include <complex>

namespace scatter::validation {

double geometric_bow_deg(double index, int p) {
  const double sine = std::sqrt((p * p - index * index) / (p * p - 1.0)); // of the angle of incidence
  const double turned = (p - 1) * pi + 2 * std::asin(sine) - 2 * p * std::asin(sine / index);
  return std::abs(std::remainder(turned, 2 * pi)) / radians_per_degree;
}

double bow_curvature(double index, int p) {
  const double n2 = index * index, p2 = p * p;
  return (p2 - 1) * (p2 - 1) / p2 * std::sqrt((p2 - n2) / std::pow(n2 - 1, 3));
}

double airy_maximum(int k) {
  // Ai'(-z) = z/3 (J_2/3 - J_-2/3)(2/3 z^(3/2)), with J_-2/3 by J and Y of order 2/3.
  const auto slope = [](double z) {
    const double order = 2.0 / 3, argument = 2.0 / 3 * std::pow(z, 1.5);
    const double J = std::cyl_bessel_j(order, argument), Y = std::cyl_neumann(order, argument);
    return J - (std::cos(order * pi) * J - std::sin(order * pi) * Y);
  };
  // Zeros lie within 0.1 of (3 pi/8 (4k - 3))^(2/3), Abramowitz & Stegun 10.4.95, and far from each other.
  const double guess = std::pow(3 * pi / 8 * (4 * k - 3), 2.0 / 3);
  double low = guess - 0.15, high = guess + 0.15;
  const bool sign = slope(low) > 0;
  for (int step = 0; step < 60; ++step) {
    const double middle = (low + high) / 2;
    ((slope(middle) > 0) == sign ? low : high) = middle;
  }
  return (low + high) / 2;
}

std::vector<double> debye_maxima_deg(double size_parameter, double index, int p, int count, int threads) {
  const double bow = geometric_bow_deg(index, p);
  // Primary, fourth, ... lie beyond their bow in theta, the secondary before: p = 2 turns by more than its
  // bow.
  const double lit = p % 2 == 0 ? 1 : -1;
  const double scale =
      lit * std::cbrt(bow_curvature(index, p)) * std::pow(size_parameter, -2.0 / 3) / radians_per_degree;
  const std::vector<int> orders{p};
  const auto intensities = [&](const std::vector<double>& reduced) {
    std::vector<double> theta;
    for (const double z : reduced) theta.push_back(bow + scale * z);
    const auto result = exact::debye_at_degrees(size_parameter, index, orders, theta, threads);
    std::vector<double> values;
    for (const std::complex<double>& S1 : result.orders.front().S1) values.push_back(std::norm(S1));
    return values;
  };
  constexpr double first = 0.3, last = 5.4, coarse = 0.03, fine = 0.002;
  std::vector<double> reduced;
  for (int i = 0; first + i * coarse <= last; ++i) reduced.push_back(first + i * coarse);
  std::vector<double> values = intensities(reduced);
  std::vector<double> near;
  for (std::size_t i = 1; i + 1 < values.size() && near.size() < static_cast<std::size_t>(count); ++i)
    if (values[i] > values[i - 1] && values[i] >= values[i + 1]) near.push_back(reduced[i]);
  if (near.size() < static_cast<std::size_t>(count))
    throw RunError(
        fmt::format("x = {}, p = {}: {} of {} maxima found", size_parameter, p, near.size(), count));
  // All of them again, finely, and a parabola through the highest three.
  const int half = static_cast<int>(std::lround(coarse / fine)) + 1, width = 2 * half + 1;
  reduced.clear();
  for (const double z : near)
    for (int i = -half; i <= half; ++i) reduced.push_back(z + i * fine);
  values = intensities(reduced);
  std::vector<double> maxima;
  for (std::size_t k = 0; k < near.size(); ++k) {
    const std::size_t start = k * static_cast<std::size_t>(width);
    std::size_t top = start + 1;
    for (std::size_t i = start + 1; i + 1 < start + static_cast<std::size_t>(width); ++i)
      if (values[i] > values[top]) top = i;
    const double before = values[top - 1], here = values[top], after = values[top + 1];
    const double z = reduced[top] + fine / 2 * (before - after) / (before - 2 * here + after);
    maxima.push_back(bow + scale * z);
  }
  return maxima;
}

} // namespace scatter::validation
