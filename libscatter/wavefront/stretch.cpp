#include <scatter/optics/units.hpp>
#include <scatter/wavefront/stretch.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::wavefront {
namespace {

constexpr double band_deg = 12; ///< of scattering angles summed together

} // namespace

std::vector<Stretch> stretches(
    const CoarseRays& coarse, int order, double ka, const IntegralShare& share, const Layout& layout,
    Columns columns, double wider) {
  const int rows = static_cast<int>(layout.theta_deg.size());
  std::vector<Stretch> made;
  for (int column = 0; column < columns.count(); ++column) {
    const double phi = layout.phi_deg[columns.first + column] * radians_per_degree;
    // The rim's directions near this azimuth.
    std::vector<RimAngles> rim;
    for (int j = 0; j < CoarseRays::azimuths; ++j) {
      const auto& last = coarse.node(order, CoarseRays::alphas, j);
      const auto& before = coarse.node(order, CoarseRays::alphas - 1, j);
      if (!last.goes_out() || !before.goes_out()) continue;
      const double apart = std::atan2(last.direction[1], last.direction[0]) - phi;
      if (std::abs(apart - 2 * pi * std::rint(apart / (2 * pi))) > 0.06) continue;
      const auto theta = [](const CoarseRays::Node& n) {
        return std::atan2(std::hypot(n.direction[0], n.direction[1]), n.direction[2]);
      };
      rim.push_back({theta(last), theta(before)});
    }
    for (int row = 0; row < rows;) {
      const int band = static_cast<int>(layout.theta_deg[row] / band_deg);
      int first = rows, end = 0;
      for (; row < rows && static_cast<int>(layout.theta_deg[row] / band_deg) == band; ++row) {
        if (share[static_cast<std::size_t>(column) * rows + row] == 0) continue;
        first = std::min(first, row);
        end = row + 1;
      }
      if (first >= end) continue;
      Stretch s;
      s.column = column;
      s.rim = rim;
      s.take_rows(first, end, layout);
      s.lay_taper(order, ka, between_poles, wider);
      made.push_back(std::move(s));
    }
  }
  return made;
}

} // namespace scatter::wavefront
