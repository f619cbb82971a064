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
};

struct Row {
  Setting setting;
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
  return all;
}

phase::Request request_of(const Setting& setting, const Range& range, int threads) {
  phase::Request request;
  request.shape = drop::sphere(setting.radius_m);
  request.wavelength_m = {red_m};
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

std::vector<Row> compare(const Setting& setting, const Range& range, int threads) {
  phase::Request request = request_of(setting, range, threads);
  const table::PhaseTable found = phase::compute(request);
  request.method = phase::Method::mie;
  const table::PhaseTable truth = phase::compute(request);
  std::vector<Row> rows;
  for (const Region& region : range.regions) {
    std::vector<double> errors, claims;
    for (std::size_t t = 0; t < request.theta_deg.size(); ++t) {
      if (request.theta_deg[t] < region.from_deg || request.theta_deg[t] > region.to_deg) continue;
      errors.push_back(found.slabs[0].phase_function[t] / truth.slabs[0].phase_function[t] - 1);
      claims.push_back(found.slabs[0].error_estimate[t]);
    }
    rows.push_back({setting, region, root_mean_square(errors), root_mean_square(claims)});
  }
  return rows;
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
      fmt::format("Spheres, {:.0f} nm, averaged over the sun: claim over true error", red_m * 1e9),
      {"radius, method", "index", "region", "true error", "error_estimate", "ratio", "holds"},
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
           row.setting.index, row.region.name() + " deg", percent(row.error), percent(row.claim),
           fmt::format("{:.2f}", row.ratio()),
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
      "averaged over "
      "the sun, against the rms of the table's <code>error_estimate</code> over the same angles. An estimate "
      "is to be no less than {} "
      "and no more than {} times the error; where it is 1 or more it claims nothing, and the upper bound "
      "does not "
      "count.",
      least, most)});
  report.blocks.emplace_back(std::move(table));
  return report;
}

} // namespace scatter::validation
