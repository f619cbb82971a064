#include <scatter/exact/cylinder.hpp>
#include <scatter/fiber/wave_section.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/fftw_planner.hpp>

#include <fftw3.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <deque>
#include <mutex>
#include <numbers>
#include <numeric>

namespace scatter::fiber {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double largest_tilt = 89.9 / 180 * pi; ///< of exact::cylinder()

/// The term k of a series loses this by averaging.
double blur(std::size_t k, double width) {
  const double a = static_cast<double>(k) * width;
  return std::exp(-0.5 * a * a);
}

/// How many terms an average over `width` leaves.
std::size_t terms_left(std::size_t count, double width) {
  if (!(width > 0)) return count;
  const double last = std::ceil(8.8 / width) + 1; // exp(-8.8^2 / 2) = 1.5e-17
  return last < static_cast<double>(count) ? static_cast<std::size_t>(last) : count;
}

/// Intervals of 0..pi that hold the intensity's whole series: twice the terms of the amplitude's.
std::size_t intervals(double size_parameter, double theta_d) {
  const double xi = size_parameter * std::cos(theta_d);
  const double needed = 2 * (xi + 9 * std::cbrt(xi) + 12) + 2;
  std::size_t count = 32;
  while (static_cast<double>(count) < needed) count *= 2;
  return count;
}

std::vector<double> intensity(const exact::CylinderAmplitudes& T, double scale) {
  std::vector<double> result(T.T1.size());
  for (std::size_t i = 0; i < result.size(); ++i)
    result[i] =
        scale * 0.5 * (std::norm(T.T1[i]) + std::norm(T.T2[i]) + std::norm(T.T3[i]) + std::norm(T.T4[i]));
  return result;
}

void check(double theta_d) {
  if (!(std::abs(theta_d) <= largest_tilt))
    throw InputError(
        fmt::format("theta_d = {} rad is outside what waves are computed for, -89.9..89.9 deg", theta_d));
}

/// |theta_d| of a section, whose domain goes up to pi/2.
double tilt_of(double theta_d) {
  if (!(std::abs(theta_d) < pi / 2))
    throw InputError(fmt::format("theta_d = {} rad is not between -pi/2 and pi/2", theta_d));
  return std::min(std::abs(theta_d), largest_tilt);
}

void check(double eta, double sigma_a, double size_parameter) {
  if (!(eta > 1 && std::isfinite(eta)))
    throw InputError(fmt::format(
        "an index of refraction eta = {} is not possible: it must be finite and greater than 1", eta));
  if (!(sigma_a >= 0 && std::isfinite(sigma_a)))
    throw InputError(fmt::format(
        "an absorption sigma_a = {} per radius is not possible: it must not be negative", sigma_a));
  if (!(size_parameter >= 1e-3 && size_parameter <= 1e5))
    throw InputError(fmt::format("a size parameter of {} is outside 0.001..1e5", size_parameter));
}

} // namespace

WaveProfile::WaveProfile(std::span<const double> values) : coefficient_(values.begin(), values.end()) {
  const auto count = static_cast<int>(coefficient_.size());
  std::vector<double> in(coefficient_);
  fftw_plan plan = nullptr;
  {
    const std::lock_guard lock(fftw_planner());
    plan = fftw_plan_r2r_1d(count, in.data(), coefficient_.data(), FFTW_REDFT00, FFTW_ESTIMATE);
  }
  if (plan == nullptr) throw RunError("FFTW cannot transform a profile");
  std::copy(values.begin(), values.end(), in.begin());
  fftw_execute(plan);
  {
    const std::lock_guard lock(fftw_planner());
    fftw_destroy_plan(plan);
  }
  for (double& c : coefficient_) c /= count - 1;
  coefficient_.front() /= 2;
  coefficient_.back() /= 2;
}

double WaveProfile::operator()(double phi, double width) const {
  // Clenshaw's sum at theta = pi - phi: the phase of term k is (-1)^k
  const double twice = -2 * std::cos(phi);
  double last = 0, before = 0;
  for (std::size_t k = terms_left(coefficient_.size(), width); k-- > 1;) {
    const double next = twice * last - before + coefficient_[k] * blur(k, width);
    before = last;
    last = next;
  }
  // Where a wave sends next to nothing, rounding may leave less than nothing.
  return coefficient_.empty() ? 0 : std::max(0.5 * twice * last - before + coefficient_[0], 0.0);
}

OrderMoments WaveProfile::moments(double width) const {
  OrderMoments sum;
  if (coefficient_.empty()) return sum;
  sum.energy = 2 * pi * coefficient_[0];
  sum.forward = sum.energy / 2;
  sum.forward_half = sum.energy / 2;
  // |phi| / pi = 1 - |theta| / pi; |phi| >= pi / 2 where |theta| <= pi / 2
  for (std::size_t k = 1; k < terms_left(coefficient_.size(), width); k += 2) {
    const auto n = static_cast<double>(k);
    const double c = coefficient_[k] * blur(k, width);
    sum.forward += c * 4 / (pi * n * n);
    sum.forward_half += c * (k % 4 == 1 ? 2 : -2) / n;
  }
  return sum;
}

