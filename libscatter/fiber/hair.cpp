#include <scatter/fiber/hair.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace scatter::fiber {
namespace {

/// Exit azimuth, wrapped, of the ray at the offset h.
double exit_azimuth(int order, double eta_prime, double h) {
  return wrap_angle(2 * order * std::asin(h / eta_prime) - 2 * std::asin(h) + order * pi);
}

/// Of rays spread evenly over h: what order p sends into the azimuth phi [1/rad]. The integral over phi is 1.
double ray_density(const RaySection& section, int order, double theta_d, double phi) {
  double sum = 0;
  for (const RayEvent& ray : section.events(order, theta_d, phi)) sum += std::min(ray.spread, 1e12);
  return sum;
}

std::array<std::shared_ptr<const CrossSection>, 3> round_sections(const HairParameters& parameters) {
  std::array<std::shared_ptr<const CrossSection>, 3> sections;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t before = 0; before < c; ++before)
      if (parameters.sigma_a[before] == parameters.sigma_a[c]) sections[c] = sections[before];
    if (!sections[c]) sections[c] = std::make_shared<RaySection>(parameters.eta, parameters.sigma_a[c]);
  }
  return sections;
}

HairParameters checked(const HairParameters& parameters) {
  if (!(parameters.eta > 1 && parameters.eta <= 10))
    throw InputError(fmt::format("eta: {} is not above 1 (and at most 10); hair has 1.55", parameters.eta));
  for (const double sigma : parameters.sigma_a)
    if (!(sigma >= 0 && std::isfinite(sigma)))
      throw InputError(fmt::format("sigma_a: {} is not finite and 0 or more per radius", sigma));
  // The widest lobe must stay below 90 deg as well, and the shift that is largest.
  if (!(std::abs(parameters.shift) < pi / 3))
    throw InputError(fmt::format(
        "shift: {:g} deg is not between -60 deg and 60 deg (TRT has 3/2 of it)",
        parameters.shift / radians_per_degree));
  if (!(parameters.width > 0 && parameters.width < pi / 4))
    throw InputError(fmt::format(
        "width: {:g} deg is not between 0 deg and 45 deg, both excluded (TRT has twice of it)",
        parameters.width / radians_per_degree));
  return parameters;
}

} // namespace

HairScattering::HairScattering(const HairParameters& parameters)
    : HairScattering(parameters, round_sections(checked(parameters)), 0, 1e-12) {}

HairScattering::HairScattering(
    const HairParameters& parameters, std::array<std::shared_ptr<const CrossSection>, 3> sections,
    double tolerance)
    : HairScattering(checked(parameters), std::move(sections), 0.2, tolerance) {}

HairScattering::HairScattering(
    const HairParameters& parameters, std::array<std::shared_ptr<const CrossSection>, 3> sections,
    double least_uniform, double tolerance)
    : parameters_(parameters), sections_(std::move(sections)), rays_(parameters.eta, 0),
      least_uniform_(least_uniform) {
  for (const auto& section : sections_)
    if (!section) throw InputError("a cross-section is missing: there is one per colour");
  if (!(tolerance >= 1e-14 && tolerance <= 1e-2))
    throw InputError(fmt::format("a tolerance of {} is outside 1e-14..0.01", tolerance));
  const Norm norm =
      parameters_.variant == Variant::printed ? Norm::area_over_theta_h : Norm::area_over_theta_o;
  const double a = parameters_.shift, b = parameters_.width;
  kernels_ = {
      LongitudinalKernel(a, b, norm), LongitudinalKernel(-0.5 * a, 0.5 * b, norm),
      LongitudinalKernel(-1.5 * a, 2 * b, norm), LongitudinalKernel(-1.5 * a, 2 * b, norm)};
  build(tolerance);
}

