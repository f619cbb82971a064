#include <scatter/exact/sun_disc.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

namespace scatter::exact {
namespace {

constexpr int stencil = 12;
constexpr double coarsest_step_deg = 180.0 / 64;
constexpr int finest_level = 16;

/// Lagrange weights at `at` (between stencil/2 - 1 and stencil/2) for nodes 0, 1, .. stencil - 1.
std::array<double, stencil> lagrange(double at) {
  std::array<double, stencil> weight{};
  for (int k = 0; k < stencil; ++k) {
    double product = 1;
    for (int j = 0; j < stencil; ++j)
      if (j != k) product *= (at - j) / (k - j);
    weight[static_cast<std::size_t>(k)] = product;
  }
  return weight;
}

struct Node {
  double theta = 0, weight = 0; ///< [rad]; weights of a disc are not yet normalised
};

/// Gauss-Legendre nodes and weights on [0, pi].
std::vector<Node> gauss_legendre(int count) {
  std::vector<Node> nodes;
  for (int i = 1; i <= count; ++i) {
    double z = std::cos(pi * (i - 0.25) / (count + 0.5)), slope = 0;
    for (int iteration = 0; iteration < 10; ++iteration) {
      double before = 1, value = z;
      for (int n = 2; n <= count; ++n) {
        const double next = ((2 * n - 1) * z * value - (n - 1) * before) / n;
        before = value;
        value = next;
      }
      slope = count * (before - z * value) / (1 - z * z);
      const double step = value / slope;
      z -= step;
      if (std::abs(step) < 1e-15) break;
    }
    nodes.push_back({pi / 2 * (1 + z), pi / ((1 - z * z) * slope * slope)});
  }
  return nodes;
}

/// Nodes of the mean over the disc; c in [0, pi/2]; alpha: a rule on [0, pi].
std::vector<Node> disc_rule(double c, double r, const std::vector<Node>& alpha) {
  std::vector<Node> nodes;
  const auto part = [&](double low, double high) {
    if (!(high > low)) return;
    for (const Node& a : alpha) {
      const double t = (low + high) / 2 - (high - low) / 2 * std::cos(a.theta);
      const double weight = a.weight * half_arc(t, c, r) * std::sin(t) * std::sin(a.theta) * (high - low) / 2;
      if (weight > 0) nodes.push_back({t, weight});
    }
  };
  part(0, r - c); // cones that lie wholly in the disc
  part(std::abs(r - c), r + c);
  return nodes;
}

/// Weights of consecutive points of the whole grid, index 0 at theta = 0.
struct Stretch {
  long first = 0;
  std::vector<double> weight;
};

/// How many nodes the rule needs to see all that a grid of this step can hold.
int node_count(double diameter_deg, double step_deg) {
  return 32 + static_cast<int>(std::ceil(pi * diameter_deg / step_deg));
}

Stretch stretch(double theta_deg, double diameter_deg, double step_deg, const std::vector<Node>& rule) {
  const bool backward = theta_deg > 90;
  const double c = (backward ? 180 - theta_deg : theta_deg) * radians_per_degree;
  const double r = diameter_deg / 2 * radians_per_degree, step = step_deg * radians_per_degree;
  const long half_turn = std::lround(180 / step_deg);
  const double lowest = std::max(c - r, 0.0), highest = c + r;
  const long first = static_cast<long>(std::floor(lowest / step)) - stencil / 2;
  const long last = static_cast<long>(std::ceil(highest / step)) + stencil / 2;
  std::vector<double> weight(static_cast<std::size_t>(last - first + 1));
  double sum = 0;
  for (const Node& node : disc_rule(c, r, rule)) {
    const double at = node.theta / step;
    const long from = static_cast<long>(std::floor(at)) - (stencil / 2 - 1);
    const auto share = lagrange(at - static_cast<double>(from));
    for (int k = 0; k < stencil; ++k)
      weight[static_cast<std::size_t>(from + k - first)] += node.weight * share[static_cast<std::size_t>(k)];
    sum += node.weight;
  }
  // Fold what lies beyond 0 deg (of the hemisphere's own pole), trim, and mirror.
  Stretch result;
  const auto folded = [&](long index) {
    index = std::abs(index);
    return index > half_turn ? 2 * half_turn - index : index;
  };
  long low = half_turn, high = 0;
  for (long i = first; i <= last; ++i) {
    if (weight[static_cast<std::size_t>(i - first)] == 0) continue;
    low = std::min(low, folded(i));
    high = std::max(high, folded(i));
  }
  result.weight.resize(static_cast<std::size_t>(high - low + 1));
  for (long i = first; i <= last; ++i) {
    const double w = weight[static_cast<std::size_t>(i - first)];
    if (w != 0) result.weight[static_cast<std::size_t>(folded(i) - low)] += w / sum;
  }
  result.first = low;
  if (backward) {
    std::reverse(result.weight.begin(), result.weight.end());
    result.first = half_turn - high;
  }
  return result;
}

} // namespace

double half_arc(double t, double c, double r) {
  const double above = std::sin((r + t - c) / 2) * std::sin((r - t + c) / 2);
  const double below = std::sin((t + c - r) / 2) * std::sin((t + c + r) / 2);
  return 2 * std::atan2(std::sqrt(std::max(above, 0.0)), std::sqrt(std::max(below, 0.0)));
}

int SunDisc::level_for(double size_parameter) {
  const double frequency = 2 * (size_parameter + 4 * std::cbrt(size_parameter) + 2);
  const double step_deg = 360 / (6 * frequency);
  return std::clamp(static_cast<int>(std::ceil(std::log2(coarsest_step_deg / step_deg))), 0, finest_level);
}

SunDisc::SunDisc(std::span<const double> theta_deg, double diameter_deg, int level, bool coarse_check) {
  if (!(diameter_deg > 0 && diameter_deg <= 60)) {
    std::ostringstream message;
    message << "the sun's disc of " << diameter_deg << " deg is not possible: give a diameter above 0deg, up "
            << "to 60deg (seen from the Earth it is 0.533deg)";
    throw InputError(message.str());
  }
  if (level < 0 || level > finest_level) throw InputError("the grid of the sun's disc has levels 0 to 16");
  const double step = std::ldexp(coarsest_step_deg, -level);
  const auto points = static_cast<std::size_t>(std::lround(180 / step)) + 1;
  std::vector<bool> used(points);
  const auto mark = [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i <= last; ++i) used[i] = true;
  };
  std::vector<std::size_t> fine_first, coarse_first;
  const auto fine_rule = gauss_legendre(node_count(diameter_deg, step)),
             coarse_rule = gauss_legendre(node_count(diameter_deg, 2 * step));
  for (const double centre : theta_deg) {
    if (!(centre >= 0 && centre <= 180)) {
      std::ostringstream message;
      message << "scattering angle " << centre << " deg is outside 0..180 deg";
      throw InputError(message.str());
    }
    const Stretch fine = stretch(centre, diameter_deg, step, fine_rule);
    fine_first.push_back(static_cast<std::size_t>(fine.first));
    fine_.push_back({0, fine_weight_.size(), fine.weight.size()});
    fine_weight_.insert(fine_weight_.end(), fine.weight.begin(), fine.weight.end());
    mark(fine_first.back(), fine_first.back() + fine.weight.size() - 1);
    if (!coarse_check) continue;
    const Stretch coarse = stretch(centre, diameter_deg, 2 * step, coarse_rule);
    coarse_first.push_back(2 * static_cast<std::size_t>(coarse.first));
    coarse_.push_back({0, coarse_weight_.size(), coarse.weight.size()});
    coarse_weight_.insert(coarse_weight_.end(), coarse.weight.begin(), coarse.weight.end());
    mark(coarse_first.back(), coarse_first.back() + 2 * (coarse.weight.size() - 1));
  }
  std::vector<std::size_t> position(points);
  for (std::size_t i = 0; i < points; ++i) {
    if (!used[i]) continue;
    position[i] = grid_deg_.size();
    grid_deg_.push_back(static_cast<double>(i) * step);
  }
  for (std::size_t i = 0; i < fine_.size(); ++i) fine_[i].position = position[fine_first[i]];
  for (std::size_t i = 0; i < coarse_.size(); ++i) coarse_[i].position = position[coarse_first[i]];
}

double SunDisc::mean(std::size_t i, std::span<const double> f) const {
  const Row& row = fine_[i];
  double sum = 0;
  for (std::size_t k = 0; k < row.count; ++k) sum += fine_weight_[row.first_weight + k] * f[row.position + k];
  return sum;
}

double SunDisc::coarse_mean(std::size_t i, std::span<const double> f) const {
  const Row& row = coarse_[i];
  double sum = 0;
  for (std::size_t k = 0; k < row.count; ++k)
    sum += coarse_weight_[row.first_weight + k] * f[row.position + 2 * k];
  return sum;
}

} // namespace scatter::exact
