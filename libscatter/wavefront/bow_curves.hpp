#pragma once

#include <scatter/wavefront/bow_edge.hpp>
#include <scatter/wavefront/layout.hpp>
#include <scatter/wavefront/ray_program.hpp>

#include <vector>

/// Where the geometric bows stand, and where they cross columns of the table.
namespace scatter::wavefront {

struct BowCurvePoint {
  double theta_deg, phi_deg;
  double u, v; ///< of the ray
  int azimuth; ///< number of its radius of the ray plane
};
using BowCurve = std::vector<BowCurvePoint>;

/// Curves of the orders 0..last, all from one tracing: where the deflection is stationary along a radius of
/// the ray plane.
[[nodiscard]] std::vector<BowCurve> bow_curves(RayProgram& rays, const Light& light, int last);

/// Where a bow's curve crosses a column.
struct BowCrossing {
  int column; ///< counted from the first
  double theta_deg;
  BowEdgeSeed seed;
  BowEdge edge;
};
/// Of all traced orders with the azimuths columns.first..columns.end-1 of the layout.
[[nodiscard]] std::vector<BowCrossing>
bow_crossings(RayProgram& rays, const Light& light, const Layout& layout, Columns columns);

} // namespace scatter::wavefront
