#pragma once

#include <cmath>
#include <complex>
#include <span>
#include <vector>

/// Lorenz-Mie scattering by a homogeneous sphere, the judge of everything else.
/// Conventions: time factor exp(-i omega t), m = n + ik with k >= 0, amplitudes of Bohren & Huffman (1983),
/// eq. 4.74.
namespace scatter::exact {

/// Largest size parameter at which results were compared with 60 digits.
inline constexpr double mie_validated_size_parameter = 5e4;

struct MieResult {
  double size_parameter = 0;
  std::complex<double> index;
  /// Cross sections over the geometric one, pi a^2. Qabs is summed on its own, not as a difference: it keeps
  /// its digits however small k is, and is 0 for k = 0. Qback = 4 |S(180 deg)|^2 / x^2 (radar cross section,
  /// Bohren & Huffman 4.82).
  double Qext = 0, Qsca = 0, Qabs = 0, Qback = 0;
  double g = 0;                             ///< mean cosine of the scattering angle
  std::vector<std::complex<double>> S1, S2; ///< one per angle
  /// sr^-1, (|S1|^2 + |S2|^2) / (2 pi x^2 Qsca): integral over the sphere 1
  std::vector<double> phase_function;
  /// Relative: of Qext, Qsca and Qabs, and of S against max(|S1|,|S2|) at the same angle.
  double error_estimate = 0;
  /// Relative: of Qback, which loses digits where its partial waves cancel, whatever the angles.
  double Qback_error_estimate = 0;
};

/// Of a sphere's Mueller matrix; S21 = S12, S22 = S11, S43 = -S34, S44 = S33, and the other eight are 0.
struct MuellerElements {
  double S11 = 0, S12 = 0, S33 = 0, S34 = 0;
};

/// Of the amplitudes at one angle: Bohren & Huffman (1983), section 4.4.4, eq. 4.77, in the unit of |S|^2,
/// not normalised. S11 = (|S2|^2 + |S1|^2) / 2, S12 = (|S2|^2 - |S1|^2) / 2, S33 + i S34 = S2 conj(S1).
/// Rounding is below 1e-15 of S11. For any amplitudes whose squares are in range; throws nothing.
[[nodiscard]] inline MuellerElements mueller_elements(std::complex<double> S1, std::complex<double> S2) {
  const double perpendicular = std::abs(S1), parallel = std::abs(S2);
  // The difference of squares as a product: it keeps its digits where the two are nearly equal.
  return {
      (std::norm(S2) + std::norm(S1)) / 2, (parallel - perpendicular) * (parallel + perpendicular) / 2,
      S2.real() * S1.real() + S2.imag() * S1.imag(), S2.imag() * S1.real() - S2.real() * S1.imag()};
}

/// theta in radians, [0, pi], any order. threads = 0: all cores. Each angle's result depends on x, m, that
/// angle and the machine's vector instructions alone, bit for bit: not on threads, order or number of angles.
///
/// Accuracy against 60-digit arithmetic, x <= 5e4: Qext, Qsca, Qabs and g 1e-13; Qback 2e-12, 2e-11 above x =
/// 5000 (Qback_error_estimate: it grows as sqrt(x), and where the partial waves cancel); S 1e-12 of
/// max(|S1|, |S2|), 1e-11 above x = 5000, mostly 1e-15 .. 1e-13, also where partial waves cancel to 1e-5 (m =
/// 1.0001 near 180 deg) and on the peak of a resonance of width 1e-8 in x: x and m count as exact. The angle
/// does, too: rounding it to radians moves the phase of S by x times 2e-16; see mie_at_degrees.
/// error_estimate was above the error of 400 random spheres, by 100 at most with errors below 1e-16 taken as
/// 1e-16. Beyond x = 5e4 (mie_validated_size_parameter) and up to 5e5 it computes the same way, with the same
/// limits for the estimates; one sphere of x = 94,248 was compared there.
///
/// Cost: |m| x steps in pairs of doubles for the coefficients, 30 us at x = 1000 and m = 1.333, then 1.2 x
/// vectorised steps for every 48 angles (24 on AVX2), for every 96 where angles come with their mirror image
/// pi - theta. Angles whose estimate is above 2e-12 (x <= 5000) or 2e-11 are summed again in 32 digits, each
/// for the price of about 20.
///
/// Throws InputError for x outside [1e-6, 5e5], an index that is not finite, n <= 0, k < 0, m = 1, |m| <
/// 1e-6, |m| x > 1e8, or an angle that is not in [0, pi].
[[nodiscard]] MieResult
mie(double size_parameter, std::complex<double> index, std::span<const double> theta, int threads = 0);

/// The same for angles in degrees, [0, 180], which count as exact in degrees; but if all of them make an even
/// grid of decimals with up to six places, such as 0:180:0.1 and in any order, they count as those decimals
/// instead of their doubles, and the estimate is of the error there.
///
/// Such a grid, if it has angles enough, is summed by FFTs over the circle: 14401 angles at x = 5e4 cost a
/// sixth of what they cost one by one, with errors of 1e-15 .. 1e-13 of max(|S1|, |S2|). Angles whose
/// estimate is too large then, as most of them for m = 1.0001, are summed again in 32 digits as above, those
/// alone. Whether FFTs are used depends on x and the grid alone, by a model of the costs. Results then depend
/// on the grid, too: two grids, or a grid and a single angle, agree at a common angle within the estimates
/// instead of bit for bit. Threads and order still change nothing.
[[nodiscard]] MieResult mie_at_degrees(
    double size_parameter, std::complex<double> index, std::span<const double> theta_deg, int threads = 0);

} // namespace scatter::exact
