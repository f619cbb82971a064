#include <scatter/exact/mie.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/accuracy.hpp>
#include <scatter/phase/methods.hpp>
#include <scatter/phase/sphere_trial.hpp>
#include <scatter/wavefront/layout.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::phase {
namespace {

constexpr double largest_size = 5e4;
constexpr double least_half_window_deg = 0.5;
constexpr double least_error = 1e-9;
constexpr double centre_spacing_deg = 0.1; ///< about

/// Half a fringe of opposite rays of the rim.
double half_window_deg(double size_parameter) {
  return std::max(least_half_window_deg, 90 / size_parameter);
}

/// Described as the drop is, so that the same kernels serve both.
drop::Shape sphere_like(const drop::Shape& shape) {
  drop::Shape sphere = drop::sphere(shape.radius_m);
  if (shape.kind != drop::Shape::Kind::cosine_series) return sphere;
  sphere.kind = shape.kind;
  sphere.cosine.assign(shape.cosine.size(), 0.0);
  sphere.cosine.front() = 1;
  return sphere;
}

/// Of wanted angles whose averages over the sun's disc are made of rows as far apart as the request's are.
double row_spacing_deg(const Request& request) {
  const bool axisymmetric = request.shape.is_sphere() || request.sun_elevation_deg == 90;
  wavefront::Wanted wanted = wanted_of(request);
  wanted.filter_sigma_deg = 0; // other filters may be tried; this one's rows are as near at least
  const double rows =
      wavefront::make_layout(wanted, tracing_of(request), axisymmetric, request.orders.back()).spacing_deg;
  // Layouts halve what is wider than a sixteenth of the disc.
  const double widest = request.sun_disc_deg / 16,
               spacing = std::clamp(rows, std::min(0.004, widest / 2), widest);
  return spacing > widest / 2 ? 2 * spacing : spacing;
}

std::vector<double> multiples(double spacing, double low, double high) {
  std::vector<double> values;
  const auto first = static_cast<int>(std::floor(low / spacing)),
             last = static_cast<int>(std::floor(high / spacing));
  for (int i = first; i <= last; ++i) values.push_back(std::min(i * spacing, 180.0));
  return values;
}

} // namespace

SphereTrial::SphereTrial(const Request& request, std::span<const wavefront::Light> lights)
    : trial_(request), theta_deg_(request.theta_deg), fewer_rays_(1), pole_deg_(request.sun_disc_deg),
      shift_deg_(bow_shift_deg(request.shape)), lights_(lights.begin(), lights.end()), truth_(lights.size()) {
  const auto shortest = std::ranges::min_element(lights_, {}, &wavefront::Light::wavelength_m);
  size_parameter_ = 2 * pi * request.shape.radius_m / shortest->wavelength_m;
  trial_.shape = sphere_like(request.shape);
  if (size_parameter_ > largest_size) {
    // Patches err as x^0.75 over the square of their number.
    fewer_rays_ = std::pow(largest_size / size_parameter_, 0.375);
    trial_.shape.radius_m *= largest_size / size_parameter_;
    size_parameter_ = largest_size;
  }
  trial_.phi_deg = {0};
  trial_.matrix = trial_.amplitudes = trial_.per_order = false;

  const double reach = half_window_deg(size_parameter_) + shift_deg_;
  const double low = std::max(theta_deg_.front() - reach, 0.0),
               high = std::min(theta_deg_.back() + reach, 180.0);
  if (request.sun_disc_deg > 0) {
    const double spacing = row_spacing_deg(request);
    trial_.theta_deg = multiples(spacing, low, high);
    const auto stride = static_cast<std::size_t>(std::ceil(centre_spacing_deg / spacing));
    for (std::size_t t = 0; t < trial_.theta_deg.size(); t += stride) {
      centres_deg_.push_back(trial_.theta_deg[t]);
      centre_at_.push_back(t);
    }
  } else {
    centres_deg_ = multiples(centre_spacing_deg, low, high);
  }
  exact_disc_.emplace(
      centres_deg_, request.sun_disc_deg > 0 ? request.sun_disc_deg : exact::sun_diameter_deg,
      exact::SunDisc::level_for(size_parameter_));
  if (centre_at_.empty()) trial_.theta_deg = exact_disc_->grid_deg();
}

