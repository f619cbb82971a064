#pragma once

#include <scatter/exact/vector_unit.hpp>

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

/// R, TT and TRT of RaySection (Polarisation::mean) for many directions at once: what hair evaluates most.
namespace scatter::fiber {

/// Where to evaluate, one entry per direction pair; all of the same length. Cosines and sines rather than
/// angles: whoever has vectors has these without a single inverse function.
struct RayLobeDirections {
  std::span<const double> cos_theta_d; ///< of half the difference of the inclinations, 0 < c <= 1
  std::span<const double> sin_half_phi, cos_half_phi; ///< of |phi| / 2, |phi| <= pi: neither is negative
};

/// N_0, N_1, N_2 per colour. Several absorptions share one search for the rays.
/// N: [order][colour][direction], 3 x sigma_a.size() x directions; order 0 is the same in all colours.
///
/// Against RaySection relative 1e-12 where phi is 5e-3 rad or more from a caustic and from the rim of the lit
/// azimuths; nearer, 1e-15 over the distance, as rounding of the arguments alone makes it. Results do not
/// depend on how directions are grouped. On a caustic to the last bit the value is
/// large and finite.
///
/// Unchecked: the caller answers for eta > 1, sigma_a >= 0 and the ranges above. Throws std::invalid_argument
/// when lengths do not match.
void ray_lobes(
    double eta, std::span<const double> sigma_a, const RayLobeDirections& directions, std::span<double> N,
    const exact::VectorUnit& unit = exact::vector_units()[0]);

/// Energy of all orders from first_order on against cos theta_d, as a Chebyshev series: the residual lobe's
/// strength in the same loops.
class ResidualEnergy {
public:
  /// Fitted to RaySection(eta, sigma_a).residual(first_order, .).energy, to 1e-12 of 1; first_order 1..1000.
  /// Takes milliseconds. Throws InputError as RaySection does.
  ResidualEnergy(double eta, double sigma_a, int first_order);

  /// 0 < cos_theta_d <= 1.
  [[nodiscard]] double operator()(double cos_theta_d) const {
    const double x = 2 * to_variable(cos_theta_d) - 1;
    double last = 0, before = 0;
    for (std::size_t k = coefficient_.size() - 1; k > 0; --k) {
      const double next = 2 * x * last - before + coefficient_[k];
      before = last;
      last = next;
    }
    return x * last - before + coefficient_[0];
  }
  /// energy[i] for cos_theta_d[i]; vectorised. Throws std::invalid_argument when lengths do not match.
  void evaluate(
      std::span<const double> cos_theta_d, std::span<double> energy,
      const exact::VectorUnit& unit = exact::vector_units()[0]) const;
  [[nodiscard]] std::size_t terms() const { return coefficient_.size(); }
  /// Of Chebyshev's polynomials of 2 sqrt(cos_theta_d) - 1.
  [[nodiscard]] const std::vector<double>& coefficients() const { return coefficient_; }

private:
  /// A little absorption makes the energy bend within cos theta_d < sigma_a: the root spreads that out.
  static double to_variable(double cos_theta_d) { return std::sqrt(cos_theta_d); }
  std::vector<double> coefficient_;
};

} // namespace scatter::fiber
