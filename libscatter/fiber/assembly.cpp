#include <scatter/fiber/assembly.hpp>
#include <scatter/fiber/longitudinal.hpp>
#include <scatter/fiber/quadrature.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace scatter::fiber {
namespace {

constexpr double largest_a_f = 1 - 1e-4;
constexpr double least_variance = 1e-8;

void fill_ladder(AssemblyAverages& averages, Variant variant) {
  for (std::size_t c = 0; c < 3; ++c) {
    const LadderSums sums = ladder_sums(
        averages.a_f[c], averages.a_b[c], averages.alpha_f[c], averages.alpha_b[c], averages.beta_f[c],
        averages.beta_b[c], variant);
    averages.A_b[c] = sums.A_b;
    averages.Delta_b[c] = sums.Delta_b;
    averages.sigma_b[c] = sums.sigma_b;
  }
}

double checked_share(const char* name, double value) {
  if (!(value >= 0 && value <= 1))
    throw InputError(fmt::format("{}: {} is not between 0 and 1", name, value));
  return value;
}

} // namespace

LadderSums ladder_sums(
    double a_f, double a_b, double alpha_f, double alpha_b, double beta_f, double beta_b, Variant variant) {
  const bool printed = variant == Variant::printed;
  a_f = std::min(a_f, largest_a_f);
  const double x = a_f * a_f, rest = 1 - x, b2 = a_b * a_b;
  LadderSums sums;
  sums.A_b = a_b * x / rest + a_b * b2 * x / (printed ? rest * rest : rest * rest * rest);
  const double twice = 2 * b2 / (rest * rest);
  sums.Delta_b = alpha_b * (printed ? 1 - twice : 1 + twice) +
                 alpha_f * (2 * rest * rest + 4 * x * b2) / (rest * rest * rest);
  // Both fractions are shortened by a_b: nothing is lost when no light comes back.
  const double once = std::sqrt(2 * beta_f * beta_f + beta_b * beta_b);
  const double thrice = std::sqrt(2 * beta_f * beta_f + 3 * beta_b * beta_b);
  sums.sigma_b = (1 + 0.7 * x) * (printed ? once * (1 + b2) / (1 + b2 * (2 * beta_f + 3 * beta_b))
                                          : (once + b2 * thrice) / (1 + b2));
  return sums;
}

AssemblyAverages assembly_averages(const FiberScattering& fiber, double theta_i, Variant variant) {
  check_inclination(theta_i);
  const std::vector<LobeEnergy> lobes = fiber.lobe_energies(theta_i);
  AssemblyAverages averages;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto average = [&](const Rgb LobeEnergy::*part, double& energy, double& shift, double& width) {
      double plain_shift = 0, plain_width = 0;
      energy = shift = width = 0;
      for (const LobeEnergy& lobe : lobes) {
        energy += (lobe.*part)[c];
        shift += (lobe.*part)[c] * lobe.shift;
        width += (lobe.*part)[c] * lobe.width;
        plain_shift += lobe.shift;
        plain_width += lobe.width;
      }
      const bool any = energy > 1e-290;
      const double over = any ? energy : static_cast<double>(lobes.size());
      shift = (any ? shift : plain_shift) / over;
      width = (any ? width : plain_width) / over;
    };
    average(&LobeEnergy::forward, averages.a_f[c], averages.alpha_f[c], averages.beta_f[c]);
    average(&LobeEnergy::backward, averages.a_b[c], averages.alpha_b[c], averages.beta_b[c]);
    averages.a_f[c] = std::min(averages.a_f[c], largest_a_f);
  }
  fill_ladder(averages, variant);
  return averages;
}

AssemblyTable::AssemblyTable(const FiberScattering& fiber, Variant variant, std::size_t nodes)
    : variant_(variant), nodes_(nodes) {
  if (nodes < 12)
    throw InputError(fmt::format("nodes: a table of {} over theta_i is too coarse; use 12 or more", nodes));
  first_ = -pi / 2 + 0.1 * radians_per_degree;
  step_ = -2 * first_ / static_cast<double>(nodes - 1);
  for (std::size_t i = 0; i < nodes; ++i) {
    const AssemblyAverages at = assembly_averages(fiber, first_ + static_cast<double>(i) * step_, variant);
    for (const Rgb* const part : {&at.a_f, &at.a_b, &at.alpha_f, &at.alpha_b, &at.beta_f, &at.beta_b})
      values_.insert(values_.end(), part->begin(), part->end());
  }
  // Against the averages themselves, half way between nodes; the worst place may lie between the probes.
  constexpr int probes = 24;
  for (int i = 0; i < probes; ++i) {
    const double to = (i + 0.5) / probes * 160 * radians_per_degree - 80 * radians_per_degree;
    const double theta_i = first_ + (std::floor((to - first_) / step_) + 0.5) * step_;
    const auto found = interpolate(theta_i);
    const AssemblyAverages at = assembly_averages(fiber, theta_i, variant);
    std::size_t k = 0;
    for (const Rgb* const part : {&at.a_f, &at.a_b, &at.alpha_f, &at.alpha_b, &at.beta_f, &at.beta_b})
      for (const double value : *part) error_ = std::max(error_, 6 * std::abs(found[k++] - value));
  }
}

