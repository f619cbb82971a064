#include <scatter/exact/mie.hpp>
#include <scatter/optics/data_table.hpp>
#include <scatter/optics/fresnel.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/accuracy.hpp>
#include <scatter/phase/methods.hpp>
#include <scatter/wavefront/layout.hpp>

#include <embedded/accuracy_integral.hpp>
#include <embedded/accuracy_patches.hpp>
#include <embedded/diffraction_gaussian_width.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
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

/// Q_sca of a sphere as rays have it, see wavefront::FarField.
double efficiency_by_rays(double size_parameter, std::complex<double> index) {
  double absorbed = 0;
  constexpr int samples = 1024;
  for (int i = 0; i < samples && index.imag() > 0; ++i) {
    const double incidence = 0.5 * pi * (i + 0.5) / samples;
    const double ring = 2 * std::sin(incidence) * std::cos(incidence) * (0.5 * pi / samples);
    const double cos_inside = std::sqrt(1 - std::pow(std::sin(incidence) / index.real(), 2));
    const double passes = std::exp(-4 * size_parameter * index.imag() * cos_inside);
    const FresnelEnergy energy = fresnel_energy(index.real(), std::cos(incidence));
    for (const double R : {energy.reflectivity_perpendicular, energy.reflectivity_parallel})
      absorbed += ring / 2 * (1 - R) * (1 - passes) / (1 - R * passes);
  }
  return 2 - absorbed + 1.9923861 * std::pow(size_parameter, -2.0 / 3);
}

/// Relative error of the scattering cross section by rays, which phase functions are divided by: of this very
/// sphere, or over a period of Mie's ripple about it where that is larger. n > 1.
double cross_section_error(double size_parameter, std::complex<double> index) {
  const double period = std::min(pi / (index.real() - 1), 0.5 * size_parameter);
  constexpr int samples = 8;
  constexpr double most_by_mie = 5e5; // larger ones are better still
  double squares = 0, own = 0;
  for (int i = 0; i < samples; ++i) {
    const double x = std::min(size_parameter + (i - samples / 2.0) / samples * period, most_by_mie);
    const double error = efficiency_by_rays(x, index) / exact::mie(x, index, {}).Qsca - 1;
    squares += error * error;
    if (i == samples / 2) own = std::abs(error);
  }
  return std::max(own, std::sqrt(squares / samples));
}

/// What is wrong about the edges of a drop that hardly bends light: measured on spheres of n = 1.005 to 1.02
/// at 0.2 and 1 mm, orders 0..3, where rays of order 1 leave, between 0 and 2 acos(1 / n), and as far beyond
/// as the rim leaks.
double faint_edges_error(double size_parameter, double n, double theta_deg) {
  const double reach = 2 * std::acos(1 / n) + 4 * std::cbrt(2 / size_parameter);
  return theta_deg * radians_per_degree > reach ? 0 : 0.25 * std::pow(0.01 / (n - 1), 2.5);
}

/// Averages over a disc as wavefront::Tracer makes them: chords of the disc, on rows this far apart.
class ByRows {
public:
  ByRows(double diameter_deg, double spacing_deg) : spacing_deg_(spacing_deg) {
    const double step = spacing_deg / (diameter_deg / 2);
    for (int k = 0; k * step < 1; ++k) weight_.push_back(std::sqrt(1 - k * step * k * step));
    sum_ = 2 * std::accumulate(weight_.begin(), weight_.end(), 0.0) - weight_.front();
  }
  /// f of the angle in degrees.
  template <typename F>
  [[nodiscard]] double operator()(double theta_deg, F&& f) const {
    double total = weight_[0] * f(theta_deg);
    for (std::size_t k = 1; k < weight_.size(); ++k)
      total += weight_[k] * (f(theta_deg - static_cast<double>(k) * spacing_deg_) +
                             f(theta_deg + static_cast<double>(k) * spacing_deg_));
    return total / sum_;
  }

private:
  double spacing_deg_, sum_;
  std::vector<double> weight_; ///< of the middle and one side
};

