#include <scatter/fiber/longitudinal.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace scatter::fiber {
namespace {

/// Share of a standard normal distribution above x.
double upper_tail(double x) {
  return 0.5 * std::erfc(x / std::numbers::sqrt2);
}

/// x with upper_tail(x) = share, 1e-300 <= share <= 1/2, by Newton's method on the logarithm, which is
/// concave and falls: from a start above the root the steps go down to it and never beyond.
double inverse_upper_tail(double share) {
  // Above the root, since a tail is less than exp(-x^2 / 2) / 2.
  double x = std::sqrt(std::max(0.0, -2 * std::log(2 * share)));
  for (int step = 0; step < 60; ++step) {
    const double tail = upper_tail(x);
    const double density = std::exp(-0.5 * x * x) / std::sqrt(2 * pi);
    const double change = std::log(tail / share) * tail / density;
    x += change;
    if (std::abs(change) <= 1e-15 * (1 + std::abs(x))) break;
  }
  return x;
}

} // namespace

double gaussian_of_unit_height(double variance, double x) {
  return std::exp(-x * x / (2 * variance));
}

double gaussian(double variance, double x) {
  return gaussian_of_unit_height(variance, x) / std::sqrt(2 * pi * variance);
}

void check_width(const char* name, double width) {
  if (!(width > 0 && width < pi / 2))
    throw InputError(fmt::format(
        "{}: {:g} deg is not between 0 deg and 90 deg, both excluded", name, width / radians_per_degree));
}

LongitudinalKernel::LongitudinalKernel(double shift, double width, Norm norm)
    : shift_(shift), width_(width), norm_(norm) {
  if (!(std::abs(shift) < pi / 2))
    throw InputError(fmt::format(
        "shift: {:g} deg is not between -90 deg and 90 deg, both excluded", shift / radians_per_degree));
  check_width("width", width);
}

double LongitudinalKernel::spread(double variance, double theta_h) const {
  const double whole = width_ * width_ + variance;
  switch (norm_) {
  case Norm::area_over_theta_o:
    return 0.5 * gaussian(whole, theta_h - shift_);
  case Norm::area_over_theta_h:
    return gaussian(whole, theta_h - shift_);
  default:
    return width_ / std::sqrt(whole) * gaussian_of_unit_height(whole, theta_h - shift_);
  }
}

double LongitudinalKernel::area() const {
  switch (norm_) {
  case Norm::area_over_theta_o:
    return 1;
  case Norm::area_over_theta_h:
    return 2;
  default:
    return 2 * width_ * std::sqrt(2 * pi);
  }
}

double LongitudinalKernel::sample(double theta_i, double u) const {
  return TruncatedNormal(2 * shift_ - theta_i, 2 * width_, -pi / 2, pi / 2).sample(u);
}

double LongitudinalKernel::density(double theta_i, double theta_o) const {
  return TruncatedNormal(2 * shift_ - theta_i, 2 * width_, -pi / 2, pi / 2).density(theta_o);
}

TruncatedNormal::TruncatedNormal(double mean, double deviation, double first, double last)
    : mean_(mean), deviation_(deviation), first_(first), last_(last), mirrored_(mean > 0.5 * (first + last)) {
  // Seen from the mean, most of the interval lies above: tails there keep their digits.
  const double a = mirrored_ ? mean_ - last_ : first_ - mean_;
  const double b = mirrored_ ? mean_ - first_ : last_ - mean_;
  tail_first_ = upper_tail(a / deviation_);
  tail_last_ = upper_tail(b / deviation_);
  mass_ = tail_first_ - tail_last_;
  if (!(mass_ > 1e-300)) mass_ = 0;
}

double TruncatedNormal::sample(double u) const {
  if (mass_ == 0) return first_ + u * (last_ - first_);
  // Increasing in u from either side.
  const double tail = mirrored_ ? tail_last_ + u * mass_ : tail_first_ - u * mass_;
  const double x = tail > 0.5 ? -inverse_upper_tail(1 - tail) : inverse_upper_tail(std::max(tail, 1e-300));
  return std::clamp(mean_ + (mirrored_ ? -x : x) * deviation_, first_, last_);
}

double TruncatedNormal::density(double x) const {
  if (!(x >= first_ && x <= last_)) return 0;
  if (mass_ == 0) return 1 / (last_ - first_);
  return gaussian(deviation_ * deviation_, x - mean_) / mass_;
}

} // namespace scatter::fiber
