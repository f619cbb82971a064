#include <scatter/optics/units.hpp>
#include <scatter/table/grid.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace scatter::table {
namespace {
constexpr double tolerance_deg = 1e-9;
}

PhiCover phi_cover(std::span<const double> phi) {
  if (phi.empty()) return PhiCover::none;
  if (phi.size() == 1) return PhiCover::one;
  const double span = phi.back() - phi.front();
  if (std::abs(phi.front()) < tolerance_deg && std::abs(phi.back() - 180) < tolerance_deg)
    return PhiCover::half;
  double largest = 0;
  for (std::size_t i = 1; i < phi.size(); ++i) largest = std::max(largest, phi[i] - phi[i - 1]);
  const double gap = 360 - span;
  return phi.size() > 2 && gap > -tolerance_deg && gap <= 1.5 * largest ? PhiCover::full : PhiCover::none;
}

bool covers_all_theta(std::span<const double> theta) {
  return theta.size() > 1 && std::abs(theta.front()) < tolerance_deg &&
         std::abs(theta.back() - 180) < tolerance_deg;
}

std::vector<double> phi_weights(std::span<const double> phi) {
  const PhiCover cover = phi_cover(phi);
  if (cover == PhiCover::none) throw std::invalid_argument("the azimuths do not cover the circle");
  if (cover == PhiCover::one) return {2 * pi};
  std::vector<double> weights(phi.size(), 0.0);
  const double scale = radians_per_degree * (cover == PhiCover::half ? 2 : 1);
  for (std::size_t i = 1; i < phi.size(); ++i) {
    const double half = scale * (phi[i] - phi[i - 1]) / 2;
    weights[i - 1] += half;
    weights[i] += half;
  }
  if (cover == PhiCover::full) {
    const double half = scale * std::max(360 - (phi.back() - phi.front()), 0.0) / 2;
    weights.front() += half;
    weights.back() += half;
  }
  return weights;
}

std::vector<double> theta_weights(std::span<const double> theta) {
  std::vector<double> weights(theta.size(), 0.0);
  for (std::size_t i = 1; i < theta.size(); ++i) {
    // Integral of a hat's slopes times sin over [a, b], written about the middle so that nothing cancels:
    // sin = sin(m) cos(u) + cos(m) sin(u), u in [-h, h], slopes (1 -+ u/h)/2.
    const double middle = radians_per_degree * (theta[i] + theta[i - 1]) / 2;
    const double h = radians_per_degree * (theta[i] - theta[i - 1]) / 2;
    const double even = std::sin(h);
    // (sin h - h cos h) / h: series below the angle where the difference would lose digits.
    const double odd =
        h < 0.01 ? h * h / 3 * (1 - h * h / 10 * (1 - h * h / 28)) : (std::sin(h) - h * std::cos(h)) / h;
    weights[i - 1] += std::sin(middle) * even - std::cos(middle) * odd;
    weights[i] += std::sin(middle) * even + std::cos(middle) * odd;
  }
  return weights;
}

std::optional<double>
sphere_integral(std::span<const double> theta, std::span<const double> phi, std::span<const double> values) {
  if (values.size() != theta.size() * phi.size()) throw std::invalid_argument("values are not [theta][phi]");
  if (!covers_all_theta(theta) || phi_cover(phi) == PhiCover::none) return std::nullopt;
  const auto theta_weight = theta_weights(theta), phi_weight = phi_weights(phi);
  double sum = 0;
  for (std::size_t t = 0; t < theta.size(); ++t) {
    double row = 0;
    for (std::size_t f = 0; f < phi.size(); ++f) row += phi_weight[f] * values[t * phi.size() + f];
    sum += theta_weight[t] * row;
  }
  return sum;
}

} // namespace scatter::table
