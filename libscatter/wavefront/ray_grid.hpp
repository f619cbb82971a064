#pragma once

#include <scatter/drop/shape.hpp>

#include <vector>

/// What the ray kernels need to know of a drop, and the order in which the grid of rays is worked off.
namespace scatter::wavefront {

/// Parameters of the kernels' surface: the axis, an ellipsoid of revolution that holds the drop, the polar
/// curve.
struct SurfaceParameters {
  std::vector<double> values; ///< layout of SURFACE_* in kernels/surface.cl
  double largest_radius = 1;  ///< of the polar curve, in units of a
  double smallest_radius = 1;
  double hull_margin = 0; ///< how far the ellipsoid stands off at most, relative
};
[[nodiscard]] SurfaceParameters surface_parameters(const drop::Shape& shape, double sun_elevation_deg);

/// Cells i..i+cells_i-1 by j..j+cells_j-1 of the grid of rays; layout of tile_t in kernels/tile.cl.
struct Tile {
  int i, j, cells_i, cells_j, flags;
};
inline constexpr int tile_cells = 32;
inline constexpr int tile_rim = 1;    ///< needs more of Newton's steps
inline constexpr int tile_direct = 2; ///< its mirror image is traced too, or is itself

enum class GridPart {
  whole,      ///< all cells, directly
  half,       ///< v >= 0 and the row of cells on the symmetry plane; for an even number of rays
  centre_line ///< the cells on the symmetry plane: all that one azimuth of an axisymmetric drop needs
};

/// Tiles that cover the disc of the given radius on the grid of rays x rays over [-radius, radius]^2, sorted
/// by azimuth so that neighbours in work are neighbours in the table of directions.
[[nodiscard]] std::vector<Tile> make_tiles(int rays, double radius, double smallest_radius, GridPart part);

/// Area of the shadow of a body of revolution in units of a^2, for light at this elevation [deg]; convex
/// drops. Accuracy 1e-6 relative.
[[nodiscard]] double shadow_area(const drop::Shape& shape, double sun_elevation_deg);

} // namespace scatter::wavefront
