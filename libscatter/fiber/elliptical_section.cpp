// Critical g, where an order begins or ceases to be reflected totally, and caustics are zeros of curves known
// with their derivatives, sampled until cubics through the samples know what is between them. Between
// critical g everything is analytic in u, g = from + (to - from) sin^2(pi u / 2).

#include <scatter/fiber/elliptical_section.hpp>
#include <scatter/fiber/elliptical_tracer.hpp>
#include <scatter/fiber/quadrature.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/errors.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace scatter::fiber {
namespace {

constexpr double pi = std::numbers::pi;
constexpr int most_orders = 64;
constexpr double smooth_tolerance = 5e-16; ///< of integrals over a smooth piece
constexpr double kinked_tolerance = 1e-14; ///< over a piece with ever smaller kinks

using Tracer = EllipticalTracer<double>;

/// Between a and b, where f changes its sign: false position and halving in turn, until rounding ends it.
template <typename Function>
double bracketed(double a, double at_a, double b, double at_b, Function&& f) {
  const double least = 2e-16 * std::max(std::abs(a), std::abs(b));
  for (int step = 0; step < 200 && b - a > least; ++step) {
    double middle = 0.5 * (a + b);
    if (step % 3 != 2) {
      const double chord = (a * at_b - b * at_a) / (at_b - at_a), nudge = 0.5 * least;
      if (chord > a && chord < b) middle = std::clamp(chord, a + nudge, b - nudge);
    }
    if (middle <= a || middle >= b) break;
    const double at = f(middle);
    if (at == 0) return middle;
    if ((at > 0) == (at_a > 0)) {
      a = middle;
      at_a = at;
    } else {
      b = middle;
      at_b = at;
    }
  }
  return 0.5 * (a + b);
}

/// A function and its derivative at one place; below `noise` its sign is rounding's.
struct Curve {
  double v = 0, d = 0, noise = 0;
};

struct Sample {
  double x = 0, phi = 0;
  std::vector<Curve> curves;
};

/// Whether the cubics through a and b with their derivatives know what is at m, half way.
bool resolved(const Sample& a, const Sample& m, const Sample& b) {
  constexpr double share = 0.02, largest_step = 0.7;
  if (std::abs(std::remainder(m.phi - a.phi, 2 * pi)) > largest_step ||
      std::abs(std::remainder(b.phi - m.phi, 2 * pi)) > largest_step)
    return false;
  const double width = b.x - a.x;
  for (std::size_t k = 0; k < m.curves.size(); ++k) {
    const Curve &l = a.curves[k], &c = m.curves[k], &r = b.curves[k];
    const double size =
        share * std::max({std::abs(l.v), std::abs(c.v), std::abs(r.v)}) + l.noise + c.noise + r.noise;
    if (!(std::abs(c.v - 0.5 * (l.v + r.v) - width * (l.d - r.d) / 8) <= size)) return false;
    if (!(std::abs(c.d * width - 1.5 * (r.v - l.v) + 0.25 * width * (l.d + r.d)) <= 4 * size)) return false;
  }
  return true;
}

template <typename At>
void refine(const Sample& a, const Sample& b, int depth, At&& at, std::vector<Sample>& found) {
  const Sample middle = at(0.5 * (a.x + b.x));
  if (depth > 0 && !resolved(a, middle, b) && found.size() < 100000) {
    refine(a, middle, depth - 1, at, found);
    refine(middle, b, depth - 1, at, found);
    return;
  }
  found.push_back(middle);
  found.push_back(b);
}

/// Samples at the places, increasing, and between them so dense that curves are cubics.
template <typename At>
std::vector<Sample> samples(const std::vector<double>& places, At&& at) {
  std::vector<Sample> found{at(places.front())};
  for (std::size_t i = 1; i < places.size(); ++i) {
    if (!(places[i] > places[i - 1])) continue;
    const Sample begin = found.back();
    refine(begin, at(places[i]), 44, at, found);
  }
  return found;
}

/// Zeros of a curve of the samples, those included that come in pairs between two of them.
template <typename At>
std::vector<double> zeros(const std::vector<Sample>& samples, std::size_t curve, At&& at) {
  std::vector<double> found;
  const auto v = [&](double x) { return at(x).curves[curve].v; };
  const auto d = [&](double x) { return at(x).curves[curve].d; };
  const Sample* last = nullptr;
  for (const Sample& now : samples) {
    const Curve& c = now.curves[curve];
    if (!(std::abs(c.v) > c.noise)) continue;
    if (last != nullptr) {
      const Curve& l = last->curves[curve];
      if ((l.v > 0) != (c.v > 0))
        found.push_back(bracketed(last->x, l.v, now.x, c.v, v));
      else if ((l.v > 0) == (l.d < 0) && (c.v > 0) == (c.d > 0) && l.d != 0 && c.d != 0) {
        const double turn = bracketed(last->x, l.d, now.x, c.d, d);
        const Curve there = at(turn).curves[curve];
        if (std::abs(there.v) > there.noise && (there.v > 0) != (c.v > 0)) {
          found.push_back(bracketed(last->x, l.v, turn, there.v, v));
          found.push_back(bracketed(turn, there.v, now.x, c.v, v));
        }
      }
    }
    last = &now;
  }
  return found;
}

/// Places to begin sampling with, those included about which all changes fast: the tips of the section, and
/// rays through the foci. From -pi/2 to pi/2, increasing.
std::vector<double> first_places(const Tracer& tracer) {
  constexpr int count = 24;
  std::vector<double> places;
  for (int i = 0; i <= count; ++i) places.push_back(pi * (static_cast<double>(i) / count - 0.5));
  for (int k = -4; k <= 4; ++k) {
    const double tip = 0.5 * pi * k - tracer.start();
    if (std::abs(tip) < pi / 2) places.push_back(tip);
  }
  std::ranges::sort(places);
  const auto at = [&](double g) {
    const Jet<double> product = tracer.focal_product(g);
    return Sample{g, 0, {{product.v, product.d, 1e-15}}};
  };
  for (const double g : zeros(samples(places, at), 0, at)) places.push_back(g);
  std::ranges::sort(places);
  return places;
}

/// For each order up to the last, g where its rays begin or cease to leave; none for order 0. Increasing.
std::vector<std::vector<double>> critical(const Tracer& tracer, const std::vector<double>& places, int last) {
  std::vector<std::vector<double>> found(static_cast<std::size_t>(last) + 1);
  if (last == 0) return found;
  const auto at = [&](double g) {
    Sample sample{g, 0, {}};
    tracer.trace<Jet<double>>(g, [&](int order, const RayAtSurface<Jet<double>>& surface) {
      if (order == 0) return true;
      const Jet<double> s = surface.sine, square = (1 - s) * (1 + s);
      sample.curves.push_back({square.v, square.d, 1e-15 * (1 + s.v * s.v + std::abs(square.d))});
      return order < last;
    });
    return sample;
  };
  const auto grid = samples(places, at);
  for (std::size_t order = 1; order < found.size(); ++order) found[order] = zeros(grid, order - 1, at);
  return found;
}

/// A stretch of g between critical ones.
struct Piece {
  double from, to;
  /// u of a g between the ends
  [[nodiscard]] double of(double g) const {
    return 2 / pi * std::atan2(std::sqrt(g - from), std::sqrt(to - g));
  }
  [[nodiscard]] double at(double u) const {
    const double s = std::sin(pi / 2 * u), c = std::cos(pi / 2 * u);
    return u < 0.5 ? from + (to - from) * s * s : to - (to - from) * c * c;
  }
  /// d g / d u
  [[nodiscard]] double rate(double u) const {
    return pi * (to - from) * std::sin(pi / 2 * u) * std::cos(pi / 2 * u);
  }
};

/// One order's azimuth over a piece that its rays leave from: nodes between which it turns one way, less than
/// half a turn.
struct Branch {
  Piece piece;
  struct Node {
    double u, phi;
  };
  std::vector<Node> nodes;
  std::vector<double> caustics; ///< u
};

Branch branch(
    const Tracer& tracer, const std::vector<double>& places, int order, const Piece& piece,
    bool critical_from, bool critical_to) {
  const auto at = [&](double u) {
    const Turning<double> t = tracer.turning(piece.at(u), order);
    const bool ends = (u == 0 && critical_from) || (u == 1 && critical_to);
    const double rate = piece.rate(u);
    double slope = 0;
    if (ends) // the cosine is a square root there, linear in u
      slope =
          (u == 0 ? 1 : -1) * pi / 2 * std::sqrt(2 * std::abs(t.sines) * (piece.to - piece.from)) * t.normal;
    else if (rate > 0)
      slope = rate * (t.slope_left - (t.cosine > 0 ? t.sines / t.cosine * t.normal : 0));
    return Sample{u, t.phi, {{t.slope, slope, t.noise}}};
  };
  std::vector<double> first{0, 0.25, 0.5, 0.75, 1};
  for (const double g : places)
    if (g > piece.from && g < piece.to) first.push_back(piece.of(g));
  std::ranges::sort(first);
  const auto grid = samples(first, at);
  Branch found{piece, {}, zeros(grid, 0, at)};
  for (const Sample& sample : grid) found.nodes.push_back({sample.x, sample.phi});
  for (const double u : found.caustics) found.nodes.push_back({u, tracer.turning(piece.at(u), order).phi});
  std::ranges::sort(found.nodes, {}, &Branch::Node::u);
  return found;
}

std::vector<Branch> branches(
    const Tracer& tracer, const std::vector<double>& places, int order, const std::vector<double>& cuts) {
  std::vector<double> edges{-pi / 2};
  edges.insert(edges.end(), cuts.begin(), cuts.end());
  edges.push_back(pi / 2);
  std::vector<Branch> found;
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    const Piece piece{edges[i], edges[i + 1]};
    if (piece.to > piece.from && tracer.leaving(piece.at(0.5), order).out)
      found.push_back(branch(tracer, places, order, piece, i > 0, i + 2 < edges.size()));
  }
  return found;
}

