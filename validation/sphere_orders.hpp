#pragma once

#include "curves.hpp"

#include <complex>
#include <vector>

/// Amplitudes of spheres order by order, by rays and exactly.
namespace scatter::validation {

/// Bohren & Huffman's S1 and S2 at one wavelength, [order][angle].
struct SphereOrders {
  double size_parameter = 0;
  std::vector<int> orders;
  std::vector<std::vector<std::complex<double>>> S1, S2;
  std::vector<std::complex<double>> whole_S1, whole_S2; ///< Lorenz-Mie; only of exact_orders()
  double seconds = 0;                                   ///< wall time, without the compilation of kernels

  /// Differential cross section over pi a^2 of the orders 0..last together; all of them must be there.
  [[nodiscard]] Curve up_to(int last) const;
  /// The same of Lorenz-Mie.
  [[nodiscard]] Curve whole() const;
};

/// The request's sphere traced as any drop, at one azimuth; its first wavelength counts. The request keeps
/// its diffraction, rays, orders.
[[nodiscard]] SphereOrders traced_orders(phase::Request request, const std::vector<double>& theta_deg);

/// Debye's terms of the same.
[[nodiscard]] SphereOrders exact_orders(const phase::Request& request, const std::vector<double>& theta_deg);

/// sqrt(|S1|^2 + |S2|^2), per angle.
[[nodiscard]] std::vector<double>
sizes(const std::vector<std::complex<double>>& S1, const std::vector<std::complex<double>>& S2);

/// The error of both amplitudes together at every angle: sizes() of the differences.
[[nodiscard]] std::vector<double>
differences(const SphereOrders& found, const SphereOrders& truth, std::size_t order);

} // namespace scatter::validation
