#include "cases.hpp"
#include "sphere_orders.hpp"
#include "words.hpp"
#include <scatter/optics/units.hpp>
#include <scatter/optics/version.hpp>
#include <scatter/scene/plot.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace scatter::validation {

namespace {

using complex = std::complex<double>;
using nlohmann::ordered_json;

constexpr double red_m = 650e-9;
constexpr int last_order = 8;
/// No direction nearer to 0 and 180 deg than this is looked at.
constexpr double polar_zone_deg = 15;

std::vector<int> first_orders(int last) {
  std::vector<int> orders;
  for (int p = 0; p <= last; ++p) orders.push_back(p);
  return orders;
}

std::vector<double> even_angles(double from, double to, double step) {
  std::vector<double> angles;
  const auto count = static_cast<int>(std::llround((to - from) / step));
  for (int i = 0; i <= count; ++i) angles.push_back(from + (to - from) * i / count);
  return angles;
}

phase::Request integral_request(const Settings& settings, double radius_m, std::vector<int> orders) {
  phase::Request request;
  // Not drop::sphere(): the surface is the one of any raindrop.
  request.shape = drop::cosine_series(radius_m, std::vector<double>(8, 0.0));
  request.wavelength_m = {red_m};
  request.index = settings.index;
  request.rays = settings.quick ? 1000 : 2000;
  request.orders = std::move(orders);
  request.diffraction = phase::Diffraction::integral;
  request.threads = settings.threads;
  return request;
}

/// One bow of one sphere: complex amplitudes against Debye's term.
struct Bow {
  double radius_m;
  int order;
  double from_deg, to_deg, bound;
  double rms = 0, largest = 0, seconds = 0; ///< errors over the order's peak
  double at_deg = 0;                        ///< where the largest is
};

std::vector<Bow> bows(bool quick) {
  std::vector<Bow> all;
  for (const auto& [radius, bound] : {std::pair{0.1e-3, 0.01}, {0.4e-3, 0.003}, {1e-3, 0.0015}}) {
    if (quick && radius > 0.5e-3) continue;
    all.push_back({radius, 2, 133, 145, bound});
    all.push_back({radius, 3, 120, 132, bound});
  }
  return all;
}

void run_bow(Bow& bow, const Settings& settings) {
  const phase::Request request = integral_request(settings, bow.radius_m, {bow.order});
  const auto angles = even_angles(bow.from_deg, bow.to_deg, settings.quick ? 0.1 : 0.05);
  const SphereOrders found = traced_orders(request, angles), truth = exact_orders(request, angles);
  double peak = 0, first = 0, second = 0;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    peak = std::max({peak, std::abs(truth.S1[0][i]), std::abs(truth.S2[0][i])});
    const double S1 = std::abs(found.S1[0][i] - truth.S1[0][i]),
                 S2 = std::abs(found.S2[0][i] - truth.S2[0][i]);
    first += S1 * S1;
    second += S2 * S2;
    if (std::max(S1, S2) > bow.largest) {
      bow.largest = std::max(S1, S2);
      bow.at_deg = angles[i];
    }
  }
  bow.rms = std::sqrt(std::max(first, second) / static_cast<double>(angles.size())) / peak;
  bow.largest /= peak;
  bow.seconds = found.seconds;
}

void add_bows(CaseReport& report, const std::vector<Bow>& all) {
  report.numbers["bows"] = ordered_json::array();
  Table table{
      "Complex amplitude of a bow's order by the integral against Debye's term",
      {"sphere", "order p", "angles", "rms error / peak", "bound", "holds", "largest", "at", "time"},
      {}};
  for (const Bow& bow : all) {
    report.numbers["bows"].push_back(
        {{"radius_m", bow.radius_m},
         {"p", bow.order},
         {"region_deg", {bow.from_deg, bow.to_deg}},
         {"rms_over_peak", bow.rms},
         {"max_over_peak", bow.largest},
         {"max_at_deg", bow.at_deg},
         {"seconds", bow.seconds}});
    report.checks.push_back(
        {fmt::format(
             "{}, p = {}, {}..{} deg: rms error of S over its peak", millimetres(bow.radius_m), bow.order,
             bow.from_deg, bow.to_deg),
         100 * bow.rms, 100 * bow.bound, "%"});
    table.rows.push_back(
        {millimetres(bow.radius_m), fmt::format("{}", bow.order),
         fmt::format("{}..{} deg", bow.from_deg, bow.to_deg), fmt::format("{:.3f} %", 100 * bow.rms),
         fmt::format("{:.2f} %", 100 * bow.bound), bow.rms <= bow.bound ? "yes" : "NO",
         fmt::format("{:.3f} %", 100 * bow.largest), fmt::format("{:.1f} deg", bow.at_deg),
         seconds_text(bow.seconds)});
  }
  report.blocks.emplace_back(Heading{"Order by order"});
  report.blocks.emplace_back(Paragraph{
      "A sphere is traced as a general drop, and the two bows' orders by themselves are computed with "
      "<code>--diffraction integral</code>, which has no constant to fit. Amplitude and phase must be those "
      "of "
      "the Debye series, the exact theory order by order: errors are those of complex S1 and S2, whichever "
      "is "
      "worse, over the largest amplitude of the order in the window. 650 nm."});
  report.blocks.emplace_back(std::move(table));
}

