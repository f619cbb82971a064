#include <scatter/phase/request_errors.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <set>
#include <utility>

namespace scatter::phase {
namespace {

/// Adds its lifetime to a sum of seconds.
class Stopwatch {
public:
  explicit Stopwatch(double& sum) : sum_(sum) {}
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;
  ~Stopwatch() { sum_ += seconds(); }
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

private:
  double& sum_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

} // namespace

RequestErrors::RequestErrors(Request request, std::span<const std::complex<double>> index)
    : request_(std::move(request)), index_(index.begin(), index.end()) {
  const std::vector<double>& wavelengths = request_.wavelength_m;
  std::vector<std::size_t> ascending(wavelengths.size());
  std::iota(ascending.begin(), ascending.end(), 0);
  std::ranges::sort(ascending, {}, [&](std::size_t w) { return wavelengths[w]; });
  const std::size_t last = ascending.size() - 1;
  for (const std::size_t place : std::set{std::size_t{0}, last / 2, last})
    samples_.push_back(ascending[place]);
}

double RequestErrors::guess(Diffraction diffraction, int rays, std::span<const int> orders, int highest) {
  const Stopwatch watch(seconds_);
  if (highest > highest_modelled_) {
    models_.clear();
    for (const std::size_t w : samples_)
      models_.emplace_back(request_, request_.wavelength_m[w], index_[w], highest);
    highest_modelled_ = highest;
  }
  std::vector<double> errors;
  for (const ErrorModel& model : models_)
    errors.push_back(root_mean_square(model.estimate(diffraction, rays, orders)));
  return root_mean_square(errors);
}

const RequestErrors::Errors& RequestErrors::tried(
    std::span<const std::size_t> wavelengths, Diffraction diffraction, int rays,
    std::span<const int> orders) {
  Errors& errors = tried_[{diffraction, rays, {orders.begin(), orders.end()}}];
  errors.resize(request_.wavelength_m.size());
  std::vector<std::size_t> missing;
  for (const std::size_t w : wavelengths)
    if (errors[w].empty()) missing.push_back(w);
  if (missing.empty()) return errors;
  const Stopwatch watch(seconds_);
  if (!trial_) {
    std::vector<wavefront::Light> lights;
    for (std::size_t w = 0; w < index_.size(); ++w) lights.push_back({request_.wavelength_m[w], index_[w]});
    trial_.emplace(request_, lights);
  }
  const double before = watch.seconds();
  std::vector<std::vector<double>> found = trial_->errors(missing, diffraction, rays, orders);
  seconds_per_trial_ = (watch.seconds() - before) / static_cast<double>(missing.size());
  // What averages have of other azimuths no sphere tells.
  const bool axisymmetric = request_.shape.is_sphere() || request_.sun_elevation_deg == 90;
  for (std::size_t i = 0; i < missing.size(); ++i) {
    for (std::size_t t = 0; t < found[i].size(); ++t)
      if (!axisymmetric &&
          std::min(request_.theta_deg[t], 180 - request_.theta_deg[t]) < request_.sun_disc_deg)
        found[i][t] = std::max(found[i][t], 1.0);
    errors[missing[i]] = std::move(found[i]);
  }
  return errors;
}

double RequestErrors::sampled(Diffraction diffraction, int rays, std::span<const int> orders) {
  const Errors& errors = tried(samples_, diffraction, rays, orders);
  std::vector<double> means;
  for (const std::size_t w : samples_) means.push_back(root_mean_square(errors[w]));
  return root_mean_square(means);
}

std::vector<std::vector<double>>
RequestErrors::all(Diffraction diffraction, int rays, std::span<const int> orders) {
  std::vector<std::size_t> wavelengths(request_.wavelength_m.size());
  std::iota(wavelengths.begin(), wavelengths.end(), 0);
  return tried(wavelengths, diffraction, rays, orders);
}

} // namespace scatter::phase
