#pragma once

#include <scatter/wavefront/bow_curves.hpp>

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <vector>

/// What the filters of kernels/far_field.cl are told: windows about the bows' edges, and what sums over rows
/// miss there.
namespace scatter::wavefront {

/// Weights of a symmetric kernel at 0, 1, .., reach: with both sides they add up to 1.
template <typename Kernel>
std::vector<double> symmetric_weights(int reach, Kernel&& kernel) {
  std::vector<double> weights;
  for (int k = 0; k <= reach; ++k) weights.push_back(kernel(k));
  const double sum = 2 * std::accumulate(weights.begin(), weights.end(), 0.0) - weights[0];
  for (double& weight : weights) weight /= sum;
  return weights;
}

/// Layout of edge_t in kernels/far_field.cl.
struct EdgeWindow {
  double theta, sigma;
  int weights, reach;
};
/// Layout of end_correction_t in kernels/far_field.cl.
struct EndCorrection {
  std::array<double, 8> amplitude;
  double mass, step, place, turn;
  int first, side, skip, replaced;
};
static_assert(sizeof(EndCorrection) == 112);

/// Some records per column, filled up with empty ones: [column][per_column].
template <typename Record>
struct PerColumn {
  std::vector<Record> records;
  int per_column = 1;

  explicit PerColumn(std::vector<std::vector<Record>> columns) {
    std::size_t most = 1;
    for (const auto& some : columns) most = std::max(most, some.size());
    for (auto& some : columns) {
      some.resize(most, Record{});
      records.insert(records.end(), some.begin(), some.end());
    }
    per_column = static_cast<int>(most);
  }
};

/// Windows of the Gaussian filter, one per crossing, and the kernels' weights that they refer to.
struct EdgeWindows {
  PerColumn<EdgeWindow> windows;
  std::vector<double> weights;
};
[[nodiscard]] EdgeWindows edge_windows(
    const Tracing& tracing, std::span<const BowCrossing> crossings, const Layout& layout, Columns columns,
    const Wanted& wanted);

/// What rows miss of the energy next to an edge: intensity falls from it like x^(-1/2), and a sum over rows
/// depends on where they happen to fall. See "Smoothing across an edge" in papers/patches-method.md.
/// between_rays: spacing of the grid, units of a.
[[nodiscard]] PerColumn<EndCorrection> end_corrections(
    const Tracing& tracing, const Light& light, double between_rays, std::span<const BowCrossing> crossings,
    const Layout& layout, Columns columns, const Wanted& wanted);

} // namespace scatter::wavefront