void HairScattering::build(double tolerance) {
  // Colours of the same section share the work.
  const auto by_channel = [this](std::size_t values, auto one) {
    return [this, values, one](double theta_d, std::span<double> to) {
      for (std::size_t c = 0; c < 3; ++c) {
        const auto out = to.subspan(c * values, values);
        const auto same = std::find(sections_.begin(), sections_.end(), sections_[c]) - sections_.begin();
        if (static_cast<std::size_t>(same) != c)
          std::ranges::copy(to.subspan(same * values, values), out.begin());
        else
          one(c, theta_d, out);
      }
    };
  };
  table_ = MomentTable(
      27,
      by_channel(
          9,
          [this](std::size_t c, double theta_d, std::span<double> out) {
            for (std::size_t lobe = 0; lobe < 3; ++lobe) {
              const OrderMoments m = sections_[c]->moments(static_cast<int>(lobe), theta_d);
              out[3 * lobe] = m.energy;
              out[3 * lobe + 1] = m.forward;
              out[3 * lobe + 2] = m.forward_half;
            }
          }),
      tolerance);
  if (least_uniform_ == 0) {
    for (std::size_t c = 0; c < 3; ++c)
      residual_energy_.emplace_back(parameters_.eta, parameters_.sigma_a[c], 3);
  } else if (parameters_.residual) {
    residual_table_ = MomentTable(
        3,
        by_channel(
            1,
            [this](std::size_t c, double theta_d, std::span<double> out) {
              out[0] = sections_[c]->residual(3, theta_d).energy;
            }),
        tolerance);
  }
}

double HairScattering::residual(std::size_t channel, double theta_d) const {
  if (!parameters_.residual) return 0;
  return residual_energy_.empty()
             ? std::max(0.0, residual_table_(channel, theta_d)) // a coarse table's waves
             : residual_energy_[channel](std::cos(std::min(std::abs(theta_d), largest_theta_d)));
}

OrderMoments HairScattering::moments(std::size_t lobe, std::size_t channel, double theta_d) const {
  if (lobe == 3) {
    const double energy = residual(channel, theta_d);
    return {energy, 0.5 * energy, 0.5 * energy};
  }
  const std::size_t first = 9 * channel + 3 * lobe;
  return {table_(first, theta_d), table_(first + 1, theta_d), table_(first + 2, theta_d)};
}

double HairScattering::azimuthal(std::size_t lobe, std::size_t channel, double theta_d, double phi) const {
  theta_d = std::clamp(theta_d, -largest_theta_d, largest_theta_d);
  if (lobe == 3) return moments(3, channel, theta_d).energy / (2 * pi);
  const double value = sections_[channel]->distribution(static_cast<int>(lobe), theta_d, phi);
  // On a caustic to the last bit: its neighbour's value stands for it.
  if (!std::isfinite(value))
    return sections_[channel]->distribution(
        static_cast<int>(lobe), theta_d, phi > 0 ? phi - 1e-9 : phi + 1e-9);
  return value;
}

Rgb HairScattering::eval(const Angles& at) const {
  const Angles angles = bounded(at);
  const double theta_h = angles.theta_h();
  const double theta_d = std::clamp(angles.theta_d(), -largest_theta_d, largest_theta_d);
  const double c = std::cos(theta_d);
  Rgb sum{};
  for (std::size_t lobe = 0; lobe < lobes(); ++lobe) {
    const double M = kernels_[lobe](theta_h) / (c * c);
    Rgb N{};
    for (std::size_t channel = 0; channel < 3; ++channel) {
      // Absorption does not change what a round section of rays reflects outside; of others R may differ.
      const bool as_before =
          channel > 0 && ((lobe == 0 && least_uniform_ == 0) || sections_[channel] == sections_[channel - 1]);
      N[channel] = as_before ? N[channel - 1] : azimuthal(lobe, channel, theta_d, angles.phi);
      sum[channel] += M * N[channel];
    }
  }
  return sum;
}

double HairScattering::forward_half(std::size_t lobe, std::size_t channel, double theta_d) const {
  return lobe == 3 ? 0.5 * residual(channel, theta_d) : table_(9 * channel + 3 * lobe + 2, theta_d);
}

Rgb HairScattering::eval_scattered(const Angles& at, const Rgb& variance) const {
  check_variance(variance);
  const Angles angles = bounded(at);
  const double theta_h = angles.theta_h();
  const double theta_d = std::clamp(angles.theta_d(), -largest_theta_d, largest_theta_d);
  const double c = std::cos(theta_d);
  Rgb sum{};
  for (std::size_t lobe = 0; lobe < lobes(); ++lobe)
    for (std::size_t channel = 0; channel < 3; ++channel)
      sum[channel] += kernels_[lobe].spread(variance[channel], theta_h) / (c * c) *
                      (forward_half(lobe, channel, theta_d) / pi);
  return sum;
}