/// All orders of a small sphere.
struct OrderRow {
  int order = 0;
  double rms = 0, rms_with_grazing = 0, of_total = 0; ///< over the order's peak; over the whole's amplitude
  double lit = 0;                                     ///< share of the angles that count
  std::array<double, 2> zone_deg{};                   ///< the grazing zone
};

/// Scattering angles of rays of the order whose angle of incidence has a cosine below 2 (2 / x)^(1/3), where
/// Fresnel's coefficients are not those of the curved surface, and that angle [rad] to both sides of where
/// the rim's ray leaves.
std::array<double, 2> grazing_zone_deg(int order, double index, double size_parameter) {
  const double width = 2 * std::cbrt(2 / size_parameter);
  const auto folded = [&](double incidence) {
    const double deviation =
        order == 0 ? pi - 2 * incidence
                   : (order - 1) * pi + 2 * incidence - 2 * order * std::asin(std::sin(incidence) / index);
    return std::acos(std::clamp(std::cos(deviation), -1.0, 1.0));
  };
  const double rim = folded(pi / 2);
  double low = rim - width, high = rim + width;
  for (int i = 0; i <= 1000; ++i) {
    const double theta = folded(std::acos(width * i / 1000));
    low = std::min(low, theta);
    high = std::max(high, theta);
  }
  return {std::max(low, 0.0) / radians_per_degree, std::min(high, pi) / radians_per_degree};
}

struct OrderStudy {
  double radius_m = 0.1e-3, from_deg = 0, to_deg = 0, seconds = 0;
  std::vector<OrderRow> rows;
};

OrderStudy run_orders(const Settings& settings) {
  OrderStudy study;
  study.from_deg = settings.quick ? 126 : polar_zone_deg;
  study.to_deg = settings.quick ? 138 : 180 - polar_zone_deg;
  const phase::Request request = integral_request(settings, study.radius_m, first_orders(last_order));
  const double step = 0.1;
  const auto angles = even_angles(study.from_deg, study.to_deg, step);
  const SphereOrders found = traced_orders(request, angles), truth = exact_orders(request, angles);
  study.seconds = found.seconds;
  // A quick look at a few directions is held to the order's peak, too, wherever that is.
  const SphereOrders everywhere =
      exact_orders(request, even_angles(polar_zone_deg, 180 - polar_zone_deg, step));
  // The ripple's minima would make any order large beside the whole.
  std::vector<double> whole = sizes(truth.whole_S1, truth.whole_S2);
  for (double& size : whole) size *= size;
  whole = average_disc(whole, step, 1);
  for (double& size : whole) size = std::sqrt(size);
  const double index = refractive_index(settings.index, red_m).real();
  for (int p = 0; p <= last_order; ++p) {
    const auto at = static_cast<std::size_t>(p);
    const std::vector<double> size = sizes(truth.S1[at], truth.S2[at]), error = differences(found, truth, at);
    OrderRow row;
    row.order = p;
    row.zone_deg = grazing_zone_deg(p, index, truth.size_parameter);
    double all = 0, some = 0, relative = 0;
    int lit = 0, counted = 0;
    for (std::size_t i = 0; i < angles.size(); ++i) {
      relative += error[i] * error[i] / (whole[i] * whole[i]);
      if (size[i] < 1e-3 * whole[i]) continue;
      ++lit;
      all += error[i] * error[i];
      if (angles[i] >= row.zone_deg[0] && angles[i] <= row.zone_deg[1]) continue;
      ++counted;
      some += error[i] * error[i];
    }
    const double peak = std::ranges::max(sizes(everywhere.S1[at], everywhere.S2[at]));
    row.rms = counted > 0 ? std::sqrt(some / counted) / peak : 0;
    row.rms_with_grazing = lit > 0 ? std::sqrt(all / lit) / peak : 0;
    row.of_total = std::sqrt(relative / static_cast<double>(angles.size()));
    row.lit = static_cast<double>(counted) / static_cast<double>(angles.size());
    study.rows.push_back(row);
  }
  return study;
}

