#pragma once

#include <scatter/phase/accuracy.hpp>

#include <complex>
#include <span>
#include <vector>

namespace scatter::phase {

/// The errors of a request at up to three of its wavelengths (first, middle, last; one, if they differ by
/// less than 10 %): errors change little between them. Computed when they are first asked for and kept: what
/// chooses settings, what predicts and what fills a table share one. Not for several threads at once.
class SampledErrors {
public:
  /// index: one per wavelength of the request.
  SampledErrors(Request request, std::span<const std::complex<double>> index);

  /// Makes orders 0..last_order known; estimates of higher ones would do it, too, and all again.
  void provide(int last_order);

  /// [theta], of the sampled wavelength nearest to this one.
  [[nodiscard]] std::vector<double>
  estimate(double wavelength_m, Diffraction diffraction, int rays, std::span<const int> orders);

  /// Over all angles and wavelengths of the request.
  [[nodiscard]] double mean(Diffraction diffraction, int rays, std::span<const int> orders);

  /// Wall time that computing them has taken so far.
  [[nodiscard]] double seconds() const { return seconds_; }

private:
  struct Sample {
    double wavelength_m = 0;
    std::complex<double> index;
    std::size_t stands_for = 0; ///< wavelengths of the request that are nearest to this one
  };
  [[nodiscard]] std::size_t nearest(double wavelength_m) const;

  Request request_;
  std::vector<Sample> samples_;
  std::vector<ErrorModel> models_; ///< one per sample, or none yet
  int provided_ = -1;
  double seconds_ = 0;
};

} // namespace scatter::phase