/// g of every ray of the order that leaves toward phi.
std::vector<double> roots(const Tracer& tracer, int order, const std::vector<Branch>& branches, double phi) {
  std::vector<double> found;
  for (const Branch& branch : branches)
    for (std::size_t i = 0; i + 1 < branch.nodes.size(); ++i) {
      const Branch::Node &a = branch.nodes[i], &b = branch.nodes[i + 1];
      const double step = std::remainder(b.phi - a.phi, 2 * pi), from = std::remainder(a.phi - phi, 2 * pi),
                   to = from + step;
      if ((from > 0) == (to > 0) || !(b.u > a.u)) continue;
      const auto miss = [&](double u) {
        // continuous from a on
        return from + std::remainder(tracer.turning(branch.piece.at(u), order).phi - a.phi, 2 * pi);
      };
      found.push_back(branch.piece.at(bracketed(a.u, from, b.u, to, miss)));
    }
  return found;
}

/// Adds the integral of f over a..b to the sum, halved until halves and whole agree within the tolerance,
/// which is that of each panel: where rays are spread so far that rounding of g shows, smaller panels could
/// not meet smaller ones.
template <typename Value, typename Function>
void add_panels(
    const Function& f, double a, double b, const Value& whole, double tolerance, int depth, Value& sum) {
  const double middle = 0.5 * (a + b);
  const Value left = gauss_legendre<Value>(f, a, middle), right = gauss_legendre<Value>(f, middle, b);
  double error = 0;
  for (std::size_t k = 0; k < sum.size(); ++k)
    error = std::max(error, std::abs(left[k] + right[k] - whole[k]));
  if (error > tolerance && depth > 0) {
    add_panels(f, a, middle, left, tolerance, depth - 1, sum);
    add_panels(f, middle, b, right, tolerance, depth - 1, sum);
    return;
  }
  for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += left[k] + right[k];
}

