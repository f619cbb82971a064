#include <scatter/optics/units.hpp>
#include <scatter/wavefront/coarse_rays.hpp>
#include <scatter/wavefront/outline.hpp>
#include <scatter/wavefront/vectors.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::wavefront {

CoarseRays::CoarseRays(RayProgram& rays, const Light& light, int last)
    : nodes_(static_cast<std::size_t>(last + 1) * (alphas + 1) * azimuths) {
  const auto outline = outline_series(rays.tracing.shape, rays.tracing.sun_elevation_deg);
  std::vector<double> u, v;
  for (int a = 0; a <= alphas; ++a)
    for (int j = 0; j < azimuths; ++j) {
      const double alpha = std::min(0.5 * pi * a / alphas, 0.5 * pi - 1e-5), psi = 2 * pi * j / azimuths;
      // Off the axis, where azimuths lose their meaning.
      const double b = series_value(outline.radius, std::cos(psi)) * std::max(std::sin(alpha), 1e-6);
      u.push_back(b * std::cos(psi));
      v.push_back(b * std::sin(psi));
    }
  const RawRays raw = rays.trace_raw(light, u, v, last, true);
  for (int p = 0; p <= last; ++p)
    for (std::size_t i = 0; i < u.size(); ++i) {
      Node& node = nodes_[static_cast<std::size_t>(p) * u.size() + i];
      const auto vector = [&](int f) {
        return Vector{raw.field(p, f, i), raw.field(p, f + 1, i), raw.field(p, f + 2, i)};
      };
      node.valid = raw.field(p, 0, i) == 1;
      node.tunnels = raw.field(p, 0, i) == 2;
      node.direction = vector(1);
      node.point = vector(14);
      node.point_slope = {vector(17), vector(20)};
      node.direction_slope = {vector(23), vector(26)};
      node.turn = inner(node.direction, cross(node.direction_slope[0], node.direction_slope[1]));
      node.foci = static_cast<int>(raw.field(p, 30, i));
    }
}

} // namespace scatter::wavefront
