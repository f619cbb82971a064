#include <scatter/exact/mie.hpp>
#include <scatter/exact/mie_accuracy.hpp>
#include <scatter/exact/partial_waves.hpp>
#include <scatter/exact/sphere_coefficients.hpp>
#include <scatter/exact/vector_clones.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;
constexpr double smallest_index = 1e-6; ///< keeps powers of it, and functions of small spheres, in range

/// What S and Q shall be good for.
double required_error(double x) {
  return x <= 5000 ? 1e-12 : 1e-11;
}

/// Errors relative to the larger amplitude; returns how many may be above `limit`.
SCATTER_VECTOR_CLONES
std::size_t relative_errors(
    const AngleSums& sums, double coefficient_error, std::size_t count, double limit, double* errors) {
  const auto* const S1 = reinterpret_cast<const double*>(sums.S1.data());
  const auto* const S2 = reinterpret_cast<const double*>(sums.S2.data());
  const double *const rounding = sums.rounding.data(), *const partial = sums.largest_partial.data();
  std::size_t above = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double first = S1[2 * i] * S1[2 * i] + S1[2 * i + 1] * S1[2 * i + 1];
    const double second = S2[2 * i] * S2[2 * i] + S2[2 * i + 1] * S2[2 * i + 1];
    errors[i] = (rounding[i] + coefficient_error * std::sqrt(partial[i])) /
                std::sqrt(first > second ? first : second);
    above += !(errors[i] <= limit);
  }
  return above;
}

/// scale (|S1|^2 + |S2|^2)
SCATTER_VECTOR_CLONES
void intensities(const AngleSums& sums, double scale, std::size_t count, double* values) {
  const auto* const S1 = reinterpret_cast<const double*>(sums.S1.data());
  const auto* const S2 = reinterpret_cast<const double*>(sums.S2.data());
  for (std::size_t i = 0; i < count; ++i)
    values[i] = scale * ((S1[2 * i] * S1[2 * i] + S1[2 * i + 1] * S1[2 * i + 1]) +
                         (S2[2 * i] * S2[2 * i] + S2[2 * i + 1] * S2[2 * i + 1]));
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

  // Errors relative to the larger amplitude. Where the sum in double is not sure of the digits, it is made
  // once more, with twice as many.
  const double required = std::max(required_error(x), enough);
  // The estimate is about twice the error.
  const double limit = 1.8 * required;
  std::vector<double> errors(angles.size());
  std::vector<std::size_t> unsure;
  if (relative_errors(sums, c.relative_error, angles.size(), limit, errors.data()) > 0)
    for (std::size_t i = 0; i < angles.size(); ++i)
      if (!(errors[i] <= limit)) unsure.push_back(i);
  if (!unsure.empty() || !(c.back_error <= limit)) {
    ExtendedWaves exact;
    c = sphere_coefficients(x, m, &exact);
    std::vector<Angle> again;
    for (const std::size_t i : unsure) again.push_back(angles[i]);
    const ExtendedWaves* const set = &exact;
    const auto better = std::move(sum_partial_waves({&set, 1}, again, threads)[0]);
    const double fine = extended_epsilon * (12 + 8 * std::sqrt(static_cast<double>(c.waves.count())));
    for (std::size_t k = 0; k < unsure.size(); ++k) {
      const std::size_t i = unsure[k];
      sums.S1[i] = better.S1[k];
      sums.S2[i] = better.S2[k];
      const double larger = std::max(std::norm(sums.S1[i]), std::norm(sums.S2[i]));
      errors[i] = 4 * epsilon + (fine + c.relative_error) * std::sqrt(sums.largest_partial[i] / larger);
    }
  }

  MieResult result;
  result.size_parameter = x;
  result.index = m;
  result.Qext = c.Qext;
  result.Qsca = c.Qsca;
  result.Qabs = c.Qabs;
  result.Qback = c.Qback;
  result.Qback_error_estimate = c.back_error;
  result.g = c.g;
  // Qabs follows the squared width of a resonance: twice the coefficient's error, and once more for the width
  // itself.
  result.error_estimate = 8 * epsilon + (m.imag() > 0 ? 4 : 1) * c.relative_error;
  result.phase_function.resize(angles.size());
  intensities(sums, 1 / (2 * std::numbers::pi * x * x * c.Qsca), angles.size(), result.phase_function.data());
  for (const double error : errors) result.error_estimate = std::max(result.error_estimate, error);
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
