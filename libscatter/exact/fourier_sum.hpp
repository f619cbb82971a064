#pragma once

#include <scatter/exact/partial_waves.hpp>

#include <complex>
#include <cstddef>
#include <functional>
#include <span>

/// Internal to scatter::exact: the sum over partial waves on an even division of the circle, by FFT. Method
/// and its count of operations: fourier_sum.cpp.
namespace scatter::exact {

/// How a sum is split.
struct FourierSplit {
  std::size_t steps = 0;      ///< of the whole circle, a multiple of 4
  std::size_t low_orders = 0; ///< Legendre polynomials of lower order become Fourier series
  std::size_t terms = 0;      ///< of the asymptotic series of the others; 0: there are no others
  double smallest_sine = 0;   ///< angles with a smaller sine are not served
  double cost = 0;            ///< [ns], on the machine where the model was measured
};

/// The cheapest split for `count` partial waves, by a model of the costs: it does not depend on the machine,
/// nor on measured times. direct_below(s): cost [ns] of the direct sum for those angles that have a sine
/// below s; the split's cost includes it.
[[nodiscard]] FourierSplit
cheapest_split(std::size_t count, std::size_t steps, const std::function<double(double)>& direct_below);

/// Where the amplitudes of one set go, one place per angle.
struct FourierSums {
  std::span<std::complex<double>> S1, S2;
  std::span<double> rounding;        ///< estimated error of S1 and S2, absolute: rounding and neglected terms
  std::span<double> largest_partial; ///< |S1|^2 + |S2|^2 + typical / sin(theta)
  double typical = 0;
};

/// All sets at theta = 2 pi j / steps, j = first..last with 0 < j < steps / 2; good where the sine is
/// split.smallest_sine or more. threads = 0: all cores; they change no bits.
void fourier_sums(
    std::span<const PartialWaves> sets, const FourierSplit& split, std::size_t first, std::size_t last,
    std::span<const FourierSums> results, int threads);

} // namespace scatter::exact