/// Integral of f(g) cos(g) / 2 over -pi/2..pi/2 in pieces between the cuts, each f smooth in u.
template <typename Value, typename Function>
Value integral(std::vector<double> cuts, double tolerance, Function&& f) {
  cuts.push_back(-pi / 2);
  cuts.push_back(pi / 2);
  std::ranges::sort(cuts);
  Value sum{};
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
    const Piece piece{cuts[i], cuts[i + 1]};
    if (!(piece.to > piece.from)) continue;
    const auto weighted = [&](double u) {
      const double g = piece.at(u), weight = 0.5 * std::cos(g) * piece.rate(u);
      Value values = f(g);
      for (double& x : values) x *= weight;
      return values;
    };
    add_panels(weighted, 0, 1, gauss_legendre<Value>(weighted, 0, 1), tolerance, 40, sum);
  }
  return sum;
}

/// What is inside after the crossings before `first`, and from there on leaves: all of it without absorption.
/// With it, what is inside after many crossings, where total reflection guides it, is shared out as it was
/// lost until then: to the outside and to absorption.
double energy_from(const Tracer& tracer, double g, int first, bool absorbs) {
  if (first == 0 && !absorbs) return 1;
  const int last = absorbs ? first + 1000 : first - 1;
  double sum = 0;
  Losses<double> losses;
  tracer.light(
      g,
      [&](int p, const Leaving<double>& leaving) {
        if (p >= first) sum += leaving.energy;
        return p < last && losses.inside > 1e-18;
      },
      &losses);
  const double all = losses.left + losses.absorbed;
  return sum + losses.inside * (all > 0 ? losses.left / all : 1);
}

