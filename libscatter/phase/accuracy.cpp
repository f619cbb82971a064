#include <scatter/optics/data_table.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/accuracy.hpp>

#include <embedded/accuracy_integral.hpp>
#include <embedded/accuracy_patches.hpp>
#include <embedded/diffraction_gaussian_width.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
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

/// One column of an accuracy table: "gaussian 137..150" holds errors between these angles, per radius.
struct Region {
  Diffraction diffraction = Diffraction::none;
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
  std::vector<Region> regions;
  for (const std::string_view text : {embedded::accuracy_patches, embedded::accuracy_integral}) {
    const DataTable table = parse_data_table(text);
    for (std::size_t column = 1; column < table.columns.size(); ++column) {
      std::istringstream name{std::string(table.columns[column])};
      std::string filter, range;
      name >> filter >> range;
      const std::size_t dots = range.find("..");
      Region region;
      region.diffraction = filter == "gaussian"   ? Diffraction::gaussian
                           : filter == "integral" ? Diffraction::integral
                                                  : Diffraction::none;
      region.from_deg = std::stod(range.substr(0, dots));
      region.to_deg = std::stod(range.substr(dots + 2));
      for (const std::vector<double>& row : table.rows) {
        region.radius_mm.push_back(row[0]);
        region.error.push_back(row[column]);
      }
      regions.push_back(std::move(region));
    }
  }
  return regions;
}

/// From the tables of tables/accuracy, interpolated in the logarithm of the radius. Between the regions: the
/// larger neighbour. Before the first and beyond the last: that, at least 1.
double measured_error(double radius_m, Diffraction diffraction, double theta_deg) {
  static const std::vector<Region> regions = read_regions();
  const double radius_mm = radius_m * 1e3;
  double inside = 0, left = 0, right = 0;
  for (const Region& region : regions) {
    if (region.diffraction != diffraction) continue;
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

/// How far a drop's bows may lie from the sphere's [deg]: Moebius's shift of the primary, (Moebius 1910), for
/// its axis ratio.
double bow_shift_deg(const drop::Shape& shape) {
  const double ratio = shape.axis_ratio(), e = std::abs(1 - ratio) / (1 + ratio);
  return std::min(4.599 * e / radians_per_degree, 15.0);
}

/// The error of a grid of rays: measured on spheres of 0.1 to 1 mm at 137..150 deg, 400 to 2000 rays.
double grid_error(double size_parameter, int rays) {
  const double spacing = 400.0 / rays;
  return 0.014 * std::pow(size_parameter / 9670, 0.75) * spacing * spacing;
}

} // namespace

ErrorModel::ErrorModel(
    const Request& request, double wavelength_m, std::complex<double> index, int last_order)
    : radius_m_(request.shape.radius_m), theta_deg_(request.theta_deg),
      size_parameter_(2 * pi * radius_m_ / wavelength_m),
      truncation_(
          size_parameter_, index, request.theta_deg, std::max(last_order, table_orders.back()),
          bow_shift_deg(request.shape), request.threads) {
  in_tables_ = truncation_.error(table_orders);
}

std::vector<double>
ErrorModel::estimate(Diffraction diffraction, int rays, std::span<const int> orders) const {
  std::vector<double> errors = truncation_.error(orders);
  const double grid = grid_error(size_parameter_, rays);
  for (std::size_t t = 0; t < errors.size(); ++t) {
    const double measured = measured_error(radius_m_, diffraction, theta_deg_[t]);
    double own = measured;
    if (diffraction != Diffraction::integral) {
      // What the table says holds the orders that its runs left out.
      own = std::sqrt(std::max(measured * measured - in_tables_[t] * in_tables_[t], measured * measured / 9));
    }
    errors[t] = std::hypot(own, errors[t], grid);
  }
  return errors;
}

double root_mean_square(std::span<const double> values) {
  const double sum = std::inner_product(values.begin(), values.end(), values.begin(), 0.0);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

} // namespace scatter::phase