/// How much of a ripple ByRows leaves beyond what the disc does: rows may be too far apart for it.
class RippleLeft {
public:
  RippleLeft(const ByRows& mean, double diameter_deg, double size_parameter) : finest_(size_parameter / 180) {
    for (int i = 0; i <= samples; ++i) {
      const double angle = 2 * pi * finest_ * i / samples, across = angle * diameter_deg / 2;
      left_.push_back(
          mean(0, [&](double theta) { return std::cos(angle * theta); }) -
          (i == 0 ? 1 : 2 * std::cyl_bessel_j(1.0, across) / across));
    }
  }
  /// Of two rays that meet with these momenta, sines of their angles of incidence.
  [[nodiscard]] double operator()(double first, double second) const {
    return left_[std::lround(std::min(std::abs(first - second) / 2, 1.0) * samples)];
  }

private:
  static constexpr int samples = 2000;
  double finest_; ///< ripple of opposite rays of the rim, cycles per degree
  std::vector<double> left_;
};

/// The rays of one order of a sphere.
class Momenta {
public:
  Momenta(int order, double n) {
    constexpr int samples = 500;
    for (int i = 0; i <= samples; ++i) {
      const double sine = std::sin(0.5 * pi * i / samples);
      const double wrapped = std::remainder(
          (order - 1) * pi + 2 * std::asin(sine) - 2 * order * std::asin(std::min(sine / n, 1.0)), 2 * pi);
      theta_.push_back(std::abs(wrapped));
      momentum_.push_back(std::copysign(sine, wrapped));
    }
  }
  /// Of the rays that leave at theta, or of the one that leaves nearest.
  [[nodiscard]] std::vector<double> at(double theta) const {
    std::vector<double> found;
    std::size_t nearest = 0;
    for (std::size_t i = 0; i < theta_.size(); ++i) {
      if (i > 0 && (theta_[i - 1] < theta) != (theta_[i] < theta)) found.push_back(momentum_[i]);
      if (std::abs(theta_[i] - theta) < std::abs(theta_[nearest] - theta)) nearest = i;
    }
    if (found.empty()) found.push_back(momentum_[nearest]);
    return found;
  }

private:
  std::vector<double> theta_, momentum_; ///< negative: the ray passed below the axis of the light
};

