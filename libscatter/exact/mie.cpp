#include <scatter/exact/mie.hpp>
#include <scatter/exact/mie_accuracy.hpp>
#include <scatter/exact/partial_waves.hpp>
#include <scatter/exact/sphere_coefficients.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <sstream>

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;
constexpr double smallest_index = 1e-6; ///< keeps powers of it, and functions of small spheres, in range

/// What S and Q shall be good for.
double required_error(double x) {
  return x <= 5000 ? 1e-12 : 1e-11;
}

/// How far S may be from its value at the angle as given, where a grid's angle stands for its decimal:
/// relative, by the largest amplitude nearby, for each angle.
std::vector<double> turn_errors(double x, std::span<const Angle> angles, std::span<const double> square) {
  std::vector<double> errors(angles.size());
  const auto off = [](const Angle& angle) { return angle.theta_rest != 0; };
  if (std::none_of(angles.begin(), angles.end(), off)) return errors;
  std::vector<std::size_t> order(angles.size());
  std::iota(order.begin(), order.end(), 0);
  const auto less = [&](std::size_t i, std::size_t j) { return angles[i].theta < angles[j].theta; };
  if (!std::is_sorted(order.begin(), order.end(), less)) std::sort(order.begin(), order.end(), less);
  std::vector<double> sorted(angles.size());
  for (std::size_t k = 0; k < order.size(); ++k) sorted[k] = square[order[k]];
  std::vector<double> nearby = sorted;
  for (std::size_t reach = 1; reach <= 3; ++reach)
    for (std::size_t k = 0; k + reach < sorted.size(); ++k) {
      nearby[k] = std::max(nearby[k], sorted[k + reach]);
      nearby[k + reach] = std::max(nearby[k + reach], sorted[k]);
    }
  for (std::size_t k = 0; k < order.size(); ++k) {
    const double turn = std::abs(angles[order[k]].theta_rest) * (std::numbers::pi / 180);
    errors[order[k]] = x * turn * std::sqrt(nearby[k] / sorted[k]);
  }
  return errors;
}

/// enough: S need not be better than that.
MieResult solve(
    double x, std::complex<double> m, std::span<const double> theta, AngleUnit unit, int threads,
    double enough = 0) {
  check_sphere(x, m);
  if (!(std::abs(m) >= smallest_index)) {
    std::ostringstream message;
    message << "index " << m.real() << '+' << m.imag() << "i is too small: use one of modulus 1e-6 or more";
    throw InputError(message.str());
  }
  const std::vector<Angle> angles = fold_angles(theta, unit);
  SphereCoefficients c = sphere_coefficients(x, m);
  auto sums = std::move(sum_partial_waves({&c.waves, 1}, angles, threads)[0]);

  // Where the sum in double is not sure of the digits, all are summed once more, with twice as many.
  const double required = std::max(required_error(x), enough), coarse = sum_rounding(c.waves.count());
  // The estimate holds several times over: 4 times what is required is no reason yet.
  std::vector<double> square(angles.size()); // of the larger amplitude
  std::vector<double> growth(angles.size()); // largest partial sum over the larger amplitude
  const auto measure = [&](std::size_t i) {
    square[i] = std::max(std::norm(sums.S1[i]), std::norm(sums.S2[i]));
    growth[i] = std::sqrt(sums.largest_partial[i] / square[i]);
  };
  for (std::size_t i = 0; i < angles.size(); ++i) measure(i);
  std::vector<std::size_t> unsure;
  for (std::size_t i = 0; i < angles.size(); ++i)
    if (!((coarse + c.relative_error) * growth[i] <= 4 * required)) unsure.push_back(i);
  ExtendedWaves exact;
  if (!unsure.empty() || !(c.back_error <= 2 * required)) {
    c = sphere_coefficients(x, m, &exact);
    std::vector<Angle> again;
    for (const std::size_t i : unsure) again.push_back(angles[i]);
    const ExtendedWaves* const set = &exact;
    const auto better = std::move(sum_partial_waves({&set, 1}, again, threads)[0]);
    for (std::size_t k = 0; k < unsure.size(); ++k) {
      sums.S1[unsure[k]] = better.S1[k];
      sums.S2[unsure[k]] = better.S2[k];
      measure(unsure[k]);
    }
  }

  MieResult result;
  result.size_parameter = x;
  result.index = m;
  result.Qext = c.Qext;
  result.Qsca = c.Qsca;
  result.Qabs = c.Qabs;
  result.Qback = c.Qback;
  result.g = c.g;
  // Qabs follows the squared width of a resonance: twice the coefficient's error, and once more for the width
  // itself.
  result.error_estimate = 8 * epsilon + (m.imag() > 0 ? 4 : 1) * c.relative_error;
  const std::vector<double> turns = turn_errors(x, angles, square);
  const double fine =
      extended_epsilon * (12 + 8 * std::sqrt(static_cast<double>(c.waves.count()))) + c.relative_error;
  auto next = unsure.begin();
  result.phase_function.reserve(angles.size());
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const bool summed_again = next != unsure.end() && *next == i;
    if (summed_again) ++next;
    const double error =
        summed_again ? 4 * epsilon + fine * growth[i] : (coarse + c.relative_error) * growth[i];
    result.error_estimate = std::max(result.error_estimate, error + turns[i]);
    result.phase_function.push_back(
        (std::norm(sums.S1[i]) + std::norm(sums.S2[i])) / (2 * std::numbers::pi * x * x * c.Qsca));
  }
  result.S1 = std::move(sums.S1);
  result.S2 = std::move(sums.S2);
  return result;
}

} // namespace

MieResult mie_at_degrees_to(
    double enough, double size_parameter, std::complex<double> index, std::span<const double> theta_deg,
    int threads) {
  return solve(size_parameter, index, theta_deg, AngleUnit::degree, threads, enough);
}

MieResult mie(double size_parameter, std::complex<double> index, std::span<const double> theta, int threads) {
  return solve(size_parameter, index, theta, AngleUnit::radian, threads);
}

MieResult mie_at_degrees(
    double size_parameter, std::complex<double> index, std::span<const double> theta_deg, int threads) {
  return solve(size_parameter, index, theta_deg, AngleUnit::degree, threads);
}

} // namespace scatter::exact
