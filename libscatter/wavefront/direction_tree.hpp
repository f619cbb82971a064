#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

namespace scatter::wavefront {

/// A box around directions (points of the unit sphere); empty where lo > hi.
struct DirectionBox {
  std::array<double, 3> lo, hi;
};

/// Embree tree over boxes of directions: which boxes may hold a direction? Leaves are whole tiles of patches,
/// not single patches: a tile is traced anew when it is hit, which costs less than keeping its patches in
/// memory, and the test that decides is then the very one that the raster uses, in double precision.
class DirectionTree {
public:
  /// Boxes are padded by the sag of great circles over their extent and rounded outward to float.
  explicit DirectionTree(std::span<const DirectionBox> boxes);
  ~DirectionTree();
  DirectionTree(const DirectionTree&) = delete;
  DirectionTree& operator=(const DirectionTree&) = delete;

  /// Indices of all boxes that may hold the direction, increasing. Never misses one; may name too many.
  void find(const std::array<double, 3>& direction, std::vector<int>& found) const;

private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

} // namespace scatter::wavefront
