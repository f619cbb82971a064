#include "bow_peaks.hpp"
#include "cases.hpp"
#include <scatter/exact/cylinder.hpp>
#include <scatter/exact/debye.hpp>
#include <scatter/exact/mie.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/scene/plot.hpp>

#include <embedded/accuracy_peers.hpp>
#include <embedded/validation_exact_truth.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <complex>
#include <initializer_list>
#include <limits>
#include <optional>
#include <sstream>
#include <tuple>
#include <utility>

namespace scatter::validation {

namespace {

using complex = std::complex<double>;
using nlohmann::json;
using nlohmann::ordered_json;

/// Errors against arbitrary precision: of efficiencies relative, of amplitudes relative to what the header of
/// the theory says.
struct Row {
  std::string theory, name;
  double x = 0;
  complex index;
  std::optional<double> tilt_deg;
  std::size_t angles = 0;
  std::vector<int> orders{};
  std::optional<double> efficiencies, g; ///< errors
  double amplitudes = 0;                 ///< error
  double estimate = 0;                   ///< error estimate that came with the worst amplitude
  double over_estimate = 0; ///< largest error over its own estimate, efficiencies and Qback included
  double seconds = 0;
  /// What the headers promise; without for what lies beyond their domain.
  std::optional<double> efficiencies_bound{}, amplitudes_bound{};

