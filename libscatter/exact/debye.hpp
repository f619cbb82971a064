#pragma once

#include <complex>
#include <span>
#include <vector>

/// Debye series of a homogeneous sphere: Lorenz-Mie amplitudes split by the number of a ray's crossings,
/// diffraction and tunnelling included. The judge of ray tracers, order by order. Conventions as in
/// exact/mie.hpp: time factor exp(-i omega t), m = n + ik with k >= 0, amplitudes of Bohren & Huffman (1983),
/// eq. 4.74, phases referred to the centre: sum over p of S_p is Mie's S.
namespace scatter::exact {

/// Largest size parameter at which Debye terms were compared with 60 digits.
inline constexpr double debye_validated_size_parameter = 2e4;

/// One part of the series: amplitudes, one per angle.
struct DebyeTerm {
  std::vector<std::complex<double>> S1, S2;
  /// Largest over the angles of the error of S1 and S2, relative to max(|S1|, |S2|, 1e-12 max of the whole's)
  /// at the same angle; with visible digits to max(|S1|, |S2|, max of the whole's).
  double error_estimate = 0;
};

struct DebyeOrder : DebyeTerm {
  int p = 0; ///< 0 external reflection and diffraction, 1 transmission, p - 1 internal reflections
};

struct DebyeResult {
  double size_parameter = 0;
  std::complex<double> index;
  std::vector<DebyeOrder> orders; ///< those asked for, ascending
  DebyeTerm partial_sum;          ///< all orders 0 .. the last asked for, whether asked for or not
  /// All orders after the last asked for, as the geometric series' closed form. It decays slowly with p:
  /// resonances keep partial waves inside, in the extreme for 1e8 reflections.
  DebyeTerm remainder;
  DebyeTerm whole; ///< all orders, closed form: Lorenz-Mie
};

/// How many digits are wanted.
enum class DebyeDigits : unsigned char {
  every,  ///< those of every term by itself, as promised below
  visible ///< errors up to 1e-7 of max(|S1|, |S2|) of the whole at the same angle: what shows beside it.
          ///< Terms that are darker than that have no digits, partial_sum and remainder stay empty
};

/// theta in radians, [0, pi], any order; orders 0..1000, any order, repeats ignored. threads = 0: all cores.
/// Each number depends on x, m, p and its angle alone, bit for bit.
///
/// Source: Hovenac & Lock 1992, J. Opt. Soc. Am. A 9, 781, with Riccati-Hankel functions of both kinds
/// outside and inside: a_n, b_n = 1/2 [1 - R22 - sum T21 R11^(p-1) T12]. See debye.cpp for the forms that
/// keep their digits.
///
/// For m < 1 the partial waves m x < n < x are totally reflected. Taken literally, as here, the series then
/// splits them with R11 next to 1: p = 0 has their amplitude but not the phase of total reflection, orders p
/// >= 1 have next to nothing of them, and `remainder` holds the difference however late it starts. What a ray
/// picture calls external reflection there is p = 0 and the remainder together.
///
/// Accuracy against 60-digit arithmetic, x <= 2e4: 1e-10 of max(|S1_p|, |S2_p|, 1e-12 |S_Mie|), mostly 1e-13,
/// also where p has no ray and all partial waves cancel; `whole` 1e-11 of max(|S1|, |S2|), x <= 5e4.
/// error_estimate was above the error in 150 random spheres (x to 1600, n 0.05..10, k to 10, orders to 60),
/// mostly by 10 to 100, and below 1e-10. The angle counts as exact. Beyond x = 2e4
/// (debye_validated_size_parameter) and up to 5e5 it computes the same way, not compared.
///
/// Cost: x |m| steps of 32 digits for the coefficients, then per order Mie's sum over partial waves, and some
/// 20 times that for angles where double is not enough; with visible digits it always is, short of accidents.
///
/// Throws InputError for x outside [1e-6, 5e5], an index that is not finite, n <= 0, k < 0, m = 1, |m| <
/// 1e-6, |m| x > 1e8, an angle that is not in [0, pi], no order, or one outside 0..1000.
[[nodiscard]] DebyeResult debye(
    double size_parameter, std::complex<double> index, std::span<const int> orders,
    std::span<const double> theta, int threads = 0, DebyeDigits digits = DebyeDigits::every);

/// The same for angles in degrees, [0, 180], which count as exact in degrees; even grids of decimals count as
/// those decimals, as in mie_at_degrees, and estimates are of the errors there. Their sums, too, may be made
/// by FFT: then numbers depend on the grid as well.
[[nodiscard]] DebyeResult debye_at_degrees(
    double size_parameter, std::complex<double> index, std::span<const int> orders,
    std::span<const double> theta_deg, int threads = 0, DebyeDigits digits = DebyeDigits::every);

} // namespace scatter::exact