void add_orders(CaseReport& report, const OrderStudy& study) {
  constexpr double bound = 0.02;
  report.numbers["orders"] = {
      {"radius_m", study.radius_m},
      {"region_deg", {study.from_deg, study.to_deg}},
      {"seconds", study.seconds},
      {"rows", ordered_json::array()}};
  Table table{
      fmt::format(
          "{}, {:.0f}..{:.0f} deg: error of S of every order", millimetres(study.radius_m), study.from_deg,
          study.to_deg),
      {"order p", "grazing zone", "angles that count", "rms error / peak", "bound", "holds",
       "with the grazing zone", "rms error / whole"},
      {}};
  for (const OrderRow& row : study.rows) {
    report.numbers["orders"]["rows"].push_back(
        {{"p", row.order},
         {"grazing_zone_deg", row.zone_deg},
         {"share_of_angles", row.lit},
         {"rms_over_peak", row.rms},
         {"rms_over_peak_with_grazing_zone", row.rms_with_grazing},
         {"rms_over_whole", row.of_total}});
    if (row.lit > 0)
      report.checks.push_back(
          {fmt::format("{}, p = {}: rms error of S over its peak", millimetres(study.radius_m), row.order),
           100 * row.rms, 100 * bound, "%"});
    table.rows.push_back(
        {fmt::format("{}", row.order), fmt::format("{:.0f}..{:.0f} deg", row.zone_deg[0], row.zone_deg[1]),
         fmt::format("{:.0f} %", 100 * row.lit), row.lit > 0 ? fmt::format("{:.2f} %", 100 * row.rms) : "-",
         fmt::format("{:.0f} %", 100 * bound),
         row.lit == 0       ? "-"
         : row.rms <= bound ? "yes"
                            : "NO",
         row.rms_with_grazing > 0 ? fmt::format("{:.2f} %", 100 * row.rms_with_grazing) : "-",
         fmt::format("{:.2f} %", 100 * row.of_total)});
  }
  report.blocks.emplace_back(Paragraph{fmt::format(
      "All orders of a small sphere at once, patches where they are far from caustics. Angles count where "
      "the "
      "order is above 1e-3 of the whole amplitude (which is smoothed over 1 deg), {:.0f} deg away from 0 and "
      "180 deg, and outside the grazing zone: where rays leave whose angle of incidence has a cosine below 2 "
      "(2/x)<sup>1/3</sup>, and as many radians to both sides of where the ray of the rim leaves. The zone "
      "holds the whole bow of orders 6 to 8, so the next column has the error with it, and the last one "
      "weighs "
      "the error by what is seen: it is over the amplitude of all orders together, over all angles.",
      polar_zone_deg)});
  report.blocks.emplace_back(std::move(table));
}

/// The whole phase function of one sphere at one wavelength, by one way.
enum class Way { patches, gaussian, integral };
constexpr Way ways[] = {Way::patches, Way::gaussian, Way::integral};

const char* name_of(Way way) {
  switch (way) {
  case Way::patches:
    return "patches";
  case Way::gaussian:
    return "patches and Gaussian filter, orders 0..3";
  case Way::integral:
    break;
  }
  return "integral";
}

struct Entry {
  double radius_m, wavelength_m;
  Way way;
  int last; ///< orders 0..last
  Region region;
  Errors errors;
  double seconds;
  double own = 0; ///< rms error against the exact sum of the same orders; of the integral, all orders
};

