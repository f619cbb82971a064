#pragma once

#include <scatter/phase/accuracy.hpp>
#include <scatter/phase/sphere_trial.hpp>

#include <complex>
#include <map>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

namespace scatter::phase {

/// The errors of a request at up to three of its wavelengths (first, middle, last; one, if they differ by
/// less than 10 %): errors change little between them. Computed when they are first asked for and kept: what
/// chooses settings, what predicts and what fills a table share one. Not for several threads at once.
class SampledErrors {
public:
  /// index: one per wavelength of the request.
  SampledErrors(Request request, std::span<const std::complex<double>> index);

  /// Over all angles and wavelengths of the request, by ErrorModel: fast when many settings are compared.
  /// Makes the model of the orders up to `highest` if there is none of as many yet.
  [[nodiscard]] double guess(Diffraction diffraction, int rays, std::span<const int> orders, int highest);

  /// What tables carry: [theta], by SphereTrial at the sampled wavelength nearest to this one; 1 at least
  /// where the sun's disc holds a pole, over which its average does not go. Throws compute::DeviceError.
  [[nodiscard]] std::vector<double>
  estimate(double wavelength_m, Diffraction diffraction, int rays, std::span<const int> orders);

  /// The same over all angles and wavelengths of the request.
  [[nodiscard]] double mean(Diffraction diffraction, int rays, std::span<const int> orders);

  /// Wall time that computing them has taken so far.
  [[nodiscard]] double seconds() const { return seconds_; }

private:
  struct Sample {
    double wavelength_m = 0;
    std::complex<double> index;
    std::size_t stands_for = 0; ///< wavelengths of the request that are nearest to this one
  };
  using Settings = std::tuple<Diffraction, int, std::vector<int>>;
  using Errors = std::vector<std::vector<double>>; ///< [sample][theta]
  [[nodiscard]] std::size_t nearest(double wavelength_m) const;
  [[nodiscard]] const Errors& tried(Diffraction diffraction, int rays, std::span<const int> orders);
  /// Over all angles, and samples by the wavelengths that they stand for.
  [[nodiscard]] double mean_of(const Errors& errors) const;

  Request request_;
  std::vector<Sample> samples_;
  std::vector<ErrorModel> models_; ///< one per sample, or none yet
  int highest_modelled_ = -1;
  std::optional<SphereTrial> trial_;
  std::map<Settings, Errors> tried_;
  double seconds_ = 0;
};

} // namespace scatter::phase
