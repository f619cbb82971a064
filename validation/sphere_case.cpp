#include "cases.hpp"
#include "words.hpp"
#include <scatter/optics/units.hpp>
#include <scatter/optics/version.hpp>
#include <scatter/scene/plot.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace scatter::validation {

namespace {

using nlohmann::ordered_json;

/// Errors of one wavelength in one region.
struct Entry {
  double radius_m, wavelength_m;
  std::size_t region;
  bool gaussian, sun_disc;
  Errors errors;
  double seconds_rays, seconds_exact;
};

ordered_json to_json(const Errors& errors) {
  return {
      {"intensity_rms", errors.rms},
      {"intensity_max", errors.largest},
      {"intensity_bias", errors.bias},
      {"intensity_rms_over_mean", errors.rms_over_mean},
      {"polarisation_rms", errors.polarisation_rms},
      {"polarisation_max", errors.polarisation_largest},
      {"angles", errors.angles}};
}

ordered_json to_json(const Region& region) {
  return {region.from_deg, region.to_deg};
}

/// One number per radius and region out of the entries: over the wavelengths, `reduce` of `value`.
class Summary {
public:
  explicit Summary(const std::vector<Entry>& entries) : entries_(entries) {}

  [[nodiscard]] std::vector<double>
  values(double radius_m, std::size_t region, bool gaussian, bool sun_disc, double Errors::*value) const {
    std::vector<double> found;
    for (const Entry& entry : entries_)
      if (entry.radius_m == radius_m && entry.region == region && entry.gaussian == gaussian &&
          entry.sun_disc == sun_disc)
        found.push_back(entry.errors.*value);
    return found;
  }
  [[nodiscard]] double
  rms(double radius_m, std::size_t region, bool gaussian, bool sun_disc, double Errors::*value) const {
    return root_mean_square(values(radius_m, region, gaussian, sun_disc, value));
  }
  [[nodiscard]] double
  mean(double radius_m, std::size_t region, bool gaussian, bool sun_disc, double Errors::*value) const {
    double sum = 0;
    const auto all = values(radius_m, region, gaussian, sun_disc, value);
    for (const double one : all) sum += one;
    return sum / static_cast<double>(all.size());
  }
  [[nodiscard]] double
  largest(double radius_m, std::size_t region, bool gaussian, bool sun_disc, double Errors::*value) const {
    return std::ranges::max(values(radius_m, region, gaussian, sun_disc, value));
  }

private:
  const std::vector<Entry>& entries_;
};

std::vector<std::string> region_columns(const std::string& first) {
  std::vector<std::string> columns{first};
  for (const Region& region : regions()) columns.push_back(region.name() + " deg");
  return columns;
}

phase::Request request_of(const Settings& settings, double radius_m) {
  phase::Request request;
  request.shape = drop::sphere(radius_m);
  request.wavelength_m = settings.wavelength_m;
  request.index = settings.index;
  request.rays = settings.rays;
  request.orders = settings.orders;
  request.threads = settings.threads;
  return request;
}

/// Smallest, middle and largest radius: more curves would hide each other.
bool is_plotted(const Settings& settings, double radius_m) {
  const auto& radii = settings.radius_m;
  return radius_m == radii.front() || radius_m == radii[radii.size() / 2] || radius_m == radii.back();
}

/// Relative error of the intensity [%] against scattering angle.
scene::Curve
error_curve(const std::string& label, const Curve& computed, const Curve& truth, const ThetaGrid& grid) {
  scene::Curve curve;
  curve.label = label;
  for (std::size_t t = 0; t < grid.theta_deg.size(); ++t) {
    curve.x.push_back(grid.theta_deg[t]);
    curve.y.push_back(100 * (computed.s11[t] / truth.s11[t] - 1));
  }
  return curve;
}

/// The text of tables/accuracy/patches.csv.
std::string accuracy_table(const Settings& settings, const Summary& summary) {
  std::string text = fmt::format(
      "# Relative rms error of the sun-disc averaged, unpolarised intensity of `--method patches` on spheres "
      "against\n"
      "# Lorenz-Mie: one column per diffraction filter and region of scattering angle in degrees, root of "
      "the "
      "mean square\n"
      "# over angles and wavelengths. Made by `scatter validate --case sphere` of version {}: {} x {} rays, "
      "orders {},\n"
      "# {} wavelength{} {:.4g}..{:.4g} nm, index {}, sun {:.4g} arcmin.\n",
      version(), settings.rays, settings.rays, fmt::join(settings.orders, ","), settings.wavelength_m.size(),
      settings.wavelength_m.size() == 1 ? "" : "s", std::ranges::min(settings.wavelength_m) * 1e9,
      std::ranges::max(settings.wavelength_m) * 1e9, index_source_name(settings.index),
      sun_diameter_deg * 60);
  text += "radius_mm";
  for (const bool gaussian : {true, false})
    for (const Region& region : regions())
      text += fmt::format(",{} {}", gaussian ? "gaussian" : "none", region.name());
  text += '\n';
  for (const double radius : settings.radius_m) {
    text += fmt::format("{:.6g}", radius * 1e3);
    for (const bool gaussian : {true, false})
      for (std::size_t r = 0; r < regions().size(); ++r)
        text += fmt::format(",{:.4g}", summary.rms(radius, r, gaussian, true, &Errors::rms));
    text += '\n';
  }
  return text;
}

/// How the answer settles as rays are added, at one wavelength.
struct Convergence {
  double radius_m = 0, wavelength_m = 0;
  struct Row {
    int rays;
    double seconds;
    std::vector<Errors> to_exact;                 ///< per region, averaged over the sun's disc
    std::vector<std::optional<Errors>> to_finest; ///< nothing where the chosen orders send no light
  };
  int finest = 0;
  std::vector<Row> rows;
};

bool is_lit(const Curve& curve, const ThetaGrid& grid, const Region& region) {
  for (std::size_t t = 0; t < grid.theta_deg.size(); ++t)
    if (grid.theta_deg[t] >= region.from_deg && grid.theta_deg[t] <= region.to_deg && !(curve.s11[t] > 0))
      return false;
  return true;
}

Convergence converge(const Settings& settings, const Progress& progress) {
  Convergence found;
  const auto& radii = settings.radius_m;
  found.radius_m = std::ranges::find(radii, 0.4e-3) != radii.end() ? 0.4e-3 : radii[radii.size() / 2];
  found.wavelength_m = 650e-9;
  Settings one = settings;
  one.wavelength_m = {found.wavelength_m};
  const double x = 2 * pi * found.radius_m / found.wavelength_m;
  const ThetaGrid grid = ripple_grid(x, 0.0125);
  const Curve truth = average_disc(
      exact_sphere(found.radius_m, one.wavelength_m, one.index, grid, one.threads).curves[0], grid.step_deg,
      sun_diameter_deg);
  std::vector<int> counts =
      settings.quick ? std::vector<int>{250, 1000} : std::vector<int>{250, 500, 1000, 2000, 3000};
  found.finest = settings.quick ? 2000 : 8000;
  counts.push_back(found.finest);
  std::vector<Curve> curves;
  for (const int rays : counts) {
    phase::Request request = request_of(one, found.radius_m);
    request.rays = rays;
    const Curves traced = traced_sphere(request, grid);
    curves.push_back(average_disc(traced.curves[0], grid.step_deg, sun_diameter_deg));
    found.rows.push_back({rays, traced.seconds[0], {}, {}});
    progress(static_cast<double>(curves.size()) / static_cast<double>(counts.size()));
  }
  for (std::size_t i = 0; i < counts.size(); ++i)
    for (const Region& region : regions()) {
      found.rows[i].to_exact.push_back(compare(curves[i], truth, grid, region));
      found.rows[i].to_finest.push_back(
          is_lit(curves.back(), grid, region) ? std::optional(compare(curves[i], curves.back(), grid, region))
                                              : std::nullopt);
    }
  found.rows.pop_back();
  return found;
}

ordered_json to_json(const Convergence& found) {
  ordered_json json{{"radius_m", found.radius_m},  {"wavelength_m", found.wavelength_m},
                    {"diffraction", "gaussian"},   {"average", "sun-disc"},
                    {"finest_rays", found.finest}, {"rows", ordered_json::array()}};
  for (const auto& row : found.rows)
    for (std::size_t r = 0; r < regions().size(); ++r)
      json["rows"].push_back(
          {{"rays", row.rays},
           {"seconds", row.seconds},
           {"region_deg", to_json(regions()[r])},
           {"to_exact", to_json(row.to_exact[r])},
           {"to_finest", row.to_finest[r] ? to_json(*row.to_finest[r]) : ordered_json()}});
  return json;
}

} // namespace

