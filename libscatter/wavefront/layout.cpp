#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/layout.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace scatter::wavefront {

double sin_deg(double degrees) {
  const double turns = std::remainder(degrees, 360.0);
  if (turns == 180 || turns == -180 || turns == 0) return 0;
  if (turns == 90) return 1;
  if (turns == -90) return -1;
  return std::sin(turns * radians_per_degree);
}
double cos_deg(double degrees) {
  const double turns = std::abs(std::remainder(degrees, 360.0));
  if (turns == 90) return 0;
  if (turns == 180) return -1;
  return std::cos(turns * radians_per_degree);
}

double even_spacing(const std::vector<double>& values) {
  if (values.size() < 2) return 1;
  const double step = (values.back() - values.front()) / static_cast<double>(values.size() - 1);
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::abs(values[i] - (values.front() + static_cast<double>(i) * step)) > 1e-6 * step) return 0;
  return step;
}

Layout make_layout(const Wanted& wanted, const Tracing& tracing, bool axisymmetric, int last_order) {
  Layout layout;
  if (axisymmetric) {
    layout.phi_deg = {0.0};
    layout.source_column.assign(wanted.phi_deg.size(), 0);
  } else {
    // Folded values that agree to 1e-9 deg are one column.
    std::vector<double> folded;
    for (const double phi : wanted.phi_deg) folded.push_back(std::abs(std::remainder(phi, 360.0)));
    layout.phi_deg = folded;
    std::sort(layout.phi_deg.begin(), layout.phi_deg.end());
    layout.phi_deg.erase(
        std::unique(
            layout.phi_deg.begin(), layout.phi_deg.end(), [](double a, double b) { return b - a < 1e-9; }),
        layout.phi_deg.end());
    for (std::size_t f = 0; f < folded.size(); ++f) {
      const auto at = std::lower_bound(layout.phi_deg.begin(), layout.phi_deg.end(), folded[f] - 1e-9);
      const int column = static_cast<int>(at - layout.phi_deg.begin());
      layout.source_column.push_back(std::remainder(wanted.phi_deg[f], 360.0) < 0 ? ~column : column);
    }
  }

  // Filters need even neighbours. An even grid is filled up until it has them: more directions, but a raster
  // lays thousands while a tree finds one. Any other angle gets a stretch of its own.
  const double widest =
      std::max(wanted.filter_sigma_deg * std::max(last_order - 1, 1) * 4, wanted.sun_disc_deg / 2);
  const double narrowest = std::min(
      wanted.filter_sigma_deg > 0 ? wanted.filter_sigma_deg / 8 : 1e9,
      wanted.sun_disc_deg > 0 ? wanted.sun_disc_deg / 16 : 1e9);
  const double reach =
      widest > 0 ? wanted.filter_sigma_deg * std::max(last_order - 1, 1) * 4 + wanted.sun_disc_deg / 2 : 0;
  const double step = even_spacing(wanted.theta_deg);
  const auto add_stretch = [&](double first, double spacing, int count) {
    const int begin = static_cast<int>(layout.theta_deg.size());
    layout.spacing_deg = spacing;
    for (int i = 0; i < count; ++i) {
      layout.theta_deg.push_back(first + i * spacing);
      layout.segment_first.push_back(begin);
      layout.segment_end.push_back(begin + count);
    }
    return begin;
  };
  if (reach == 0) {
    layout.theta_deg = wanted.theta_deg;
    const int rows = static_cast<int>(wanted.theta_deg.size());
    layout.spacing_deg = step > 0 ? step : 1;
    layout.segment_first.assign(wanted.theta_deg.size(), 0);
    layout.segment_end.assign(wanted.theta_deg.size(), rows);
    layout.row_of.resize(wanted.theta_deg.size());
    std::iota(layout.row_of.begin(), layout.row_of.end(), 0);
  } else if (
      wanted.theta_deg.size() > 1 && step > 0 &&
      (step <= 4 * narrowest || (tracing.search != Search::tree && even_spacing(layout.phi_deg) > 0))) {
    // One stretch, refined by a whole number so that wanted angles stay on it, and continued on both sides.
    const int refine = std::max(1, static_cast<int>(std::ceil(step / narrowest - 1e-9)));
    const double fine = step / refine;
    const double first = wanted.theta_deg.front(), last = wanted.theta_deg.back();
    const int before = static_cast<int>(std::min(std::ceil(reach / fine), std::floor(first / fine + 1e-9)));
    const int after =
        static_cast<int>(std::min(std::ceil(reach / fine), std::floor((180 - last) / fine + 1e-9)));
    const int inside = refine * static_cast<int>(wanted.theta_deg.size() - 1) + 1;
    add_stretch(first - before * fine, fine, before + inside + after);
    // Wanted angles exactly as given, not as sums of steps.
    for (std::size_t t = 0; t < wanted.theta_deg.size(); ++t) {
      layout.row_of.push_back(before + refine * static_cast<int>(t));
      layout.theta_deg[layout.row_of.back()] = wanted.theta_deg[t];
    }
    for (double& theta : layout.theta_deg) theta = std::clamp(theta, 0.0, 180.0);
  } else {
    const double fine = narrowest;
    for (const double theta : wanted.theta_deg) {
      const int before = static_cast<int>(std::min(std::ceil(reach / fine), std::floor(theta / fine)));
      const int after = static_cast<int>(std::min(std::ceil(reach / fine), std::floor((180 - theta) / fine)));
      const int begin = add_stretch(theta - before * fine, fine, before + 1 + after);
      layout.row_of.push_back(begin + before);
      layout.theta_deg[layout.row_of.back()] = theta;
    }
  }
  const bool even = even_spacing(layout.theta_deg) > 0 && even_spacing(layout.phi_deg) > 0;
  if (tracing.search == Search::raster && !even)
    throw InputError(
        "--search raster needs evenly spaced angles in theta and phi; use --search tree or an even range");
  layout.raster = tracing.search == Search::raster || (tracing.search == Search::automatic && even);
  return layout;
}

} // namespace scatter::wavefront
