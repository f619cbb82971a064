#include <scatter/optics/units.hpp>
#include <scatter/wavefront/ray_grid.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::wavefront {

SurfaceParameters surface_parameters(const drop::Shape& shape, double sun_elevation_deg) {
  SurfaceParameters parameters;
  const double h = sun_elevation_deg * radians_per_degree;
  // Extent along the axis (downward positive) and across it.
  constexpr int samples = 2880;
  double lowest = -10, highest = 10, widest = 0;
  parameters.smallest_radius = 10;
  parameters.largest_radius = 0;
  for (int i = 0; i <= samples; ++i) {
    const double theta = pi * i / samples, r = shape.radius(theta);
    lowest = std::max(lowest, r * std::cos(theta));
    highest = std::min(highest, r * std::cos(theta));
    widest = std::max(widest, r * std::sin(theta));
    parameters.largest_radius = std::max(parameters.largest_radius, r);
    parameters.smallest_radius = std::min(parameters.smallest_radius, r);
  }
  const double centre = 0.5 * (lowest + highest), half_height = 0.5 * (lowest - highest);
  // The ellipsoid with these axes, blown up until it holds every sample, and a little for what lies between
  // them.
  double blow_up = 1;
  for (int i = 0; i <= samples; ++i) {
    const double theta = pi * i / samples, r = shape.radius(theta);
    blow_up = std::max(
        blow_up, std::hypot(r * std::sin(theta) / widest, (r * std::cos(theta) - centre) / half_height));
  }
  parameters.hull_margin = blow_up - 1;
  if (shape.kind != drop::Shape::Kind::spheroid && !shape.is_sphere()) blow_up += 1e-6;
  if (shape.is_sphere()) blow_up = 1;
  const double across = widest * blow_up, along = half_height * blow_up;
  parameters.values = {std::cos(h), 0, std::sin(h), 1 / (across * across), 1 / (along * along), centre};
  if (shape.kind == drop::Shape::Kind::spheroid) {
    parameters.values.push_back(1 / (shape.horizontal_semi_axis * shape.horizontal_semi_axis));
    parameters.values.push_back(1 / (shape.vertical_semi_axis * shape.vertical_semi_axis));
  } else {
    for (const double coefficient : shape.polynomial()) parameters.values.push_back(coefficient);
  }
  return parameters;
}

std::vector<Tile> make_tiles(int rays, double radius, double smallest_radius, GridPart part) {
  const double step = 2 * radius / rays, origin = -radius + 0.5 * step;
  std::vector<Tile> tiles;
  const auto add = [&](int i, int j, int cells_i, int cells_j, int flags) {
    const double u0 = origin + i * step, u1 = u0 + cells_i * step, v0 = origin + j * step,
                 v1 = v0 + cells_j * step;
    const double near_u = std::max({u0, -u1, 0.0}), near_v = std::max({v0, -v1, 0.0});
    if (std::hypot(near_u, near_v) > radius) return;
    const double far = std::hypot(std::max(std::abs(u0), std::abs(u1)), std::max(std::abs(v0), std::abs(v1)));
    if (far > 0.85 * smallest_radius) flags |= tile_rim;
    tiles.push_back({i, j, cells_i, cells_j, flags});
  };
  const int cells = rays - 1;
  const auto add_rows = [&](int j, int cells_j, int flags) {
    for (int i = 0; i < cells; i += tile_cells) add(i, j, std::min(tile_cells, cells - i), cells_j, flags);
  };
  if (part == GridPart::whole) {
    for (int j = 0; j < cells; j += tile_cells) add_rows(j, std::min(tile_cells, cells - j), tile_direct);
  } else {
    // The cells on the plane v = 0: one row for an even number of rays, the two that meet there for an odd
    // one.
    const int middle = rays % 2 == 0 ? rays / 2 - 1 : std::max(rays / 2 - 1, 0);
    add_rows(middle, rays % 2 == 0 ? 1 : std::min(2, cells), tile_direct);
    if (part == GridPart::half)
      for (int j = middle + 1; j < cells; j += tile_cells) add_rows(j, std::min(tile_cells, cells - j), 0);
  }
  const auto azimuth = [&](const Tile& tile) {
    return std::atan2(
        origin + (tile.j + 0.5 * tile.cells_j) * step, origin + (tile.i + 0.5 * tile.cells_i) * step);
  };
  std::stable_sort(
      tiles.begin(), tiles.end(), [&](const Tile& a, const Tile& b) { return azimuth(a) < azimuth(b); });
  return tiles;
}

double shadow_area(const drop::Shape& shape, double sun_elevation_deg) {
  if (shape.is_sphere()) return pi;
  // Half the surface integral of |n . s|: for a ring of the body of revolution the azimuth's integral of
  // |a + b cos(alpha)| has a closed form. d(area) n = (-z', r') rho d(theta), with z downward and rho the
  // ring's radius.
  const double h = sun_elevation_deg * radians_per_degree, along = std::abs(std::sin(h)),
               across = std::cos(h);
  constexpr int samples = 20000;
  double sum = 0;
  for (int i = 0; i < samples; ++i) {
    const double theta = pi * (i + 0.5) / samples, r = shape.radius(theta), dr = shape.slope(theta);
    const double s = std::sin(theta), c = std::cos(theta);
    const double rho = r * s, rho_slope = dr * s + r * c, z_slope = dr * c - r * s;
    const double a = std::abs(rho_slope) * along, b = std::abs(z_slope) * across;
    const double ring =
        a >= b ? 2 * pi * a : 4 * (std::sqrt((b - a) * (b + a)) + a * std::asin(std::min(a / b, 1.0)));
    sum += ring * rho;
  }
  return 0.5 * sum * pi / samples;
}

} // namespace scatter::wavefront
