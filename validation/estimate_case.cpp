#include "cases.hpp"
#include "words.hpp"
#include <scatter/phase/job.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>

namespace scatter::validation {

namespace {

using nlohmann::ordered_json;

constexpr double red_m = 650e-9;
/// What estimates are held to, as claim over true error.
constexpr double least = 0.5, most = 10;

/// A range of angles that is computed at once, and its regions.
struct Range {
  double from_deg, to_deg, step_deg;
  std::vector<Region> regions;
};

struct Setting {
  double radius_m;
  phase::Diffraction diffraction;
  int last_order, rays;
  std::string index;
  std::vector<double> wavelength_m{red_m};
};

struct Row {
  Setting setting;
  double wavelength_m;
  Region region;
  double error, claim;
  /// An estimate of 1 or more says that nothing is known.
  [[nodiscard]] bool claims() const { return claim < 1; }
  [[nodiscard]] double ratio() const { return claim / error; }
};

const char* name_of(phase::Diffraction diffraction) {
  return diffraction == phase::Diffraction::integral   ? "integral"
         : diffraction == phase::Diffraction::gaussian ? "gaussian"
                                                       : "none";
}

std::vector<Range> ranges(bool quick) {
  if (quick)
    return {{0.6, 5, 0.1, {{0.6, 2}, {2, 5}}}, {120, 150, 0.25, {{120, 129}, {130, 137}, {137, 150}}}};
  return {
      {0.6, 5, 0.05, {{0.6, 1.5}, {1.5, 5}}},
      {5, 30, 0.1, {{5, 15}, {15, 30}}},
      {30, 120, 0.1, {{30, 80}, {80, 120}}},
      {120, 150, 0.1, {{120, 129}, {130, 137}, {137, 150}}},
      {150, 178, 0.1, {{150, 165}, {165, 178}}}};
}

std::vector<Setting> settings_of(bool quick) {
  using enum phase::Diffraction;
  const std::string water = "iapws";
  std::vector<Setting> all;
  for (const double radius :
       quick ? std::vector{0.1e-3} : std::vector{0.01e-3, 0.03e-3, 0.1e-3, 0.4e-3, 1e-3})
    for (const auto& [diffraction, last] :
         {std::pair{none, 3}, {gaussian, 3}, {gaussian, 8}, {integral, 3}, {integral, 8}, {integral, 20}})
      if (last < 20 || (radius <= 0.1e-3 && !quick)) all.push_back({radius, diffraction, last, 1000, water});
  for (const int rays : {50, 300}) {
    if (quick && rays > 50) continue;
    for (const double radius : {0.1e-3, 0.4e-3}) {
      if (quick && radius > 0.1e-3) continue;
      for (const phase::Diffraction diffraction : {none, integral})
        all.push_back({radius, diffraction, diffraction == none ? 3 : 8, rays, water});
    }
  }
  for (const char* index : {"1.005", "1.02", "1.1", "1.5", "1.333+1e-4i", "1.333+1e-2i"})
    if (!quick || index == std::string("1.005"))
      for (const double radius : {0.05e-3, 0.2e-3, 0.4e-3}) {
        if ((radius == 0.4e-3) != (index == std::string("1.333+1e-4i"))) continue;
        if (quick && radius > 0.1e-3) continue;
        all.push_back({radius, integral, 8, 1000, index});
        all.push_back({radius, none, 3, 1000, index});
      }
  // The largest drops that fall: ripples finer than rows.
  if (!quick)
    for (const double radius : {2e-3, 3e-3})
      for (const phase::Diffraction diffraction : {none, integral})
        all.push_back({radius, diffraction, 3, 1000, water, {400e-9}});
  const std::vector<double> colours{400e-9, 475e-9, 550e-9, 625e-9, 700e-9};
  if (!quick)
    for (const double radius : {0.05e-3, 0.4e-3})
      for (const phase::Diffraction diffraction : {none, integral})
        all.push_back({radius, diffraction, diffraction == none ? 3 : 8, 1000, water, colours});
  return all;
}

phase::Request request_of(const Setting& setting, const Range& range, int threads) {
  phase::Request request;
  request.shape = drop::sphere(setting.radius_m);
  request.wavelength_m = setting.wavelength_m;
  request.index = parse_index_source(setting.index);
  request.method = phase::Method::patches;
  request.diffraction = setting.diffraction;
  request.rays = setting.rays;
  request.orders.resize(setting.last_order + 1);
  std::iota(request.orders.begin(), request.orders.end(), 0);
  const auto steps = static_cast<int>(std::lround((range.to_deg - range.from_deg) / range.step_deg));
  for (int i = 0; i <= steps; ++i) request.theta_deg.push_back(range.from_deg + i * range.step_deg);
  request.phi_deg = {0};
  request.sun_disc_deg = sun_diameter_deg;
  request.threads = threads;
  return request;
}

/// What one wavelength's table claims and what it is off by, [theta][phi], over the angles of a region.
Row row_of(
    const Setting& setting, const phase::Request& request, const Region& region, std::size_t wavelength,
    const table::Slab& found, const table::Slab& truth) {
  std::vector<double> errors, claims;
  const std::size_t azimuths = request.phi_deg.size();
  for (std::size_t i = 0; i < found.phase_function.size(); ++i) {
    const std::size_t t = i / azimuths;
    if (request.theta_deg[t] < region.from_deg || request.theta_deg[t] > region.to_deg) continue;
    errors.push_back(found.phase_function[i] / truth.phase_function[i] - 1);
    claims.push_back(found.error_estimate[t]);
  }
  return {
      setting, request.wavelength_m[wavelength], region, root_mean_square(errors), root_mean_square(claims)};
}

std::vector<Row> compare(const Setting& setting, const Range& range, int threads) {
  phase::Request request = request_of(setting, range, threads);
  const table::PhaseTable found = phase::compute(request);
  request.method = phase::Method::mie;
  const table::PhaseTable truth = phase::compute(request);
  std::vector<Row> rows;
  for (std::size_t w = 0; w < setting.wavelength_m.size(); ++w)
    for (const Region& region : range.regions)
      rows.push_back(row_of(setting, request, region, w, found.slabs[w], truth.slabs[w]));
  return rows;
}

/// A deformed drop, under a sun at 20 deg.
struct Drop {
  const char* name;
  drop::Shape shape;
};

/// What few orders and poorer methods claim about a drop, held to the integral of more orders.
void add_drops(CaseReport& report, int threads) {
  const std::vector<Drop> drops{
      {"spheroid of 0.2 mm, axis ratio 0.98", drop::spheroid(0.2e-3, 0.98)},
      {"Beard-Chuang drop of 0.5 mm", drop::beard_chuang(0.5e-3)}};
  const Range range{120, 150, 0.1, {{120, 129}, {130, 137}, {137, 150}}};
  Table table{
      "Drops, 650 nm, averaged over the sun: claim over the difference from the integral of orders 0..8",
      {"drop", "method, orders 0..3", "region", "difference", "error_estimate", "ratio"},
      {}};
  report.numbers["drops"] = ordered_json::array();
  double low = 1e300, high = 0;
  for (const Drop& drop : drops) {
    const auto compute = [&](phase::Diffraction diffraction, int last_order) {
      phase::Request request =
          request_of({drop.shape.radius_m, diffraction, last_order, 1000, "iapws"}, range, threads);
      request.shape = drop.shape;
      request.sun_elevation_deg = 20;
      request.phi_deg = {0, 30, 60, 90, 120, 150, 180};
      return std::pair{request, phase::compute(request).slabs.front()};
    };
    const table::Slab reference = compute(phase::Diffraction::integral, 8).second;
    for (const phase::Diffraction diffraction :
         {phase::Diffraction::none, phase::Diffraction::gaussian, phase::Diffraction::integral}) {
      const auto [request, found] = compute(diffraction, 3);
      for (const Region& region : range.regions) {
        const Row row = row_of(
            {drop.shape.radius_m, diffraction, 3, 1000, "iapws"}, request, region, 0, found, reference);
        low = std::min(low, row.ratio());
        high = std::max(high, row.ratio());
        report.numbers["drops"].push_back(
            {{"drop", drop.name},
             {"diffraction", name_of(diffraction)},
             {"region_deg", {region.from_deg, region.to_deg}},
             {"difference_rms", row.error},
             {"error_estimate_rms", row.claim}});
        table.rows.push_back(
            {drop.name, name_of(diffraction), region.name() + " deg", percent(row.error), percent(row.claim),
             fmt::format("{:.2f}", row.ratio())});
      }
    }
  }
  report.blocks.emplace_back(Paragraph{
      "No exact theory judges a deformed drop. Its table claims what its settings miss on the sphere of "
      "equal "
      "volume, the worst as far as bows may be shifted; held here to the integral of orders 0..8 at seven "
      "azimuths."});
  report.blocks.emplace_back(std::move(table));
  report.checks.push_back(
      {"drops: difference from the integral of orders 0..8 over the estimate, largest", 1 / low, 1 / least,
       ""});
  report.checks.push_back(
      {"drops: estimate over the difference from the integral of orders 0..8, largest", high, most, ""});
  report.findings.push_back(fmt::format(
      "On two falling drops <code>error_estimate</code> is {:.2f} to {:.1f} times the difference from the "
      "integral of orders 0..8.",
      low, high));
}

} // namespace

CaseReport run_estimate(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "estimate";
  report.title = "What tables claim about their errors";
  const std::vector<Setting> all = settings_of(settings.quick);
  const std::vector<Range> parts = ranges(settings.quick);
  std::vector<Row> rows;
  double done = 0;
  for (const Setting& setting : all)
    for (const Range& range : parts) {
      const std::vector<Row> found = compare(setting, range, settings.threads);
      rows.insert(rows.end(), found.begin(), found.end());
      progress(++done / static_cast<double>(all.size() * parts.size()));
    }

  report.numbers["rows"] = ordered_json::array();
  Table table{
      "Spheres, averaged over the sun: claim over true error",
      {"radius, method", "wavelength", "index", "region", "true error", "error_estimate", "ratio", "holds"},
      {}};
  struct Worst {
    double low = 1e300, high = 0;
    int claims = 0, nothing = 0;
  };
  for (const phase::Diffraction diffraction :
       {phase::Diffraction::none, phase::Diffraction::gaussian, phase::Diffraction::integral}) {
    Worst worst;
    for (const Row& row : rows) {
      if (row.setting.diffraction != diffraction) continue;
      const bool holds = row.ratio() >= least && row.ratio() <= most;
      report.numbers["rows"].push_back(
          {{"radius_m", row.setting.radius_m},
           {"wavelength_m", row.wavelength_m},
           {"diffraction", name_of(diffraction)},
           {"last_order", row.setting.last_order},
           {"rays", row.setting.rays},
           {"index", row.setting.index},
           {"region_deg", {row.region.from_deg, row.region.to_deg}},
           {"intensity_rms", row.error},
           {"error_estimate_rms", row.claim},
           {"claims_nothing", !row.claims()}});
      table.rows.push_back(
          {fmt::format(
               "{}, {}, orders 0..{}, {} rays", millimetres(row.setting.radius_m), name_of(diffraction),
               row.setting.last_order, row.setting.rays),
           fmt::format("{:.0f} nm", row.wavelength_m * 1e9), row.setting.index, row.region.name() + " deg",
           percent(row.error), percent(row.claim), fmt::format("{:.2f}", row.ratio()),
           !row.claims() ? "claims nothing"
           : holds       ? "yes"
                         : "NO"});
      // Who says that nothing is known may be wrong by 200 %, not by more.
      worst.low = std::min(worst.low, row.ratio());
      if (!row.claims()) {
        ++worst.nothing;
        continue;
      }
      ++worst.claims;
      worst.high = std::max(worst.high, row.ratio());
    }
    report.checks.push_back(
        {fmt::format(
             "--diffraction {}: true error over the estimate, largest of {} regions", name_of(diffraction),
             worst.claims + worst.nothing),
         1 / worst.low, 1 / least, ""});
    report.checks.push_back(
        {fmt::format(
             "--diffraction {}: estimate over the true error, largest of {} regions", name_of(diffraction),
             worst.claims),
         worst.high, most, ""});
    report.findings.push_back(fmt::format(
        "On spheres, <code>--diffraction {}</code>: <code>error_estimate</code> is {:.2f} to {:.1f} times "
        "the true error in {} "
        "regions, and is 1 or more, which claims nothing, in {}.",
        name_of(diffraction), worst.low, worst.high, worst.claims, worst.nothing));
  }
  report.blocks.emplace_back(Paragraph{fmt::format(
      "Spheres are traced as drops and held to Lorenz-Mie: the rms of the relative error of the intensity, "
      "averaged over the sun, against the rms of the table's <code>error_estimate</code> over the same "
      "angles. "
      "Tables get the estimate from a trial of the same kind on the sphere of equal volume, at each of their "
      "wavelengths and about each angle; these spheres are their own. An estimate "
      "is to be no less than {} "
      "and no more than {} times the error; where it is 1 or more it claims nothing, and the upper bound "
      "does not "
      "count.",
      least, most)});
  report.blocks.emplace_back(std::move(table));
  if (!settings.quick) add_drops(report, settings.threads);
  return report;
}

} // namespace scatter::validation
