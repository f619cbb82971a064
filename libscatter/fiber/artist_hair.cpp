#include <scatter/fiber/artist_hair.hpp>
#include <scatter/fiber/quadrature.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace scatter::fiber {
namespace {

void check_not_negative(const std::string& name, double value) {
  if (!(value >= 0 && std::isfinite(value)))
    throw InputError(fmt::format("{}: {} is not finite and 0 or more", name, value));
}

void check(const char* name, const Highlight& highlight) {
  const std::string prefix = std::string(name) + ".";
  for (const double value : highlight.colour) check_not_negative(prefix + "colour", value);
  check_not_negative(prefix + "intensity", highlight.intensity);
  if (!(std::abs(highlight.shift) < pi / 2))
    throw InputError(fmt::format(
        "{}shift: {:g} deg is not between -90 deg and 90 deg, both excluded", prefix,
        highlight.shift / radians_per_degree));
  check_width((prefix + "width").c_str(), highlight.width);
}

/// Moments over the whole circle of g'(width^2, centre - |phi|).
struct LobeMoments {
  double energy, forward, forward_half;
};
LobeMoments gaussian_moments(double width, double centre) {
  const double scale = width * std::numbers::sqrt2;
  const auto area = [&](double a, double b) { // of 0..pi in |phi|, both signs of phi
    return width * std::sqrt(2 * pi) * (std::erf((b - centre) / scale) - std::erf((a - centre) / scale));
  };
  const double energy = area(0, pi);
  const double edges =
      gaussian_of_unit_height(width * width, centre) - gaussian_of_unit_height(width * width, pi - centre);
  return {energy, (centre * energy + 2 * width * width * edges) / pi, area(pi / 2, pi)};
}

constexpr std::size_t choice_nodes = 91, energy_nodes = 361;

} // namespace

double glint_half_angle_of(std::uint64_t strand, std::uint64_t seed) {
  // The finaliser of splitmix64 (Steele, Lea & Flood 2014).
  std::uint64_t z = strand + 0x9E3779B97F4A7C15ULL * (seed + 1);
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  z ^= z >> 31;
  return (30 + 15 * (static_cast<double>(z >> 11) * 0x1p-53)) * radians_per_degree;
}

ArtistHair::ArtistHair(const ArtistHairParameters& p, Variant variant) : parameters_(p), variant_(variant) {
  check("primary", p.primary);
  check("transmission", p.transmission);
  check("secondary", p.secondary);
  check_width("transmission_azimuthal_width", p.transmission_azimuthal_width);
  check_width("glint_azimuthal_width", p.glint_azimuthal_width);
  check_not_negative("glint_intensity", p.glint_intensity);
  if (!(p.glint_half_angle >= 0 && p.glint_half_angle <= pi))
    throw InputError(fmt::format(
        "glint_half_angle: {:g} deg is not between 0 deg and 180 deg",
        p.glint_half_angle / radians_per_degree));
  std::size_t lobe = 0;
  for (const Highlight* const h : {&p.primary, &p.transmission, &p.secondary}) {
    kernels_[lobe] = LongitudinalKernel(h->shift, h->width, Norm::unit_height);
    for (std::size_t c = 0; c < 3; ++c) tint_[lobe][c] = h->colour[c] * h->intensity;
    ++lobe;
  }
  const auto moments = [](const LobeMoments& m) { return Azimuth{m.energy, m.forward, m.forward_half}; };
  const Azimuth heart{4, 4 - 8 / pi, 4 - 2 * std::numbers::sqrt2}; // of cos(phi/2)
  parts_ = {
      heart, moments(gaussian_moments(p.transmission_azimuthal_width, pi)), heart,
      moments(gaussian_moments(p.glint_azimuthal_width, p.glint_half_angle))};
  for (double Azimuth::*const part : {&Azimuth::energy, &Azimuth::forward, &Azimuth::forward_half})
    parts_[3].*part *= p.glint_intensity;
  for (std::size_t i = 0; i < choice_nodes; ++i) {
    const double theta_i = std::clamp(
        pi * (static_cast<double>(i) / (choice_nodes - 1) - 0.5), -largest_theta_d, largest_theta_d);
    std::array<double, lobe_count> energy{};
    for (std::size_t k = 0; k < lobe_count; ++k) energy[k] = longitudinal_energy(k, theta_i);
    energy_table_.push_back(energy);
  }
}

double ArtistHair::azimuthal(std::size_t lobe, double phi) const {
  const ArtistHairParameters& p = parameters_;
  const double around = std::abs(phi);
  switch (lobe) {
  case 0:
    return std::cos(0.5 * phi);
  case 1:
    return gaussian_of_unit_height(
        p.transmission_azimuthal_width * p.transmission_azimuthal_width, pi - around);
  default:
    return std::cos(0.5 * phi) + p.glint_intensity * gaussian_of_unit_height(
                                                         p.glint_azimuthal_width * p.glint_azimuthal_width,
                                                         p.glint_half_angle - around);
  }
}

