#pragma once

#include <scatter/exact/vector_unit.hpp>

#include <cstddef>

/// Internal to scatter::fiber: the inner loop of Cloth::eval over blocks of directions.
namespace scatter::fiber {

/// What the loop over tangents needs of one thread.
struct StrandConstants {
  double cos_direction = 1, sin_direction = 0, coverage = 0;
  double contrast = 0;                         ///< eta^2 - 1
  double surface_height = 0, surface_rate = 0; ///< height 2^(-rate theta_h^2)
  double volume_height = 0, volume_rate = 0, isotropic = 0;
  double albedo[3] = {0, 0, 0};
  const double* cos_offset = nullptr;
  const double* sin_offset = nullptr;
  const double* share = nullptr;
  std::size_t tangents = 0;
  double least_cos_offset = 1, largest_sin_offset = 0; ///< of all tangents, the sine without its sign
};

struct WeaveConstants {
  const StrandConstants* strands = nullptr;
  std::size_t count = 0;
  double gap = 0;          ///< 1 - sum of coverages
  double masking_rate = 0; ///< 2^(-rate (d/2)^2) is u
};

inline constexpr std::size_t weave_lanes = 32;

/// Directions by component, one per lane.
struct alignas(64) WeaveBlock {
  double light[3][weave_lanes], view[3][weave_lanes], value[3][weave_lanes];
};

void evaluate_block(
    const WeaveConstants& weave, WeaveBlock& block, const exact::VectorUnit& unit = exact::vector_units()[0]);

} // namespace scatter::fiber