/// Of one wavelength, or of all.
double rms_of(
    const std::vector<Entry>& entries, double radius_m, Way way, int last, const Region& region,
    double Errors::*value, std::optional<double> wavelength_m = {}) {
  std::vector<double> found;
  for (const Entry& entry : entries)
    if (entry.radius_m == radius_m && entry.way == way && entry.last == last &&
        entry.region.from_deg == region.from_deg &&
        entry.wavelength_m == wavelength_m.value_or(entry.wavelength_m))
      found.push_back(entry.errors.*value);
  return root_mean_square(found);
}

/// Where both sides are compared: all but the backward polar zone, or next to the primary bow for a quick
/// look.
std::vector<Region> compared_regions(bool quick) {
  std::vector<Region> found;
  for (Region region : regions()) {
    region.from_deg = std::max(region.from_deg, quick ? 130.0 : 0.0);
    region.to_deg = std::min(region.to_deg, quick ? 150.0 : 180 - polar_zone_deg);
    if (region.from_deg < region.to_deg) found.push_back(region);
  }
  return found;
}

/// The bows' bright bands: within half of the largest intensity, averaged over the sun.
Region bright_band(const Curve& truth, const ThetaGrid& grid, const Region& region) {
  double peak = 0;
  for (std::size_t i = 0; i < grid.theta_deg.size(); ++i)
    if (grid.theta_deg[i] >= region.from_deg && grid.theta_deg[i] <= region.to_deg)
      peak = std::max(peak, truth.s11[i]);
  Region band{180, 0};
  for (std::size_t i = 0; i < grid.theta_deg.size(); ++i)
    if (grid.theta_deg[i] >= region.from_deg && grid.theta_deg[i] <= region.to_deg &&
        truth.s11[i] >= peak / 2) {
      band.from_deg = std::min(band.from_deg, grid.theta_deg[i]);
      band.to_deg = std::max(band.to_deg, grid.theta_deg[i]);
    }
  return band;
}

const char* bow_name(int order) {
  return order == 2 ? "primary" : "secondary";
}

/// Degree of linear polarisation in a bow's bright band: largest differences.
struct BandPolarisation {
  double radius_m, wavelength_m;
  int order; ///< whose bow
  Region band;
  std::array<double, 3> largest{}, rms{}; ///< from Lorenz-Mie, per way
  double perfect = 0;                     ///< of perfect amplitudes of the same orders
  double own = 0;                         ///< of the integral from those
};

/// A bow's polarisation from ever more orders.
constexpr std::array more_orders{last_order, 22, 33, 44};

/// Largest differences from Lorenz-Mie with the orders 0..more_orders[i].
struct MoreOrders {
  double radius_m;
  int order; ///< whose bow
  std::array<double, more_orders.size()> integral{}, perfect{};
  double seconds = 0; ///< with the most orders
};

MoreOrders run_more_orders(const Settings& settings, const BandPolarisation& bow) {
  const double margin_deg = 0.6 * sun_diameter_deg;
  const ThetaGrid grid = ripple_grid(
      2 * pi * bow.radius_m / bow.wavelength_m, 0.0125, bow.band.from_deg - margin_deg,
      bow.band.to_deg + margin_deg);
  phase::Request request = integral_request(settings, bow.radius_m, first_orders(more_orders.back()));
  request.wavelength_m = {bow.wavelength_m};
  const SphereOrders debye = exact_orders(request, grid.theta_deg),
                     traced = traced_orders(request, grid.theta_deg);
  const auto smooth = [&](const Curve& sharp) {
    return average_disc(sharp, grid.step_deg, sun_diameter_deg);
  };
  const Curve truth = smooth(debye.whole());
  const auto off = [&](const SphereOrders& orders, int last) {
    return compare(smooth(orders.up_to(last)), truth, grid, bow.band).polarisation_largest;
  };
  MoreOrders found{bow.radius_m, bow.order};
  for (std::size_t i = 0; i < more_orders.size(); ++i) {
    found.integral[i] = off(traced, more_orders[i]);
    found.perfect[i] = off(debye, more_orders[i]);
  }
  found.seconds = traced.seconds;
  return found;
}

