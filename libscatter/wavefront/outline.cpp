#include <scatter/optics/units.hpp>
#include <scatter/wavefront/outline.hpp>
#include <scatter/wavefront/vectors.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace scatter::wavefront {

Outline outline_series(const drop::Shape& shape, double sun_elevation_deg) {
  if (shape.is_sphere()) return {{1.0}, {0.0}};
  const double h = sun_elevation_deg * radians_per_degree;
  const Vector axis{std::cos(h), 0, std::sin(h)};
  constexpr int samples = 256;
  std::array<std::vector<double>, 2> values{
      std::vector<double>(samples + 1), std::vector<double>(samples + 1)};
  for (int i = 0; i <= samples; ++i) {
    const double psi = pi * i / samples;
    const Vector side{std::cos(psi), std::sin(psi), 0};
    // At azimuth psi the line of sight touches where |P| / R(P) is least along it.
    const auto gauge = [&](double z) {
      const Vector p{side[0], side[1], z};
      const double r = std::sqrt(inner(p, p));
      return r / shape.radius(std::acos(std::clamp(inner(axis, p) / r, -1.0, 1.0)));
    };
    // Golden section: the gauge of a convex drop has one minimum.
    constexpr double golden = 0.6180339887498949;
    double low = -3, high = 3;
    for (int step = 0; step < 60; ++step) {
      const double left = high - golden * (high - low), right = low + golden * (high - low);
      (gauge(left) < gauge(right) ? high : low) = gauge(left) < gauge(right) ? right : left;
    }
    const double z = 0.5 * (low + high);
    values[0][i] = 1 / gauge(z);
    values[1][i] = z / gauge(z);
  }
  std::array<std::vector<double>, 2> series;
  for (int which = 0; which < 2; ++which)
    for (int n = 0; n <= samples / 2; ++n) {
      double sum = 0;
      for (int i = 0; i <= samples; ++i)
        sum += (i == 0 || i == samples ? 0.5 : 1.0) * values[which][i] * std::cos(pi * n * i / samples);
      series[which].push_back(sum * (n == 0 ? 1.0 : 2.0) / samples);
    }
  // z is known to 1e-8 only, where the gauge is flat; its own effect is of second order.
  while (series[0].size() > 1 && std::abs(series[0].back()) < 1e-14 && std::abs(series[1].back()) < 1e-8) {
    series[0].pop_back();
    series[1].pop_back();
  }
  return {series[0], series[1]};
}

double series_value(const std::vector<double>& series, double cosine) {
  double b1 = 0, b2 = 0;
  for (std::size_t n = series.size(); n-- > 1;) {
    const double b = series[n] + 2 * cosine * b1 - b2;
    b2 = b1;
    b1 = b;
  }
  return series[0] + cosine * b1 - b2;
}

} // namespace scatter::wavefront
