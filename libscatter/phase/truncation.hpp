#pragma once

#include <scatter/exact/sun_disc.hpp>

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

namespace scatter::phase {

/// What it costs to leave orders out: the exact orders of a sphere near a list of scattering angles.
class Truncation {
public:
  /// theta_deg increasing, in [0, 180]. Orders 0..min(last_order, 60) are at hand. shift_deg: how far the
  /// bows of a drop that is no sphere may lie from the sphere's; errors are the worst within it. Larger
  /// spheres count as x = 10000 over 20 deg, down to x = 2000 over 116 deg and more. threads = 0: all cores.
  /// Source: exact::debye.
  Truncation(
      double size_parameter, std::complex<double> index, std::span<const double> theta_deg, int last_order,
      double shift_deg, int threads = 0);

  /// Relative error of the unpolarised intensity, averaged over the sun's disc, of the coherent sum of these
  /// orders against all: root of the mean square within 2 deg of each angle, [theta]. Orders that
  /// are not at hand count as left out.
  [[nodiscard]] std::vector<double> error(std::span<const int> orders) const;

  /// Unpolarised intensity of one order by itself, averaged over the sun's disc, over that of all orders
  /// together, [theta]; 0 for orders that are not at hand.
  [[nodiscard]] std::vector<double> share(int order) const;

  /// Intensity of all orders, averaged over the sun's disc: (|S1|^2 + |S2|^2) / x^2, [theta].
  [[nodiscard]] std::vector<double> whole() const;

private:
  /// The nearest centre.
  [[nodiscard]] std::ptrdiff_t centre_of(double theta_deg) const;

  struct Amplitudes {
    std::vector<std::complex<double>> S1, S2;
  };
  std::vector<double> theta_deg_, centres_deg_;
  double shift_deg_ = 0, size_parameter_;
  exact::SunDisc disc_;
  std::vector<Amplitudes> orders_; ///< at the disc's grid
  std::vector<double> whole_;      ///< mean intensity of all orders at the centres
};

} // namespace scatter::phase
