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

/// The errors of a request: guessed or tried at up to three of its wavelengths (the shortest, one in the
/// middle, the longest), and tried at all of them. Computed when they are first asked for and kept: what
/// chooses settings, what predicts and what fills a table share them. Not for several threads at once.
class RequestErrors {
public:
  /// index: one per wavelength of the request.
  RequestErrors(Request request, std::span<const std::complex<double>> index);

  /// Over all angles and the sampled wavelengths, by ErrorModel: fast when many settings are compared.
  /// Makes the model of the orders up to `highest` if there is none of as many yet.
  [[nodiscard]] double guess(Diffraction diffraction, int rays, std::span<const int> orders, int highest);

  /// The same by SphereTrial. Throws compute::DeviceError.
  [[nodiscard]] double sampled(Diffraction diffraction, int rays, std::span<const int> orders);

  /// What tables carry: [wavelength][theta], by SphereTrial; 1 at least where the sun's disc holds a pole,
  /// unless the drop is axisymmetric about the light. Throws compute::DeviceError.
  [[nodiscard]] std::vector<std::vector<double>>
  all(Diffraction diffraction, int rays, std::span<const int> orders);

  /// Wall time that computing them has taken so far.
  [[nodiscard]] double seconds() const { return seconds_; }
  /// What all() will take of it after sampled(), as trials of these settings have gone.
  [[nodiscard]] double seconds_to_come() const {
    return seconds_per_trial_ * static_cast<double>(request_.wavelength_m.size() - samples_.size());
  }

private:
  using Settings = std::tuple<Diffraction, int, std::vector<int>>;
  using Errors = std::vector<std::vector<double>>; ///< [wavelength][theta]; empty: not yet tried
  /// Errors with these wavelengths tried at least.
  [[nodiscard]] const Errors& tried(
      std::span<const std::size_t> wavelengths, Diffraction diffraction, int rays,
      std::span<const int> orders);

  Request request_;
  std::vector<std::complex<double>> index_;
  std::vector<std::size_t> samples_; ///< wavelengths
  std::vector<ErrorModel> models_;   ///< one per sample, or none yet
  int highest_modelled_ = -1;
  std::optional<SphereTrial> trial_;
  std::map<Settings, Errors> tried_;
  double seconds_ = 0, seconds_per_trial_ = 0;
};

} // namespace scatter::phase
