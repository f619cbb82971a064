#include <scatter/fiber/assembly.hpp>
#include <scatter/fiber/longitudinal.hpp>
#include <scatter/fiber/quadrature.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

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

void check_finite(const char* name, double value) {
  if (!std::isfinite(value)) throw InputError(fmt::format("{}: {} is not finite", name, value));
}

void check_not_negative(const char* name, double value) {
  if (!(value >= 0 && std::isfinite(value)))
    throw InputError(fmt::format("{}: {} is not finite and 0 or more", name, value));
}

/// As check_inclination(), the axis itself included: there a table's outermost values hold.
void check_table_angle(const std::string& name, double theta_i) {
  if (!(std::abs(theta_i) <= pi / 2))
    throw InputError(
        fmt::format("{}: {:g} deg is not between -90 deg and 90 deg", name, theta_i / radians_per_degree));
}

template <typename Fibre>
std::shared_ptr<Fibre> present(const char* name, std::shared_ptr<Fibre> fibre) {
  if (!fibre) throw InputError(fmt::format("{}: the fibre is missing", name));
  return fibre;
}

Rgb energies(const AssemblyAverages& averages) {
  Rgb sum{};
  for (std::size_t c = 0; c < 3; ++c) sum[c] = averages.a_f[c] + averages.a_b[c];
  return sum;
}

/// Of A_b g / (pi cos^2 theta_d).
double back_factor(const DualScatteringOptions& options) {
  return options.back_energy == BackEnergy::conserved ? 0.5 : 2;
}

constexpr double least_energy = 1e-290;
constexpr std::size_t single_nodes = 36;
/// Wider than this [rad^2 of theta_h] a Gaussian is flat over all of a fibre to 1 %, and is drawn as if it
/// were no wider.
constexpr double widest_drawn = 100;
/// Room for the peaks of what carries this energy, and for its weights.
constexpr double largest_energy = 1e280;

[[noreturn]] void refuse_overflow() {
  throw InputError(fmt::format(
      "the shadow, the adjustments and the fibre make light of more than {:g} times what arrives; smaller "
      "transmittances or intensities are needed",
      largest_energy));
}

void check_no_overflow(const Rgb& light) {
  for (const double value : light)
    if (!std::isfinite(value)) refuse_overflow();
}

double checked_share(const char* name, double value) {
  if (!(value >= 0 && value <= 1))
    throw InputError(fmt::format("{}: {} is not between 0 and 1", name, value));
  return value;
}

void check(const Shadow& shadow) {
  checked_share("shadow.direct", shadow.direct);
  for (std::size_t c = 0; c < 3; ++c) {
    check_not_negative("shadow.transmittance", shadow.transmittance[c]);
    check_not_negative("shadow.variance", shadow.variance[c]);
  }
}

