#pragma once

#include <scatter/exact/extended_functions.hpp>
#include <scatter/exact/partial_waves.hpp>

/// Internal to scatter::exact: the sum over partial waves in 32 digits, for amplitudes that are what remains
/// when much larger partial waves cancel.
namespace scatter::exact {

/// Coefficients like PartialWaves', for the forward half; index 0 is n = 1.
struct ExtendedWaves {
  struct Wave {
    Extended plus_re, plus_im, minus_re, minus_im;
  };
  std::vector<Wave> waves;
};

/// For each set, the amplitudes at the given angles as double: rounded once from about 30 digits of the
/// largest partial sum. threads and bits as with sum_partial_waves.
struct ExtendedSums {
  std::vector<std::complex<double>> S1, S2;
};
[[nodiscard]] std::vector<ExtendedSums>
sum_partial_waves(std::span<const ExtendedWaves* const> sets, std::span<const Angle> angles, int threads);

} // namespace scatter::exact