/// The text of tables/accuracy/integral.csv.
std::string accuracy_table(
    const Settings& settings, const std::vector<double>& wavelengths, const std::vector<Entry>& entries) {
  std::string text = fmt::format(
      "# Relative rms error of the sun-disc averaged, unpolarised intensity of `--diffraction integral` on "
      "spheres,\n# orders 0..{} against the exact sum of the same orders: one column per region of "
      "scattering "
      "angle in degrees, root of\n# the mean square over angles and wavelengths. Made by `scatter validate "
      "--case integral` of version {}:\n# {} x {} rays, {} wavelength{} {:.4g}..{:.4g} nm, index {}, sun "
      "{:.4g} arcmin.\n",
      last_order, version(), settings.rays, settings.rays, wavelengths.size(),
      wavelengths.size() == 1 ? "" : "s", wavelengths.front() * 1e9, wavelengths.back() * 1e9,
      index_source_name(settings.index), sun_diameter_deg * 60);
  text += "radius_mm";
  for (const Region& region : compared_regions(settings.quick))
    text += fmt::format(",integral {}", region.name());
  text += '\n';
  for (const double radius : settings.radius_m) {
    text += fmt::format("{:.6g}", radius * 1e3);
    for (const Region& region : compared_regions(settings.quick)) {
      std::vector<double> found;
      for (const Entry& entry : entries)
        if (entry.radius_m == radius && entry.way == Way::integral && entry.last == last_order &&
            entry.region.from_deg == region.from_deg)
          found.push_back(entry.own);
      text += fmt::format(",{:.4g}", root_mean_square(found));
    }
    text += '\n';
  }
  return text;
}

} // namespace