const std::vector<double>& SphereTrial::truth(std::size_t light) {
  std::vector<double>& means = truth_[light];
  if (!means.empty()) return means;
  const double x = 2 * pi * trial_.shape.radius_m / lights_[light].wavelength_m;
  const exact::MieResult mie =
      exact::mie_at_degrees(x, lights_[light].index, exact_disc_->grid_deg(), trial_.threads);
  std::vector<double> sharp;
  for (std::size_t i = 0; i < mie.S1.size(); ++i)
    sharp.push_back((std::norm(mie.S1[i]) + std::norm(mie.S2[i])) / (2 * x * x * mie.Qsca * pi));
  for (std::size_t c = 0; c < centres_deg_.size(); ++c) means.push_back(exact_disc_->mean(c, sharp));
  return means;
}

std::vector<std::vector<double>> SphereTrial::errors(
    std::span<const std::size_t> which, Diffraction diffraction, int rays, std::span<const int> orders) {
  trial_.diffraction = diffraction;
  trial_.rays = std::max(2, static_cast<int>(std::lround(rays * fewer_rays_)));
  trial_.orders.assign(orders.begin(), orders.end());
  std::vector<wavefront::Light> lights;
  for (const std::size_t w : which) lights.push_back(lights_[w]);
  std::vector<std::vector<double>> all(which.size());
  const compute::Device device(trial_.threads);
  wavefront::Tracer(tracing_of(trial_), device)
      .far_field(lights, wanted_of(trial_), [&](std::size_t i, wavefront::FarField& field) {
        const std::vector<double>& exact = truth(which[i]);
        std::vector<double> errors;
        for (std::size_t c = 0; c < centres_deg_.size(); ++c) {
          const double mean = centre_at_.empty() ? exact_disc_->mean(c, field.phase_function)
                                                 : field.phase_function[centre_at_[c]];
          errors.push_back(mean / exact[c] - 1);
        }
        const double x = 2 * pi * trial_.shape.radius_m / lights[i].wavelength_m;
        all[i] = about_angles(errors, half_window_deg(x));
      });
  return all;
}

std::vector<double> SphereTrial::about_angles(std::span<const double> errors, double half_window_deg) const {
  std::vector<double> up_to{0}; // of the squares
  for (const double error : errors) up_to.push_back(up_to.back() + error * error);
  const auto last = std::ssize(centres_deg_) - 1;
  const auto nearest = [&](double theta) {
    const double step =
        (centres_deg_.back() - centres_deg_.front()) / static_cast<double>(std::max<std::ptrdiff_t>(last, 1));
    return std::clamp<std::ptrdiff_t>(std::lround((theta - centres_deg_.front()) / step), 0, last);
  };
  std::vector<double> about;
  for (const double centre : centres_deg_) {
    // Averages over a disc that holds a pole are no measure of others.
    const bool at_pole = std::min(centre, 180 - centre) < pole_deg_;
    double low = centre - half_window_deg, high = centre + half_window_deg;
    if (!at_pole) {
      low = std::max(low, pole_deg_);
      high = std::min(high, 180 - pole_deg_);
    }
    const auto from = nearest(low), to = nearest(high);
    about.push_back(std::sqrt((up_to[to + 1] - up_to[from]) / static_cast<double>(to - from + 1)));
  }
  std::vector<double> worst;
  for (const double theta : theta_deg_) {
    worst.push_back(least_error);
    for (auto c = nearest(theta - shift_deg_); c <= nearest(theta + shift_deg_); ++c)
      worst.back() = std::max(worst.back(), about[c]);
  }
  return worst;
}

} // namespace scatter::phase