/// What rows too far apart leave of the ripple between rays of a sphere, per angle; share: of the light,
/// [order][theta].
std::vector<double> ripple_errors(
    const RippleLeft& left, double n, std::span<const double> theta_deg,
    std::span<const std::vector<double>> share) {
  std::vector<Momenta> momenta;
  for (std::size_t p = 0; p < share.size(); ++p) momenta.emplace_back(static_cast<int>(p), n);
  struct Ray {
    double momentum, share;
  };
  std::vector<Ray> rays;
  std::vector<double> errors;
  for (std::size_t t = 0; t < theta_deg.size(); ++t) {
    constexpr double faint = 1e-4;
    rays.clear();
    for (std::size_t p = 0; p < share.size(); ++p) {
      if (share[p][t] < faint) continue;
      const std::vector<double> found = momenta[p].at(theta_deg[t] * radians_per_degree);
      for (const double momentum : found)
        rays.push_back({momentum, share[p][t] / static_cast<double>(found.size())});
    }
    double squares = 0;
    for (std::size_t i = 0; i < rays.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        squares += 2 * rays[i].share * rays[j].share * std::pow(left(rays[i].momentum, rays[j].momentum), 2);
    errors.push_back(std::sqrt(squares));
  }
  return errors;
}

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

/// Errors about the forward peak, per angle: of averaging it over the sun along theta alone, or of leaving it
/// out. background: other light, |S|^2 over x^2; its phase is not known, an eighth of a turn stands for all.
std::vector<double> forward_errors(
    double size_parameter, std::span<const double> theta_deg, std::span<const double> background,
    double diameter_deg, const ByRows* by_rows) {
  // Rings come and go within the disc: the mean square of some places.
  constexpr int reach = 2, places_each = 2 * reach + 1;
  std::vector<double> places, amplitude, intensity, errors;
  for (const double theta : theta_deg)
    for (int i = -reach; i <= reach; ++i) places.push_back(std::max(theta + i * diameter_deg / 16, 0.0));
  const exact::SunDisc disc(places, diameter_deg, exact::SunDisc::level_for(size_parameter));
  const auto S = [&](double at) { return forward_amplitude(size_parameter, at); };
  for (const double at : disc.grid_deg()) {
    amplitude.push_back(S(at));
    intensity.push_back(amplitude.back() * amplitude.back());
  }
  for (std::size_t t = 0; t < theta_deg.size(); ++t) {
    const double beat = std::sqrt(2 * background[t]);
    double squares = 0;
    for (std::size_t i = t * places_each; i < (t + 1) * places_each; ++i) {
      const double truth = disc.mean(i, intensity) + beat * disc.mean(i, amplitude) + background[t];
      const double found =
          by_rows ? (*by_rows)(places[i], [&](double at) { return S(at) * (S(at) + beat); }) : 0;
      squares += std::pow((found + background[t]) / truth - 1, 2);
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
  const double n = index.real(), cross_section = cross_section_error(size_parameter_, index);
  for (const double theta : theta_deg_)
    common_.push_back(std::hypot(cross_section, faint_edges_error(size_parameter_, n, theta)));
  for (int p = 0; p <= last_order; ++p) by_patches_.push_back(truncation_.share(p));
  disc_.assign(theta_deg_.size(), 0.0);
  std::optional<ByRows> by_rows;
  if (request.sun_disc_deg > 0) {
    wavefront::Wanted wanted = wanted_of(request);
    wanted.filter_sigma_deg = 0; // rows are as near to each other at least
    const bool axisymmetric = request.shape.is_sphere() || request.sun_elevation_deg == 90;
    by_rows.emplace(
        request.sun_disc_deg,
        wavefront::make_layout(wanted, tracing_of(request), axisymmetric, last_order).spacing_deg);
    disc_ = ripple_errors(
        RippleLeft(*by_rows, request.sun_disc_deg, size_parameter_), n, theta_deg_, by_patches_);
  }
  // Flat drops leave more to the patches.
  const bool flat = bow_shift_deg(request.shape) > 0.01;
  for (int p = 0; p <= last_order; ++p) {
    const KeptByPatches kept(p, n, size_parameter_, flat ? 8 : 30, flat ? 12 : 40);
    for (std::size_t t = 0; t < theta_deg_.size(); ++t) by_patches_[p][t] *= kept(theta_deg_[t]);
  }

  no_peak_.assign(theta_deg_.size(), 0.0);
  const auto near =
      static_cast<std::size_t>(std::ranges::upper_bound(theta_deg_, forward_deg) - theta_deg_.begin());
  if (near > 0) {
    std::vector<double> background = truncation_.share(1);
    const std::vector<double> whole = truncation_.whole();
    for (std::size_t t = 0; t < near; ++t) background[t] *= whole[t];
    const auto theta = std::span(theta_deg_).first(near);
    std::ranges::copy(
        forward_errors(size_parameter_, theta, background, exact::sun_diameter_deg, nullptr),
        no_peak_.begin());
    if (by_rows) {
      const auto errors = forward_errors(size_parameter_, theta, background, request.sun_disc_deg, &*by_rows);
      for (std::size_t t = 0; t < near; ++t) disc_[t] = std::hypot(disc_[t], errors[t]);
    }
  }
  // The average over the disc goes along theta alone, and has no rows beyond a pole.
  for (std::size_t t = 0; t < theta_deg_.size(); ++t)
    if (std::min(theta_deg_[t], 180 - theta_deg_[t]) < request.sun_disc_deg)
      disc_[t] = std::max(disc_[t], 1.0);
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
    const double parts[] = {own, errors[t], patches * grid, common_[t], disc_[t]};
    errors[t] = std::sqrt(std::inner_product(std::begin(parts), std::end(parts), std::begin(parts), 0.0));
  }
  return errors;
}

double root_mean_square(std::span<const double> values) {
  const double sum = std::inner_product(values.begin(), values.end(), values.begin(), 0.0);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

} // namespace scatter::phase
