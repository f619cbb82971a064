#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/planner.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <thread>

namespace scatter::phase {
namespace {

/// Core seconds, from user times of the program: orders, wavelengths and sizes (0.1 to 1 mm) one by one and
/// together; those of the integral count half more, for its cores wait for each other.
/// `scatter validate --case pareto` sets what comes of it beside what was achieved.
namespace cost {
constexpr double ray = 8e-8;    ///< per ray and order, with its patch
constexpr double hit = 3e-8;    ///< per direction and order
constexpr double window = 0.03; ///< of the integral, at x = 5000, times the order to the power of 2.5
/// Of the integral along lines of constant azimuth, for any size, and more at x = 5000.
struct Rings {
  double any, more;
};
constexpr Rings of_sphere{0.15, 0.04}, of_drop{0.2, 0.2};
constexpr double column = 0.006; ///< the same per azimuth at x = 5000
constexpr double integral = 0.2; ///< once per request
constexpr double shadow = 4e-7;  ///< order 0 of the integral, per direction
constexpr double filter = 0.3;   ///< per wavelength of a drop; a sphere's is one column
constexpr double least = 0.01;   ///< per wavelength, whatever is asked for
} // namespace cost
/// Wall time of a process's first request: device, kernels out of the driver's cache, tables.
constexpr double starting_seconds = 0.1;

/// Columns that are computed: mirror images and what is axisymmetric share one.
double distinct_columns(const Request& request) {
  if (request.shape.is_sphere() || request.sun_elevation_deg == 90) return 1;
  std::set<double> folded;
  for (const double phi : request.phi_deg) folded.insert(std::abs(std::remainder(phi, 360)));
  return static_cast<double>(folded.size());
}

/// Windows of 12 deg that the integral takes for one order, bows and grazing rays being in about a third of
/// all directions.
double windows(const Request& request, double columns) {
  const double first = request.theta_deg.front(), last = request.theta_deg.back();
  // Each azimuth costs its own as far as it was measured (15 of them); more than these are taken to share.
  const double half_a_turn = 40 * std::sin(0.5 * (first + last) * radians_per_degree) + 1;
  const double across = std::min(columns, half_a_turn);
  return std::max(1.0, ((last - first) / 12 + 1) / (last - first > 60 ? 3 : 1.5)) * across;
}

/// Orders up to this one are mostly summed along lines of constant azimuth; those of flat drops fold in
/// azimuth, too.
double last_order_by_columns(const Request& request) {
  const double flattening = std::abs(1 - request.shape.axis_ratio());
  return flattening < 1e-9 ? 1e9 : std::max(0.04 / flattening, flattening < 0.06 ? 2.0 : 0.0);
}

/// Whether the order's bow or grazing rays lie within the angles asked for, as on the sphere, give or take
/// what the drop is flat by.
bool has_caustic(const Request& request, int order, double mean_m) {
  const double n = refractive_index(request.index, mean_m).real();
  const double margin = 6 + 100 * order * std::abs(1 - request.shape.axis_ratio());
  const auto asked = [&](double cos_incidence) {
    const double alpha = std::acos(cos_incidence), beta = std::asin(std::sin(alpha) / n);
    const double deflection = pi * (order - 1) + 2 * (alpha - order * beta);
    const double theta = std::acos(std::cos(deflection)) / radians_per_degree;
    return theta > request.theta_deg.front() - margin && theta < request.theta_deg.back() + margin;
  };
  const double cos2 = order > 1 ? (n * n - 1) / (order * order - 1.0) : 1.0;
  return asked(0) || (cos2 < 1 && asked(std::sqrt(cos2)));
}

std::string orders_text(const std::vector<int>& orders) {
  return orders.size() > 1 && orders.back() - orders.front() + 1 == static_cast<int>(orders.size())
             ? fmt::format("{}..{}", orders.front(), orders.back())
             : fmt::format("{}", fmt::join(orders, ","));
}

std::string settings_text(const Request& request) {
  const char* filter = request.diffraction == Diffraction::integral   ? "integral"
                       : request.diffraction == Diffraction::gaussian ? "gaussian"
                                                                      : "none";
  return fmt::format(
      "--diffraction {} --orders {} --rays {}", filter, orders_text(request.orders), request.rays);
}

} // namespace

bool integral_fits(const Request& request) {
  const double longest_m = std::ranges::max(request.wavelength_m);
  return request.orders.front() > 0 ||
         2 * pi * request.shape.radius_m / longest_m >= wavefront::smallest_size_with_shadow;
}

namespace {

/// All of a prediction but the error.
Prediction time_of(const Request& request) {
  const double columns = distinct_columns(request), rows = static_cast<double>(request.theta_deg.size());
  const double orders = request.orders.back() + 1,
               wavelengths = static_cast<double>(request.wavelength_m.size());
  const double mean_m =
      std::accumulate(request.wavelength_m.begin(), request.wavelength_m.end(), 0.0) / wavelengths;
  const double x = 2 * pi * request.shape.radius_m / mean_m;
  const bool axisymmetric = request.sun_elevation_deg == 90 || request.shape.is_sphere();
  const double half = axisymmetric ? 0.1 : 0.5;
  const double once = request.diffraction == Diffraction::integral ? cost::integral : 0;
  double each = cost::ray * half * request.rays * request.rays * orders +
                cost::hit * rows * columns * static_cast<double>(request.orders.size());
  each += cost::least;
  if (request.diffraction == Diffraction::gaussian && !axisymmetric) each += cost::filter;
  const cost::Rings& rings = axisymmetric ? cost::of_sphere : cost::of_drop;
  if (request.diffraction == Diffraction::integral)
    for (const int order : request.orders) {
      if (order == 0 || !has_caustic(request, order, mean_m)) continue;
      each += order <= last_order_by_columns(request)
                  ? rings.any + (x / 5000) * (rings.more + cost::column * columns)
                  : (x / 5000) * cost::window * std::pow(order, 2.5) * windows(request, columns);
    }
  if (request.diffraction == Diffraction::integral && request.orders.front() == 0)
    each += cost::shadow * rows * columns;
  const unsigned all = std::max(1U, std::thread::hardware_concurrency());
  const double cores = request.threads > 0 ? std::min<double>(request.threads, all) : all;
  Prediction made;
  made.seconds = (once + each * wavelengths) / cores;
  made.starting_seconds = starting_seconds;
  return made;
}

} // namespace

Prediction predict(const Request& request, RequestErrors& errors) {
  Prediction made = time_of(request);
  made.error = errors.sampled(request.diffraction, request.rays, request.orders);
  made.judging_seconds = errors.seconds();
  made.judging_seconds_to_come = errors.seconds_to_come();
  return made;
}

namespace {

struct Candidate {
  Request request;
  Prediction expected; ///< its error: guessed, or found by trial
  bool tried = false;
};

/// All open settings with orders up to the highest, cheapest first.
std::vector<Candidate> candidates(const Request& request, RequestErrors& errors, int highest) {
  if (!request.open.orders) highest = request.orders.back();
  std::vector<Diffraction> filters{request.diffraction};
  if (request.open.diffraction) {
    filters = {Diffraction::gaussian};
    if (request.interference && request.focal_lines == FocalLines::exact && integral_fits(request))
      filters.push_back(Diffraction::integral);
  }
  std::vector<std::vector<int>> selections{request.orders};
  if (request.open.orders) {
    selections.clear();
    for (const int last : {1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 30}) {
      if (last > highest) break;
      std::vector<int>& orders = selections.emplace_back(last + 1);
      std::iota(orders.begin(), orders.end(), 0);
    }
  }
  std::vector<int> grids{request.rays};
  if (request.open.rays) grids = {300, 500, 1000, 2000, 4000};
  std::vector<Candidate> all;
  for (const Diffraction filter : filters)
    for (const auto& orders : selections) {
      // One filter serves all orders: as wide as the highest needs, it blurs the bows of the low ones.
      if (filter == Diffraction::gaussian && orders.back() > 3 && request.open.diffraction) continue;
      for (const int rays : grids) {
        Candidate c{request, {}, false};
        c.request.diffraction = filter;
        c.request.orders = orders;
        c.request.rays = rays;
        c.expected = time_of(c.request);
        c.expected.error = errors.guess(filter, rays, orders, highest);
        all.push_back(std::move(c));
      }
    }
  std::ranges::stable_sort(
      all, {}, [](const Candidate& c) { return std::pair(c.expected.seconds, c.expected.error); });
  return all;
}

/// What to do about a tolerance that nothing reaches, beside asking for less.
std::string what_bars_better(const Request& request) {
  if (request.open.diffraction) {
    if (!request.interference) return ", or drop --no-interference, which bars the integral";
    if (request.focal_lines != FocalLines::exact) return ", or drop --focal-lines, which bars the integral";
    if (!integral_fits(request)) return "; the drop is too small for the integral";
  } else if (request.diffraction != Diffraction::integral) {
    return ", or drop --diffraction, which bars the integral";
  }
  if (!request.open.orders) return ", or drop --orders, and more can be chosen";
  // The regions of tables/accuracy end there.
  if (request.theta_deg.front() < 20 || request.theta_deg.back() > 165)
    return ", or leave out directions near 0 and 180deg";
  return "";
}

std::vector<Candidate>::iterator
most_accurate(std::vector<Candidate>& all, std::optional<Diffraction> filter = {}) {
  return std::ranges::min_element(all, {}, [&](const Candidate& c) {
    return filter && c.request.diffraction != *filter ? 1e300 : c.expected.error;
  });
}

} // namespace

Choice choose_settings(const Request& request, RequestErrors& errors) {
  constexpr int most_trials = 12;
  std::vector<Candidate> all;
  auto found = all.end();
  int trials = 0;
  // A trial corrects what was guessed of its filter. True: it is good enough.
  const auto is_good = [&](Candidate& c) {
    const double guessed = c.expected.error;
    c.expected = predict(c.request, errors);
    c.tried = true;
    ++trials;
    for (Candidate& other : all)
      if (!other.tried && other.request.diffraction == c.request.diffraction)
        other.expected.error *= c.expected.error / guessed;
    return c.expected.error <= request.tolerance;
  };
  // Few orders first: to guess at many takes seconds.
  for (const int highest : {8, 30}) {
    all = candidates(request, errors, highest);
    found = all.end();
    trials = 0;
    while (trials < most_trials) {
      // The cheapest that may do, or else the most accurate.
      auto next = std::find_if(all.begin(), found, [&](const Candidate& c) {
        return !c.tried && c.expected.error <= request.tolerance;
      });
      if (next == found) {
        if (found != all.end()) break;
        next = most_accurate(all);
        if (next->tried) break;
      }
      if (is_good(*next)) found = next;
    }
    if (found != all.end() || !request.open.orders) break;
  }
  if (found == all.end()) {
    const Candidate& best = *std::ranges::min_element(
        all, {}, [](const Candidate& c) { return c.tried ? c.expected.error : 1e300; });
    throw InputError(fmt::format(
        "--tolerance: {:.3g} % is out of reach for these directions; the best is {:.2g} % with {}: ask for "
        "that{}",
        100 * request.tolerance, 100 * best.expected.error, settings_text(best.request),
        what_bars_better(request)));
  }
  Choice choice{found->request, found->expected, {}};
  std::string& text = choice.explanation;
  const auto line = [&](const Candidate& c, const char* verdict) {
    text += fmt::format(
        "{:9.3g} % {:9.3g} s  {}: {}{}\n", 100 * c.expected.error,
        c.expected.seconds + c.expected.starting_seconds, settings_text(c.request), verdict,
        c.tried ? "" : " (guess)");
  };
  text += fmt::format(
      "considered for {:.3g} %: error on the sphere of equal volume (root mean square over theta) and time\n",
      100 * request.tolerance);
  for (const Diffraction filter : {Diffraction::none, Diffraction::gaussian, Diffraction::integral})
    if (const auto best = most_accurate(all, filter);
        filter != found->request.diffraction && best->request.diffraction == filter)
      line(*best, "the most accurate of its kind");
  if (found != all.begin()) line(*std::prev(found), "the next cheaper, not good enough");
  line(*found, "chosen, the cheapest that is good enough");
  text.pop_back();
  return choice;
}

} // namespace scatter::phase
