#pragma once

#include <scatter/fiber/quadrature.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

/// How light spreads along a fibre: Gaussians of the half angle theta_h = (theta_i + theta_o) / 2. The
/// variance always comes first, and the norm is always named: which of three a formula means is the reason of
/// most of the print's errors. All angles in radians.
namespace scatter::fiber {

/// exp(-x^2 / (2 variance)) / sqrt(2 pi variance): the area over x is 1. variance > 0; for variance = 0 or
/// less the result is no number that means anything: check_width() keeps such widths out.
[[nodiscard]] double gaussian(double variance, double x);
/// exp(-x^2 / (2 variance)): the height is 1.
[[nodiscard]] double gaussian_of_unit_height(double variance, double x);

/// What a kernel is normalised to. At a fixed theta_i, d theta_o = 2 d theta_h.
enum class Norm {
  area_over_theta_o, ///< 1/2 gaussian: the light's energy, counted where it goes
  area_over_theta_h, ///< as the dissertation prints it (4.8): twice that energy
  unit_height,       ///< the artists' (4.9): the peak stays when the width changes
};

/// Throws InputError unless 0 < width < pi/2 [rad]; name is for the message, such as "width".
void check_width(const char* name, double width);

/// A lobe along the fibre: the peak at theta_h = shift, the standard deviation of theta_h = width.
class LongitudinalKernel {
public:
  LongitudinalKernel() = default;
  /// shift: -pi/2 < shift < pi/2; width as check_width() wants it. Throws InputError.
  LongitudinalKernel(double shift, double width, Norm norm);

  [[nodiscard]] double shift() const { return shift_; }
  [[nodiscard]] double width() const { return width_; }
  [[nodiscard]] Norm norm() const { return norm_; }

  [[nodiscard]] double operator()(double theta_h) const { return spread(0, theta_h); }
  /// The kernel of light that comes with this much variance [rad^2] of theta_h already: wider, with the same
  /// area as without, whatever the norm.
  [[nodiscard]] double spread(double variance, double theta_h) const;
  /// Integral of spread(variance, theta_h) over all theta_o, beyond +-pi/2 as well: the same for every
  /// variance.
  [[nodiscard]] double area() const;

  /// theta_o of light from theta_i, for u in 0..1: the kernel as a distribution over -pi/2..pi/2, where what
  /// lies beyond is left out. Exact to rounding: the distribution's inverse, no rejection.
  [[nodiscard]] double sample(double theta_i, double u) const;
  /// Its density over theta_o [1/rad]; 0 beyond +-pi/2.
  [[nodiscard]] double density(double theta_i, double theta_o) const;

private:
  double shift_ = 0, width_ = 0.1;
  Norm norm_ = Norm::area_over_theta_o;
};

/// Integral over theta_o, -pi/2..pi/2, of M(theta_h) f(theta_d) cos^2 theta_o / cos^2 theta_d for light from
/// theta_i: with f what a lobe sends around the fibre, the share of the light that it sends anywhere. Value
/// as for integrate(); the tolerance, absolute, is that of each panel, which is no wider than the lobe's
/// standard deviation nor than 10 deg.
template <typename Value, typename Function>
[[nodiscard]] Value
integral_along(const LongitudinalKernel& kernel, double theta_i, double tolerance, const Function& f) {
  // Nine standard deviations hold all but 1e-18.
  const double centre = 2 * kernel.shift() - theta_i, deviation = 2 * kernel.width();
  const double first = std::max(-std::numbers::pi / 2, centre - 9 * deviation);
  const double last = std::min(std::numbers::pi / 2, centre + 9 * deviation);
  Value sum{};
  if (!(last > first)) return sum;
  const auto at = [&](double theta_o) {
    const double theta_d = 0.5 * (theta_o - theta_i), ratio = std::cos(theta_o) / std::cos(theta_d);
    const double weight = kernel(0.5 * (theta_i + theta_o)) * ratio * ratio;
    Value value = f(theta_d);
    for (std::size_t k = 0; k < value.size(); ++k) value[k] *= weight;
    return value;
  };
  const int panels = static_cast<int>(std::ceil((last - first) / std::min(deviation, 0.17)));
  const double step = (last - first) / panels;
  for (int i = 0; i < panels; ++i) {
    const Value part = integrate<Value>(at, first + i * step, first + (i + 1) * step, tolerance);
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += part[k];
  }
  return sum;
}

/// A normal distribution cut to first..last, for sampling. mean may lie outside. When all of its mass lies
/// beyond the cut to 1e-300, it is taken as uniform.
class TruncatedNormal {
public:
  TruncatedNormal(double mean, double deviation, double first, double last);
  [[nodiscard]] double sample(double u) const;
  [[nodiscard]] double density(double x) const;
  [[nodiscard]] double mean() const { return mean_; }
  [[nodiscard]] double deviation() const { return deviation_; }
  /// Share of the distribution that the cut leaves; 0 where it is taken as uniform.
  [[nodiscard]] double mass() const { return mass_; }

private:
  double mean_, deviation_, first_, last_;
  bool mirrored_ = false;         ///< tails are counted from the nearer side
  double tail_first_, tail_last_; ///< upper tails at the cuts
  double mass_;
};

} // namespace scatter::fiber
