#pragma once

#include <complex>
#include <span>
#include <vector>

/// Lorenz-Mie scattering by a homogeneous sphere, the judge of everything else.
/// Conventions: time factor exp(-i omega t), m = n + ik with k >= 0, amplitudes of Bohren & Huffman (1983), eq. 4.74.
namespace scatter::exact {

struct MieResult {
  double size_parameter = 0;
  std::complex<double> index;
  double Qext = 0, Qsca = 0, Qabs = 0, Qback = 0, g = 0;
  std::vector<std::complex<double>> S1, S2; ///< one per angle
  std::vector<double> phase_function;       ///< sr^-1, integral over the sphere 1
  double error_estimate = 0;                ///< relative: of the Q's, and of S against max(|S1|,|S2|) at the same angle
};

/// See the source for the method and its accuracy. theta in radians, [0, pi], any order.
/// threads = 0: all cores; the result does not depend on it.
/// Throws InputError for x outside [1e-6, 5e5], an index that is not finite, n <= 0, k < 0, or m = 1.
[[nodiscard]] MieResult mie(double size_parameter, std::complex<double> index, std::span<const double> theta, int threads = 0);

} // namespace scatter::exact
