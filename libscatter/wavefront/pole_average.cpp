#include <scatter/exact/sun_disc.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/pole_average.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace scatter::wavefront {
namespace {

constexpr double reach_in_diameters = 60;
constexpr int cones = 96, stencil = 8;

/// Where a cone lies among rows, and the weights of Lagrange's polynomial there; `at` in rows.
struct Interpolated {
  Interpolated(double at, int rows) : count(std::min(stencil, rows)) {
    first = std::clamp(static_cast<int>(std::floor(at)) - (count / 2 - 1), 0, rows - count);
    for (int k = 0; k < count; ++k) {
      weight[k] = 1;
      for (int j = 0; j < count; ++j)
        if (j != k) weight[k] *= (at - first - j) / (k - j);
    }
  }
  int first = 0, count;
  std::array<double, stencil> weight{};
};

} // namespace

PoleAverage pole_average(const Layout& layout, double diameter_deg) {
  const double r = diameter_deg / 2 * radians_per_degree, spacing = layout.spacing_deg * radians_per_degree;
  const int rows = static_cast<int>(layout.theta_deg.size());
  PoleAverage made;
  made.width = std::min(2 * static_cast<int>(std::ceil(r / spacing)) + 2 * stencil, rows);
  for (int row = 0; row < rows; ++row) {
    const double theta = layout.theta_deg[row];
    if (std::min(theta, 180 - theta) >= reach_in_diameters * diameter_deg) continue;
    // From the nearer pole, counting along the rows of the segment.
    const bool backward = theta > 90;
    const int begin = layout.segment_first[row], count = layout.segment_end[row] - begin;
    const double c = (backward ? 180 - theta : theta) * radians_per_degree;
    std::vector<double> weights(count, 0.0);
    double sum = 0;
    for (int i = 0; i < cones; ++i) {
      // Dense where arcs end.
      const double low = std::max(c - r, 0.0), alpha = pi * (i + 0.5) / cones;
      const double t = 0.5 * (low + c + r) - 0.5 * (c + r - low) * std::cos(alpha);
      const double weight = exact::half_arc(t, c, r) * std::sin(t) * std::sin(alpha);
      const double at = (backward ? c - t : t - c) / spacing + (row - begin);
      const Interpolated rows_at(std::clamp(at, 0.0, count - 1.0), count);
      for (int k = 0; k < rows_at.count; ++k) weights[rows_at.first + k] += weight * rows_at.weight[k];
      sum += weight;
    }
    const auto used = std::ranges::find_if(weights, [](double w) { return w != 0; });
    const int first = std::min(begin + static_cast<int>(used - weights.begin()), rows - made.width);
    made.row.push_back(row);
    made.first.push_back(first);
    for (int k = 0; k < made.width; ++k) {
      const int other = first + k - begin;
      made.weights.push_back(other >= 0 && other < count ? weights[other] / sum : 0.0);
    }
  }
  return made;
}

} // namespace scatter::wavefront
