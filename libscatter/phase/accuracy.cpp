#include <scatter/optics/data_table.hpp>
#include <scatter/phase/methods.hpp>

#include <embedded/accuracy_integral.hpp>
#include <embedded/accuracy_patches.hpp>
#include <embedded/diffraction_gaussian_width.hpp>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace scatter::phase {

double gaussian_filter_width_deg(double radius_m) {
  static const DataTable table = parse_data_table(embedded::diffraction_gaussian_width);
  const double radius_mm = radius_m * 1e3;
  const double first = table.rows.front()[0], last = table.rows.back()[0];
  if (radius_mm < first) return table.rows.front()[1] * std::pow(radius_mm / first, -2.0 / 3);
  if (radius_mm > last) return table.rows.back()[1] * std::pow(radius_mm / last, -2.0 / 3);
  return table.interpolate(radius_mm)[0];
}

namespace {

/// One column of an accuracy table: "gaussian 137..150" holds errors of that kind between these angles, per
/// radius.
struct Region {
  std::string kind;
  double from_deg = 0, to_deg = 0;
  std::vector<double> radius_mm, error;

  /// Power law between the radii of the table, constant beyond them.
  [[nodiscard]] double at(double radius) const {
    const auto above = std::lower_bound(radius_mm.begin(), radius_mm.end(), radius);
    if (above == radius_mm.begin()) return error.front();
    if (above == radius_mm.end()) return error.back();
    const auto i = static_cast<std::size_t>(above - radius_mm.begin());
    const double f = std::log(radius / radius_mm[i - 1]) / std::log(radius_mm[i] / radius_mm[i - 1]);
    return error[i - 1] * std::pow(error[i] / error[i - 1], f);
  }
};

std::vector<Region> read_regions(std::string_view text) {
  const DataTable table = parse_data_table(text);
  std::vector<Region> regions;
  for (std::size_t column = 1; column < table.columns.size(); ++column) {
    std::istringstream name{std::string(table.columns[column])};
    std::string kind, range;
    name >> kind >> range;
    const std::size_t dots = range.find("..");
    Region region{kind, std::stod(range.substr(0, dots)), std::stod(range.substr(dots + 2)), {}, {}};
    for (const std::vector<double>& row : table.rows) {
      region.radius_mm.push_back(row[0]);
      region.error.push_back(row[column]);
    }
    regions.push_back(std::move(region));
  }
  return regions;
}

double
estimate(const std::vector<Region>& regions, std::string_view kind, double radius_m, double theta_deg) {
  const double radius_mm = radius_m * 1e3;
  double inside = 0, left = 0, right = 0;
  for (const Region& region : regions) {
    if (region.kind != kind) continue;
    const double error = region.at(radius_mm);
    // Columns stand in the order of their angles: the last one below and the first one above are the
    // neighbours.
    if (region.to_deg < theta_deg)
      left = error;
    else if (region.from_deg > theta_deg)
      right = right > 0 ? right : error;
    else
      inside = std::max(inside, error);
  }
  if (inside > 0) return inside;
  // Nothing is claimed before the first region and behind the last, where forward peak and glory lie.
  return left > 0 && right > 0 ? std::max(left, right) : std::max({1.0, left, right});
}

} // namespace

double patches_error_estimate(double radius_m, Diffraction diffraction, double theta_deg) {
  static const std::vector<Region> regions = read_regions(embedded::accuracy_patches);
  return estimate(regions, diffraction == Diffraction::gaussian ? "gaussian" : "none", radius_m, theta_deg);
}

double integral_error_estimate(double radius_m, const std::vector<int>& orders, double theta_deg) {
  static const std::vector<Region> regions = read_regions(embedded::accuracy_integral);
  int last = -1; // of the orders that are all there
  for (const int order : orders)
    if (order == last + 1) last = order;
  if (last < 3) return 1;
  return estimate(regions, last < 8 ? "p<=3" : "p<=8", radius_m, theta_deg);
}

} // namespace scatter::phase
