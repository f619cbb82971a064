#include <scatter/optics/data_table.hpp>
#include <scatter/phase/methods.hpp>

#include <embedded/accuracy_patches.hpp>
#include <embedded/diffraction_gaussian_width.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::phase {

double gaussian_filter_width_deg(double radius_m) {
  static const DataTable table = parse_data_table(embedded::diffraction_gaussian_width);
  const double radius_mm = radius_m * 1e3;
  const double first = table.rows.front()[0], last = table.rows.back()[0];
  if (radius_mm < first) return table.rows.front()[1] * std::pow(radius_mm / first, -2.0 / 3);
  if (radius_mm > last) return table.rows.back()[1] * std::pow(radius_mm / last, -2.0 / 3);
  return table.interpolate(radius_mm)[0];
}

double patches_error_estimate(double radius_m, Diffraction diffraction, double theta_deg) {
  // Columns: radius_mm, gaussian (0 or 1), theta_from_deg, theta_to_deg, rms; sorted by radius.
  static const DataTable table = parse_data_table(embedded::accuracy_patches);
  const double wanted_filter = diffraction == Diffraction::gaussian ? 1 : 0, radius_mm = radius_m * 1e3;
  // Error in one region at this radius; the region is named by its limits.
  const auto error_in = [&](double from, double to) {
    const std::vector<double>* below = nullptr;
    const std::vector<double>* above = nullptr;
    for (const std::vector<double>& row : table.rows) {
      if (row[1] != wanted_filter || row[2] != from || row[3] != to) continue;
      if (row[0] <= radius_mm) below = &row;
      if (row[0] >= radius_mm && above == nullptr) above = &row;
    }
    if (below == nullptr) return (*above)[4];
    if (above == nullptr || (*above)[0] == (*below)[0]) return (*below)[4];
    const double f = std::log(radius_mm / (*below)[0]) / std::log((*above)[0] / (*below)[0]);
    return (*below)[4] * std::pow((*above)[4] / (*below)[4], f);
  };
  double inside = -1, left = -1, right = -1, left_edge = -1, right_edge = 1e9;
  for (const std::vector<double>& row : table.rows) {
    const double from = row[2], to = row[3];
    if (theta_deg >= from && theta_deg <= to) inside = std::max(inside, error_in(from, to));
    if (to <= theta_deg && to > left_edge) left_edge = to, left = error_in(from, to);
    if (from >= theta_deg && from < right_edge) right_edge = from, right = error_in(from, to);
  }
  // Nothing is claimed behind the last region, where the glory lies.
  if (inside < 0 && right < 0) return std::max(1.0, left);
  return inside >= 0 ? inside : std::max(left, right);
}

} // namespace scatter::phase
