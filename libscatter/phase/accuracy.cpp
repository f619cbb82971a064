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

double bow_shift_deg(const drop::Shape& shape) {
  const double ratio = shape.axis_ratio(), e = std::abs(1 - ratio) / (1 + ratio);
  return std::min(4.599 * e / radians_per_degree, 15.0);
}

namespace {

/// One column of an accuracy table: "gaussian 137..150" holds errors between these angles, per radius.
struct Region {
  Diffraction diffraction = Diffraction::none;
  double from_deg = 0, to_deg = 0;
  std::vector<double> radius_mm, error;

  /// Power law between the radii of the table, and as between the first two below; constant above.
  [[nodiscard]] double at(double radius) const {
    auto above = std::lower_bound(radius_mm.begin(), radius_mm.end(), radius);
    if (above == radius_mm.end()) return error.back();
    if (above == radius_mm.begin()) ++above;
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

/// The filter of orders above this one spreads the bows of the low ones over the dark band between them.
constexpr int last_filtered_order = 3;

/// It does so by up to that much in 120..150 deg: orders 0..8, measured on spheres of 0.05 to 1 mm.
double wide_filter_error(double radius_m) {
  return 2.8 * 0.1e-3 / radius_m;
}

/// Light of higher orders runs along the inside of a drop's edge, where the integral misses as much of it as
/// it adds: orders above 12 at x = 290, above 20 at x = 970.
int last_useful_order(double size_parameter) {
  return static_cast<int>(12 * std::sqrt(size_parameter / 290));
}

/// The error of what a grid of patches carries: measured on spheres of 0.1 to 1 mm at 137..150 deg, 400 to
/// 2000 rays. Rays too few to tell anything miss all of it.
double grid_error(double size_parameter, int rays) {
  const double spacing = 400.0 / rays;
  return std::min(0.014 * std::pow(size_parameter / 9670, 0.75) * spacing * spacing, 1.0);
}

/// Scattering angle of a sphere's ray of order p by its angle of incidence, radians.
double scattering_angle(int order, double n, double incidence) {
  const double deviation =
      (order - 1) * pi + 2 * incidence - 2 * order * std::asin(std::min(std::sin(incidence) / n, 1.0));
  return std::acos(std::cos(deviation));
}

/// What patches keep of an order of a sphere beside the diffraction integral: nothing of order 0, nor about
/// the bow and where grazing rays leave, as wavefront::integral_share() has it; all of it next to the axis.
class KeptByPatches {
public:
  /// Of the bow's Airy pattern the integral takes all within `inner` widths and nothing beyond `outer`.
  KeptByPatches(int order, double n, double size_parameter, double inner, double outer) : order_(order) {
    const double grazing = std::sqrt(6.0) * std::cbrt(2 / size_parameter),
                 leak = 2 * std::cbrt(2 / size_parameter);
    const double rim = scattering_angle(order, n, pi / 2);
    double low = rim - leak, high = rim + leak;
    for (int i = 0; i <= 200; ++i) {
      const double theta = scattering_angle(order, n, std::acos(std::min(grazing, 1.0) * i / 200));
      low = std::min(low, theta);
      high = std::max(high, theta);
    }
    zones_.push_back({low, high, low, high});
    const double p2 = order * order, cos2 = (n * n - 1) / (p2 - 1);
    if (order < 2 || cos2 >= 1) return;
    // Directions bend by h X^2 / 2 about the bow (van de Hulst 1957, section 13.23).
    const double h = (p2 - 1) * (p2 - 1) / p2 * std::sqrt((p2 - n * n) / std::pow(n * n - 1, 3));
    const double width = std::min(std::cbrt(h / 2) * std::pow(size_parameter, -2.0 / 3), 0.1);
    const double bow = scattering_angle(order, n, std::acos(std::sqrt(cos2)));
    zones_.push_back({bow - outer * width, bow + outer * width, bow - inner * width, bow + inner * width});
  }
  /// Share of the amplitude.
  [[nodiscard]] double operator()(double theta_deg) const {
    constexpr double axis_deg = 12;
    if (order_ == 0) return 0;
    if (std::min(theta_deg, 180 - theta_deg) < axis_deg) return 1;
    const double theta = theta_deg * radians_per_degree;
    double kept = 1;
    for (const Zone& z : zones_) {
      if (theta <= z.low || theta >= z.high) continue;
      const double below = theta < z.low_inside ? (z.low_inside - theta) / (z.low_inside - z.low) : 0,
                   above = theta > z.high_inside ? (theta - z.high_inside) / (z.high - z.high_inside) : 0;
      const double outside = std::max(below, above);
      kept = std::min(kept, outside * outside * (3 - 2 * outside));
    }
    return kept;
  }

private:
  struct Zone {
    double low, high, low_inside, high_inside;
  };
  int order_;
  std::vector<Zone> zones_;
};

/// In the second region of tables/accuracy/patches.csv, where forward diffraction is faint.
constexpr double beside_peak_deg = 16;

/// Where forward diffraction is looked at [deg].
constexpr double forward_deg = 30;

/// Amplitude of forward diffraction by a sphere's shadow over x.
double forward_amplitude(double size_parameter, double theta_deg) {
  const double z = size_parameter * std::sin(std::abs(theta_deg) * radians_per_degree);
  if (z < 1e-6) return size_parameter / 2;
  constexpr double far = 25; // where two terms are good to 1e-4
  const double J1 =
      z < far ? std::cyl_bessel_j(1.0, z)
              : std::sqrt(2 / (pi * z)) * (std::cos(z - 0.75 * pi) - 3 / (8 * z) * std::sin(z - 0.75 * pi));
  return size_parameter * J1 / z;
}

/// What leaving the forward peak out costs, per angle. background: other light, |S|^2 over x^2; its phase is
/// not known, an eighth of a turn stands for all.
std::vector<double> errors_without_peak(
    double size_parameter, std::span<const double> theta_deg, std::span<const double> background) {
  // Rings come and go within the disc: the mean square of some places.
  constexpr int reach = 2, places_each = 2 * reach + 1;
  std::vector<double> places, amplitude, intensity, errors;
  for (const double theta : theta_deg)
    for (int i = -reach; i <= reach; ++i)
      places.push_back(std::max(theta + i * exact::sun_diameter_deg / 16, 0.0));
  const exact::SunDisc disc(places, exact::sun_diameter_deg, exact::SunDisc::level_for(size_parameter));
  for (const double at : disc.grid_deg()) {
    amplitude.push_back(forward_amplitude(size_parameter, at));
    intensity.push_back(amplitude.back() * amplitude.back());
  }
  for (std::size_t t = 0; t < theta_deg.size(); ++t) {
    const double beat = std::sqrt(2 * background[t]);
    double squares = 0;
    for (std::size_t i = t * places_each; i < (t + 1) * places_each; ++i) {
      const double truth = disc.mean(i, intensity) + beat * disc.mean(i, amplitude) + background[t];
      squares += std::pow(background[t] / truth - 1, 2);
    }
    errors.push_back(std::sqrt(squares / places_each));
  }
  return errors;
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
  for (int p = 0; p <= last_order; ++p) by_patches_.push_back(truncation_.share(p));
  // Flat drops leave more to the patches.
  const bool flat = bow_shift_deg(request.shape) > 0.01;
  for (int p = 0; p <= last_order; ++p) {
    const KeptByPatches kept(p, index.real(), size_parameter_, flat ? 8 : 30, flat ? 12 : 40);
    for (std::size_t t = 0; t < theta_deg_.size(); ++t) by_patches_[p][t] *= kept(theta_deg_[t]);
  }

  no_peak_.assign(theta_deg_.size(), 0.0);
  const auto near =
      static_cast<std::size_t>(std::ranges::upper_bound(theta_deg_, forward_deg) - theta_deg_.begin());
  if (near > 0) {
    std::vector<double> background = truncation_.share(1);
    const std::vector<double> whole = truncation_.whole();
    for (std::size_t t = 0; t < near; ++t) background[t] *= whole[t];
    std::ranges::copy(
        errors_without_peak(size_parameter_, std::span(theta_deg_).first(near), background),
        no_peak_.begin());
  }
}

std::vector<double>
ErrorModel::estimate(Diffraction diffraction, int rays, std::span<const int> orders) const {
  std::vector<double> errors = truncation_.error(orders);
  if (diffraction == Diffraction::integral) {
    const auto useful = std::ranges::upper_bound(orders, last_useful_order(size_parameter_));
    const std::vector<double> of_useful =
        useful == orders.end() ? errors : truncation_.error(orders.first(useful - orders.begin()));
    for (std::size_t t = 0; t < errors.size(); ++t) errors[t] = std::max(errors[t], of_useful[t]);
  }
  const double grid = grid_error(size_parameter_, rays);
  for (std::size_t t = 0; t < errors.size(); ++t) {
    // The peak that patches lack comes on its own, by no_peak_: theirs is what they have beside it.
    const double looked_up_deg =
        diffraction == Diffraction::integral ? theta_deg_[t] : std::max(theta_deg_[t], beside_peak_deg);
    const double measured = measured_error(radius_m_, diffraction, looked_up_deg);
    double own = measured, patches = 1;
    if (diffraction == Diffraction::integral) {
      patches = 0;
      for (const int p : orders)
        if (static_cast<std::size_t>(p) < by_patches_.size()) patches += by_patches_[p][t];
      patches = std::min(patches, 1.0);
    } else {
      // What the table says holds the orders that its runs left out.
      own = std::sqrt(std::max(measured * measured - in_tables_[t] * in_tables_[t], measured * measured / 9));
      own = std::hypot(own, no_peak_[t]);
      if (diffraction == Diffraction::gaussian && orders.back() > last_filtered_order)
        own = std::max({own, 1.0, wide_filter_error(radius_m_)});
    }
    errors[t] = std::hypot(own, errors[t], patches * grid);
  }
  return errors;
}

double root_mean_square(std::span<const double> values) {
  const double sum = std::inner_product(values.begin(), values.end(), values.begin(), 0.0);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

} // namespace scatter::phase
