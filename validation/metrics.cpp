#include "metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace scatter::validation {

std::string Region::name() const {
  return fmt::format("{}..{}", from_deg, to_deg);
}

const std::vector<Region>& regions() {
  static const std::vector<Region> all{{0, 15},    {15, 30},   {30, 120}, {120, 129},
                                       {130, 137}, {137, 150}, {150, 178}};
  return all;
}

ThetaGrid ripple_grid(double largest_size_parameter, double coarsest_deg, double from_deg, double to_deg) {
  const double step = std::min(coarsest_deg, 180 / largest_size_parameter / 4);
  // A whole number of steps per degree, so that the borders of the regions lie on the grid.
  auto per_degree = static_cast<std::size_t>(std::ceil(1 / step - 1e-9));
  const bool halves = std::floor(from_deg) != from_deg || std::floor(to_deg) != to_deg;
  if (halves) per_degree += per_degree % 2;
  ThetaGrid grid{1 / static_cast<double>(per_degree), {}};
  const auto number = [&](double angle) {
    return static_cast<std::size_t>(std::llround(angle * static_cast<double>(per_degree)));
  };
  for (std::size_t i = number(from_deg); i <= number(to_deg); ++i)
    grid.theta_deg.push_back(static_cast<double>(i) / static_cast<double>(per_degree));
  return grid;
}

namespace {

/// Share of the unit disc's area left of the chord at t in [-1, 1].
double area_left_of(double t) {
  constexpr double pi = 3.14159265358979323846;
  t = std::clamp(t, -1.0, 1.0);
  return 0.5 + (t * std::sqrt(1 - t * t) + std::asin(t)) / pi;
}

} // namespace

std::vector<double> average_disc(std::span<const double> values, double step_deg, double diameter_deg) {
  const double step = step_deg / (diameter_deg / 2); // in units of the disc's radius
  const int reach = static_cast<int>(std::floor(1 / step + 0.5));
  std::vector<double> weight;
  for (int k = -reach; k <= reach; ++k)
    weight.push_back(area_left_of((k + 0.5) * step) - area_left_of((k - 0.5) * step));
  const int last = static_cast<int>(values.size()) - 1;
  std::vector<double> mean(values.size());
  for (int i = 0; i <= last; ++i) {
    double sum = 0;
    for (int k = -reach; k <= reach; ++k) {
      int at = i + k;
      if (at < 0) at = -at;
      if (at > last) at = 2 * last - at;
      sum += weight[static_cast<std::size_t>(k + reach)] * values[static_cast<std::size_t>(at)];
    }
    mean[static_cast<std::size_t>(i)] = sum;
  }
  return mean;
}

Curve average_disc(const Curve& curve, double step_deg, double diameter_deg) {
  return {average_disc(curve.s11, step_deg, diameter_deg), average_disc(curve.s12, step_deg, diameter_deg)};
}

Errors compare(const Curve& computed, const Curve& truth, const ThetaGrid& grid, const Region& region) {
  const std::size_t count = grid.theta_deg.size();
  if (computed.s11.size() != count || computed.s12.size() != count || truth.s11.size() != count ||
      truth.s12.size() != count)
    throw std::invalid_argument("compare: curves and grid differ in size");
  Errors errors;
  double squares = 0, differences = 0, intensity = 0, polarisation = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (grid.theta_deg[i] < region.from_deg || grid.theta_deg[i] > region.to_deg) continue;
    if (!(truth.s11[i] > 0)) throw std::invalid_argument("compare: the truth is not positive");
    const double difference = computed.s11[i] - truth.s11[i], relative = difference / truth.s11[i];
    // Where nothing arrives nothing is polarised.
    const double degree = computed.s11[i] > 0 ? -computed.s12[i] / computed.s11[i] : 0;
    const double off = degree + truth.s12[i] / truth.s11[i];
    squares += relative * relative;
    differences += difference * difference;
    intensity += truth.s11[i];
    polarisation += off * off;
    errors.bias += relative;
    errors.largest = std::max(errors.largest, std::abs(relative));
    errors.polarisation_largest = std::max(errors.polarisation_largest, std::abs(off));
    ++errors.angles;
  }
  if (errors.angles == 0) throw std::invalid_argument("compare: no angle in " + region.name());
  const auto n = static_cast<double>(errors.angles);
  errors.rms = std::sqrt(squares / n);
  errors.bias /= n;
  errors.rms_over_mean = std::sqrt(differences / n) / (intensity / n);
  errors.polarisation_rms = std::sqrt(polarisation / n);
  return errors;
}

double root_mean_square(std::span<const double> values) {
  if (values.empty()) throw std::invalid_argument("root_mean_square: no values");
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

} // namespace scatter::validation
