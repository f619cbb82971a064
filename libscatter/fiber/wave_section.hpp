#pragma once

#include <scatter/fiber/cross_section.hpp>

#include <memory>
#include <span>
#include <vector>

namespace scatter::fiber {

/// What a wave sends around the axis, unpolarised: a cosine series in the azimuth with finitely many terms,
/// so that averages and integrals of it are exact.
class WaveProfile {
public:
  WaveProfile() = default;
  /// Even in the angle theta from straight on; intensity[j] at theta = pi j / (size - 1), enough of them that
  /// the series ends.
  explicit WaveProfile(std::span<const double> intensity);

  /// [1/rad] toward phi = pi - theta, averaged by a Gaussian of standard deviation `width` [rad], 0: not at
  /// all.
  [[nodiscard]] double operator()(double phi, double width) const;
  /// Of the profile so averaged.
  [[nodiscard]] OrderMoments moments(double width) const;
  /// Integral over from <= phi <= to of the profile so averaged; any from <= to.
  [[nodiscard]] double energy_between(double from, double to, double width) const;

private:
  std::vector<double> coefficient_; ///< of cos(k theta)
};

/// Profiles of Debye's orders, of what they leave out and of the whole wave, for one cylinder and tilt.
struct WaveProfiles {
  std::vector<WaveProfile> orders; ///< as asked for
  WaveProfile rest;                ///< all orders but these, interference among them included
  WaveProfile whole;               ///< everything, interference of all orders included
  double error_estimate = 0;       ///< of the amplitudes, the largest
};

/// size_parameter: k times the radius. eta > 1, sigma_a >= 0 per radius (the index is eta + i sigma_a / (2
/// x), as a ray's energy falls by exp(-sigma_a) per radius). Shares of what falls on the section: |T|^2 / (pi
/// x cos theta_d), with |T|^2 the mean over incident polarisations of all four amplitudes, T3 and T4
/// included. theta_d in radians. Throws InputError for |theta_d| > 89.9 deg, eta <= 1, sigma_a < 0, numbers
/// that are not finite and size parameters outside 1e-3..1e5 (exact::cylinder() takes thinner cylinders, and
/// those thinner than their surroundings), orders outside 0..1000, and what else exact::cylinder() refuses.
/// Accuracy: that of exact::cylinder().
[[nodiscard]] WaveProfiles
wave_profiles(double eta, double sigma_a, double size_parameter, double theta_d, std::span<const int> orders);

/// The Lorenz-Mie cylinder as a cross-section: order p is the Debye term p, theta_d the tilt.
///
/// Order 0 is reflection together with all diffraction around the fibre, which no measurement tells apart:
/// its energy is that of the reflected rays and about 1 for what the shadow diffracts forward, into |pi -
/// phi| of some wavelengths over the diameter; diffraction() says how that light would lie by itself. Orders
/// of waves interfere, so that energies of orders do not add up exactly; residual(n) is the wave of all
/// orders from n on.
///
/// theta_d [rad]: beyond +-89.9 deg, where exact::cylinder() ends, orders have the values of 89.9 deg. All
/// functions of it but caustics() throw InputError for |theta_d| >= pi/2 or not finite, phi not finite, and
/// orders outside 0..1000.
class WaveSection final : public CrossSection {
public:
  /// width: standard deviation of the Gaussian that averages over azimuth [rad], 0..10; the others as for
  /// wave_profiles(). Throws InputError for eta <= 1, sigma_a < 0, size parameters outside 1e-3..1e5 and a
  /// width out of range.
  WaveSection(double eta, double sigma_a, double size_parameter, double width);

  [[nodiscard]] double distribution(int order, double theta_d, double phi) const override;
  [[nodiscard]] OrderMoments moments(int order, double theta_d) const override;
  [[nodiscard]] OrderMoments residual(int first_order, double theta_d) const override;
  /// Waves have none.
  [[nodiscard]] std::vector<double> caustics(int order, double theta_d) const override;

  /// Fraunhofer's diffraction by a strip of the fibre's width, (xi / pi) (sin(s) / s)^2 with xi = x cos
  /// theta_d and s = xi sin(pi - phi), times the obliquity ((1 + cos(pi - phi)) / 2)^2, not averaged: energy
  /// about 1.
  [[nodiscard]] double diffraction(double theta_d, double phi) const;

  [[nodiscard]] double size_parameter() const { return size_parameter_; }
  [[nodiscard]] double width() const { return width_; }

private:
  struct Cache;
  [[nodiscard]] std::shared_ptr<const WaveProfile> profile(bool residual, int order, double theta_d) const;

  double eta_, sigma_a_, size_parameter_, width_;
  std::shared_ptr<Cache> cache_; ///< the profiles of late; copies share it
};

} // namespace scatter::fiber
