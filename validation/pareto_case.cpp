#include "cases.hpp"
#include "words.hpp"
#include <scatter/exact/mie.hpp>
#include <scatter/exact/sun_disc.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/job.hpp>
#include <scatter/scene/plot.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace scatter::validation {

namespace {

using nlohmann::ordered_json;

constexpr double wavelength_m = 650e-9;
const Region compared{120, 150};
/// Where errors are looked at, in steps of which every setting's step is a fraction.
constexpr double target_step_deg = 0.1;

std::vector<int> first_orders(int last) {
  std::vector<int> orders;
  for (int p = 0; p <= last; ++p) orders.push_back(p);
  return orders;
}

/// One way to compute the bows.
struct Setting {
  const char* method; ///< one mark in the figure
  phase::Method kind;
  phase::Diffraction diffraction;
  int rays, last_order;
  double step_deg;
  [[nodiscard]] std::string name() const {
    return kind == phase::Method::mie
               ? fmt::format("{:g} deg", step_deg)
               : fmt::format("{} rays, orders 0..{}, {:g} deg", rays, last_order, step_deg);
  }
};

std::vector<Setting> settings_of(bool quick) {
  using phase::Diffraction;
  using phase::Method;
  std::vector<Setting> all;
  const auto rays = [&](const char* name, Diffraction diffraction, int count, int last, double step) {
    all.push_back({name, Method::patches, diffraction, count, last, step});
  };
  const char* const gaussian = "patches and Gaussian filter";
  rays(gaussian, Diffraction::gaussian, 300, 3, 0.1);
  if (!quick) rays(gaussian, Diffraction::gaussian, 1000, 3, 0.05);
  rays(gaussian, Diffraction::gaussian, quick ? 1000 : 3000, 3, 0.0125);
  const char* const bare = "patches";
  rays(bare, Diffraction::none, 300, 3, 0.1);
  if (!quick) rays(bare, Diffraction::none, 1000, 8, 0.05);
  rays(bare, Diffraction::none, quick ? 1000 : 3000, 8, 0.0125);
  const char* const integral = "integral";
  rays(integral, Diffraction::integral, 300, 3, 0.1);
  if (!quick) {
    rays(integral, Diffraction::integral, 1000, 3, 0.025);
    rays(integral, Diffraction::integral, 1000, 5, 0.05);
    rays(integral, Diffraction::integral, 1000, 8, 0.025);
  }
  for (const double step : {0.1, 0.05, 0.0125})
    all.push_back({"Lorenz-Mie", Method::mie, Diffraction::none, 0, 0, step});
  return all;
}

struct Row {
  double radius_m;
  Setting setting;
  double rms = 0, largest = 0;
  double seconds = 0; ///< without judging
  double judging_seconds = 0, predicted_seconds = 0;
};

/// The truth at the targets: Lorenz-Mie averaged over discs on the sphere of directions.
std::vector<double>
truth_at(double radius_m, const IndexSource& index, const std::vector<double>& targets, int threads) {
  const double x = 2 * pi * radius_m / wavelength_m;
  const exact::SunDisc disc(targets, sun_diameter_deg, exact::SunDisc::level_for(x));
  const exact::MieResult mie =
      exact::mie_at_degrees(x, refractive_index(index, wavelength_m), disc.grid_deg(), threads);
  std::vector<double> intensity;
  for (std::size_t i = 0; i < mie.S1.size(); ++i)
    intensity.push_back((std::norm(mie.S1[i]) + std::norm(mie.S2[i])) / (2 * pi * x * x));
  std::vector<double> truth;
  for (std::size_t i = 0; i < targets.size(); ++i) truth.push_back(disc.mean(i, intensity));
  return truth;
}

/// The fastest of as many runs as fit into half a second, at least one.
table::PhaseTable timed(const phase::Request& request, Row& row) {
  const phase::Plan plan = phase::plan(request);
  table::MemorySink sink;
  const phase::Outcome outcome = phase::run(plan, sink);
  row.seconds = outcome.seconds;
  row.judging_seconds = outcome.judging_seconds;
  row.predicted_seconds = phase::predict(plan).seconds;
  for (double spent = row.seconds; spent + row.seconds < 0.5;) {
    table::NullSink nothing;
    const double again = phase::run(plan, nothing).seconds;
    spent += again;
    row.seconds = std::min(row.seconds, again);
  }
  return std::move(sink.table);
}

Row run_row(
    double radius_m, const Setting& setting, const std::vector<double>& targets,
    const std::vector<double>& truth, const Settings& settings) {
  Row row{radius_m, setting};
  const double half = std::ceil(sun_diameter_deg / 2 / target_step_deg + 1) * target_step_deg;
  phase::Request request;
  request.shape = drop::sphere(radius_m);
  request.wavelength_m = {wavelength_m};
  request.index = settings.index;
  request.method = setting.kind;
  request.diffraction = setting.diffraction;
  if (setting.rays > 0) request.rays = setting.rays;
  request.orders = first_orders(setting.last_order);
  request.phi_deg = {0};
  request.threads = settings.threads;
  const double first = compared.from_deg - half, last = compared.to_deg + half;
  const auto count = static_cast<int>(std::llround((last - first) / setting.step_deg));
  for (int i = 0; i <= count; ++i) request.theta_deg.push_back(first + (last - first) * i / count);
  const table::PhaseTable table = timed(request, row);
  const table::Slab& slab = table.slabs.front();
  std::vector<double> intensity = slab.phase_function;
  const double scale = slab.scattering_cross_section / (pi * radius_m * radius_m);
  for (double& value : intensity) value *= scale;
  const std::vector<double> mean = average_disc(intensity, setting.step_deg, sun_diameter_deg);
  const auto skip = static_cast<std::size_t>(std::llround(half / setting.step_deg));
  const auto every = static_cast<std::size_t>(std::llround(target_step_deg / setting.step_deg));
  double squares = 0;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const double error = mean[skip + every * i] / truth[i] - 1;
    squares += error * error;
    row.largest = std::max(row.largest, std::abs(error));
  }
  row.rms = std::sqrt(squares / static_cast<double>(targets.size()));
  return row;
}

