#include <scatter/fiber/fiber_scattering.hpp>
#include <scatter/fiber/quadrature.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace scatter::fiber {
namespace {

/// Of a direction that need not have unit length.
glm::dvec3 direction(const glm::dvec3& v, const char* name) {
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  if (!(largest > 0 && std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z)))
    throw InputError(std::string("the direction to the ") + name + " must be finite and not zero");
  return glm::normalize(v / largest);
}

} // namespace

Angles bounded(const Angles& angles) {
  if (std::isnan(angles.theta_i) || std::isnan(angles.theta_o) || !std::isfinite(angles.phi))
    throw InputError("an angle of a fibre's scattering is not a number");
  return {
      std::clamp(angles.theta_i, -pi / 2, pi / 2), std::clamp(angles.theta_o, -pi / 2, pi / 2),
      wrap_angle(angles.phi)};
}

void check_inclination(double theta_i) {
  if (!(std::abs(theta_i) < pi / 2))
    throw InputError(fmt::format(
        "theta_i: {:g} deg is not between -90 deg and 90 deg, both excluded", theta_i / radians_per_degree));
}

void check_variance(const Rgb& variance) {
  for (const double value : variance)
    if (!(value >= 0 && std::isfinite(value)))
      throw InputError(fmt::format("variance: {} is not finite and 0 or more", value));
}

std::size_t chosen(std::span<const double> shares, double u) {
  std::size_t at = 0;
  while (at + 1 < shares.size() && u >= shares[at]) u -= shares[at++];
  while (at > 0 && shares[at] == 0) --at; // rounding may lead beyond the last
  return at;
}

ScatteringSample FiberScattering::weighed(const Angles& angles) const {
  ScatteringSample sample{angles.theta_o, angles.phi, {}, pdf(angles)};
  if (!(sample.pdf > 0)) return sample;
  sample.weight = eval(angles);
  for (double& value : sample.weight) value *= std::cos(angles.theta_o) / sample.pdf;
  return sample;
}

Rgb FiberScattering::eval(const Frame& frame, const glm::dvec3& to_light, const glm::dvec3& to_eye) const {
  return eval(angles(frame, direction(to_light, "light"), direction(to_eye, "eye")));
}

Rgb FiberScattering::albedo(double theta_i) const {
  Rgb sum{};
  for (const LobeEnergy& lobe : lobe_energies(theta_i))
    for (std::size_t c = 0; c < 3; ++c) sum[c] += lobe.forward[c] + lobe.backward[c];
  return sum;
}

std::vector<LobeEnergy> FiberScattering::lobe_energies(double theta_i) const {
  // Per colour: forward and backward energy, and the first two moments of theta_h.
  using Sums = std::array<double, 12>;
  const auto at_theta = [&](double theta_o) {
    const double measure = std::cos(theta_o) * std::cos(theta_o);
    const auto at_phi = [&](double phi) {
      // Both signs of phi: fibres that are not mirror symmetric count with both sides.
      const Rgb one = eval(Angles{theta_i, theta_o, phi}), other = eval(Angles{theta_i, theta_o, -phi});
      const double theta_h = 0.5 * (theta_i + theta_o);
      Sums sums{};
      for (std::size_t c = 0; c < 3; ++c) {
        const double value = (one[c] + other[c]) * measure;
        sums[c] = value * phi / pi;
        sums[3 + c] = value - sums[c];
        sums[6 + c] = value * theta_h;
        sums[9 + c] = value * theta_h * theta_h;
      }
      return sums;
    };
    Sums sums{};
    for (int i = 0; i < 6; ++i) {
      const Sums part = integrate<Sums>(at_phi, pi * i / 6, pi * (i + 1) / 6, 1e-11);
      for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += part[k];
    }
    return sums;
  };
  Sums sums{};
  constexpr int panels = 24;
  for (int i = 0; i < panels; ++i) {
    const Sums part =
        integrate<Sums>(at_theta, -pi / 2 + pi * i / panels, -pi / 2 + pi * (i + 1) / panels, 1e-10 / panels);
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += part[k];
  }
  LobeEnergy lobe;
  double energy = 0, first = 0, second = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    lobe.forward[c] = sums[c];
    lobe.backward[c] = sums[3 + c];
    energy += sums[c] + sums[3 + c];
    first += sums[6 + c];
    second += sums[9 + c];
  }
  if (energy > 0) {
    lobe.shift = first / energy;
    lobe.width = std::sqrt(std::max(0.0, second / energy - lobe.shift * lobe.shift));
  }
  return {lobe};
}

} // namespace scatter::fiber