  /// Of efficiencies and g.
  [[nodiscard]] std::optional<double> totals() const {
    return efficiencies && g ? std::max(*efficiencies, *g) : efficiencies;
  }
  [[nodiscard]] bool holds() const {
    return over_estimate <= 1 && (!efficiencies_bound || *totals() <= *efficiencies_bound) &&
           (!amplitudes_bound || amplitudes <= *amplitudes_bound);
  }
};

complex as_complex(const json& pair) {
  return {pair[0].get<double>(), pair[1].get<double>()};
}

/// A term that is 0 in truth must be 0.
double relative_error(double value, double truth) {
  return truth == 0 ? std::abs(value) : std::abs(value / truth - 1);
}

/// NaN must not pass for a small error.
double larger(double a, double b) {
  return std::isnan(a) || std::isnan(b) ? std::numeric_limits<double>::infinity() : std::max(a, b);
}

/// The result and the wall time of the fastest of as many calls as fit into 20 ms, at least one.
template <typename Call>
auto timed(double& seconds, Call&& call) {
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  auto result = call();
  seconds = std::chrono::duration<double>(Clock::now() - start).count();
  while (std::chrono::duration<double>(Clock::now() - start).count() + seconds < 0.02) {
    const auto again = Clock::now();
    result = call();
    seconds = std::min(seconds, std::chrono::duration<double>(Clock::now() - again).count());
  }
  return result;
}

Row row_of(const char* theory, const json& truth) {
  Row row;
  row.theory = theory;
  row.name = truth["name"];
  row.x = truth["x"];
  row.index = as_complex(truth["m"]);
  row.angles = truth["theta_deg"].size();
  return row;
}

/// Largest error of S1 and S2 over the angles, relative to the larger of both and `floor` of the whole's.
template <typename Amplitudes>
double error_of(const Amplitudes& found, const json& truth, const json& whole, double floor) {
  double worst = 0;
  for (std::size_t i = 0; i < truth["S1"].size(); ++i) {
    const auto size = [i](const json& one) {
      return std::max(std::abs(as_complex(one["S1"][i])), std::abs(as_complex(one["S2"][i])));
    };
    const double scale = std::max(size(truth), floor * size(whole));
    for (const double error :
         {std::abs(found.S1[i] - as_complex(truth["S1"][i])),
          std::abs(found.S2[i] - as_complex(truth["S2"][i]))})
      worst = larger(worst, error / scale);
  }
  return worst;
}

Row run_sphere_row(const json& truth, int threads) {
  Row row = row_of("sphere", truth);
  const std::vector<double> angles = truth["theta_deg"];
  const exact::MieResult found =
      timed(row.seconds, [&] { return exact::mie_at_degrees(row.x, row.index, angles, threads); });
  double efficiencies = 0;
  for (const auto& [value, key] : {std::pair{found.Qext, "Qext"}, {found.Qsca, "Qsca"}, {found.Qabs, "Qabs"}})
    efficiencies = larger(efficiencies, relative_error(value, truth[key]));
  row.efficiencies = efficiencies;
  row.g = relative_error(found.g, truth["g"]);
  row.amplitudes = error_of(found, truth, truth, 0);
  row.estimate = found.error_estimate;
  row.over_estimate = larger(efficiencies, row.amplitudes) / found.error_estimate;
  row.over_estimate =
      larger(row.over_estimate, relative_error(found.Qback, truth["Qback"]) / found.Qback_error_estimate);
  if (row.x <= exact::mie_validated_size_parameter) {
    row.efficiencies_bound = 1e-13;
    row.amplitudes_bound = row.x <= 5000 ? 1e-12 : 1e-11;
  }
  return row;
}

Row run_debye_row(const json& truth, int threads) {
  Row row = row_of("Debye series", truth);
  const std::vector<double> angles = truth["theta_deg"];
  for (const json& order : truth["orders"]) row.orders.push_back(order["p"]);
  const exact::DebyeResult found = timed(
      row.seconds, [&] { return exact::debye_at_degrees(row.x, row.index, row.orders, angles, threads); });
  const auto add = [&](const exact::DebyeTerm& term, const json& expected) {
    const double error = error_of(term, expected, truth, 1e-12);
    if (error >= row.amplitudes) {
      row.amplitudes = error;
      row.estimate = term.error_estimate;
    }
    row.over_estimate = larger(row.over_estimate, error / term.error_estimate);
  };
  for (std::size_t i = 0; i < row.orders.size(); ++i) add(found.orders[i], truth["orders"][i]);
  add(found.remainder, truth["remainder"]);
  add(found.whole, truth);
  row.amplitudes_bound = 1e-10; // exact/debye.hpp
  return row;
}

/// Largest error of T1..T4 over the angles, relative to the largest of them at the same angle or, for an
/// order, at any angle.
double error_of(const exact::CylinderAmplitudes& found, const json& truth, bool same_angle) {
  const std::pair<const std::vector<complex>*, const char*> parts[] = {
      {&found.T1, "T1"}, {&found.T2, "T2"}, {&found.T3, "T3"}, {&found.T4, "T4"}};
  std::vector<double> errors, sizes;
  for (std::size_t i = 0; i < truth["T1"].size(); ++i) {
    double error = 0, size = 0;
    for (const auto& [values, key] : parts) {
      const complex expected = as_complex(truth[key][i]);
      error = larger(error, std::abs((*values)[i] - expected));
      size = std::max(size, std::abs(expected));
    }
    errors.push_back(error);
    sizes.push_back(size);
  }
  const double largest = *std::ranges::max_element(sizes);
  double worst = 0;
  for (std::size_t i = 0; i < errors.size(); ++i)
    worst = larger(worst, errors[i] / (same_angle ? sizes[i] : largest));
  return worst;
}

Row run_cylinder_row(const json& truth) {
  Row row = row_of("cylinder", truth);
  row.tilt_deg = truth["tilt_deg"].get<double>();
  const std::vector<double> angles = truth["theta_deg"];
  if (truth.contains("orders"))
    for (const json& order : truth["orders"]) row.orders.push_back(order["p"]);
  const exact::CylinderResult found = timed(row.seconds, [&] {
    return exact::cylinder_at_degrees(row.x, row.index, *row.tilt_deg, angles, row.orders);
  });
  double efficiencies = 0;
  for (const auto& [value, key] :
       {std::pair{found.Qext, "Qext"}, {found.Qsca, "Qsca"}, {found.Qabs, "Qabs"}}) {
    efficiencies = larger(efficiencies, relative_error(value.I, truth[key]["I"]));
    efficiencies = larger(efficiencies, relative_error(value.II, truth[key]["II"]));
  }
  row.efficiencies = efficiencies;
  row.amplitudes = error_of(found.amplitudes, truth, true);
  row.estimate = found.error_estimate;
  row.over_estimate = larger(efficiencies, row.amplitudes) / found.error_estimate;
  for (std::size_t i = 0; i < row.orders.size(); ++i) {
    const double error = error_of(found.orders[i].amplitudes, truth["orders"][i], false);
    row.over_estimate = larger(row.over_estimate, error / found.orders[i].error_estimate);
    if (error > row.amplitudes) {
      row.amplitudes = error;
      row.estimate = found.orders[i].error_estimate;
    }
  }
  row.efficiencies_bound = 1e-15; // exact/cylinder.hpp
  row.amplitudes_bound = row.name == "beside a narrow resonance" ? 5e-14
                         : std::abs(row.index - 1.0) < 1e-3      ? 5e-12
                                                                 : 5e-15;
  return row;
}

/// What validation/peers/run measured last: public codes beside this one. Not measured again here.
void add_peers(CaseReport& report) {
  std::istringstream text{std::string(embedded::accuracy_peers)};
  std::vector<std::string> remarks;
  Table table{"Public Mie codes beside this one", {}, {}};
  for (std::string line; std::getline(text, line);) {
    if (line.empty()) continue;
    if (line.starts_with("# ")) {
      remarks.push_back(line.substr(2));
      continue;
    }
    std::vector<std::string> cells;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, ';');) cells.push_back(cell);
    if (table.columns.empty()) {
      table.columns = std::move(cells);
    } else {
      cells.resize(table.columns.size());
      table.rows.push_back(std::move(cells));
    }
  }
  report.blocks.emplace_back(Heading{"Other Mie codes"});
  for (const std::string& remark : remarks) report.blocks.emplace_back(Paragraph{escape(remark)});
  report.blocks.emplace_back(std::move(table));
}