DualScatteringOptions checked(const DualScatteringOptions& options) {
  checked_share("d_f", options.d_f);
  checked_share("d_b", options.d_b);
  const MultipleAdjustments& adjust = options.adjustments;
  check_finite("back_intensity", adjust.back_intensity);
  check_finite("forward_intensity", adjust.forward_intensity);
  check_finite("back_shift", adjust.back_shift);
  check_finite("back_variance", adjust.back_variance);
  for (std::size_t c = 0; c < 3; ++c) {
    check_finite("back_colour", adjust.back_colour[c]);
    check_finite("forward_colour", adjust.forward_colour[c]);
    check_finite("back_colour times back_intensity", adjust.back_colour[c] * adjust.back_intensity);
    check_finite(
        "forward_colour times forward_intensity", adjust.forward_colour[c] * adjust.forward_intensity);
  }
  return options;
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
  check_table_angle("theta_i", theta_i);
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
    : single_(present("single", std::move(single))), multiple_(present("multiple", std::move(multiple))),
      options_(checked(options)), table_(*multiple_, options.variant, options.nodes) {
  for (std::size_t i = 0; i < single_nodes; ++i) {
    const double theta_i = ((static_cast<double>(i) + 0.5) / single_nodes - 0.5) * pi;
    const Rgb energy = single_ == multiple_ ? energies(table_(theta_i)) : single_->albedo(theta_i);
    single_energy_.push_back(energy[0] + energy[1] + energy[2]);
  }
}

Shadow DualScattering::through(std::span<const double> theta_i) const {
  Shadow shadow;
  for (std::size_t i = 0; i < theta_i.size(); ++i)
    check_table_angle(fmt::format("theta_i[{}]", i), theta_i[i]);
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
  check_not_negative("strands_of_full_shadow", strands_of_full_shadow);
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

double DualScattering::back_variance(double sigma_b, double variance) const {
  return std::max(sigma_b * sigma_b + variance + options_.adjustments.back_variance, least_variance);
}

double DualScattering::passed(const Shadow& shadow, std::size_t colour) const {
  const double T = shadow.transmittance[colour];
  return options_.variant == Variant::printed ? (options_.d_f * T - shadow.direct) * options_.d_f
                                              : (1 - shadow.direct) * options_.d_f * T;
}

Rgb DualScattering::back(const Angles& at, const Rgb& variance) const {
  check_variance(variance);
  const Angles angles = bounded(at);
  const Rgb found = back(table_(angles.theta_i), angles, variance);
  check_no_overflow(found);
  return found;
}

Rgb DualScattering::back(const AssemblyAverages& averages, const Angles& angles, const Rgb& variance) const {
  const double theta_d = std::clamp(angles.theta_d(), -largest_theta_d, largest_theta_d);
  const double cosine = std::cos(theta_d);
  const MultipleAdjustments& adjust = options_.adjustments;
  Rgb found{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double V = back_variance(averages.sigma_b[c], variance[c]);
    found[c] = back_factor(options_) * averages.A_b[c] *
               gaussian(V, angles.theta_h() - averages.Delta_b[c] + adjust.back_shift) /
               (pi * cosine * cosine) * adjust.back_colour[c] * adjust.back_intensity;
  }
  return found;
}

DualScattering::Parts DualScattering::eval(const Angles& at, const Shadow& shadow) const {
  check(shadow);
  const Angles angles = bounded(at);
  return parts(angles, shadow, std::cos(angles.theta_i));
}

DualScattering::Parts
DualScattering::multiple(const Angles& angles, const Shadow& shadow, double factor) const {
  const Rgb f_scatter = multiple_->eval_scattered(angles, shadow.variance);
  const AssemblyAverages averages = table_(angles.theta_i);
  const Rgb back_direct = back(averages, angles, {}), back_scatter = back(averages, angles, shadow.variance);
  const MultipleAdjustments& adjust = options_.adjustments;
  Parts parts;
  for (std::size_t c = 0; c < 3; ++c) {
    const double through = passed(shadow, c) * factor;
    parts.back[c] = shadow.direct * factor * options_.d_b * back_direct[c];
    parts.forward[c] = through * f_scatter[c] * adjust.forward_colour[c] * adjust.forward_intensity;
    parts.forward_back[c] = through * pi * options_.d_b * back_scatter[c];
  }
  check_no_overflow(parts.sum());
  return parts;
}

DualScattering::Parts DualScattering::parts(const Angles& angles, const Shadow& shadow, double factor) const {
  Parts parts = multiple(angles, shadow, factor);
  const Rgb f_s = single_->eval(angles);
  for (std::size_t c = 0; c < 3; ++c) parts.single[c] = shadow.direct * factor * f_s[c];
  return parts;
}

DualScattering::Mixture DualScattering::mixture(double theta_i, const Shadow& shadow) const {
  Mixture found;
  const double at = std::clamp((theta_i / pi + 0.5) * single_nodes - 0.5, 0.0, single_nodes - 1.0);
  const auto node = std::min(static_cast<std::size_t>(at), single_nodes - 2);
  found.shares.push_back(
      shadow.direct *
      std::lerp(single_energy_[node], single_energy_[node + 1], at - static_cast<double>(node)));
  const auto add = [&](double shift, double variance, double energy) {
    if (energy == 0) return;
    const double drawn = std::min(variance, widest_drawn);
    found.spreads.emplace_back(2 * shift - theta_i, 2 * std::sqrt(drawn), -pi / 2, pi / 2);
    // What is drawn narrower is higher than what is meant.
    found.shares.push_back(std::abs(energy) * found.spreads.back().mass() * std::sqrt(drawn / variance));
  };
  const MultipleAdjustments& adjust = options_.adjustments;
  const AssemblyAverages averages = table_(theta_i);
  for (std::size_t c = 0; c < 3; ++c) {
    // Of f_back over all azimuths: d theta_o = 2 d theta_h.
    const double energy = 4 * back_factor(options_) * averages.A_b[c] * adjust.back_colour[c] *
                          adjust.back_intensity * options_.d_b;
    const double shift = averages.Delta_b[c] - adjust.back_shift;
    add(shift, back_variance(averages.sigma_b[c], 0), energy * shadow.direct);
    add(shift, back_variance(averages.sigma_b[c], shadow.variance[c]), energy * pi * passed(shadow, c));
  }
  for (const ScatteredLobe& lobe : multiple_->scattered_lobes(theta_i, shadow.variance))
    for (std::size_t c = 0; c < 3; ++c)
      add(lobe.shift, lobe.variance[c],
          lobe.energy[c] * adjust.forward_colour[c] * adjust.forward_intensity * passed(shadow, c));
  double whole = 0;
  for (const double energy : found.shares) whole += energy;
  if (!(whole <= largest_energy)) refuse_overflow();
  if (whole > least_energy) {
    for (double& share : found.shares) share /= whole;
  } else { // Where nothing leaves, directions are the single scattering's.
    std::ranges::fill(found.shares, 0);
    found.shares[0] = 1;
  }
  return found;
}

double DualScattering::density(const Mixture& mixture, const Angles& angles) const {
  double along = 0;
  for (std::size_t k = 0; k < mixture.spreads.size(); ++k)
    if (mixture.shares[k + 1] > 0)
      along += mixture.shares[k + 1] * mixture.spreads[k].density(angles.theta_o);
  double sum = along / (2 * pi * std::max(std::cos(angles.theta_o), 1e-12));
  if (mixture.shares[0] > 0) sum += mixture.shares[0] * single_->pdf(angles);
  return sum;
}

double DualScattering::pdf(const Angles& at, const Shadow& shadow) const {
  check(shadow);
  const Angles angles = bounded(at);
  return density(mixture(angles.theta_i, shadow), angles);
}

ScatteringSample
DualScattering::sample(double theta_i, const Shadow& shadow, const std::array<double, 3>& u) const {
  check(shadow);
  theta_i = bounded({theta_i, 0, 0}).theta_i;
  const Mixture mixed = mixture(theta_i, shadow);
  const std::size_t part = chosen(mixed.shares, u[0]);
  ScatteringSample drawn;
  if (part == 0) {
    // What of u[0] did not choose the part chooses within it.
    drawn = single_->sample(theta_i, {std::min(u[0] / mixed.shares[0], 1 - 0x1p-53), u[1], u[2]});
  } else {
    drawn.theta_o = mixed.spreads[part - 1].sample(u[1]);
    drawn.phi = wrap_angle(2 * pi * u[2]);
  }
  const Angles angles{theta_i, drawn.theta_o, drawn.phi};
  drawn.pdf = density(mixed, angles);
  drawn.weight = {};
  if (!(drawn.pdf > 0)) return drawn;
  drawn.weight = parts(angles, shadow, 1).sum();
  for (double& weight : drawn.weight) weight *= std::cos(drawn.theta_o) / drawn.pdf;
  return drawn;
}

DualScattering::Parts DualScattering::albedo(double theta_i, const Shadow& shadow) const {
  check(shadow);
  check_inclination(theta_i);
  // The Gaussians' own places cut the integral: no narrow one lies between the points of a rule.
  std::vector<double> cuts;
  for (int i = 0; i <= 18; ++i) cuts.push_back(pi * (i / 18.0 - 0.5));
  const Mixture mixed = mixture(theta_i, shadow);
  for (const TruncatedNormal& spread : mixed.spreads)
    for (const double away : {-9.0, -3.0, -1.0, 1.0, 3.0, 9.0}) {
      const double cut = spread.mean() + away * spread.deviation();
      if (std::abs(cut) < pi / 2) cuts.push_back(cut);
    }
  std::ranges::sort(cuts);
  // back, forward, forward_back; nothing of them depends on phi.
  using Sums = std::array<double, 9>;
  const auto at = [&](double theta_o) {
    const double cosine = std::cos(theta_o);
    const Parts parts = multiple({theta_i, theta_o, 0}, shadow, 2 * pi * cosine * cosine);
    Sums sums{};
    for (std::size_t c = 0; c < 3; ++c) {
      sums[c] = parts.back[c];
      sums[3 + c] = parts.forward[c];
      sums[6 + c] = parts.forward_back[c];
    }
    return sums;
  };
  Sums sums{};
  // A first pass says how much there is, of which all panels may miss 1e-9 together. Of nothing, nothing.
  double whole = 0;
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i)
    for (const double part : gauss_legendre<Sums>(at, cuts[i], cuts[i + 1])) whole += std::abs(part);
  const double tolerance = std::max(1e-9 / static_cast<double>(cuts.size()) * whole, 1e-300);
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
    const Sums part = integrate<Sums>(at, cuts[i], cuts[i + 1], tolerance);
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += part[k];
  }
  Parts parts;
  const Rgb single = shadow.direct > 0 ? single_->albedo(theta_i) : Rgb{};
  for (std::size_t c = 0; c < 3; ++c) {
    parts.single[c] = shadow.direct * single[c];
    parts.back[c] = sums[c];
    parts.forward[c] = sums[3 + c];
    parts.forward_back[c] = sums[6 + c];
  }
  return parts;
}

} // namespace scatter::fiber
