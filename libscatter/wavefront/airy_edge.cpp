#include <scatter/optics/units.hpp>
#include <scatter/wavefront/airy_edge.hpp>

#include <array>
#include <cmath>

namespace scatter::wavefront {

Airy airy(double tau) {
  // By Bessel functions of order 1/3 and 2/3 (DLMF 9.6.2 .. 9.6.9).
  const double z = std::abs(tau), zeta = 2.0 / 3 * z * std::sqrt(z), root3 = std::sqrt(3.0);
  // DLMF 9.2.3 .. 9.2.6
  if (zeta == 0)
    return {0.355028053887817239, 0.614926627446000736, -0.258819403792806798, 0.448288357353826359};
  if (tau > 0) {
    const double K = std::cyl_bessel_k(1.0 / 3, zeta), I = std::cyl_bessel_i(1.0 / 3, zeta);
    const double K2 = std::cyl_bessel_k(2.0 / 3, zeta), I2 = std::cyl_bessel_i(2.0 / 3, zeta);
    return {
        std::sqrt(z / 3) / pi * K, std::sqrt(z / 3) * (2 * I + root3 / pi * K), -z / (pi * root3) * K2,
        z / root3 * (2 * I2 + root3 / pi * K2)};
  }
  const double J = std::cyl_bessel_j(1.0 / 3, zeta), Y = std::cyl_neumann(1.0 / 3, zeta);
  const double J2 = std::cyl_bessel_j(2.0 / 3, zeta), Y2 = std::cyl_neumann(2.0 / 3, zeta);
  return {
      0.5 * std::sqrt(z) * (J - Y / root3), -0.5 * std::sqrt(z) * (J / root3 + Y),
      0.5 * z * (J2 + Y2 / root3), 0.5 * z * (J2 / root3 - Y2)};
}

AiryEdge airy_edge(double tau) {
  const double z = std::abs(tau), zeta = 2.0 / 3 * z * std::sqrt(z);
  const auto [Ai, Bi, Ai_slope, Bi_slope] = airy(tau);
  const double ray = tau < 0 ? zeta : 0, beyond = std::atan2(-Bi, Ai) + pi / 4 - ray;
  return {-std::log(pi * (Ai * Ai + Bi * Bi)), beyond - 2 * pi * std::round(beyond / (2 * pi)) + ray};
}

const std::vector<double>& airy_edge_series() {
  static const std::vector<double> series = [] {
    constexpr int points = 256;
    std::vector<double> log_g(edge_terms, 0.0), slope(edge_terms, 0.0), phase(edge_terms, 0.0);
    for (int i = 0; i < points; ++i) {
      const double angle = pi * (i + 0.5) / points;
      const AiryEdge edge = airy_edge(edge_reach * std::cos(angle));
      for (int n = 0; n < edge_terms; ++n) {
        const double weight = (n == 0 ? 1.0 : 2.0) / points * std::cos(n * angle);
        log_g[n] += weight * edge.log_g;
        phase[n] += weight * edge.phase;
      }
    }
    // c'_{n-1} = c'_{n+1} + 2 n c_n.
    for (int n = edge_terms - 1; n >= 1; --n)
      slope[n - 1] = (n + 1 < edge_terms ? slope[n + 1] : 0) + 2 * n * log_g[n];
    slope[0] *= 0.5;
    for (double& c : slope) c /= edge_reach;
    std::vector<double> all = log_g;
    all.insert(all.end(), slope.begin(), slope.end());
    all.insert(all.end(), phase.begin(), phase.end());
    return all;
  }();
  return series;
}

} // namespace scatter::wavefront