std::string index_text(complex index) {
  return index.imag() == 0 ? fmt::format("{:.6g}", index.real())
                           : fmt::format("{:.6g} + {:.3g}i", index.real(), index.imag());
}

std::string error_text(const std::optional<double>& error) {
  return !error ? "" : *error == 0 ? "0" : fmt::format("{:.1e}", *error);
}

std::string time_text(double seconds) {
  return seconds < 1e-3 ? fmt::format("{:.1f} us", seconds * 1e6)
         : seconds < 1  ? fmt::format("{:.2f} ms", seconds * 1e3)
                        : fmt::format("{:.2f} s", seconds);
}

std::string orders_text(const std::vector<int>& orders) {
  return fmt::format("{}", fmt::join(orders, ","));
}

void add_bodies(CaseReport& report, const std::vector<Row>& rows) {
  report.numbers["bodies"] = ordered_json::array();
  for (const Row& row : rows) {
    ordered_json entry{
        {"theory", row.theory},
        {"name", row.name},
        {"x", row.x},
        {"m", {row.index.real(), row.index.imag()}}};
    if (row.tilt_deg) entry["tilt_deg"] = *row.tilt_deg;
    if (!row.orders.empty()) entry["orders"] = row.orders;
    entry["angles"] = row.angles;
    if (row.efficiencies) entry["efficiencies_error"] = *row.efficiencies;
    if (row.g) entry["g_error"] = *row.g;
    entry.update(
        {{"amplitudes_error", row.amplitudes},
         {"error_estimate", row.estimate},
         {"largest_error_over_estimate", row.over_estimate},
         {"seconds", row.seconds}});
    if (row.amplitudes_bound) entry["amplitudes_bound"] = *row.amplitudes_bound;
    report.numbers["bodies"].push_back(std::move(entry));

    const std::string what = row.theory + ", " + row.name;
    if (row.efficiencies_bound)
      report.checks.push_back(
          {what + (row.g ? ": efficiencies and g" : ": efficiencies"), *row.totals(), *row.efficiencies_bound,
           ""});
    if (row.amplitudes_bound)
      report.checks.push_back({what + ": amplitudes", row.amplitudes, *row.amplitudes_bound, ""});
    report.checks.push_back({what + ": error over estimate", row.over_estimate, 1, ""});
  }

  Table spheres{
      "Spheres (Lorenz-Mie): errors of Q and g, and of S",
      {"sphere", "x", "m", "Q, g", "S", "estimate", "bound", "holds", "time"},
      {}};
  Table debye{
      "Debye series of spheres: error of S, the worst of the orders, the remainder and the whole",
      {"sphere", "x", "m", "orders p", "S", "estimate", "bound", "holds", "time"},
      {}};
  Table cylinders{
      "Infinite cylinders: errors of Q and T",
      {"cylinder", "x", "m", "tilt", "Q", "T", "estimate", "bound", "holds", "time"},
      {}};
  for (const Row& row : rows) {
    const std::string with_orders =
        row.tilt_deg && !row.orders.empty() ? " (and p = " + orders_text(row.orders) + ")" : "";
    std::vector<std::string> cells{
        row.name + with_orders, fmt::format("{:.6g}", row.x), index_text(row.index)};
    const auto add = [&](std::initializer_list<std::string> more) { cells.insert(cells.end(), more); };
    if (row.theory == "sphere")
      add({error_text(row.totals())});
    else if (row.tilt_deg)
      add({fmt::format("{:.8g}", *row.tilt_deg), error_text(row.efficiencies)});
    else
      add({orders_text(row.orders)});
    add(
        {error_text(row.amplitudes), error_text(row.estimate),
         row.amplitudes_bound ? fmt::format("{:.0e}", *row.amplitudes_bound) : "-",
         row.holds() ? "yes" : "NO", time_text(row.seconds)});
    (row.theory == "sphere" ? spheres : row.tilt_deg ? cylinders : debye).rows.push_back(std::move(cells));
  }
  report.blocks.emplace_back(Heading{"Hard cases"});
  report.blocks.emplace_back(Paragraph{
      "Bodies of the kinds that make codes lose digits: tiny x, x at a multiple of pi, hardly any "
      "absorption and metals, an index next to 1 and below it, the narrow resonance of b<sub>68</sub> at x "
      "= 49.9386, the poles, x = 50,000; cylinders on and beside resonances of widths down to 3e-13, at "
      "tilts to 89.5 deg and at their critical tilt. The "
      "truth is the textbook's formulas (for cylinders Maxwell's boundary conditions) with 50 digits and "
      "more. Errors of Q are relative, those of S and T are relative to the largest amplitude at the same "
      "angle (of a cylinder's orders: at any angle), the worst of all angles. The estimate is what the "
      "library returns with the result, the bound is what its header promises of S and T (1e-13 for Q and g"
      " of spheres, 1e-15 for Q of cylinders); <b>holds</b> also asks that the estimate is not below the "
      "error. x = 94,248 is beyond the documented domain: there only the estimate is held to something. "
      "Q<sub>back</sub> loses digits where its partial waves cancel: it is held to an estimate of its own. "
      "Tilts are in degrees; the time is that of one call for 10 to 19 angles."});
  report.blocks.emplace_back(std::move(spheres));
  report.blocks.emplace_back(std::move(debye));
  report.blocks.emplace_back(std::move(cylinders));

  scene::Plot plot{
      .title = "Errors of amplitudes and their estimates",
      .x_label = "log10 of the size parameter x",
      .y_label = "relative error"};
  plot.log_y = true;
  plot.y_range = {{3e-18, 1e-7}};
  plot.x_range = {{-6.3, 5.3}};
  plot.height = 560;
  constexpr double smallest = 1e-17;
  for (const auto& [theory, colour] :
       {std::pair{"sphere", "#0072B2"}, {"Debye series", "#009E73"}, {"cylinder", "#D55E00"}})
    for (const bool estimate : {false, true}) {
      scene::Curve curve{.label = std::string(theory) + (estimate ? ", estimate" : ", error")};
      curve.colour = colour;
      curve.points = true;
      curve.dashed = estimate;
      for (const Row& row : rows)
        if (row.theory == theory) {
          curve.x.push_back(std::log10(row.x));
          curve.y.push_back(std::max(estimate ? row.estimate : row.amplitudes, smallest));
        }
      plot.curves.push_back(std::move(curve));
    }
  report.blocks.emplace_back(Figure{
      scene::draw(plot, scene::PictureFormat::svg),
      "A full mark for every body's error, an open one for the estimate that came with it; errors below "
      "1e-17 "
      "are drawn there. The high ones are indices next to 1, whose partial waves cancel near 180 deg, and "
      "spheres on a narrow resonance, where the last digit of x moves the result."});

  std::vector<double> ratios; // of estimate to error; rounding of the truth itself hides smaller errors
  for (const Row& row : rows) ratios.push_back(row.estimate / std::max(row.amplitudes, 1e-16));
  std::ranges::sort(ratios);
  const double worst = std::ranges::max_element(rows, {}, &Row::over_estimate)->over_estimate;
  report.numbers["estimate_over_error"] = {
      {"median", ratios[ratios.size() / 2]}, {"largest", ratios.back()}, {"smallest", 1 / worst}};
  const auto count = [&](const char* theory) { return std::ranges::count(rows, theory, &Row::theory); };
  std::size_t below = 0, held = 0;
  for (const Row& row : rows) {
    below += row.over_estimate <= 1 ? 1 : 0;
    held += row.holds() ? 1 : 0;
  }
  report.findings.push_back(fmt::format(
      "At {} hard spheres, {} Debye series and {} cylinders the exact references keep what their headers "
      "promise "
      "in {} of {}; the error estimate is not below the error in {}, the median is {:.0f} times the error, "
      "the most {:.0f} times.",
      count("sphere"), count("Debye series"), count("cylinder"), held, rows.size(), below,
      ratios[ratios.size() / 2], ratios.back()));
}

