#pragma once

#include <optional>
#include <span>
#include <vector>

/// The grid of directions of a table: which part of the sphere it covers, and integrals over it.
namespace scatter::table {

/// How the azimuths of a grid stand for the whole circle.
enum class PhiCover {
  none, ///< they do not cover it
  one,  ///< a single azimuth: covers it only for a scatterer with symmetry of revolution about the sunlight
  half, ///< 0 .. 180 deg: covers it by mirror symmetry (phi -> -phi), which upright drops have
  full  ///< the whole circle, with or without its end repeated
};

/// phi in degrees, increasing. A grid covers a circle when it begins and ends at 0 and 180, or when the step
/// that closes the circle is no larger than 1.5 times its largest step.
[[nodiscard]] PhiCover phi_cover(std::span<const double> phi_deg);

/// True when theta, in degrees and increasing, begins at 0 and ends at 180.
[[nodiscard]] bool covers_all_theta(std::span<const double> theta_deg);

/// Weights [rad] that average over phi: their sum is 2 pi. Trapezoid rule, periodic for PhiCover::full.
/// Throws std::invalid_argument for PhiCover::none.
[[nodiscard]] std::vector<double> phi_weights(std::span<const double> phi_deg);

/// Weights of theta: sum of weight * f is the integral of f(theta) sin(theta) d theta between the first and
/// the last angle, exact for f linear between the grid's angles. One angle has weight 0.
[[nodiscard]] std::vector<double> theta_weights(std::span<const double> theta_deg);

/// Integral over the sphere of values[theta][phi], or nothing when the grid does not cover the sphere.
/// Its error is that of linear interpolation: (grid step)^2 / 12 times the curvature of f, relative.
[[nodiscard]] std::optional<double> sphere_integral(
    std::span<const double> theta_deg, std::span<const double> phi_deg, std::span<const double> values);

} // namespace scatter::table