CaseReport run_sphere(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "sphere";
  report.title = "Spheres: rays against Lorenz-Mie";
  std::vector<Entry> entries;
  scene::Plot error_plot;
  struct Totals {
    double rays = 0, exact = 0, cross_section = 0;
    double step_deg = 0;
    std::size_t angles = 0;
  };
  std::map<double, Totals> totals;
  ordered_json cross_sections = ordered_json::array();

  // The share of a radius in the work grows with its square: angles and terms both follow x.
  double work = 0, done = 0;
  for (const double radius : settings.radius_m) work += 1e-8 + radius * radius;
  const double convergence_share = 0.05;

  for (const double radius : settings.radius_m) {
    const double share = (1 - convergence_share) * (1e-8 + radius * radius) / work;
    const auto part = [&](double from, double to) {
      return [&progress, base = done, share, from, to](double f) {
        progress(base + share * (from + (to - from) * f));
      };
    };
    const double x = 2 * pi * radius / std::ranges::min(settings.wavelength_m);
    const ThetaGrid grid = ripple_grid(x, settings.quick ? 0.025 : 0.0125);
    const Curves truth =
        exact_sphere(radius, settings.wavelength_m, settings.index, grid, settings.threads, part(0, 0.5));
    std::vector<Curve> smooth_truth;
    for (const Curve& curve : truth.curves)
      smooth_truth.push_back(average_disc(curve, grid.step_deg, sun_diameter_deg));
    Totals& total = totals[radius];
    total.step_deg = grid.step_deg;
    total.angles = grid.theta_deg.size();
    for (const bool gaussian : {true, false}) {
      phase::Request request = request_of(settings, radius);
      request.diffraction = gaussian ? phase::Diffraction::gaussian : phase::Diffraction::none;
      const Curves traced = traced_sphere(request, grid, gaussian ? part(0.5, 0.7) : part(0.75, 0.95));
      for (std::size_t w = 0; w < settings.wavelength_m.size(); ++w) {
        const Curve smooth = average_disc(traced.curves[w], grid.step_deg, sun_diameter_deg);
        for (std::size_t r = 0; r < regions().size(); ++r)
          for (const bool sun_disc : {false, true})
            entries.push_back(
                {radius, settings.wavelength_m[w], r, gaussian, sun_disc,
                 compare(
                     sun_disc ? smooth : traced.curves[w], sun_disc ? smooth_truth[w] : truth.curves[w], grid,
                     regions()[r]),
                 traced.seconds[w], truth.seconds[w]});
        if (!gaussian) continue;
        if (w == settings.wavelength_m.size() / 2 && is_plotted(settings, radius))
          error_plot.curves.push_back(error_curve(millimetres(radius), smooth, smooth_truth[w], grid));
        total.rays += traced.seconds[w];
        total.exact += truth.seconds[w];
        const double off = traced.scattering_efficiency[w] / truth.scattering_efficiency[w] - 1;
        total.cross_section = std::abs(off) > std::abs(total.cross_section) ? off : total.cross_section;
        cross_sections.push_back(
            {{"radius_m", radius},
             {"wavelength_m", settings.wavelength_m[w]},
             {"rays", traced.scattering_efficiency[w]},
             {"exact", truth.scattering_efficiency[w]},
             {"relative_difference", off}});
      }
    }
    done += share;
  }
  const Convergence convergence =
      converge(settings, [&](double f) { progress(done + convergence_share * f); });

  // For machines.
  report.numbers["units"] = {
      {"intensity", "relative to Lorenz-Mie's differential scattering cross section"},
      {"polarisation", "difference of -S12/S11"},
      {"seconds", "wall time per wavelength on this angular grid"}};
  report.numbers["entries"] = ordered_json::array();
  for (const Entry& entry : entries) {
    ordered_json json{
        {"radius_m", entry.radius_m},
        {"wavelength_m", entry.wavelength_m},
        {"region_deg", to_json(regions()[entry.region])},
        {"diffraction", entry.gaussian ? "gaussian" : "none"},
        {"average", entry.sun_disc ? "sun-disc" : "point"}};
    json.update(to_json(entry.errors));
    json["seconds_rays"] = entry.seconds_rays;
    json["seconds_exact"] = entry.seconds_exact;
    report.numbers["entries"].push_back(std::move(json));
  }
  const Summary summary(entries);
  report.numbers["summary"] = ordered_json::array();
  for (const double radius : settings.radius_m)
    for (const bool gaussian : {true, false})
      for (const bool sun_disc : {true, false})
        for (std::size_t r = 0; r < regions().size(); ++r)
          report.numbers["summary"].push_back(
              {{"radius_m", radius},
               {"region_deg", to_json(regions()[r])},
               {"diffraction", gaussian ? "gaussian" : "none"},
               {"average", sun_disc ? "sun-disc" : "point"},
               {"intensity_rms", summary.rms(radius, r, gaussian, sun_disc, &Errors::rms)},
               {"intensity_max", summary.largest(radius, r, gaussian, sun_disc, &Errors::largest)},
               {"intensity_bias", summary.mean(radius, r, gaussian, sun_disc, &Errors::bias)},
               {"polarisation_rms", summary.rms(radius, r, gaussian, sun_disc, &Errors::polarisation_rms)}});
  report.numbers["cross_sections"] = std::move(cross_sections);
  report.numbers["convergence"] = to_json(convergence);
  report.files.push_back({"patches-accuracy.csv", accuracy_table(settings, summary)});

  // For people.
  const auto add = [&](auto block) { report.blocks.emplace_back(std::move(block)); };
  add(Paragraph{fmt::format(
      "Spheres are traced as any drop would be (<code>--method patches</code>, {} x {} rays, orders p = {}, "
      "index {}) and compared with the exact series at {} wavelength{} from {:.4g} to {:.4g} nm. Compared "
      "are "
      "differential scattering cross sections, on angles fine enough for the ripple of each size (four per "
      "period). Errors are relative to Lorenz-Mie, angle by angle; a table's cell is the root of their mean "
      "square over the region and all wavelengths. \"Averaged over the sun\" means that both sides were "
      "first "
      "averaged over the sun's disc ({:.2f} arcmin), as any picture of a rainbow is.",
      settings.rays, settings.rays, fmt::join(settings.orders, ", "),
      escape(index_source_name(settings.index)), settings.wavelength_m.size(),
      settings.wavelength_m.size() == 1 ? "" : "s", std::ranges::min(settings.wavelength_m) * 1e9,
      std::ranges::max(settings.wavelength_m) * 1e9, sun_diameter_deg * 60)});

  const auto table_of = [&](const std::string& caption, bool gaussian, bool sun_disc, double Errors::*value,
                            const char* how, bool with_times) {
    Table table{caption, region_columns("radius"), {}};
    if (with_times) {
      table.columns.emplace_back("rays");
      table.columns.emplace_back("Lorenz-Mie");
    }
    for (const double radius : settings.radius_m) {
      std::vector<std::string> row{millimetres(radius)};
      for (std::size_t r = 0; r < regions().size(); ++r) {
        const std::string_view kind = how;
        const double number = kind == "rms"    ? summary.rms(radius, r, gaussian, sun_disc, value)
                              : kind == "mean" ? summary.mean(radius, r, gaussian, sun_disc, value)
                                               : summary.largest(radius, r, gaussian, sun_disc, value);
        row.push_back(percent(number));
      }
      if (with_times) {
        const auto waves = static_cast<double>(settings.wavelength_m.size());
        row.push_back(seconds_text(totals[radius].rays / waves));
        row.push_back(seconds_text(totals[radius].exact / waves));
      }
      table.rows.push_back(std::move(row));
    }
    add(std::move(table));
  };
  add(Heading{"Intensity"});
  table_of(
      "Averaged over the sun, Gaussian filter: rms relative error, and wall time per wavelength", true, true,
      &Errors::rms, "rms", true);
  table_of("Averaged over the sun, no filter: rms relative error", false, true, &Errors::rms, "rms", false);
  error_plot.title = fmt::format(
      "Error of rays with Gaussian filter, {:.4g} nm, averaged over the sun",
      settings.wavelength_m[settings.wavelength_m.size() / 2] * 1e9);
  error_plot.x_label = "scattering angle [deg]";
  error_plot.y_label = "intensity relative to Lorenz-Mie [%]";
  error_plot.x_range = {{0, 180}};
  error_plot.y_range = {{-100, 150}};
  error_plot.height = 480;
  for (scene::Curve& curve : error_plot.curves) curve.width = 1;
  add(Figure{
      scene::draw(error_plot, scene::PictureFormat::svg),
      "Where the errors lie: -100 % at 0 deg is the missing forward peak, the spikes near 129 and 138 deg "
      "are the "
      "edges of the bows, the level below zero elsewhere is the light of untraced orders; near 180 deg the "
      "glory "
      "is missing."});
  add(Paragraph{
      "The Gaussian filter softens the bows' edges, where rays alone are infinitely bright on one side and "
      "dark on the other. What remains has three causes. Orders beyond the last one traced shine everywhere, "
      "most visibly in Alexander's band (130 to 137 deg), where they are all the light there is besides "
      "external reflection and the tails of the bows. The filter has the wrong shape: light that a bow "
      "diffracts "
      "into its dark side falls off otherwise, and the bow's main peak stands farther out than rays put it. "
      "And "
      "in 0 to 30 deg the light diffracted around the drop, the forward peak, is missing altogether: rays do "
      "not "
      "have it."});
  add(Paragraph{"Where it acts, the filter also washes out the minima beside a bow's main peak, which "
                "interference had put "
                "right: wherever the first table's error is larger than the second's, the filter does more "
                "harm than good "
                "by this measure. Weighed by light instead of angles, further down, it may still gain, for "
                "it takes the "
                "false peak off the edge."});
  table_of(
      "Averaged over the sun, Gaussian filter: mean relative error (above zero: too bright)", true, true,
      &Errors::bias, "mean", false);
  table_of(
      "Averaged over the sun, Gaussian filter: largest relative error", true, true, &Errors::largest, "max",
      false);
  table_of(
      "Averaged over the sun, Gaussian filter: rms difference over the region's mean intensity", true, true,
      &Errors::rms_over_mean, "rms", false);
  add(Paragraph{
      "The last two tables weigh light instead of angles: a bright bow counts for more than the dark "
      "beside it. In the "
      "forward region the missing peak is all there is to see."});
  table_of("Pointwise, Gaussian filter: rms relative error", true, false, &Errors::rms, "rms", false);
  table_of("Pointwise, no filter: rms relative error", false, false, &Errors::rms, "rms", false);
  add(Paragraph{
      "Pointwise errors are those of a sun without extent. They are dominated by the minima of the ripple: "
      "where "
      "the exact intensity nearly vanishes, a minimum that lies a hundredth of a degree off is a huge "
      "relative "
      "error, and nothing that one could see. Without the filter the bows' edges add their infinite peaks."});
  table_of(
      "Pointwise, Gaussian filter: rms difference over the region's mean intensity", true, false,
      &Errors::rms_over_mean, "rms", false);

  for (const double radius : settings.radius_m) {
    Table table{
        fmt::format("{}, Gaussian filter, per wavelength", millimetres(radius)),
        region_columns("wavelength"),
        {}};
    table.folded = true;
    for (const char* const column : {"rays", "Lorenz-Mie"}) table.columns.emplace_back(column);
    for (std::size_t i = 0; i < entries.size();) {
      const Entry& entry = entries[i];
      if (entry.radius_m != radius || !entry.gaussian) {
        ++i;
        continue;
      }
      // Regions follow each other, with the pointwise entry before the averaged one.
      std::vector<std::string> row{fmt::format("{:.4g} nm", entry.wavelength_m * 1e9)};
      for (std::size_t r = 0; r < regions().size(); ++r, i += 2)
        row.push_back(percent(entries[i + 1].errors.rms) + " / " + percent(entries[i].errors.rms));
      row.push_back(seconds_text(entry.seconds_rays));
      row.push_back(seconds_text(entry.seconds_exact));
      table.rows.push_back(std::move(row));
    }
    table.caption += ": rms relative error averaged over the sun / pointwise, and wall time";
    add(std::move(table));
  }

  add(Heading{"Degree of polarisation"});
  add(Paragraph{
      "The degree of linear polarisation of scattered sunlight is -S12/S11 = (perpendicular - parallel) / "
      "(perpendicular + parallel). Here are absolute differences: 5 % means 0.91 instead of 0.96."});
  table_of(
      "Averaged over the sun, Gaussian filter: rms difference", true, true, &Errors::polarisation_rms, "rms",
      false);
  table_of(
      "Averaged over the sun, no filter: rms difference", false, true, &Errors::polarisation_rms, "rms",
      false);
  table_of(
      "Pointwise, Gaussian filter: rms difference", true, false, &Errors::polarisation_rms, "rms", false);

  add(Heading{"Total cross section and time"});
  {
    Table table{
        "Scattering cross section by rays (shadow plus all that meets the drop) against Lorenz-Mie's",
        {"radius", "largest difference", "angles", "step", "rays, all wavelengths",
         "Lorenz-Mie, all wavelengths"},
        {}};
    for (const double radius : settings.radius_m) {
      const Totals& total = totals[radius];
      table.rows.push_back(
          {millimetres(radius), fmt::format("{:+.2f} %", 100 * total.cross_section),
           fmt::format("{}", total.angles), fmt::format("{:.4f} deg", total.step_deg),
           fmt::format("{:.2f} s", total.rays), fmt::format("{:.2f} s", total.exact)});
    }
    add(std::move(table));
    add(Paragraph{
        "Rays give twice the shadow; the exact cross section approaches that from above as 1 + x^(-2/3) and "
        "ripples about it. Times are for the whole angular grid of that radius with the Mueller matrix; "
        "those "
        "of rays include the filter but not the compilation of kernels, and need one azimuth only because "
        "the drop is a sphere."});
  }

  add(Heading{fmt::format(
      "Convergence in rays: {}, {:.0f} nm", millimetres(convergence.radius_m),
      convergence.wavelength_m * 1e9)});
  for (const bool exact : {true, false}) {
    Table table{
        exact ? std::string("To Lorenz-Mie, averaged over the sun: rms relative error")
              : fmt::format(
                    "To {0} x {0} rays, averaged over the sun: rms relative difference", convergence.finest),
        region_columns("rays"),
        {}};
    table.columns.emplace_back("time");
    for (const auto& row : convergence.rows) {
      std::vector<std::string> cells{fmt::format("{}", row.rays)};
      for (std::size_t r = 0; r < regions().size(); ++r) {
        if (exact)
          cells.push_back(percent(row.to_exact[r].rms));
        else
          cells.push_back(
              row.to_finest[r] ? fmt::format("{:.3g} %", 100 * row.to_finest[r]->rms) : "no light");
      }
      cells.push_back(seconds_text(row.seconds));
      table.rows.push_back(std::move(cells));
    }
    add(std::move(table));
  }
  add(Paragraph{"The upper table stops falling where the method itself, not the number of rays, sets the "
                "error; the lower "
                "one shows how far a grid of rays is from a much finer one, and so what more rays could "
                "still change."});

  // In short.
  std::size_t band = 0, primary = 0, secondary = 0;
  for (std::size_t r = 0; r < regions().size(); ++r) {
    if (regions()[r].from_deg == 130) band = r;
    if (regions()[r].from_deg == 137) primary = r;
    if (regions()[r].from_deg == 120) secondary = r;
  }
  for (const double radius : {settings.radius_m.front(), settings.radius_m.back()}) {
    const auto rms = [&](std::size_t region, bool gaussian, double Errors::*value) {
      return percent(summary.rms(radius, region, gaussian, true, value));
    };
    report.findings.push_back(fmt::format(
        "A sphere of {}, averaged over the sun: rays with the Gaussian filter miss Lorenz-Mie by {} (rms, "
        "angle by "
        "angle) in the primary bow, {} in the secondary, {} in Alexander's band between them; without the "
        "filter by "
        "{}, {} and {}. Relative to the mean intensity of the primary bow it is {} with and {} without. The "
        "degree "
        "of polarisation in the primary bow is off by {}.",
        millimetres(radius), rms(primary, true, &Errors::rms), rms(secondary, true, &Errors::rms),
        rms(band, true, &Errors::rms), rms(primary, false, &Errors::rms), rms(secondary, false, &Errors::rms),
        rms(band, false, &Errors::rms), rms(primary, true, &Errors::rms_over_mean),
        rms(primary, false, &Errors::rms_over_mean), rms(primary, true, &Errors::polarisation_rms)));
    if (settings.radius_m.size() == 1) break;
  }
  return report;
}

} // namespace scatter::validation