/// A falling drop at all azimuths: time can be measured, the error is what the table claims.
struct DropRun {
  std::string name;
  std::size_t directions = 0, wavelengths = 0;
  phase::Outcome outcome;
  double predicted_seconds = 0;
};

phase::Request drop_request(const Settings& settings) {
  phase::Request request;
  request.shape = drop::beard_chuang(0.5e-3);
  request.sun_elevation_deg = 20;
  request.wavelength_m = {wavelength_m};
  request.index = settings.index;
  request.method = phase::Method::patches;
  request.diffraction = phase::Diffraction::integral;
  request.rays = 1000;
  request.orders = first_orders(3);
  for (int i = 0; i <= 300; ++i) request.theta_deg.push_back(120 + 0.1 * i);
  for (int i = 0; i <= 180; ++i) request.phi_deg.push_back(2.0 * i);
  request.sun_disc_deg = sun_diameter_deg;
  request.threads = settings.threads;
  return request;
}

DropRun run_drop(const char* name, const phase::Request& request) {
  const phase::Plan plan = phase::plan(request);
  table::NullSink nothing;
  DropRun made{name, request.theta_deg.size() * request.phi_deg.size(), request.wavelength_m.size(), {}, 0};
  made.outcome = phase::run(plan, nothing);
  made.predicted_seconds = phase::predict(plan).seconds;
  return made;
}

/// What the planner would take for the drop's bows to be right to a tolerance; nothing is computed.
struct Price {
  double tolerance = 0;
  std::vector<int> orders;
  phase::Prediction expected; ///< seconds = 0: out of reach
  std::string refusal;
};

Price price_of(phase::Request request, double tolerance) {
  request.tolerance = tolerance;
  Price price{tolerance, {}, {}, {}};
  try {
    const phase::Plan plan = phase::plan(request);
    price.orders = plan.request.orders;
    price.expected = phase::predict(plan);
  } catch (const InputError& error) {
    price.refusal = error.what();
  }
  return price;
}

} // namespace

