#pragma once

#include <scatter/exact/long_complex.hpp>

#include <complex>
#include <cstddef>
#include <span>
#include <vector>

/// Fourier sums over the azimuth, sum_n c_n cos(n theta) and sum_n c_n sin(n theta), for many angles and
/// several sequences c_n at once.
namespace scatter::exact {

/// The c_n of one sum, packed for it.
class AzimuthSeries {
public:
  enum class Kind { cosine, sine };
  /// coefficients[n], n = 0, 1, ...; those of a sine series may start with anything.
  AzimuthSeries(Kind kind, std::span<const LongComplex> coefficients);

  /// The terms around one order N: those of N + j and N - j share cos(j theta) and sin(j theta).
  static constexpr std::size_t half = 32;
  struct Block {
    double middle_re, middle_im;
    double sum_re[half], sum_im[half];   ///< c_{N+j} + c_{N-j}, j = 1..half
    double less_re[half], less_im[half]; ///< c_{N+j} - c_{N-j}
  };
  [[nodiscard]] const std::vector<Block>& blocks() const { return blocks_; }
  [[nodiscard]] Kind kind() const { return kind_; }
  /// sqrt(sum |c_n|^2)
  [[nodiscard]] double size() const { return size_; }

private:
  Kind kind_;
  std::vector<Block> blocks_;
  double size_ = 0;
};

struct AzimuthSum {
  std::vector<std::complex<double>> value; ///< one per angle
  std::vector<double> rounding;            ///< estimate of the absolute rounding error of each value
};

/// One sum per series. theta in radians, [-pi, pi]. An angle's sums depend on the coefficients and that angle
/// alone, bit for bit. threads = 0: all cores.
///
/// Accuracy: the factors cos(n theta) and sin(n theta) are right to 2e-16 each, whatever n is. Cost: about
/// one vectorised multiply-add per coefficient (real, imaginary) and angle.
[[nodiscard]] std::vector<AzimuthSum>
sum_over_azimuth(std::span<const AzimuthSeries> series, std::span<const real> theta, int threads);

} // namespace scatter::exact