std::vector<ScatteredLobe> HairScattering::scattered_lobes(double theta_i, const Rgb& variance) const {
  check_variance(variance);
  theta_i = bounded({theta_i, 0, 0}).theta_i;
  std::vector<ScatteredLobe> found(lobes());
  for (std::size_t lobe = 0; lobe < lobes(); ++lobe) {
    const LongitudinalKernel& kernel = kernels_[lobe];
    const double peak = 2 * kernel.shift() - theta_i;
    found[lobe].shift = kernel.shift();
    for (std::size_t channel = 0; channel < 3; ++channel) {
      found[lobe].variance[channel] = kernel.width() * kernel.width() + variance[channel];
      const double deviation = 2 * std::sqrt(found[lobe].variance[channel]); // of theta_o
      double brightest = 0;
      for (const double away : {-2.0, -1.0, 0.0, 1.0, 2.0}) {
        const double theta_o = std::clamp(peak + away * deviation, -pi / 2, pi / 2);
        const double theta_d = std::clamp(0.5 * (theta_o - theta_i), -largest_theta_d, largest_theta_d);
        brightest = std::max(brightest, forward_half(lobe, channel, theta_d));
      }
      // The mean over the half circle beyond, all around.
      found[lobe].energy[channel] = kernel.area() * 2 * brightest;
    }
  }
  return found;
}

std::array<double, HairScattering::lobe_count> HairScattering::choice(double theta_i) const {
  std::array<double, lobe_count> q{};
  double sum = 0;
  for (std::size_t lobe = 0; lobe < lobes(); ++lobe) {
    for (std::size_t channel = 0; channel < 3; ++channel)
      q[lobe] += std::max(0.0, moments(lobe, channel, theta_i).energy);
    sum += q[lobe];
  }
  if (!(sum > 0)) return {1, 0, 0, 0};
  for (double& one : q) one *= (1 - least_uniform_) / sum;
  q[3] += least_uniform_;
  return q;
}

double HairScattering::pdf(const Angles& at) const {
  const Angles angles = bounded(at);
  const double theta_d = std::clamp(angles.theta_d(), -largest_theta_d, largest_theta_d);
  const auto q = choice(angles.theta_i);
  double sum = 0;
  for (std::size_t lobe = 0; lobe < lobe_count; ++lobe) {
    if (q[lobe] == 0) continue;
    const double around =
        lobe == 3 ? 1 / (2 * pi) : ray_density(rays_, static_cast<int>(lobe), theta_d, angles.phi);
    sum += q[lobe] * kernels_[lobe].density(angles.theta_i, angles.theta_o) * around;
  }
  return sum / std::max(std::cos(angles.theta_o), 1e-12);
}

ScatteringSample HairScattering::sample(double theta_i, const std::array<double, 3>& u) const {
  theta_i = bounded({theta_i, 0, 0}).theta_i;
  const std::size_t lobe = chosen(choice(theta_i), u[0]);
  const double theta_o = kernels_[lobe].sample(theta_i, u[1]);
  const double theta_d = std::clamp(0.5 * (theta_o - theta_i), -largest_theta_d, largest_theta_d);
  const double phi =
      lobe == 3 ? wrap_angle(2 * pi * u[2])
                : exit_azimuth(static_cast<int>(lobe), bravais_index(parameters_.eta, theta_d), 2 * u[2] - 1);
  return weighed({theta_i, theta_o, phi});
}

std::vector<LobeEnergy> HairScattering::lobe_energies(double theta_i) const {
  check_inclination(theta_i);
  std::vector<LobeEnergy> found;
  for (std::size_t lobe = 0; lobe < lobes(); ++lobe) {
    using Sums = std::array<double, 6>;
    const Sums sums = integral_along<Sums>(kernels_[lobe], theta_i, 1e-12, [&](double theta_d) {
      Sums around{};
      for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t value = 9 * c + 3 * lobe;
        const double energy = lobe < 3 ? table_(value, theta_d) : residual(c, theta_d);
        const double forward = lobe < 3 ? table_(value + 1, theta_d) : 0.5 * energy;
        around[c] = forward;
        around[3 + c] = energy - forward;
      }
      return around;
    });
    found.push_back(
        {kernels_[lobe].shift(),
         kernels_[lobe].width(),
         {sums[0], sums[1], sums[2]},
         {sums[3], sums[4], sums[5]}});
  }
  return found;
}

} // namespace scatter::fiber