CaseReport run_pareto(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "pareto";
  report.title = "Error against time";
  const std::vector<double> radii =
      settings.quick ? std::vector<double>{0.2e-3} : std::vector<double>{0.1e-3, 0.2e-3, 0.5e-3, 1e-3};
  const std::vector<Setting> all = settings_of(settings.quick);
  std::vector<double> targets;
  const auto count = static_cast<int>(std::llround((compared.to_deg - compared.from_deg) / target_step_deg));
  for (int i = 0; i <= count; ++i)
    targets.push_back(compared.from_deg + (compared.to_deg - compared.from_deg) * i / count);

  // The first job of its kind compiles its kernels; later ones find them in the driver's cache.
  for (const phase::Diffraction diffraction : {phase::Diffraction::none, phase::Diffraction::integral}) {
    phase::Request small = drop_request(settings);
    small.shape = drop::sphere(0.1e-3);
    small.diffraction = diffraction;
    small.rays = 16;
    small.orders = {2};
    small.theta_deg = {138};
    small.phi_deg = {0};
    (void)phase::compute(small);
  }
  std::vector<Row> rows;
  for (const double radius : radii) {
    const std::vector<double> truth = truth_at(radius, settings.index, targets, settings.threads);
    for (const Setting& setting : all) {
      rows.push_back(run_row(radius, setting, targets, truth, settings));
      progress(0.6 * static_cast<double>(rows.size()) / static_cast<double>(radii.size() * all.size()));
    }
  }

  std::vector<DropRun> drops;
  std::vector<Price> prices;
  phase::Request drop = drop_request(settings);
  if (settings.quick) drop.phi_deg = {0, 90, 180};
  phase::Request filtered = drop;
  filtered.diffraction = phase::Diffraction::gaussian;
  drops.push_back(run_drop("patches and Gaussian filter, orders 0..3", filtered));
  drops.push_back(run_drop("integral, orders 0..3", drop));
  progress(0.65);
  if (!settings.quick) {
    for (const double tolerance : {0.08, 0.02, 0.01}) prices.push_back(price_of(drop, tolerance));
    progress(0.75);
    // The whole table, as README has it.
    phase::Request table = drop;
    table.wavelength_m.clear();
    for (int nm = 380; nm <= 700; nm += 10) table.wavelength_m.push_back(nm * 1e-9);
    table.theta_deg.clear();
    for (int i = 0; i <= 1800; ++i) table.theta_deg.push_back(0.1 * i);
    drops.push_back(run_drop("integral, orders 0..3, the whole sphere", table));
    progress(1);
  }

  double load = 0;
  if (::getloadavg(&load, 1) == 1) report.numbers["load"] = load;
  report.numbers["region_deg"] = {compared.from_deg, compared.to_deg};
  report.numbers["wavelength_m"] = wavelength_m;
  report.numbers["rows"] = ordered_json::array();
  Table table{
      fmt::format("{} deg, averaged over the sun: error against Lorenz-Mie and wall time", compared.name()),
      {"radius, method", "setting", "rms error", "largest", "time", "predicted", "error estimate's time"},
      {}};
  for (const Row& row : rows) {
    report.numbers["rows"].push_back(
        {{"radius_m", row.radius_m},
         {"method", row.setting.method},
         {"rays", row.setting.rays},
         {"last_order", row.setting.last_order},
         {"step_deg", row.setting.step_deg},
         {"intensity_rms", row.rms},
         {"intensity_max", row.largest},
         {"seconds", row.seconds},
         {"predicted_seconds", row.predicted_seconds},
         {"judging_seconds", row.judging_seconds}});
    table.rows.push_back(
        {fmt::format("{}, {}", millimetres(row.radius_m), row.setting.method), row.setting.name(),
         percent(row.rms), percent(row.largest), seconds_text(row.seconds),
         seconds_text(row.predicted_seconds), seconds_text(row.judging_seconds)});
  }
  report.blocks.emplace_back(Paragraph{fmt::format(
      "The bows of spheres, {} deg at {:.0f} nm, by every method with rougher and finer settings: rms "
      "relative "
      "error of the unpolarised intensity averaged over the sun's disc, against wall time of the far field. "
      "What the table's own <code>error_estimate</code> takes is the same for all methods of rays and stands "
      "apart. Beside the time is what <code>--explain</code> predicts for it on two cores that do nothing "
      "else, starting the program not counted; the machine's load was {:.1f} at the end. "
      "Rays and patches of a sphere serve all azimuths at once, so their times are those of one azimuth; the "
      "integral's are not much longer for a whole table of a sphere. For a falling drop see below: it has no "
      "exact judge.",
      compared.name(), wavelength_m * 1e9, load)});
  const auto best = [&](double radius_m, std::string_view method) {
    const Row* found = nullptr;
    for (const Row& row : rows)
      if (row.radius_m == radius_m && row.setting.method == method && (!found || row.rms < found->rms))
        found = &row;
    return found;
  };
  const char* const names[] = {"patches", "patches and Gaussian filter", "integral", "Lorenz-Mie"};
  Table best_of_each{"The most accurate setting of each method: error and time", {"radius"}, {}};
  best_of_each.columns.insert(best_of_each.columns.end(), std::begin(names), std::end(names));
  report.numbers["best"] = ordered_json::array();
  for (const double radius : radii) {
    best_of_each.rows.push_back({millimetres(radius)});
    for (const char* const name : names) {
      const Row& row = *best(radius, name);
      best_of_each.rows.back().push_back(fmt::format("{}, {}", percent(row.rms), seconds_text(row.seconds)));
      report.numbers["best"].push_back(
          {{"radius_m", radius},
           {"method", name},
           {"setting", row.setting.name()},
           {"intensity_rms", row.rms},
           {"seconds", row.seconds}});
    }
  }
  report.blocks.emplace_back(std::move(best_of_each));
  report.blocks.emplace_back(std::move(table));
  const char* const colours[] = {"#d55e00", "#e69f00", "#0072b2", "#009e73"};
  for (const double radius : radii) {
    scene::Plot plot;
    plot.title = fmt::format(
        "Sphere of {}, {} deg, {:.0f} nm: error against time", millimetres(radius), compared.name(),
        wavelength_m * 1e9);
    plot.x_label = "wall time [s]";
    plot.y_label = "rms error of the sun-disc average [%]";
    plot.log_x = plot.log_y = true;
    plot.height = 460;
    double fastest = 1e9, slowest = 0;
    std::vector<std::string> methods;
    for (const Row& row : rows) {
      if (row.radius_m != radius) continue;
      fastest = std::min(fastest, row.seconds);
      slowest = std::max(slowest, row.seconds);
      if (std::ranges::find(methods, row.setting.method) == methods.end())
        methods.emplace_back(row.setting.method);
    }
    for (std::size_t m = 0; m < methods.size(); ++m) {
      scene::Curve marks;
      marks.label = methods[m];
      marks.colour = colours[m % std::size(colours)];
      marks.points = true;
      for (const Row& row : rows)
        if (row.radius_m == radius && row.setting.method == methods[m]) {
          marks.x.push_back(row.seconds);
          marks.y.push_back(100 * row.rms);
        }
      plot.curves.push_back(std::move(marks));
    }
    plot.x_range = {{fastest / 2, slowest * 2}};
    report.blocks.emplace_back(Figure{
        scene::draw(plot, scene::PictureFormat::svg),
        "One mark per setting of the table above. Lower and further left is better."});
  }

  report.numbers["drop"] = {
      {"shape", "beard-chuang"},
      {"radius_m", 0.5e-3},
      {"sun_elevation_deg", 20},
      {"rows", ordered_json::array()}};
  Table times{
      "Beard-Chuang drop of 0.5 mm, sun at 20 deg, averaged over the sun",
      {"method", "directions", "wavelengths", "error claimed", "time", "predicted", "error estimate's time"},
      {}};
  for (const DropRun& run : drops) {
    report.numbers["drop"]["rows"].push_back(
        {{"name", run.name},
         {"directions", run.directions},
         {"wavelengths", run.wavelengths},
         {"error_claimed", run.outcome.error},
         {"seconds", run.outcome.seconds},
         {"predicted_seconds", run.predicted_seconds},
         {"judging_seconds", run.outcome.judging_seconds}});
    times.rows.push_back(
        {run.name, fmt::format("{}", run.directions), fmt::format("{}", run.wavelengths),
         percent(run.outcome.error), seconds_text(run.outcome.seconds), seconds_text(run.predicted_seconds),
         seconds_text(run.outcome.judging_seconds)});
  }
  report.blocks.emplace_back(Heading{"A falling drop"});
  report.blocks.emplace_back(Paragraph{
      "Both bows of a deformed drop at all azimuths, and its whole table of 33 wavelengths. Nothing exact "
      "judges a drop: the error is the table's own <code>error_estimate</code>, and case <code>drops</code> "
      "says how far orders 2 and 3 agree with other methods. The bows with orders 0..3 are quick because "
      "these "
      "orders are right to about 1 % of their own peaks; the sum is worse by far, for the orders left out "
      "shine "
      "in Alexander's band. The whole sphere claims 100 % near 0 and 180 deg, where nothing is known."});
  report.blocks.emplace_back(std::move(times));
  if (!prices.empty()) {
    Table bought{
        "The same bows to a tolerance: what --tolerance chooses and predicts, not computed",
        {"tolerance", "orders", "predicted error", "predicted time"},
        {}};
    report.numbers["drop"]["tolerances"] = ordered_json::array();
    for (const Price& price : prices) {
      const bool reached = price.refusal.empty();
      bought.rows.push_back(
          {percent(price.tolerance), reached ? fmt::format("0..{}", price.orders.back()) : "out of reach",
           reached ? percent(price.expected.error) : price.refusal,
           reached ? seconds_text(price.expected.seconds) : ""});
      ordered_json entry{{"tolerance", price.tolerance}, {"reached", reached}};
      if (reached) {
        entry["last_order"] = price.orders.back();
        entry["predicted_error"] = price.expected.error;
        entry["predicted_seconds"] = price.expected.seconds;
      }
      report.numbers["drop"]["tolerances"].push_back(std::move(entry));
    }
    report.blocks.emplace_back(std::move(bought));
  }
  if (!settings.quick) {
    const DropRun &bows = drops[1], &whole = drops.back();
    report.checks.push_back(
        {"0.5 mm drop, 120..150 deg, all azimuths, one wavelength, orders 0..3: wall time",
         bows.outcome.seconds + bows.outcome.judging_seconds, 5, "s"});
    report.checks.push_back(
        {"the same: error claimed for the sum of all orders", 100 * bows.outcome.error, 1, "%"});
    report.checks.push_back(
        {"0.5 mm drop, whole sphere, 33 wavelengths, orders 0..3: wall time",
         whole.outcome.seconds + whole.outcome.judging_seconds, 300, "s"});
    std::string costs;
    for (const Price& price : prices)
      costs += price.refusal.empty() ? fmt::format(
                                           " {} takes orders 0..{}, predicted {}.", percent(price.tolerance),
                                           price.orders.back(), seconds_text(price.expected.seconds))
                                     : fmt::format(" {} is out of reach.", percent(price.tolerance));
    report.findings.push_back(fmt::format(
        "Both bows of a falling drop of 0.5 mm at all azimuths, orders 0..3 with the integral: {}, {} "
        "claimed "
        "for the sum of all orders.{}",
        seconds_text(bows.outcome.seconds + bows.outcome.judging_seconds), percent(bows.outcome.error),
        costs));
  }
  for (const double radius : {radii.front(), radii.back()}) {
    const auto text = [&](const char* method) {
      const Row& row = *best(radius, method);
      return fmt::format("{} in {}", percent(row.rms), seconds_text(row.seconds));
    };
    report.findings.push_back(fmt::format(
        "Both bows of a sphere of {} (120 to 150 deg, averaged over the sun), best setting of each method: "
        "patches {}, with the Gaussian filter {}, the integral {}, Lorenz-Mie {}.",
        millimetres(radius), text("patches"), text("patches and Gaussian filter"), text("integral"),
        text("Lorenz-Mie")));
    if (radii.size() == 1) break;
  }
  return report;
}

} // namespace scatter::validation