Rgb ArtistHair::eval(const Angles& at) const {
  const Angles angles = bounded(at);
  const double cosine = std::cos(std::clamp(angles.theta_d(), -largest_theta_d, largest_theta_d));
  Rgb sum{};
  for (std::size_t lobe = 0; lobe < lobe_count; ++lobe) {
    const double value = kernels_[lobe](angles.theta_h()) * azimuthal(lobe, angles.phi) / (cosine * cosine);
    for (std::size_t c = 0; c < 3; ++c) sum[c] += tint_[lobe][c] * value;
  }
  return sum;
}

Rgb ArtistHair::eval_scattered(const Angles& at, const Rgb& variance) const {
  check_variance(variance);
  const Angles angles = bounded(at);
  const double cosine = std::cos(std::clamp(angles.theta_d(), -largest_theta_d, largest_theta_d));
  Rgb sum{};
  for (std::size_t lobe = 0; lobe < lobe_count; ++lobe) {
    const LongitudinalKernel& kernel = kernels_[lobe];
    const double N = (parts_[lobe].forward_half + (lobe == 2 ? parts_[3].forward_half : 0)) / pi;
    for (std::size_t c = 0; c < 3; ++c) {
      const double M = variant_ == Variant::printed ? gaussian_of_unit_height(
                                                          kernel.width() * kernel.width() + variance[c],
                                                          angles.theta_h() - kernel.shift())
                                                    : kernel.spread(variance[c], angles.theta_h());
      sum[c] += tint_[lobe][c] * M * N / (cosine * cosine);
    }
  }
  return sum;
}

std::vector<ScatteredLobe> ArtistHair::scattered_lobes(double, const Rgb& variance) const {
  check_variance(variance);
  std::vector<ScatteredLobe> found(lobe_count);
  for (std::size_t lobe = 0; lobe < lobe_count; ++lobe) {
    const LongitudinalKernel& kernel = kernels_[lobe];
    const double around = 2 * (parts_[lobe].forward_half + (lobe == 2 ? parts_[3].forward_half : 0));
    found[lobe].shift = kernel.shift();
    for (std::size_t c = 0; c < 3; ++c) {
      const double whole = kernel.width() * kernel.width() + variance[c];
      const double area = variant_ == Variant::printed ? 2 * std::sqrt(2 * pi * whole) : kernel.area();
      found[lobe].variance[c] = whole;
      found[lobe].energy[c] = tint_[lobe][c] * area * around;
    }
  }
  return found;
}

double ArtistHair::longitudinal_energy(std::size_t lobe, double theta_i) const {
  using Sum = std::array<double, 1>;
  return integral_along<Sum>(kernels_[lobe], theta_i, 1e-14, [](double) { return Sum{1}; })[0];
}

std::vector<LobeEnergy> ArtistHair::lobe_energies(double theta_i) const {
  check_inclination(theta_i);
  std::vector<LobeEnergy> found;
  for (std::size_t lobe = 0; lobe < lobe_count; ++lobe) {
    const double along = longitudinal_energy(lobe, theta_i);
    double energy = parts_[lobe].energy, forward = parts_[lobe].forward;
    if (lobe == 2) {
      energy += parts_[3].energy;
      forward += parts_[3].forward;
    }
    LobeEnergy one{kernels_[lobe].shift(), kernels_[lobe].width(), {}, {}};
    for (std::size_t c = 0; c < 3; ++c) {
      one.forward[c] = tint_[lobe][c] * along * forward;
      one.backward[c] = tint_[lobe][c] * along * (energy - forward);
    }
    found.push_back(one);
  }
  return found;
}

std::array<double, ArtistHair::part_count> ArtistHair::choice(double theta_i) const {
  const double at = (theta_i / pi + 0.5) * (choice_nodes - 1);
  const auto node = static_cast<std::size_t>(std::clamp(at, 0.0, choice_nodes - 2.0));
  const double share = at - static_cast<double>(node);
  std::array<double, part_count> q{};
  double sum = 0;
  for (std::size_t part = 0; part < part_count; ++part) {
    const std::size_t lobe = std::min(part, lobe_count - 1);
    const double along = (1 - share) * energy_table_[node][lobe] + share * energy_table_[node + 1][lobe];
    q[part] = along * parts_[part].energy * (tint_[lobe][0] + tint_[lobe][1] + tint_[lobe][2]);
    sum += q[part];
  }
  if (!(sum > 1e-290)) return {1, 0, 0, 0};
  for (double& one : q) one /= sum;
  return q;
}

double ArtistHair::pdf(const Angles& at) const {
  const Angles angles = bounded(at);
  const auto q = choice(angles.theta_i);
  const double around = std::abs(angles.phi);
  const TruncatedNormal transmitted(pi, parameters_.transmission_azimuthal_width, 0, pi);
  const TruncatedNormal glint(parameters_.glint_half_angle, parameters_.glint_azimuthal_width, 0, pi);
  const double heart = 0.25 * std::cos(0.5 * angles.phi);
  const std::array<double, part_count> N{
      heart, 0.5 * transmitted.density(around), heart, 0.5 * glint.density(around)};
  double sum = 0;
  for (std::size_t part = 0; part < part_count; ++part)
    if (q[part] > 0)
      sum += q[part] * N[part] *
             kernels_[std::min(part, lobe_count - 1)].density(angles.theta_i, angles.theta_o);
  return sum / std::max(std::cos(angles.theta_o), 1e-12);
}

