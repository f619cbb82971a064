#pragma once

#include <scatter/drop/shape.hpp>

#include <vector>

/// The drop's outline seen along the light: the edge of its shadow.
namespace scatter::wavefront {

/// Where lines of sight along the light touch the drop: cosine series over the azimuth (0 = most downward) of
/// the radius about the light and of the z along it, units of a. The radius is good to 1e-14, z to 1e-8.
struct Outline {
  std::vector<double> radius, z;
  [[nodiscard]] std::vector<double> both() const {
    std::vector<double> all = radius;
    all.insert(all.end(), z.begin(), z.end());
    return all;
  }
};

/// For drops that are convex along their outline.
[[nodiscard]] Outline outline_series(const drop::Shape& shape, double sun_elevation_deg);

/// A cosine series at the azimuth of that cosine.
[[nodiscard]] double series_value(const std::vector<double>& series, double cosine);

} // namespace scatter::wavefront
