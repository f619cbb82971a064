#include <scatter/optics/data_table.hpp>
#include <scatter/phase/methods.hpp>

#include <embedded/accuracy_patches.hpp>
#include <embedded/diffraction_gaussian_width.hpp>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <string>
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

/// One column of the accuracy table: "gaussian 137..150" holds errors between these angles, per radius.
struct Region {
  bool gaussian = false;
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

std::vector<Region> read_regions() {
  const DataTable table = parse_data_table(embedded::accuracy_patches);
  std::vector<Region> regions;
  for (std::size_t column = 1; column < table.columns.size(); ++column) {
    std::istringstream name{std::string(table.columns[column])};
    std::string filter, range;
    name >> filter >> range;
    const std::size_t dots = range.find("..");
    Region region{
        filter == "gaussian", std::stod(range.substr(0, dots)), std::stod(range.substr(dots + 2)), {}, {}};
    for (const std::vector<double>& row : table.rows) {
      region.radius_mm.push_back(row[0]);
      region.error.push_back(row[column]);
    }
    regions.push_back(std::move(region));
  }
  return regions;
}

} // namespace

double patches_error_estimate(double radius_m, Diffraction diffraction, double theta_deg) {
  static const std::vector<Region> regions = read_regions();
  const double radius_mm = radius_m * 1e3;
  double inside = 0, left = 0, right = 0;
  for (const Region& region : regions) {
    if (region.gaussian != (diffraction == Diffraction::gaussian)) continue;
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
  // Nothing is claimed behind the last region, where the glory lies.
  return right > 0 ? std::max(left, right) : std::max(1.0, left);
}

} // namespace scatter::phase