ScatteringSample ArtistHair::sample(double theta_i, const std::array<double, 3>& u) const {
  theta_i = bounded({theta_i, 0, 0}).theta_i;
  const std::size_t part = chosen(choice(theta_i), u[0]);
  const double theta_o = kernels_[std::min(part, lobe_count - 1)].sample(theta_i, u[1]);
  // One number draws the sign and the size of phi.
  const double sign = u[2] < 0.5 ? -1 : 1, size = u[2] < 0.5 ? 2 * u[2] : 2 * u[2] - 1;
  const auto drawn = [&](double mean, double width) {
    return sign * TruncatedNormal(mean, width, 0, pi).sample(size);
  };
  const double phi = part == 1   ? drawn(pi, parameters_.transmission_azimuthal_width)
                     : part == 3 ? drawn(parameters_.glint_half_angle, parameters_.glint_azimuthal_width)
                                 : 2 * std::asin(2 * u[2] - 1);
  return weighed({theta_i, theta_o, wrap_angle(phi)});
}

NormalisedScattering::NormalisedScattering(
    std::shared_ptr<const LobedScattering> of, Normalisation normalisation)
    : of_(std::move(of)), normalisation_(normalisation), first_(-pi / 2 + 1e-3),
      step_(-2 * first_ / (energy_nodes - 1)) {
  for (std::size_t i = 0; i < energy_nodes; ++i)
    energy_.push_back(of_->albedo(first_ + static_cast<double>(i) * step_));
}

Rgb NormalisedScattering::factors_of(const Rgb& energy) const {
  const double largest = std::ranges::max(energy);
  Rgb factor{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double by = normalisation_ == Normalisation::each ? energy[c] : largest;
    factor[c] = by > 1e-290 ? 1 / by : 0;
  }
  return factor;
}

Rgb NormalisedScattering::factors(double theta_i) const {
  const double last = energy_nodes - 1;
  const double at = std::clamp((theta_i - first_) / step_, 0.0, last);
  const double start = std::clamp(std::floor(at) - 2, 0.0, last - 5);
  const auto weights = six_point_weights(at - start);
  Rgb energy{};
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t c = 0; c < 3; ++c)
      energy[c] += weights[i] * energy_[static_cast<std::size_t>(start) + i][c];
  return factors_of(energy);
}

Rgb NormalisedScattering::eval(const Angles& angles) const {
  Rgb value = of_->eval(angles);
  const Rgb factor = factors(bounded(angles).theta_i);
  for (std::size_t c = 0; c < 3; ++c) value[c] *= factor[c];
  return value;
}

Rgb NormalisedScattering::eval_scattered(const Angles& angles, const Rgb& variance) const {
  Rgb value = of_->eval_scattered(angles, variance);
  const Rgb factor = factors(bounded(angles).theta_i);
  for (std::size_t c = 0; c < 3; ++c) value[c] *= factor[c];
  return value;
}

std::vector<ScatteredLobe> NormalisedScattering::scattered_lobes(double theta_i, const Rgb& variance) const {
  std::vector<ScatteredLobe> lobes = of_->scattered_lobes(theta_i, variance);
  const Rgb factor = factors(bounded({theta_i, 0, 0}).theta_i);
  for (ScatteredLobe& lobe : lobes)
    for (std::size_t c = 0; c < 3; ++c) lobe.energy[c] *= factor[c];
  return lobes;
}

double NormalisedScattering::pdf(const Angles& angles) const {
  return of_->pdf(angles);
}

ScatteringSample NormalisedScattering::sample(double theta_i, const std::array<double, 3>& u) const {
  ScatteringSample sample = of_->sample(theta_i, u);
  const Rgb factor = factors(bounded({theta_i, 0, 0}).theta_i);
  for (std::size_t c = 0; c < 3; ++c) sample.weight[c] *= factor[c];
  return sample;
}

std::vector<LobeEnergy> NormalisedScattering::lobe_energies(double theta_i) const {
  std::vector<LobeEnergy> lobes = of_->lobe_energies(theta_i);
  Rgb energy{};
  for (const LobeEnergy& lobe : lobes)
    for (std::size_t c = 0; c < 3; ++c) energy[c] += lobe.forward[c] + lobe.backward[c];
  const Rgb factor = factors_of(energy);
  for (LobeEnergy& lobe : lobes)
    for (std::size_t c = 0; c < 3; ++c) {
      lobe.forward[c] *= factor[c];
      lobe.backward[c] *= factor[c];
    }
  return lobes;
}

DualScattering dual_scattering(const ArtistHairShading& shading) {
  const auto single = std::make_shared<const ArtistHair>(shading.single, shading.dual.variant);
  const auto base =
      shading.multiple ? std::make_shared<const ArtistHair>(*shading.multiple, shading.dual.variant) : single;
  return DualScattering(
      single, std::make_shared<const NormalisedScattering>(base, shading.normalisation), shading.dual);
}

} // namespace scatter::fiber