/// What the ray of the order toward phi, which is near g, adds to N. In long double: near a caustic phi's
/// rounding counts. Where azimuths turn so fast that numbers next to each other miss phi on either side, it
/// is between theirs.
double density(const EllipticalTracer<long double>& tracer, int order, double phi, double near) {
  using real = long double;
  struct Ray {
    real g, miss, step, density;
  };
  const auto ray = [&](real g) -> Ray {
    const Turning<real> turning = tracer.turning(g, order);
    const Leaving<real> leaving = tracer.leaving(g, order);
    const real miss = std::remainder(turning.phi - phi, 2 * std::numbers::pi_v<real>), cosine = std::cos(g),
               per_turn = turning.cosine / std::abs(turning.slope);
    return {
        g, miss, -miss * turning.cosine / turning.slope,
        cosine > 0 && leaving.energy > 0 ? leaving.energy * cosine * per_turn / 2 : 0};
  };
  Ray best = ray(near);
  for (int step = 0; step < 6 && std::abs(best.step) < 1e-10L; ++step) {
    const Ray next = ray(best.g + best.step);
    if (!(std::abs(next.miss) < std::abs(best.miss))) break;
    best = next;
  }
  const Ray beside = ray(std::nextafter(best.g, best.step > 0 ? real(4) : real(-4)));
  if ((best.miss > 0) == (beside.miss > 0) || !(beside.density > 0)) return static_cast<double>(best.density);
  const real share = best.miss / (best.miss - beside.miss);
  return static_cast<double>(best.density + share * (beside.density - best.density));
}

void check(int order, double theta_d, double phi_i) {
  if (!(std::abs(theta_d) < pi / 2))
    throw InputError(
        fmt::format("theta_d = {} rad is not possible: between -pi/2 and pi/2, without the ends", theta_d));
  if (!std::isfinite(phi_i))
    throw InputError(fmt::format("an azimuth of the light of {} is not possible", phi_i));
  if (order < 0 || order > most_orders)
    throw InputError(fmt::format("order {} is outside 0..{}", order, most_orders));
}

} // namespace

