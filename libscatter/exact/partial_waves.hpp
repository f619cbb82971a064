#pragma once

#include <scatter/exact/vector_unit.hpp>

#include <complex>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

/// Internal to scatter::exact: what all solutions for a sphere share, from coefficients to amplitudes.
/// S1 = sum (2n+1)/(n(n+1)) (a_n pi_n + b_n tau_n), S2 with pi_n and tau_n exchanged (Bohren & Huffman 4.74).
namespace scatter::exact {

/// One set of coefficients.
class PartialWaves {
public:
  PartialWaves() = default;
  /// All at once: four per n, as weights() gives them.
  explicit PartialWaves(std::vector<double> weights) : weights_(std::move(weights)) {}
  /// Appends the next n: plus and minus are (2n+1)/(n(n+1)) (a_n +- b_n) / 2.
  void add(std::complex<double> plus, std::complex<double> minus) {
    weights_.insert(weights_.end(), {plus.real(), plus.imag(), minus.real(), minus.imag()});
  }
  [[nodiscard]] std::size_t count() const { return weights_.size() / 4; }
  /// Four per n, as added.
  [[nodiscard]] std::span<const double> weights() const { return weights_; }

private:
  std::vector<double> weights_;
};

enum class AngleUnit : unsigned char { radian, degree };

/// One scattering angle, folded into the forward half: t = 1 - cos(theta') with theta' = min(theta, pi -
/// theta).
struct Angle {
  double t = 0, t_rest = 0; ///< t to twice the digits of a double
  double theta = 0;         ///< as given; theta + theta_rest counts as exact in its unit
  double theta_rest = 0;
  /// Millionths of a degree, exactly, if the angle belongs to an even grid of decimals; otherwise -1.
  std::int32_t place = -1;
  AngleUnit unit = AngleUnit::radian;
  bool backward = false; ///< theta > 90 deg
};

/// Angles count as exact in their unit. Where all of them make an even grid in degrees, in any order, whose
/// values are doubles next to decimals with up to six places (0:180:0.1), they count as those decimals: so
/// the grid is even, and symmetric to 90 deg, to the last digit.
///
/// Throws InputError for an angle that is not in [0, pi] or [0, 180] deg.
[[nodiscard]] std::vector<Angle> fold_angles(std::span<const double> angles, AngleUnit unit);

/// Indices of the angles in blocks of at most `size`, each of one half only.
[[nodiscard]] std::vector<std::vector<std::size_t>>
blocks_of_one_half(std::span<const Angle> angles, std::size_t size);

/// Amplitudes of one set of coefficients, one per angle.
struct AngleSums {
  std::vector<std::complex<double>> S1, S2;
  std::vector<double> largest_partial; ///< max over the sum's course of (|S1|^2 + |S2|^2) / 2
  std::vector<double> rounding;        ///< estimated error of the sum itself, absolute
};

/// How sums over partial waves are made: one by one, or for the whole circle by FFT (fourier_sum.hpp) where
/// the angles are an even grid of decimals.
enum class SumMethod {
  cheapest, ///< by FFT where a model of the costs, which knows numbers alone, says that it saves a fifth
  direct,
  fourier ///< by FFT wherever possible: InputError if the angles are no grid of at most 4e6 steps
};

/// The amplitudes of several sets of coefficients, all of the same count, at the same angles. threads = 0:
/// all cores. Angles that come with their mirror image pi - theta cost half. Summed directly, each amplitude
/// depends on its set, its angle and the vector unit alone, bit for bit. By FFT it also depends on which
/// angles there are (not on their order), within `rounding`; angles near the axis, and those where `rounding`
/// would be worse than the direct sum's, are summed directly then, too.
[[nodiscard]] std::vector<AngleSums> sum_partial_waves(
    std::span<const PartialWaves> sets, std::span<const Angle> angles, int threads,
    const VectorUnit& unit = vector_units()[0], SumMethod method = SumMethod::cheapest);

/// Rounding of a direct sum over `count` partial waves, relative to the root of its largest_partial.
[[nodiscard]] double sum_rounding(std::size_t count);

/// Runs work(0) .. work(items - 1), in any order, on at most `threads` threads (0: all cores), fewer where
/// there is little to do: a thread costs about as much as 1e5 of `cost`, the whole work's.
void in_parallel(std::size_t items, double cost, int threads, const std::function<void(std::size_t)>& work);

/// Throws InputError for x outside [1e-6, 5e5], an index that is not finite, n <= 0, k < 0, m = 1, |m| x >
/// 1e8.
void check_sphere(double size_parameter, std::complex<double> index);

} // namespace scatter::exact
