#include <scatter/optics/units.hpp>
#include <scatter/wavefront/edge_filter.hpp>

#include <cmath>
#include <numbers>
#include <utility>

namespace scatter::wavefront {

EdgeWindows edge_windows(
    const Tracing& tracing, std::span<const BowCrossing> crossings, const Layout& layout, Columns columns,
    const Wanted& wanted) {
  std::vector<std::vector<EdgeWindow>> found(columns.count());
  std::vector<double> weights;
  for (const int order : tracing.orders) {
    if (order < 2) continue;
    const double sigma = wanted.filter_sigma_deg * (order - 1);
    const double step = layout.spacing_deg / sigma;
    const int at = static_cast<int>(weights.size()), reach = static_cast<int>(4 / step);
    const auto kernel = symmetric_weights(reach, [&](int k) { return std::exp(-0.5 * k * step * k * step); });
    weights.insert(weights.end(), kernel.begin(), kernel.end());
    for (const BowCrossing& crossing : crossings)
      if (crossing.seed.order == order)
        found[crossing.column].push_back({crossing.theta_deg, sigma, at, reach});
  }
  return {PerColumn(std::move(found)), std::move(weights)};
}

PerColumn<EndCorrection> end_corrections(
    const Tracing& tracing, const Light& light, double between_rays, std::span<const BowCrossing> crossings,
    const Layout& layout, Columns columns, const Wanted& wanted) {
  const double h_deg = layout.spacing_deg, h = h_deg * radians_per_degree;
  const double wave = 2 * tracing.shape.radius_m / light.wavelength_m;
  const bool counted = tracing.interference && tracing.focal_lines != FocalLines::none;
  const int rows = static_cast<int>(layout.theta_deg.size());
  std::vector<std::vector<const BowCrossing*>> of_column(columns.count());
  for (const BowCrossing& crossing : crossings) {
    if (crossing.edge.state != BowEdge::State::found) continue;
    // Neighbouring segments of the curve may name one edge twice.
    auto& others = of_column[crossing.column];
    if (std::none_of(others.begin(), others.end(), [&](const BowCrossing* other) {
          return other->seed.order == crossing.seed.order &&
                 std::hypot(other->edge.u - crossing.edge.u, other->edge.v - crossing.edge.v) < 1e-3;
        }))
      others.push_back(&crossing);
  }
  std::vector<std::vector<EndCorrection>> corrections(of_column.size());
  for (std::size_t column = 0; column < of_column.size(); ++column)
    for (const BowCrossing* crossing : of_column[column]) {
      const BowEdge& edge = crossing->edge;
      // Next to the edge patches are too wide for the peak: there its law stands in for them, as long as
      // the two sheets keep in step.
      const double patch = 0.5 * edge.curvature * between_rays * between_rays;
      const double turn = 4.0 / 3 * pi * wave * std::sqrt(2 / edge.curvature);
      const double in_step = std::pow(0.5 / turn, 2.0 / 3);
      // The rule counts the focal line where the deflection turns, not where the sheets meet.
      const double miscounted =
          tracing.interference && tracing.focal_lines == FocalLines::rule ? edge.focal_offset : 0;
      const double replaced = std::max(std::min(6 * patch, in_step), miscounted);
      if (replaced < 2 * patch || replaced > in_step) continue;
      const int near = static_cast<int>(std::ceil(replaced / h));
      // Rows that change must be smoothed entirely.
      if (wanted.filter_sigma_deg > 0 && std::abs(edge.theta_deg - crossing->theta_deg) + (2 + near) * h_deg >
                                             wanted.filter_sigma_deg * (crossing->seed.order - 1))
        continue;
      // Two edges of a curve that folds back share their peak; others spoil each other's rows.
      if (std::any_of(of_column[column].begin(), of_column[column].end(), [&](const BowCrossing* other) {
            const double apart = std::abs(other->edge.theta_deg - edge.theta_deg) / h_deg;
            return other != crossing && apart < near + (other->seed.order == crossing->seed.order ? 8 : 4);
          }))
        continue;
      for (int first = 0; first < rows; first = layout.segment_end[first]) {
        const int end = layout.segment_end[first];
        const double place = (edge.theta_deg - layout.theta_deg[first]) / h_deg;
        if (!(place >= near + 6 && place <= end - first - near - 7)) continue;
        EndCorrection c{};
        c.side = edge.side;
        c.first = first + static_cast<int>(edge.side > 0 ? std::ceil(place) : std::floor(place));
        const double alpha = std::abs(c.first - first - place);
        c.place = alpha;
        c.step = h;
        c.turn = counted ? turn : 0;
        c.skip = alpha < 0.25 ? 1 : 0;
        c.replaced = std::max(0, static_cast<int>(std::ceil(replaced / h - alpha)));
        c.mass = -hurwitz_zeta_half(alpha + c.skip) / std::sqrt(h);
        const auto& [S1, S2, S3, S4] = edge.amplitude;
        // Where no focal line is counted both sheets leave the edge in phase.
        const double factor = tracing.interference && !counted ? std::numbers::sqrt2 : 1;
        c.amplitude = {factor * S1.real(), factor * S1.imag(), factor * S2.real(), factor * S2.imag(),
                       factor * S3.real(), factor * S3.imag(), factor * S4.real(), factor * S4.imag()};
        corrections[column].push_back(c);
      }
    }
  return PerColumn(std::move(corrections));
}

} // namespace scatter::wavefront
