#include <scatter/phase/sampled_errors.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>
#include <utility>

namespace scatter::phase {

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

void SampledErrors::provide(int last_order) {
  if (last_order <= provided_) return;
  const auto start = std::chrono::steady_clock::now();
  models_.clear();
  for (const Sample& sample : samples_)
    models_.emplace_back(request_, sample.wavelength_m, sample.index, last_order);
  provided_ = last_order;
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<double>
SampledErrors::estimate(double wavelength_m, Diffraction diffraction, int rays, std::span<const int> orders) {
  provide(orders.back());
  return models_[nearest(wavelength_m)].estimate(diffraction, rays, orders);
}

double SampledErrors::mean(Diffraction diffraction, int rays, std::span<const int> orders) {
  provide(orders.back());
  double squares = 0;
  for (std::size_t s = 0; s < samples_.size(); ++s) {
    const double error = root_mean_square(models_[s].estimate(diffraction, rays, orders));
    squares += static_cast<double>(samples_[s].stands_for) * error * error;
  }
  return std::sqrt(squares / static_cast<double>(request_.wavelength_m.size()));
}

} // namespace scatter::phase
