#pragma once

#include <scatter/wavefront/far_field.hpp>

#include <vector>

/// Which directions are computed for those that are wanted.
namespace scatter::wavefront {

/// Sine and cosine of an angle in degrees, exact at multiples of 90.
[[nodiscard]] double sin_deg(double degrees);
[[nodiscard]] double cos_deg(double degrees);

/// Spacing of an even grid, to 1e-6 of itself; 1 for a single value and 0 for any other list.
[[nodiscard]] double even_spacing(const std::vector<double>& values);

/// How wanted directions come out of computed ones: azimuths folded into [0, 180] by the mirror plane (all
/// into one for an axisymmetric drop), scattering angles surrounded by what filters need.
struct Layout {
  std::vector<double> theta_deg, phi_deg;      ///< computed rows and columns
  std::vector<int> row_of;                     ///< per wanted theta
  std::vector<int> source_column;              ///< per wanted phi; ~column for its mirror image
  std::vector<int> segment_first, segment_end; ///< per row: the evenly spaced stretch that it belongs to
  double spacing_deg = 1;                      ///< between the rows of a stretch
  bool raster = false;
};

/// A block of the layout's azimuths: first..end-1.
struct Columns {
  int first = 0, end = 0;
  [[nodiscard]] int count() const { return end - first; }
};

/// axisymmetric: about the sunlight. last_order: the highest that is traced, for the reach of its filter.
/// Throws InputError when Tracing::search asks for a raster and the angles are not even.
[[nodiscard]] Layout
make_layout(const Wanted& wanted, const Tracing& tracing, bool axisymmetric, int last_order);

} // namespace scatter::wavefront
