#include <scatter/fiber/legendre_rule.hpp>
#include <scatter/fiber/longitudinal.hpp>
#include <scatter/fiber/thread.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/fresnel.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

namespace scatter::fiber {
namespace {

constexpr double along_thread = 1e-8; // cosine of the inclination
constexpr double cos2_floor = 1e-8;   // of cos^2 theta_d
constexpr double half_turn = pi;
constexpr double right_angle = pi / 2;

double squared(double x) {
  return x * x;
}

/// A Gaussian in theta_h, as a distribution of the other direction's inclination.
TruncatedNormal around_cone(double gamma, double theta) {
  return {-theta, 2 * gamma, -right_angle, right_angle};
}

/// 1/cos^2 theta_d over theta_o, normalised: cos theta_i / (4 cos^2 theta_d).
double spread_density(double theta_i, double theta_o) {
  return std::cos(theta_i) / (4 * squared(std::cos(0.5 * (theta_o - theta_i))));
}
double spread_sample(double theta_i, double u) {
  // The integral is tan((theta_o - theta_i) / 2), from theta_o = -90 to 90 deg.
  const double low = std::tan(-0.5 * (right_angle + theta_i)), high = std::tan(0.5 * (right_angle - theta_i));
  return theta_i + 2 * std::atan(low + u * (high - low));
}

constexpr int weight_steps = 12;

/// Of the volume's light.
double isotropic_share(const ThreadParameters& thread, double theta_h) {
  const double g = (1 - thread.kd) * gaussian(squared(thread.gamma_v), theta_h);
  return thread.kd / std::max(g + thread.kd, 1e-300);
}

} // namespace

SurfaceLobe parse_surface_lobe(const std::string& name) {
  for (const auto lobe : {SurfaceLobe::printed, SurfaceLobe::energy_true})
    if (name == surface_lobe_name(lobe)) return lobe;
  throw InputError(quote(name) + " is no surface lobe: use printed or energy-true");
}

const char* surface_lobe_name(SurfaceLobe lobe) {
  return lobe == SurfaceLobe::printed ? "printed" : "energy-true";
}

void check(const ThreadParameters& thread, const std::string& where) {
  const auto refuse = [&](const std::string& field, double value, const std::string& right) {
    std::ostringstream message;
    message << where << field << ": " << value << " is not possible; " << right;
    throw InputError(message.str());
  };
  // Written so that what is not a number is refused.
  if (!(thread.eta > 1 && thread.eta <= 10))
    refuse("eta", thread.eta, "a refractive index is above 1, up to 10, such as 1.46");
  if (!(thread.kd >= 0 && thread.kd <= 1)) refuse("kd", thread.kd, "use a share from 0 to 1");
  for (const auto& [field, value] :
       {std::pair{"gamma_s_deg", thread.gamma_s}, std::pair{"gamma_v_deg", thread.gamma_v}})
    if (!(value >= 0.01 * radians_per_degree * (1 - 1e-12) && value < right_angle))
      refuse(
          field, value / radians_per_degree,
          "a lobe's standard deviation is from 0.01 up to, but not including, 90 degrees");
  for (int c = 0; c < 3; ++c)
    if (!(thread.albedo[c] >= 0 && thread.albedo[c] <= 1))
      refuse("albedo", thread.albedo[c], "each of red, green and blue (with albedo_scale) is from 0 to 1");
}

Thread::Thread(const ThreadParameters& parameters, SurfaceLobe surface)
    : parameters_(parameters), surface_(surface),
      surface_scale_(surface == SurfaceLobe::printed ? 1 : 0.125) {
  check(parameters_, "");
  // Energies of the three lobes, roughly: they only steer the sampling.
  const auto rule = legendre_rule(12);
  const double mean_albedo = (parameters_.albedo.x + parameters_.albedo.y + parameters_.albedo.z) / 3;
  for (int step = 0; step < weight_steps; ++step) {
    const double theta_i = right_angle * (step + 0.5) / weight_steps;
    const auto narrow = around_cone(parameters_.gamma_s, theta_i);
    const auto wide = around_cone(parameters_.gamma_v, theta_i);
    LobeWeights energy{};
    const auto add = [&](std::size_t lobe, double theta_o, double per_theta) {
      const double isotropic = isotropic_share(parameters_, 0.5 * (theta_i + theta_o));
      for (std::size_t p = 0; p < rule.x.size(); ++p) {
        const ThreadLobes value = lobes({theta_i, theta_o, half_turn * 0.5 * (1 + rule.x[p])});
        const double volume = mean_albedo * value.volume;
        const double share = lobe == 0   ? value.surface
                             : lobe == 1 ? volume * (1 - isotropic)
                                         : volume * isotropic;
        energy[lobe] += rule.weight[p] * share * squared(std::cos(theta_o)) / per_theta;
      }
    };
    for (int k = 0; k < 8; ++k) {
      const double u = (k + 0.5) / 8;
      const double s = narrow.sample(u), v = wide.sample(u), i = spread_sample(theta_i, u);
      add(0, s, narrow.density(s));
      add(1, v, wide.density(v));
      add(2, i, spread_density(theta_i, i));
    }
    const double sum = energy[0] + energy[1] + energy[2];
    // None is ever left out: each is needed where it is the largest.
    for (double& e : energy) e = (sum > 0 ? e / sum : 0) * 0.85 + 0.05;
    weights_.push_back(energy);
  }
}

Thread::LobeWeights Thread::lobe_weights(double theta_i) const {
  const double at = std::abs(theta_i) / right_angle * weight_steps;
  return weights_[std::min(static_cast<std::size_t>(std::max(at, 0.0)), weights_.size() - 1)];
}

ThreadLobes Thread::lobes(const Angles& angles) const {
  const double cos_i = std::cos(angles.theta_i), cos_o = std::cos(angles.theta_o);
  if (!(cos_i > along_thread && cos_o > along_thread)) return {};
  const double theta_h = angles.theta_h(), cos_d = std::cos(angles.theta_d());
  const double cos_half = std::max(std::cos(0.5 * angles.phi), 0.0);
  const auto energy = fresnel_energy(parameters_.eta, std::clamp(cos_d * cos_half, 0.0, 1.0));
  const double reflected = 0.5 * (energy.reflectivity_perpendicular + energy.reflectivity_parallel);
  const double entering = 0.5 * (energy.transmissivity_perpendicular + energy.transmissivity_parallel);
  const double spread = 1 / std::max(cos_d * cos_d, cos2_floor);
  return {
      surface_scale_ * reflected * cos_half * gaussian(squared(parameters_.gamma_s), theta_h) * spread,
      entering * entering *
          ((1 - parameters_.kd) * gaussian(squared(parameters_.gamma_v), theta_h) + parameters_.kd) /
          (cos_i + cos_o) * spread};
}

Rgb Thread::eval(const Angles& angles) const {
  const ThreadLobes value = lobes(bounded(angles));
  Rgb colour;
  for (int c = 0; c < 3; ++c) colour[c] = value.surface + value.volume * parameters_.albedo[c];
  return colour;
}

std::vector<LobeEnergy> Thread::lobe_energies(double theta_i) const {
  // Panels between the kernels' centre and multiples of their widths; the azimuth is smooth on 0..pi.
  static const LegendreRule rule = legendre_rule(20);
  theta_i = bounded({theta_i, 0, 0}).theta_i;
  std::vector<double> edges{-right_angle, right_angle};
  for (const double gamma : {parameters_.gamma_s, parameters_.gamma_v})
    for (int k = -9; k <= 9; ++k) {
      const double edge = 2 * gamma * k - theta_i;
      if (std::abs(edge) < right_angle) edges.push_back(edge);
    }
  // cos theta_o goes to zero at both ends, at one of them beside cos theta_d: graded panels.
  for (double distance = 0.3; distance > 1e-5; distance *= 0.4) {
    edges.push_back(right_angle - distance);
    edges.push_back(distance - right_angle);
  }
  std::ranges::sort(edges);
  struct Part {
    double forward = 0, backward = 0;
  };
  Part surface, wide, isotropic;
  double second_moment = 0;
  for (std::size_t e = 1; e < edges.size(); ++e) {
    const double half = 0.5 * (edges[e] - edges[e - 1]), middle = 0.5 * (edges[e] + edges[e - 1]);
    if (!(half > 0)) continue;
    for (std::size_t i = 0; i < rule.x.size(); ++i) {
      const double theta_o = middle + half * rule.x[i], theta_h = 0.5 * (theta_i + theta_o);
      const double share = isotropic_share(parameters_, theta_h);
      const double measure = rule.weight[i] * half * squared(std::cos(theta_o));
      for (int panel = 0; panel < 2; ++panel)
        for (std::size_t p = 0; p < rule.x.size(); ++p) {
          const double phi = half_turn * (0.25 + 0.5 * panel + 0.25 * rule.x[p]);
          const double weight = measure * rule.weight[p] * 0.5 * half_turn;
          const ThreadLobes value = lobes({theta_i, theta_o, phi});
          const auto add = [&](Part& part, double energy) {
            part.forward += energy * phi / half_turn;
            part.backward += energy * (1 - phi / half_turn);
          };
          add(surface, weight * value.surface);
          add(wide, weight * value.volume * (1 - share));
          add(isotropic, weight * value.volume * share);
          second_moment += weight * value.volume * share * theta_h * theta_h;
        }
    }
  }
  const auto lobe = [&](double width, const Part& part, const glm::dvec3& colour) {
    LobeEnergy made;
    made.width = width;
    for (int c = 0; c < 3; ++c) {
      made.forward[c] = part.forward * colour[c];
      made.backward[c] = part.backward * colour[c];
    }
    return made;
  };
  const double isotropic_energy = isotropic.forward + isotropic.backward;
  return {
      lobe(parameters_.gamma_s, surface, glm::dvec3(1)), lobe(parameters_.gamma_v, wide, parameters_.albedo),
      lobe(
          isotropic_energy > 0 ? std::sqrt(second_moment / isotropic_energy) : parameters_.gamma_v, isotropic,
          parameters_.albedo)};
}

double Thread::pdf(const Angles& given) const {
  const auto [theta_i, theta_o, phi] = bounded(given);
  const double cos_i = std::cos(theta_i), cos_o = std::cos(theta_o);
  if (!(cos_i > along_thread && cos_o > along_thread)) return 0;
  const LobeWeights w = lobe_weights(theta_i);
  const double surface =
      around_cone(parameters_.gamma_s, theta_i).density(theta_o) * std::max(std::cos(0.5 * phi), 0.0) / 4;
  const double volume = around_cone(parameters_.gamma_v, theta_i).density(theta_o) / (2 * pi);
  const double isotropic = spread_density(theta_i, theta_o) / (2 * pi);
  return (w[0] * surface + w[1] * volume + w[2] * isotropic) / cos_o;
}

ScatteringSample Thread::sample(double theta_i, const std::array<double, 3>& u) const {
  theta_i = bounded({theta_i, 0, 0}).theta_i;
  const std::size_t lobe = chosen(lobe_weights(theta_i), u[2]);
  if (lobe == 2)
    return weighed(
        {theta_i, std::clamp(spread_sample(theta_i, u[0]), -right_angle, right_angle), (2 * u[1] - 1) * pi});
  const double theta_o =
      around_cone(lobe == 0 ? parameters_.gamma_s : parameters_.gamma_v, theta_i).sample(u[0]);
  return weighed({theta_i, theta_o, lobe == 0 ? 2 * std::asin(2 * u[1] - 1) : (2 * u[1] - 1) * pi});
}

Angles thread_angles(const Frame& frame, const glm::dvec3& to_light, const glm::dvec3& to_eye) {
  const auto inclined = [&](const glm::dvec3& w) {
    return std::atan2(
        glm::dot(w, frame.tangent), std::hypot(glm::dot(w, frame.normal), glm::dot(w, frame.binormal)));
  };
  return {
      inclined(to_light), inclined(to_eye), wrap_angle(azimuth(frame, to_eye) - azimuth(frame, to_light))};
}

} // namespace scatter::fiber