EllipticalSection::EllipticalSection(double eta, double sigma_a, double axis_ratio)
    : eta_(eta), sigma_a_(sigma_a), axis_ratio_(axis_ratio) {
  (void)RaySection(eta, sigma_a); // refuses what is no fibre
  if (!(axis_ratio >= 0.1 && axis_ratio <= 1))
    throw InputError(
        fmt::format("an axis ratio of {} is outside 0.1..1: short axis over long axis", axis_ratio));
}

double EllipticalSection::width(double phi_i) const {
  const double b = std::sqrt(axis_ratio_);
  return std::hypot(std::sin(phi_i) / b, b * std::cos(phi_i));
}

double EllipticalSection::distribution(int order, double theta_d, double phi_i, double phi) const {
  check(order, theta_d, phi_i);
  if (!std::isfinite(phi)) throw InputError(fmt::format("an azimuth phi of {} is not possible", phi));
  const Tracer tracer(eta_, sigma_a_, axis_ratio_, theta_d, phi_i);
  const auto places = first_places(tracer);
  const auto cuts = critical(tracer, places, order);
  const EllipticalTracer<long double> fine(eta_, sigma_a_, axis_ratio_, theta_d, phi_i);
  double sum = 0;
  for (const double g : roots(tracer, order, branches(tracer, places, order, cuts.back()), phi))
    sum += density(fine, order, phi, g);
  return sum;
}

OrderMoments EllipticalSection::moments(int order, double theta_d, double phi_i) const {
  check(order, theta_d, phi_i);
  const Tracer tracer(eta_, sigma_a_, axis_ratio_, theta_d, phi_i);
  const auto places = first_places(tracer);
  const auto critical_ones = critical(tracer, places, order);
  // Rays that a reflection before was total for change their share at its limit, too.
  std::vector<double> cuts = places;
  for (const auto& of_order : critical_ones) cuts.insert(cuts.end(), of_order.begin(), of_order.end());
  // Where the weights have kinks.
  const auto leaving = branches(tracer, places, order, critical_ones.back());
  for (const double phi : {0.0, pi / 2, -pi / 2, pi})
    for (const double g : roots(tracer, order, leaving, phi)) cuts.push_back(g);
  using Values = std::array<double, 3>;
  const auto sums = integral<Values>(std::move(cuts), smooth_tolerance, [&](double g) -> Values {
    const Leaving<double> ray = tracer.leaving(g, order);
    if (!ray.out) return {};
    const double phi = std::abs(std::remainder(ray.phi, 2 * pi));
    return {ray.energy, ray.energy * phi / pi, phi >= pi / 2 ? ray.energy : 0};
  });
  return {sums[0], sums[1], sums[2]};
}

double EllipticalSection::residual_energy(int first_order, double theta_d, double phi_i) const {
  check(first_order, theta_d, phi_i);
  const Tracer tracer(eta_, sigma_a_, axis_ratio_, theta_d, phi_i);
  // Without absorption only the crossings before matter; with it all do, each less than the one before.
  const bool absorbs = sigma_a_ > 0;
  const int last = absorbs ? first_order + 12 : std::max(first_order - 1, 0);
  const auto places = first_places(tracer);
  std::vector<double> cuts = places;
  for (const auto& of_order : critical(tracer, places, last))
    cuts.insert(cuts.end(), of_order.begin(), of_order.end());
  return integral<std::array<double, 1>>(
      std::move(cuts), absorbs ? kinked_tolerance : smooth_tolerance,
      [&](double g) { return std::array<double, 1>{energy_from(tracer, g, first_order, absorbs)}; })[0];
}

std::vector<double> EllipticalSection::caustics(int order, double theta_d, double phi_i) const {
  check(order, theta_d, phi_i);
  const Tracer tracer(eta_, sigma_a_, axis_ratio_, theta_d, phi_i);
  std::vector<double> found;
  const auto places = first_places(tracer);
  for (const Branch& branch : branches(tracer, places, order, critical(tracer, places, order).back()))
    for (const double u : branch.caustics) found.push_back(tracer.turning(branch.piece.at(u), order).phi);
  std::ranges::sort(found);
  return found;
}

} // namespace scatter::fiber