double WaveProfile::energy_between(double from, double to, double width) const {
  double sum = coefficient_.empty() ? 0 : coefficient_[0] * (to - from);
  for (std::size_t k = 1; k < terms_left(coefficient_.size(), width); ++k) {
    const auto n = static_cast<double>(k);
    sum += (k % 2 == 0 ? 1 : -1) * coefficient_[k] * blur(k, width) *
           (std::sin(n * to) - std::sin(n * from)) / n;
  }
  return sum;
}

WaveProfiles wave_profiles(
    double eta, double sigma_a, double size_parameter, double theta_d, std::span<const int> orders) {
  check(theta_d);
  check(eta, sigma_a, size_parameter);
  const std::size_t count = intervals(size_parameter, theta_d);
  std::vector<double> theta_deg(count + 1);
  for (std::size_t j = 0; j <= count; ++j)
    theta_deg[j] = 180.0 * static_cast<double>(j) / static_cast<double>(count);
  const std::complex<double> index(eta, sigma_a / (2 * size_parameter));
  const auto wave =
      exact::cylinder_at_degrees(size_parameter, index, theta_d * (180 / pi), theta_deg, orders);
  const double scale = 1 / (pi * size_parameter * std::cos(theta_d));
  WaveProfiles profiles;
  for (const auto& order : wave.orders) {
    profiles.orders.emplace_back(intensity(order.amplitudes, scale));
    profiles.error_estimate = std::max(profiles.error_estimate, order.error_estimate);
  }
  profiles.whole = WaveProfile(intensity(wave.amplitudes, scale));
  profiles.rest = orders.empty() ? profiles.whole : WaveProfile(intensity(wave.remainder, scale));
  profiles.error_estimate = std::max(profiles.error_estimate, wave.error_estimate);
  return profiles;
}

struct WaveSection::Cache {
  struct Entry {
    bool residual;
    int order;
    double theta_d;
    std::shared_ptr<const WaveProfile> profile;
  };
  std::mutex mutex;
  std::deque<Entry> entries; ///< the newest first
};

WaveSection::WaveSection(double eta, double sigma_a, double size_parameter, double width)
    : eta_(eta), sigma_a_(sigma_a), size_parameter_(size_parameter), width_(width),
      cache_(std::make_shared<Cache>()) {
  if (!(width >= 0 && width <= 10))
    throw InputError(fmt::format("an average over {} rad is not possible: 0 (none) to 10", width));
  check(eta, sigma_a, size_parameter);
}

std::shared_ptr<const WaveProfile> WaveSection::profile(bool residual, int order, double theta_d) const {
  const double tilt = tilt_of(theta_d);
  if (order < 0 || order > 1000) throw InputError(fmt::format("order {} is outside 0..1000", order));
  const auto same = [&](const Cache::Entry& entry) {
    return entry.residual == residual && entry.order == order && entry.theta_d == tilt;
  };
  {
    const std::lock_guard lock(cache_->mutex);
    const auto found = std::ranges::find_if(cache_->entries, same);
    if (found != cache_->entries.end()) return found->profile;
  }
  // Computed without the lock: two threads may do the same work, and find the same.
  std::vector<int> orders{order};
  if (residual) {
    orders.resize(static_cast<std::size_t>(order));
    std::iota(orders.begin(), orders.end(), 0);
  }
  const WaveProfiles made = wave_profiles(eta_, sigma_a_, size_parameter_, tilt, orders);
  auto profile = std::make_shared<const WaveProfile>(residual ? made.rest : made.orders[0]);
  const std::lock_guard lock(cache_->mutex);
  cache_->entries.push_front({residual, order, tilt, profile});
  if (cache_->entries.size() > 64) cache_->entries.pop_back();
  return profile;
}

double WaveSection::distribution(int order, double theta_d, double phi) const {
  if (!std::isfinite(phi)) throw InputError(fmt::format("an azimuth phi of {} is not possible", phi));
  return (*profile(false, order, theta_d))(phi, width_);
}

OrderMoments WaveSection::moments(int order, double theta_d) const {
  return profile(false, order, theta_d)->moments(width_);
}

OrderMoments WaveSection::residual(int first_order, double theta_d) const {
  return profile(true, first_order, theta_d)->moments(width_);
}

std::vector<double> WaveSection::caustics(int, double) const {
  return {};
}

double WaveSection::diffraction(double theta_d, double phi) const {
  (void)tilt_of(theta_d); // throws
  if (!std::isfinite(phi)) throw InputError(fmt::format("an azimuth phi of {} is not possible", phi));
  const double theta = pi - phi, xi = size_parameter_ * std::cos(theta_d), s = xi * std::sin(theta);
  const double sinc = std::abs(s) < 1e-8 ? 1 : std::sin(s) / s, obliquity = (1 + std::cos(theta)) / 2;
  return xi / pi * sinc * sinc * obliquity * obliquity;
}

} // namespace scatter::fiber
