#include <scatter/exact/debye.hpp>
#include <scatter/phase/truncation.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace scatter::phase {
namespace {

/// Errors change slowly with size, mostly they fall: where many angles are asked for, a smaller sphere stands
/// in, so that it takes about a second at most.
double judged_size(double size_parameter, std::span<const double> theta_deg) {
  const double range_deg = theta_deg.back() - theta_deg.front() + 4;
  return std::min(size_parameter, std::clamp(2.4e5 / range_deg, 2000.0, 1e4));
}

constexpr int highest_order = 60;
constexpr double centre_step_deg = 0.125;
constexpr double half_window_deg = 2;

std::vector<double> centres(std::span<const double> theta_deg, double reach_deg) {
  const auto first = static_cast<int>(std::floor((theta_deg.front() - reach_deg) / centre_step_deg));
  const auto last = static_cast<int>(std::ceil((theta_deg.back() + reach_deg) / centre_step_deg));
  std::vector<double> centres_deg;
  for (int i = std::max(first, 0); i <= std::min(last, static_cast<int>(180 / centre_step_deg)); ++i)
    centres_deg.push_back(i * centre_step_deg);
  return centres_deg;
}

std::vector<double> mean_intensity(
    const exact::SunDisc& disc, const std::vector<std::complex<double>>& S1,
    const std::vector<std::complex<double>>& S2) {
  std::vector<double> intensity(S1.size()), means(disc.size());
  for (std::size_t i = 0; i < S1.size(); ++i) intensity[i] = std::norm(S1[i]) + std::norm(S2[i]);
  for (std::size_t c = 0; c < means.size(); ++c) means[c] = disc.mean(c, intensity);
  return means;
}

} // namespace

Truncation::Truncation(
    double size_parameter, std::complex<double> index, std::span<const double> theta_deg, int last_order,
    double shift_deg, int threads)
    : theta_deg_(theta_deg.begin(), theta_deg.end()),
      centres_deg_(centres(theta_deg, half_window_deg + shift_deg)), shift_deg_(shift_deg),
      size_parameter_(judged_size(size_parameter, theta_deg)),
      disc_(centres_deg_, exact::sun_diameter_deg, exact::SunDisc::level_for(size_parameter_)) {
  std::vector<int> all(std::min(last_order, highest_order) + 1);
  std::iota(all.begin(), all.end(), 0);
  auto series = exact::debye_at_degrees(
      size_parameter_, index, all, disc_.grid_deg(), threads, exact::DebyeDigits::visible);
  for (auto& order : series.orders) orders_.push_back({std::move(order.S1), std::move(order.S2)});
  whole_ = mean_intensity(disc_, series.whole.S1, series.whole.S2);
}

std::ptrdiff_t Truncation::centre_of(double theta_deg) const {
  const double c = (theta_deg - centres_deg_.front()) / centre_step_deg;
  return std::clamp<std::ptrdiff_t>(std::lround(c), 0, static_cast<std::ptrdiff_t>(centres_deg_.size()) - 1);
}

std::vector<double> Truncation::share(int order) const {
  std::vector<double> shares(theta_deg_.size(), 0.0);
  if (static_cast<std::size_t>(order) >= orders_.size()) return shares;
  const std::vector<double> means = mean_intensity(disc_, orders_[order].S1, orders_[order].S2);
  for (std::size_t t = 0; t < shares.size(); ++t) {
    const std::ptrdiff_t c = centre_of(theta_deg_[t]);
    shares[t] = means[c] / whole_[c];
  }
  return shares;
}

std::vector<double> Truncation::whole() const {
  std::vector<double> intensity;
  for (const double theta : theta_deg_)
    intensity.push_back(whole_[centre_of(theta)] / (size_parameter_ * size_parameter_));
  return intensity;
}

std::vector<double> Truncation::error(std::span<const int> orders) const {
  const std::size_t size = disc_.grid_deg().size();
  std::vector<std::complex<double>> S1(size), S2(size);
  for (const int p : orders) {
    if (static_cast<std::size_t>(p) >= orders_.size()) continue;
    for (std::size_t i = 0; i < size; ++i) {
      S1[i] += orders_[p].S1[i];
      S2[i] += orders_[p].S2[i];
    }
  }
  const std::vector<double> means = mean_intensity(disc_, S1, S2);
  std::vector<double> up_to(means.size() + 1, 0.0); // of the squares
  for (std::size_t c = 0; c < means.size(); ++c) {
    const double relative = means[c] / whole_[c] - 1;
    up_to[c + 1] = up_to[c] + relative * relative;
  }
  const auto local = [&](std::ptrdiff_t centre) {
    const auto reach = static_cast<std::ptrdiff_t>(half_window_deg / centre_step_deg);
    const auto first = std::max<std::ptrdiff_t>(centre - reach, 0);
    const auto end = std::min<std::ptrdiff_t>(centre + reach + 1, static_cast<std::ptrdiff_t>(means.size()));
    return std::sqrt(std::max(up_to[end] - up_to[first], 0.0) / static_cast<double>(end - first));
  };
  std::vector<double> errors;
  for (const double theta : theta_deg_) {
    double worst = 0;
    for (auto c = centre_of(theta - shift_deg_); c <= centre_of(theta + shift_deg_); ++c)
      worst = std::max(worst, local(c));
    errors.push_back(worst);
  }
  return errors;
}

} // namespace scatter::phase
