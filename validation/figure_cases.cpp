#include "cases.hpp"
#include "words.hpp"
#include <scatter/optics/units.hpp>
#include <scatter/scene/colour.hpp>
#include <scatter/scene/plot.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace scatter::validation {

namespace {

using nlohmann::ordered_json;

/// What both figures show: secondary bow, Alexander's band, primary bow with supernumeraries.
constexpr Region shown{120, 150};

/// How brightly a table's curve is polarised, seen through a filter or none.
enum class Polarisation { none, perpendicular, parallel };

double intensity(const Curve& curve, std::size_t t, Polarisation polarisation) {
  switch (polarisation) {
  case Polarisation::perpendicular:
    return (curve.s11[t] - curve.s12[t]) / 2;
  case Polarisation::parallel:
    return (curve.s11[t] + curve.s12[t]) / 2;
  default:
    return curve.s11[t];
  }
}

std::vector<Curve> averaged(const Curves& curves, const ThetaGrid& grid) {
  std::vector<Curve> smooth;
  for (const Curve& curve : curves.curves)
    smooth.push_back(average_disc(curve, grid.step_deg, sun_diameter_deg));
  return smooth;
}

/// Indices of the grid's angles within what is shown.
std::pair<std::size_t, std::size_t> shown_indices(const ThetaGrid& grid) {
  const auto index = [&](double theta) {
    return static_cast<std::size_t>(std::llround(theta / grid.step_deg));
  };
  return {index(shown.from_deg), index(shown.to_deg)};
}

/// Colours of sunlight after scattering, angle by angle over what is shown, before exposure.
std::vector<scene::LinearRgb> colours(
    const std::vector<Curve>& per_wavelength, const std::vector<double>& wavelength_m, const ThetaGrid& grid,
    Polarisation polarisation) {
  const scene::SunlitColour sunlit(wavelength_m);
  const auto [first, last] = shown_indices(grid);
  std::vector<scene::LinearRgb> found;
  std::vector<double> spectrum(wavelength_m.size());
  for (std::size_t t = first; t <= last; ++t) {
    for (std::size_t w = 0; w < spectrum.size(); ++w)
      spectrum[w] = intensity(per_wavelength[w], t, polarisation);
    found.push_back(sunlit(spectrum));
  }
  return found;
}

std::vector<double> luminances(const std::vector<scene::LinearRgb>& from) {
  std::vector<double> found;
  for (const scene::LinearRgb& colour : from) found.push_back(scene::tristimulus(colour).Y);
  return found;
}

scene::ColourStrip
strip(const std::string& label, const std::vector<scene::LinearRgb>& from, double brightest) {
  scene::ColourStrip made{label, shown.from_deg, shown.to_deg, {}};
  constexpr std::size_t pixels = 600;
  for (std::size_t i = 0; i < pixels; ++i) {
    const std::size_t at = (2 * i + 1) * (from.size() - 1) / (2 * pixels);
    const scene::LinearRgb& colour = from[at];
    made.pixels.push_back(
        scene::srgb_bytes({colour.r / brightest, colour.g / brightest, colour.b / brightest}));
  }
  return made;
}

scene::Curve line(
    const std::string& label, const std::vector<double>& values, const ThetaGrid& grid, std::size_t first,
    std::size_t last) {
  scene::Curve made;
  made.label = label;
  for (std::size_t t = first; t <= last; ++t) {
    made.x.push_back(grid.theta_deg[t]);
    made.y.push_back(values[t]);
  }
  return made;
}

/// Every `stride`-th value over what is shown, six digits.
ordered_json
sampled(const std::vector<double>& values, std::size_t first, std::size_t last, std::size_t stride) {
  ordered_json list = ordered_json::array();
  for (std::size_t t = first; t <= last; t += stride)
    list.push_back(std::stod(fmt::format("{:.6g}", values[t])));
  return list;
}

/// Where the values are largest between two angles [deg], by the parabola through the three highest points.
double
highest(const std::vector<double>& theta_deg, const std::vector<double>& values, double from, double to) {
  std::size_t best = 0;
  bool any = false;
  for (std::size_t i = 1; i + 1 < theta_deg.size(); ++i)
    if (theta_deg[i] >= from && theta_deg[i] <= to && (!any || values[i] > values[best])) {
      best = i;
      any = true;
    }
  const double left = values[best - 1], middle = values[best], right = values[best + 1];
  const double curvature = left - 2 * middle + right;
  const double offset = curvature < 0 ? 0.5 * (left - right) / curvature : 0;
  return theta_deg[best] + offset * (theta_deg[best + 1] - theta_deg[best]);
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

constexpr const char* intensity_axis = "cross section per steradian / (π a²)";

} // namespace

CaseReport run_figure_3_12(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "figure-3.12";
  report.title = "What each effect adds: a sphere of 0.4 mm (figure 3.12)";
  const double radius_m = 0.4e-3, wavelength_m = 650e-9;
  const ThetaGrid grid = ripple_grid(2 * pi * radius_m / std::ranges::min(settings.wavelength_m), 0.0125);
  const auto [first, last] = shown_indices(grid);

  struct Stage {
    const char* name;
    const char* label;
    bool interference, gaussian, exact;
  };
  const Stage stages[] = {
      {"geometric", "geometric optics", false, false, false},
      {"interference", "+ interference", true, false, false},
      {"gaussian", "+ Gaussian filter", true, true, false},
      {"lorenz-mie", "Lorenz-Mie", true, true, true},
  };
  Settings one = settings;
  one.wavelength_m = {wavelength_m};
  std::vector<Curve> point, disc;
  std::vector<std::vector<scene::LinearRgb>> colour;
  std::vector<double> seconds;
  for (const Stage& stage : stages) {
    const auto compute = [&](const Settings& with) {
      if (stage.exact) return exact_sphere(radius_m, with.wavelength_m, with.index, grid, with.threads);
      phase::Request request = request_of(with, radius_m);
      request.interference = stage.interference;
      request.diffraction = stage.gaussian ? phase::Diffraction::gaussian : phase::Diffraction::none;
      return traced_sphere(request, grid);
    };
    const Curves red = compute(one), all = compute(settings);
    point.push_back(red.curves[0]);
    disc.push_back(average_disc(red.curves[0], grid.step_deg, sun_diameter_deg));
    colour.push_back(colours(averaged(all, grid), settings.wavelength_m, grid, Polarisation::none));
    seconds.push_back(red.seconds[0]);
    progress(static_cast<double>(point.size()) / 4);
  }

  const double brightest = std::ranges::max(luminances(colour.back()));
  scene::Plot plot;
  plot.title = "a = 0.4 mm, 650 nm, averaged over the sun's disc; strips: sunlight";
  plot.x_label = "scattering angle [deg]";
  plot.y_label = intensity_axis;
  plot.log_y = true;
  plot.height = 720;
  for (std::size_t i = 0; i < point.size(); ++i) {
    plot.strips.push_back(strip(stages[i].label, colour[i], brightest));
    plot.curves.push_back(line(stages[i].label, disc[i].s11, grid, first, last));
  }
  plot.curves[3].colour = "#000000";
  plot.curves[3].width = 2.2;
  std::swap(plot.curves[0], plot.curves[3]); // the truth lies below, so that what leaves it shows
  std::rotate(plot.curves.begin() + 1, plot.curves.begin() + 3, plot.curves.end());
  report.blocks.emplace_back(Paragraph{fmt::format(
      "The same sphere four times: rays whose intensities add; rays that interfere; the same smoothed at the "
      "bows' edges by the Gaussian filter; and the exact series. {} x {} rays; colours from {} wavelengths, "
      "every "
      "strip with the same exposure.",
      settings.rays, settings.rays, settings.wavelength_m.size())});
  report.blocks.emplace_back(Figure{
      scene::draw(plot, scene::PictureFormat::svg),
      "Averaged over the sun's disc. Geometric optics ends at the bows' edges; interference brings the "
      "supernumerary bows; the filter moves light across the edges. Between the bows Lorenz-Mie is brighter "
      "than "
      "any of them: orders beyond the last one traced."});
  plot.title = "a = 0.4 mm, 650 nm, a sun without extent";
  plot.strips.clear();
  plot.height = 560;
  plot.x_range = {{134, 146}};
  plot.curves.clear();
  for (const std::size_t i : {3, 0, 1, 2}) {
    plot.curves.push_back(line(stages[i].label, point[i].s11, grid, first, last));
    plot.curves.back().width = i == 3 ? 2.2 : 1.2;
    if (i == 3) plot.curves.back().colour = "#000000";
  }
  report.blocks.emplace_back(Figure{
      scene::draw(plot, scene::PictureFormat::svg), "The primary bow pointwise. The fine ripple is the "
                                                    "interference of the bow with light reflected off the "
                                                    "outside of the drop; the sun's disc blurs it."});

  Table table{
      "650 nm, averaged over the sun: rms error relative to Lorenz-Mie",
      {"", "120..129 deg", "130..137 deg", "137..150 deg", "time"},
      {}};
  report.numbers["radius_m"] = radius_m;
  report.numbers["wavelength_m"] = wavelength_m;
  report.numbers["rows"] = ordered_json::array();
  for (std::size_t i = 0; i < point.size(); ++i) {
    std::vector<std::string> cells{stages[i].label};
    for (const Region& region : {Region{120, 129}, Region{130, 137}, Region{137, 150}}) {
      const Errors smooth = compare(disc[i], disc[3], grid, region),
                   sharp = compare(point[i], point[3], grid, region);
      cells.push_back(i == 3 ? "-" : percent(smooth.rms));
      if (i < 3)
        report.numbers["rows"].push_back(
            {{"stage", stages[i].name},
             {"region_deg", {region.from_deg, region.to_deg}},
             {"sun_disc_intensity_rms", smooth.rms},
             {"point_intensity_rms", sharp.rms},
             {"seconds", seconds[i]}});
    }
    cells.push_back(
        seconds[i] < 0.0995 ? fmt::format("{:.0f} ms", 1e3 * seconds[i])
                            : fmt::format("{:.1f} s", seconds[i]));
    table.rows.push_back(std::move(cells));
  }
  report.blocks.emplace_back(std::move(table));
  const std::size_t stride = std::max<std::size_t>(1, static_cast<std::size_t>(0.025 / grid.step_deg));
  report.numbers["theta_deg"] = sampled(grid.theta_deg, first, last, stride);
  for (std::size_t i = 0; i < point.size(); ++i) {
    report.numbers["curves"][stages[i].name] = {
        {"point", sampled(point[i].s11, first, last, stride)},
        {"sun_disc", sampled(disc[i].s11, first, last, stride)}};
  }

  // Airy's theory: first zero of Ai' at -1.018793, curvature h of the deflection at the bow.
  const double n = refractive_index(settings.index, wavelength_m).real(),
               x = 2 * pi * radius_m / wavelength_m;
  const double incidence = std::acos(std::sqrt((n * n - 1) / 3)),
               refraction = std::asin(std::sin(incidence) / n);
  const double bow_deg = 180 + (2 * incidence - 4 * refraction) / radians_per_degree;
  const double h = 2.25 * std::sqrt((4 - n * n) / std::pow(n * n - 1, 3));
  const double airy_peak = bow_deg + 1.018793 * std::cbrt(h / (x * x)) / radians_per_degree;
  const double exact_peak = highest(grid.theta_deg, disc[3].s11, 137, 141),
               filtered_peak = highest(grid.theta_deg, disc[2].s11, 137, 141);
  report.numbers["primary_peak_deg"] = {
      {"gaussian", filtered_peak}, {"lorenz-mie", exact_peak}, {"airy", airy_peak}};
  report.checks.push_back(
      {"Lorenz-Mie's main maximum against Airy's theory", std::abs(exact_peak - airy_peak), 0.15, "deg"});
  report.findings.push_back(fmt::format(
      "Figure 3.12, 0.4 mm at 650 nm: the filtered primary bow peaks at {:.2f} deg, the exact one at {:.2f} "
      "deg "
      "(Airy's theory: {:.2f}; the dissertation's text says about 138.5). Interference alone puts the "
      "supernumerary bows where Lorenz-Mie has them.",
      filtered_peak, exact_peak, airy_peak));
  return report;
}

CaseReport run_figure_3_7(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "figure-3.7";
  report.title = "The bows of a 0.1 mm sphere in polarised light (figure 3.7)";
  const double radius_m = 0.1e-3;
  const ThetaGrid grid = ripple_grid(2 * pi * radius_m / std::ranges::min(settings.wavelength_m), 0.0125);
  const auto [first, last] = shown_indices(grid);
  const std::vector<double> theta(
      grid.theta_deg.begin() + static_cast<std::ptrdiff_t>(first),
      grid.theta_deg.begin() + static_cast<std::ptrdiff_t>(last + 1));
  const std::pair<Polarisation, const char*> kinds[] = {
      {Polarisation::perpendicular, "perpendicular"},
      {Polarisation::parallel, "parallel"},
      {Polarisation::none, "unpolarised"}};

  report.blocks.emplace_back(Paragraph{fmt::format(
      "Sunlight scattered by a sphere of 0.1 mm, averaged over the sun's disc and added up over {} "
      "wavelengths: "
      "luminance and colour for light polarised perpendicular to the scattering plane, parallel to it, and "
      "for "
      "all of it. First as the exact series has it, which is what the figure shows; then by rays with the "
      "Gaussian "
      "filter ({} x {}). All strips have the same exposure.",
      settings.wavelength_m.size(), settings.rays, settings.rays)});
  double brightest = 0;
  report.numbers["radius_m"] = radius_m;
  for (const bool exact : {true, false}) {
    const Curves curves =
        exact ? exact_sphere(radius_m, settings.wavelength_m, settings.index, grid, settings.threads)
              : traced_sphere(request_of(settings, radius_m), grid);
    const std::vector<Curve> smooth = averaged(curves, grid);
    scene::Plot plot;
    plot.title =
        exact ? "a = 0.1 mm, sunlight, Lorenz-Mie" : "a = 0.1 mm, sunlight, rays with Gaussian filter";
    plot.x_label = "scattering angle [deg]";
    plot.y_label = intensity_axis;
    plot.log_y = true;
    plot.y_range = {{2e-4, 0.2}};
    plot.height = 600;
    std::vector<std::vector<scene::LinearRgb>> colour;
    std::vector<std::vector<double>> luminance;
    for (const auto& kind : kinds) {
      colour.push_back(colours(smooth, settings.wavelength_m, grid, kind.first));
      luminance.push_back(luminances(colour.back()));
    }
    if (exact) brightest = std::ranges::max(luminance.back());
    for (std::size_t i = 0; i < colour.size(); ++i) {
      plot.strips.push_back(strip(kinds[i].second, colour[i], brightest));
      scene::Curve curve;
      curve.label = kinds[i].second;
      curve.x = theta;
      curve.y = luminance[i];
      plot.curves.push_back(std::move(curve));
      report.numbers["luminance"][exact ? "lorenz-mie" : "gaussian"][kinds[i].second] =
          sampled(luminance[i], 0, luminance[i].size() - 1, 4);
    }
    plot.curves.back().colour = "#000000";
    const double primary = highest(theta, luminance.back(), 136, 142),
                 secondary = highest(theta, luminance.back(), 122, 131);
    // (perpendicular - parallel) / (perpendicular + parallel) of the luminance.
    const auto polarised = [&](double at_deg) {
      const auto t = static_cast<std::size_t>(std::llround((at_deg - theta.front()) / grid.step_deg));
      return (luminance[0][t] - luminance[1][t]) / (luminance[0][t] + luminance[1][t]);
    };
    report.numbers["polarisation_at_peaks"][exact ? "lorenz-mie" : "gaussian"] = {
        {"primary", polarised(primary)}, {"secondary", polarised(secondary)}};
    report.numbers["peaks_deg"][exact ? "lorenz-mie" : "gaussian"] = {
        {"primary", primary}, {"secondary", secondary}};
    report.blocks.emplace_back(Figure{
        scene::draw(plot, scene::PictureFormat::svg),
        fmt::format(
            "{}: primary bow brightest at {:.1f} deg, {:.0f} % polarised there; secondary at {:.1f} deg, "
            "{:.0f} %.",
            exact ? "Lorenz-Mie" : "Rays with the Gaussian filter", primary, 100 * polarised(primary),
            secondary, 100 * polarised(secondary))});
    if (exact) {
      report.checks.push_back(
          {"primary bow against the dissertation's, near 139 deg", std::abs(primary - 139), 0.5, "deg"});
      report.checks.push_back(
          {"secondary bow against the dissertation's, near 127 deg", std::abs(secondary - 127), 1, "deg"});
    }
    progress(exact ? 0.5 : 1.0);
  }
  report.numbers["theta_deg"] = sampled(theta, 0, theta.size() - 1, 4);
  const auto& exact_peaks = report.numbers["peaks_deg"]["lorenz-mie"];
  const auto& ray_peaks = report.numbers["peaks_deg"]["gaussian"];
  report.findings.push_back(fmt::format(
      "Figure 3.7, 0.1 mm in sunlight: primary and secondary bow are brightest at {:.1f} and {:.1f} deg by "
      "Lorenz-Mie, at {:.1f} and {:.1f} deg by rays.",
      exact_peaks["primary"].get<double>(), exact_peaks["secondary"].get<double>(),
      ray_peaks["primary"].get<double>(), ray_peaks["secondary"].get<double>()));
  return report;
}

} // namespace scatter::validation
