#include <scatter/phase/sampled_errors.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>
#include <utility>

namespace scatter::phase {
namespace {

/// Adds its lifetime to a sum of seconds.
class Stopwatch {
public:
  explicit Stopwatch(double& seconds) : seconds_(seconds) {}
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;
  ~Stopwatch() {
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

private:
  double& seconds_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

} // namespace

SampledErrors::SampledErrors(Request request, std::span<const std::complex<double>> index)
    : request_(std::move(request)) {
  const std::vector<double>& wavelengths = request_.wavelength_m;
  const std::size_t last = wavelengths.size() - 1;
  const auto [least, most] = std::ranges::minmax(wavelengths);
  std::set<std::size_t> sampled{last / 2};
  if (most > 1.1 * least) sampled.insert({0, last});
  for (const std::size_t w : sampled) samples_.push_back({wavelengths[w], index[w], 0});
  for (const double wavelength_m : wavelengths) ++samples_[nearest(wavelength_m)].stands_for;
}

std::size_t SampledErrors::nearest(double wavelength_m) const {
  return static_cast<std::size_t>(
      std::ranges::min_element(
          samples_, {}, [&](const Sample& s) { return std::abs(s.wavelength_m - wavelength_m); }) -
      samples_.begin());
}

double SampledErrors::mean_of(const Errors& errors) const {
  double squares = 0;
  for (std::size_t s = 0; s < samples_.size(); ++s) {
    const double error = root_mean_square(errors[s]);
    squares += static_cast<double>(samples_[s].stands_for) * error * error;
  }
  return std::sqrt(squares / static_cast<double>(request_.wavelength_m.size()));
}

double SampledErrors::guess(Diffraction diffraction, int rays, std::span<const int> orders, int highest) {
  const Stopwatch watch(seconds_);
  if (highest > highest_modelled_) {
    models_.clear();
    for (const Sample& sample : samples_)
      models_.emplace_back(request_, sample.wavelength_m, sample.index, highest);
    highest_modelled_ = highest;
  }
  Errors errors;
  for (const ErrorModel& model : models_) errors.push_back(model.estimate(diffraction, rays, orders));
  return mean_of(errors);
}

const SampledErrors::Errors&
SampledErrors::tried(Diffraction diffraction, int rays, std::span<const int> orders) {
  Settings settings{diffraction, rays, {orders.begin(), orders.end()}};
  if (const auto known = tried_.find(settings); known != tried_.end()) return known->second;
  const Stopwatch watch(seconds_);
  if (!trial_) {
    std::vector<wavefront::Light> lights;
    for (const Sample& sample : samples_) lights.push_back({sample.wavelength_m, sample.index});
    trial_.emplace(request_, lights);
  }
  Errors errors = trial_->errors(diffraction, rays, orders);
  for (std::vector<double>& of_sample : errors)
    for (std::size_t t = 0; t < of_sample.size(); ++t)
      if (std::min(request_.theta_deg[t], 180 - request_.theta_deg[t]) < request_.sun_disc_deg)
        of_sample[t] = std::max(of_sample[t], 1.0);
  return tried_.emplace(std::move(settings), std::move(errors)).first->second;
}

std::vector<double>
SampledErrors::estimate(double wavelength_m, Diffraction diffraction, int rays, std::span<const int> orders) {
  return tried(diffraction, rays, orders)[nearest(wavelength_m)];
}

double SampledErrors::mean(Diffraction diffraction, int rays, std::span<const int> orders) {
  return mean_of(tried(diffraction, rays, orders));
}

} // namespace scatter::phase