CaseReport run_integral(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "integral";
  report.title = "Diffraction by the integral: spheres";
  const double bows_share = 0.1, orders_share = 0.1;

  std::vector<Bow> all = bows(settings.quick);
  for (std::size_t i = 0; i < all.size(); ++i) {
    run_bow(all[i], settings);
    progress(bows_share * static_cast<double>(i + 1) / static_cast<double>(all.size()));
  }
  add_bows(report, all);
  const OrderStudy study = run_orders(settings);
  add_orders(report, study);
  progress(bows_share + orders_share);

  // Three wavelengths stand for all: the exact colours are not what is looked for.
  const double red = *std::ranges::min_element(
      settings.wavelength_m, {}, [](double wavelength) { return std::abs(wavelength - red_m); });
  std::vector<double> wavelengths{red};
  if (!settings.quick)
    for (const double wanted : {450e-9, 550e-9}) {
      const double nearest = *std::ranges::min_element(
          settings.wavelength_m, {}, [&](double wavelength) { return std::abs(wavelength - wanted); });
      if (std::ranges::find(wavelengths, nearest) == wavelengths.end()) wavelengths.push_back(nearest);
    }
  std::ranges::sort(wavelengths);
  const std::vector<Region> compared = compared_regions(settings.quick);
  const double from = std::max(compared.front().from_deg - 0.5, 0.0),
               to = std::min(compared.back().to_deg + 0.5, 180.0);

  std::vector<Entry> entries;
  std::vector<BandPolarisation> polarisation;
  std::vector<std::pair<double, scene::Plot>> pictures;
  double done = 0, work = 0;
  for (const double radius : settings.radius_m) work += radius;
  for (const double radius : settings.radius_m) {
    const ThetaGrid grid =
        ripple_grid(2 * pi * radius / wavelengths.front(), settings.quick ? 0.025 : 0.0125, from, to);
    for (const double wavelength : wavelengths) {
      phase::Request request = integral_request(settings, radius, first_orders(last_order));
      request.wavelength_m = {wavelength};
      request.rays = settings.rays;
      const auto smooth = [&](const Curve& curve) {
        return average_disc(curve, grid.step_deg, sun_diameter_deg);
      };
      const SphereOrders debye = exact_orders(request, grid.theta_deg);
      const Curve truth = smooth(debye.whole()), perfect = smooth(debye.up_to(last_order));
      const bool plotted =
          wavelength == red && (radius == settings.radius_m.front() || radius == settings.radius_m.back());
      scene::Plot errors;
      std::vector<BandPolarisation> here;
      for (const int p : {3, 2}) {
        const Region bow = p == 2 ? Region{137, 145} : Region{120, 129};
        if (bow.from_deg >= from && bow.to_deg <= to)
          here.push_back({radius, wavelength, p, bright_band(truth, grid, bow)});
      }
      for (const Way way : ways) {
        // The filter acts on intensities: it has no amplitudes to be added up.
        request.diffraction = way == Way::integral   ? phase::Diffraction::integral
                              : way == Way::gaussian ? phase::Diffraction::gaussian
                                                     : phase::Diffraction::none;
        Curve few, many;
        double seconds = 0;
        if (way == Way::gaussian) {
          // As the dissertation has it: the filter is wider for every order, and one filter serves all light.
          phase::Request few_orders = request;
          few_orders.orders = first_orders(3);
          const Curves traced = traced_sphere(few_orders, grid);
          many = smooth(traced.curves.front());
          seconds = traced.seconds.front();
        } else {
          const SphereOrders traced = traced_orders(request, grid.theta_deg);
          few = smooth(traced.up_to(3));
          many = smooth(traced.up_to(last_order));
          seconds = traced.seconds;
        }
        for (const Region& region : compared) {
          entries.push_back(
              {radius, wavelength, way, last_order, region, compare(many, truth, grid, region), seconds,
               way == Way::integral ? compare(many, perfect, grid, region).rms : 0});
          if (way == Way::integral)
            entries.push_back(
                {radius, wavelength, way, 3, region, compare(few, truth, grid, region), seconds});
        }
        for (BandPolarisation& bow : here) {
          const Errors off = compare(many, truth, grid, bow.band);
          bow.largest[static_cast<std::size_t>(way)] = off.polarisation_largest;
          bow.rms[static_cast<std::size_t>(way)] = off.polarisation_rms;
          if (way == Way::integral) bow.own = compare(many, perfect, grid, bow.band).polarisation_largest;
        }
        if (plotted) {
          scene::Curve curve;
          curve.label = way == Way::gaussian ? "Gaussian filter" : name_of(way); // a legend of one line
          for (std::size_t i = 0; i < grid.theta_deg.size(); ++i) {
            if (grid.theta_deg[i] < 120 || grid.theta_deg[i] > 150) continue;
            curve.x.push_back(grid.theta_deg[i]);
            curve.y.push_back(100 * (many.s11[i] / truth.s11[i] - 1));
          }
          errors.curves.push_back(std::move(curve));
        }
      }
      // Perfect amplitudes of the same orders: what no method can be better than.
      for (const int last : {3, last_order}) {
        const Curve curve = smooth(debye.up_to(last));
        for (const Region& region : compared) {
          ordered_json entry{{"radius_m", radius}, {"wavelength_m", wavelength}, {"last_order", last}};
          entry["region_deg"] = {region.from_deg, region.to_deg};
          entry["intensity_rms"] = compare(curve, truth, grid, region).rms;
          report.numbers["truncation"].push_back(std::move(entry));
        }
      }
      for (BandPolarisation& bow : here)
        bow.perfect = compare(perfect, truth, grid, bow.band).polarisation_largest;
      polarisation.insert(polarisation.end(), here.begin(), here.end());
      if (plotted) {
        errors.title = fmt::format(
            "Error of the intensity averaged over the sun, {}, {:.4g} nm, orders 0..{}", millimetres(radius),
            wavelength * 1e9, last_order);
        errors.x_label = "scattering angle [deg]";
        errors.y_label = "intensity relative to Lorenz-Mie [%]";
        errors.x_range = {{std::max(from, 120.0), std::min(to, 150.0)}};
        errors.y_range = {{-60, 60}};
        errors.height = 420;
        pictures.emplace_back(radius, std::move(errors));
      }
      done += radius / static_cast<double>(wavelengths.size());
      progress(bows_share + orders_share + (1 - bows_share - orders_share) * done / work);
    }
  }

  // For machines.
  report.numbers["entries"] = ordered_json::array();
  for (const Entry& entry : entries)
    report.numbers["entries"].push_back(
        {{"radius_m", entry.radius_m},
         {"wavelength_m", entry.wavelength_m},
         {"way", name_of(entry.way)},
         {"last_order", entry.last},
         {"region_deg", {entry.region.from_deg, entry.region.to_deg}},
         {"intensity_rms", entry.errors.rms},
         {"intensity_max", entry.errors.largest},
         {"intensity_bias", entry.errors.bias},
         {"polarisation_rms", entry.errors.polarisation_rms},
         {"polarisation_max", entry.errors.polarisation_largest},
         {"own_intensity_rms", entry.own},
         {"seconds", entry.seconds}});
  report.numbers["bright_bands"] = ordered_json::array();
  for (const BandPolarisation& bow : polarisation)
    report.numbers["bright_bands"].push_back(
        {{"radius_m", bow.radius_m},
         {"wavelength_m", bow.wavelength_m},
         {"p", bow.order},
         {"band_deg", {bow.band.from_deg, bow.band.to_deg}},
         {"polarisation_max", bow.largest},
         {"polarisation_rms", bow.rms},
         {"polarisation_max_of_perfect_orders", bow.perfect},
         {"polarisation_max_of_integral_against_perfect_orders", bow.own}});
  report.files.push_back({"integral-accuracy.csv", accuracy_table(settings, wavelengths, entries)});

  // For people.
  const auto add = [&](auto block) { report.blocks.emplace_back(std::move(block)); };
  add(Heading{"The whole phase function against Lorenz-Mie"});
  std::string nanometres;
  for (const double wavelength : wavelengths)
    nanometres += fmt::format("{}{:.4g}", nanometres.empty() ? "" : ", ", wavelength * 1e9);
  add(Paragraph{fmt::format(
      "Orders 0..{0} of spheres traced as general drops ({1} x {1} rays, {2} nm), unpolarised and averaged "
      "over "
      "the sun's disc: rms relative error of the differential cross section over angles and wavelengths. "
      "Perfect amplitudes of orders 0..{0} would not be without error either: the last rows of a radius have "
      "what orders beyond would add. The Gaussian filter has the dissertation's orders 0..3: with all it "
      "would "
      "spread the primary bow over the widths of the higher ones.",
      last_order, settings.rays, nanometres)});
  Table table{"Rms relative error per region of scattering angle", {"radius, method"}, {}};
  for (const Region& region : compared) table.columns.push_back(region.name() + " deg");
  table.columns.emplace_back("time per wavelength");
  for (const double radius : settings.radius_m) {
    for (const Way way : ways) {
      std::vector<std::string> row{fmt::format("{}, {}", millimetres(radius), name_of(way))};
      for (const Region& region : compared)
        row.push_back(percent(rms_of(entries, radius, way, last_order, region, &Errors::rms)));
      double seconds = 0;
      for (const Entry& entry : entries)
        if (entry.radius_m == radius && entry.way == way && entry.last == last_order &&
            entry.region.from_deg == compared.front().from_deg)
          seconds += entry.seconds / static_cast<double>(wavelengths.size());
      row.push_back(seconds_text(seconds));
      table.rows.push_back(std::move(row));
    }
    for (const int last : {3, last_order}) {
      std::vector<std::string> row{fmt::format("{}, perfect orders 0..{}", millimetres(radius), last)};
      for (const Region& region : compared) {
        std::vector<double> found;
        for (const auto& entry : report.numbers["truncation"])
          if (entry["radius_m"] == radius && entry["last_order"] == last &&
              entry["region_deg"][0] == region.from_deg)
            found.push_back(entry["intensity_rms"]);
        row.push_back(percent(root_mean_square(found)));
      }
      row.emplace_back("");
      table.rows.push_back(std::move(row));
    }
  }
  add(std::move(table));
  for (const auto& [radius, plot] : pictures)
    add(Figure{
        scene::draw(plot, scene::PictureFormat::svg),
        fmt::format(
            "{}: the Gaussian filter against the integral. Where patches alone leave the "
            "picture "
            "are the edges of the bows.",
            millimetres(radius))});
  struct Target {
    double radius_m, from_deg, bound;
  };
  for (const Target& target :
       {Target{0.1e-3, 137, 0.012}, {0.1e-3, 130, 0.04}, {0.4e-3, 137, 0.006}, {0.4e-3, 130, 0.03}}) {
    if (std::ranges::find(settings.radius_m, target.radius_m) == settings.radius_m.end()) continue;
    const auto region = std::ranges::find(compared, target.from_deg, &Region::from_deg);
    report.checks.push_back(
        {fmt::format(
             "{}, {} deg, orders 0..{}, {:.4g} nm: rms relative error of the intensity",
             millimetres(target.radius_m), region->name(), last_order, red * 1e9),
         100 * rms_of(entries, target.radius_m, Way::integral, last_order, *region, &Errors::rms, red),
         100 * target.bound, "%"});
  }

  Table degrees{
      "Degree of linear polarisation in the bows' bright bands (above half of the peak): largest difference",
      {"radius", "wavelength", "bow", "band", name_of(Way::patches), name_of(Way::gaussian),
       name_of(Way::integral), "perfect orders", "integral against perfect orders"},
      {}};
  for (const BandPolarisation& bow : polarisation) {
    std::vector<std::string> row{
        millimetres(bow.radius_m), fmt::format("{:.4g} nm", bow.wavelength_m * 1e9), bow_name(bow.order),
        fmt::format("{:.1f}..{:.1f} deg", bow.band.from_deg, bow.band.to_deg)};
    for (const double largest : bow.largest) row.push_back(fmt::format("{:.4f}", largest));
    row.push_back(fmt::format("{:.4f}", bow.perfect));
    row.push_back(fmt::format("{:.4f}", bow.own));
    degrees.rows.push_back(std::move(row));
  }
  add(std::move(degrees));
  add(Paragraph{fmt::format(
      "Perfect amplitudes of orders 0..{0} miss Lorenz-Mie's polarisation by as much as the integral does: "
      "what is missing are the orders beyond, of which many add a little each. No method that stops at order "
      "{0} can do better, so the integral is held to the sum of the same orders, too.",
      last_order)});
  if (!settings.quick) {
    Table more{"The same with more orders, integral / perfect orders", {"radius", "bow"}, {}};
    for (const int last : more_orders) more.columns.push_back(fmt::format("orders 0..{}", last));
    more.columns.push_back(fmt::format("time, 0..{}", more_orders.back()));
    report.numbers["more_orders"] = ordered_json::array();
    for (const BandPolarisation& bow : polarisation) {
      if (bow.wavelength_m != red || bow.radius_m > 0.5e-3) continue;
      const MoreOrders found = run_more_orders(settings, bow);
      std::vector<std::string> row{millimetres(found.radius_m), bow_name(found.order)};
      for (std::size_t i = 0; i < more_orders.size(); ++i)
        row.push_back(fmt::format("{:.4f} / {:.4f}", found.integral[i], found.perfect[i]));
      row.push_back(seconds_text(found.seconds));
      more.rows.push_back(std::move(row));
      report.numbers["more_orders"].push_back(
          {{"radius_m", found.radius_m},
           {"p", found.order},
           {"last_order", more_orders},
           {"integral", found.integral},
           {"perfect", found.perfect},
           {"seconds", found.seconds}});
    }
    add(std::move(more));
    add(Paragraph{"The series itself comes near slowly and not steadily. Beyond about 20 orders light runs "
                  "along the inside of the drop's edge, where rays miss part of what the wave does: on the "
                  "small sphere the integral then ends further from Lorenz-Mie than perfect orders."});
  }
  for (const double radius : settings.radius_m) {
    if (radius != 0.1e-3 && radius != 0.4e-3) continue;
    for (const int p : {2, 3}) {
      double worst = -1, own = -1;
      for (const BandPolarisation& bow : polarisation)
        if (bow.radius_m == radius && bow.order == p && bow.wavelength_m == red) {
          worst = std::max(worst, bow.largest[static_cast<std::size_t>(Way::integral)]);
          own = std::max(own, bow.own);
        }
      if (worst < 0) continue;
      const std::string which = fmt::format(
          "{}, {} bow, {:.4g} nm: degree of polarisation, largest difference", millimetres(radius),
          bow_name(p), red * 1e9);
      report.checks.push_back({which, worst, 0.01, ""});
      report.checks.push_back(
          {fmt::format("{} from perfect orders 0..{}", which, last_order), own, 0.01, ""});
    }
  }

  const auto& widest = settings.radius_m;
  for (const double radius : {widest.front(), widest.back()}) {
    const auto rms = [&](Way way, double region_from) {
      const auto region = std::ranges::find(compared, region_from, &Region::from_deg);
      return percent(rms_of(entries, radius, way, last_order, *region, &Errors::rms));
    };
    report.findings.push_back(fmt::format(
        "A sphere of {}, orders 0..{}, averaged over the sun: the diffraction integral misses Lorenz-Mie by "
        "{} in "
        "the primary bow and {} in Alexander's band; patches with the Gaussian filter by {} and {}.",
        millimetres(radius), last_order, rms(Way::integral, 137), rms(Way::integral, 130),
        rms(Way::gaussian, 137), rms(Way::gaussian, 130)));
    if (widest.size() == 1) break;
  }
  return report;
}

} // namespace scatter::validation