std::array<double, AssemblyTable::per_node> AssemblyTable::interpolate(double theta_i) const {
  const double last = static_cast<double>(nodes_ - 1);
  const double at = std::clamp((theta_i - first_) / step_, 0.0, last);
  const double start = std::clamp(std::floor(at) - 2, 0.0, last - 5);
  const auto weights = six_point_weights(at - start);
  std::array<double, per_node> found{};
  const double* from = &values_[static_cast<std::size_t>(start) * per_node];
  for (const double weight : weights) {
    for (std::size_t k = 0; k < per_node; ++k) found[k] += weight * from[k];
    from += per_node;
  }
  return found;
}

AssemblyAverages AssemblyTable::operator()(double theta_i) const {
  const auto found = interpolate(theta_i);
  AssemblyAverages averages;
  std::size_t k = 0;
  for (Rgb* const part :
       {&averages.a_f, &averages.a_b, &averages.alpha_f, &averages.alpha_b, &averages.beta_f,
        &averages.beta_b})
    for (double& value : *part) value = found[k++];
  for (std::size_t c = 0; c < 3; ++c) {
    averages.a_f[c] = std::clamp(averages.a_f[c], 0.0, largest_a_f);
    averages.a_b[c] = std::max(averages.a_b[c], 0.0);
  }
  fill_ladder(averages, variant_);
  return averages;
}

Rgb DualScattering::Parts::sum() const {
  Rgb all{};
  for (std::size_t c = 0; c < 3; ++c) all[c] = single[c] + back[c] + forward[c] + forward_back[c];
  return all;
}

DualScattering::DualScattering(
    std::shared_ptr<const FiberScattering> single, std::shared_ptr<const LobedScattering> multiple,
    const DualScatteringOptions& options)
    : single_(std::move(single)), multiple_(std::move(multiple)), options_(options),
      table_(*multiple_, options.variant, options.nodes) {
  checked_share("d_f", options.d_f);
  checked_share("d_b", options.d_b);
}

Shadow DualScattering::through(std::span<const double> theta_i) const {
  Shadow shadow;
  shadow.direct = theta_i.empty() ? 1 : 0;
  for (const double theta : theta_i) {
    const AssemblyAverages averages = table_(theta);
    for (std::size_t c = 0; c < 3; ++c) {
      shadow.transmittance[c] *= averages.a_f[c];
      shadow.variance[c] += averages.beta_f[c] * averages.beta_f[c];
    }
  }
  return shadow;
}

Shadow DualScattering::estimated(double theta_i, double opacity, double strands_of_full_shadow) const {
  checked_share("opacity", opacity);
  if (!(strands_of_full_shadow >= 0 && std::isfinite(strands_of_full_shadow)))
    throw InputError(fmt::format("strands_of_full_shadow: {} is not 0 or more", strands_of_full_shadow));
  const double n = opacity * strands_of_full_shadow;
  const AssemblyAverages averages = table_(theta_i);
  Shadow shadow;
  shadow.direct = 1 - opacity;
  for (std::size_t c = 0; c < 3; ++c) {
    shadow.transmittance[c] = std::pow(averages.a_f[c], n);
    shadow.variance[c] = n * averages.beta_f[c] * averages.beta_f[c];
  }
  return shadow;
}

Rgb DualScattering::back(const Angles& at, const Rgb& variance) const {
  const Angles angles = bounded(at);
  const double theta_d = std::clamp(angles.theta_d(), -largest_theta_d, largest_theta_d);
  const double cosine = std::cos(theta_d);
  const AssemblyAverages averages = table_(angles.theta_i);
  const MultipleAdjustments& adjust = options_.adjustments;
  const double energy = options_.back_energy == BackEnergy::conserved ? 0.5 : 2;
  Rgb found{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double V = std::max(
        averages.sigma_b[c] * averages.sigma_b[c] + variance[c] + adjust.back_variance, least_variance);
    found[c] = energy * averages.A_b[c] *
               gaussian(V, angles.theta_h() - averages.Delta_b[c] + adjust.back_shift) /
               (pi * cosine * cosine) * adjust.back_colour[c] * adjust.back_intensity;
  }
  return found;
}

DualScattering::Parts DualScattering::eval(const Angles& at, const Shadow& shadow) const {
  const Angles angles = bounded(at);
  const double cosine = std::cos(angles.theta_i);
  const Rgb f_s = single_->eval(angles);
  const Rgb f_scatter = multiple_->eval_scattered(angles, shadow.variance);
  const Rgb back_direct = back(angles, {}), back_scatter = back(angles, shadow.variance);
  const MultipleAdjustments& adjust = options_.adjustments;
  Parts parts;
  for (std::size_t c = 0; c < 3; ++c) {
    const double direct = shadow.direct * cosine;
    const double through = options_.variant == Variant::printed
                               ? (options_.d_f * shadow.transmittance[c] - shadow.direct) * options_.d_f
                               : (1 - shadow.direct) * options_.d_f * shadow.transmittance[c];
    parts.single[c] = direct * f_s[c];
    parts.back[c] = direct * options_.d_b * back_direct[c];
    parts.forward[c] = through * cosine * f_scatter[c] * adjust.forward_colour[c] * adjust.forward_intensity;
    parts.forward_back[c] = through * cosine * pi * options_.d_b * back_scatter[c];
  }
  return parts;
}

} // namespace scatter::fiber
