#pragma once

#include <scatter/wavefront/layout.hpp>

#include <vector>

/// Internal to scatter::wavefront: the average over the sun's disc where the arcs of equal scattering angle
/// in it are no chords.
namespace scatter::wavefront {

/// Rows within sixty of the disc's diameters of 0 or 180 deg, and the rows that each one averages. Cones
/// about the light cut the disc in arcs; along an arc the light is taken for that of the row's own azimuth,
/// so that the average is right where light does not depend on the azimuth, as far as polynomials through
/// eight rows follow it. Straight chords are off by 0.9 % at 4 deg (a sphere of 0.05 mm, ripple of 0.4 deg)
/// and by any factor next to a pole.
struct PoleAverage {
  std::vector<int> row, first; ///< of the layout; first of `width` rows
  std::vector<double> weights; ///< [row][width], normalised
  int width = 0;
};

[[nodiscard]] PoleAverage pole_average(const Layout& layout, double diameter_deg);

} // namespace scatter::wavefront