/// Maxima of perpendicular light, n = 1.333; the last digit printed is what they are held to.
struct PublishedMaxima {
  double x;
  int p;
  std::vector<std::pair<double, int>> maxima_deg; ///< value and decimals
};

void add_bows(CaseReport& report, const Settings& settings, const Progress& progress) {
  constexpr double index = 1.333;
  const std::vector<PublishedMaxima> published{
      {1000, 2, {{138.899, 3}, {141.049, 3}, {142.546, 3}}},
      {1000, 3, {{127.493, 3}, {123.607, 3}}},
      {5000, 2, {{138.2595, 4}, {138.999, 3}, {139.518, 3}}},
      {5000, 3, {{128.520, 3}, {127.191, 3}}},
  };
  // Half a unit of the last digit, and a hundredth for a tie.
  const auto half_unit = [](int decimals) { return 0.505 * std::pow(10, -decimals); };

  report.blocks.emplace_back(Heading{"Bows and supernumeraries"});
  // Published constants of Airy's theory: the geometric bow, its curvature h, zeros of Ai'.
  struct Constant {
    std::string name;
    double published, found, bound;
    int decimals;
    const char* unit;
  };
  std::vector<Constant> constants;
  for (const auto& [p, bow, h, h_decimals] : {std::tuple{2, 137.9219, 4.8992, 4}, {3, 129.1092, 27.910, 3}}) {
    constants.push_back(
        {fmt::format("geometric bow, p = {}", p), bow, geometric_bow_deg(index, p), half_unit(4), 4, "deg"});
    constants.push_back(
        {fmt::format("h, p = {}", p), h, bow_curvature(index, p), half_unit(h_decimals), h_decimals, ""});
  }
  const double published_z[] = {1.018793, 3.248198, 4.820099};
  for (const int k : {1, 2, 3})
    constants.push_back({fmt::format("z_{}", k), published_z[k - 1], airy_maximum(k), half_unit(6), 6, ""});
  Table constants_table{
      "Airy's theory, n = 1.333: maxima at theta_bow + z_k h^(1/3) x^(-2/3)",
      {"constant", "published", "computed", "difference"},
      {}};
  report.numbers["airy"] = {{"index", index}, {"constants", ordered_json::array()}};
  for (const Constant& one : constants) {
    constants_table.rows.push_back(
        {one.name, fmt::format("{:.{}f}", one.published, one.decimals),
         fmt::format("{:.{}f}", one.found, one.decimals + 2),
         fmt::format("{:+.1e} {}", one.found - one.published, one.unit)});
    report.numbers["airy"]["constants"].push_back(
        {{"name", one.name}, {"published", one.published}, {"computed", one.found}});
    report.checks.push_back({"Airy: " + one.name, std::abs(one.found - one.published), one.bound, one.unit});
  }
  report.blocks.emplace_back(Paragraph{
      "Airy's theory puts the bow and its supernumeraries at the zeros z_k of Ai', on a scale that the "
      "curvature h of the deflection and x set. The Debye series knows no such approximation: with growing "
      "x its maxima move towards Airy's as x^(-2/3). The column <i>x to infinity</i> takes that away, and "
      "the next power, with the three largest x; what is left is of order x^(-2)."});
  report.blocks.emplace_back(std::move(constants_table));

  Table peaks{
      "Maxima of the Debye terms, perpendicular polarisation, n = 1.333",
      {"x", "order p", "maximum", "published", "Debye series", "difference", "Airy"},
      {}};
  report.numbers["debye_peaks"] = ordered_json::array();
  std::vector<double> sizes{1000, 5000, 20000};
  if (!settings.quick) sizes.push_back(50000);
  // theta of every x, p and k.
  std::vector<std::vector<std::vector<double>>> maxima;
  double worst = 0;
  std::size_t count = 0;
  for (const double x : sizes) {
    maxima.emplace_back();
    for (const int p : {2, 3}) {
      maxima.back().push_back(debye_maxima_deg(x, index, p, 3, settings.threads));
      const auto& found = maxima.back().back();
      const auto one =
          std::ranges::find_if(published, [&](const auto& row) { return row.x == x && row.p == p; });
      for (std::size_t k = 0; one != published.end() && k < one->maxima_deg.size(); ++k) {
        const auto& [theta, decimals] = one->maxima_deg[k];
        const double difference = found[k] - theta;
        const double airy = geometric_bow_deg(index, p) + (p == 2 ? 1 : -1) *
                                                              airy_maximum(static_cast<int>(k) + 1) *
                                                              std::cbrt(bow_curvature(index, p)) *
                                                              std::pow(x, -2.0 / 3) / radians_per_degree;
        worst = std::max(worst, std::abs(difference));
        ++count;
        peaks.rows.push_back(
            {fmt::format("{}", x), fmt::format("{}", p), fmt::format("{}", k + 1),
             fmt::format("{:.{}f}", theta, decimals), fmt::format("{:.5f}", found[k]),
             fmt::format("{:+.5f} deg", difference), fmt::format("{:.3f}", airy)});
        report.numbers["debye_peaks"].push_back(
            {{"x", x},
             {"p", p},
             {"k", k + 1},
             {"published_deg", theta},
             {"debye_deg", found[k]},
             {"difference_deg", difference},
             {"airy_deg", airy}});
        report.checks.push_back(
            {fmt::format("Debye series, x = {}, p = {}, maximum {}", x, p, k + 1), std::abs(difference),
             half_unit(decimals), "deg"});
      }
    }
    progress(static_cast<double>(maxima.size()) / static_cast<double>(sizes.size()));
  }
  report.blocks.emplace_back(std::move(peaks));

  Table limits{"Maxima of the Debye terms on Airy's scale, z = (theta - theta_bow) h^(-1/3) x^(2/3)", {}, {}};
  limits.columns = {"order p, maximum"};
  for (const double x : sizes) limits.columns.push_back(fmt::format("x = {}", x));
  limits.columns.insert(limits.columns.end(), {"x to infinity", "Airy", "relative difference"});
  report.numbers["airy"]["limits"] = ordered_json::array();
  double farthest = 0;
  for (const int p : {2, 3})
    for (const std::size_t k : {0, 1, 2}) {
      std::vector<double> z;
      for (std::size_t i = 0; i < sizes.size(); ++i)
        z.push_back(
            std::abs(maxima[i][static_cast<std::size_t>(p - 2)][k] - geometric_bow_deg(index, p)) *
            radians_per_degree / std::cbrt(bow_curvature(index, p)) * std::pow(sizes[i], 2.0 / 3));
      // The parabola in x^(-2/3) through the three largest x, at 0 (Lagrange).
      double limit = 0;
      const std::size_t from = sizes.size() - 3;
      for (std::size_t i = from; i < sizes.size(); ++i) {
        double weight = 1;
        for (std::size_t j = from; j < sizes.size(); ++j)
          if (j != i) {
            const double here = std::pow(sizes[i], -2.0 / 3), there = std::pow(sizes[j], -2.0 / 3);
            weight *= there / (there - here);
          }
        limit += weight * z[i];
      }
      const double difference = limit / published_z[k] - 1;
      farthest = std::max(farthest, std::abs(difference));
      std::vector<std::string> cells{fmt::format("p = {}, maximum {}", p, k + 1)};
      for (const double value : z) cells.push_back(fmt::format("{:.5f}", value));
      cells.insert(
          cells.end(), {fmt::format("{:.5f}", limit), fmt::format("{:.6f}", published_z[k]),
                        fmt::format("{:+.1e}", difference)});
      limits.rows.push_back(std::move(cells));
      report.numbers["airy"]["limits"].push_back(
          {{"p", p}, {"k", k + 1}, {"x", sizes}, {"z", z}, {"limit", limit}, {"airy", published_z[k]}});
      report.checks.push_back(
          {fmt::format("Airy's limit of the Debye series, p = {}, maximum {}", p, k + 1),
           std::abs(difference), 1e-3, ""});
    }
  report.blocks.emplace_back(std::move(limits));
  report.findings.push_back(fmt::format(
      "The Debye series meets {} published maxima of bows and supernumeraries to {:.1e} deg, and Airy's six "
      "in "
      "the limit of large drops to {:.1e} of their distance from the bow.",
      count, worst, farthest));
}

} // namespace

CaseReport run_exact(const Settings& settings, const Progress& progress) {
  CaseReport report;
  report.name = "exact";
  report.title = "The exact references at their hard cases";
  const json truth = json::parse(embedded::validation_exact_truth);
  std::size_t count = 0, done = 0;
  for (const json& list : truth) count += list.size();
  const double share = 0.7; // of the time
  const auto step = [&] { progress(share * static_cast<double>(++done) / static_cast<double>(count)); };
  std::vector<Row> rows;
  for (const json& one : truth.at("sphere")) {
    rows.push_back(run_sphere_row(one, settings.threads));
    step();
  }
  for (const json& one : truth.at("debye")) {
    rows.push_back(run_debye_row(one, settings.threads));
    step();
  }
  for (const json& one : truth.at("cylinder")) {
    rows.push_back(run_cylinder_row(one));
    step();
  }
  report.numbers["truth"] = "validation/data/exact_truth.json, made by make_exact_truth.py beside it";
  add_bodies(report, rows);
  add_peers(report);
  add_bows(report, settings, [&](double part) { progress(share + (1 - share) * part); });
  return report;
}

} // namespace scatter::validation
