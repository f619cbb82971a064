// A point of the section is (a cos s, b sin s). Seen from the light it lies at the offset w sin(s - s0), so
// that g = s - s0, -pi/2 .. pi/2, runs over what is lit and nothing is singular at the rims. A ray and its
// derivative by g are traced together.

#include <scatter/fiber/elliptical_section.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/errors.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace scatter::fiber {
namespace {

constexpr double pi = std::numbers::pi;
constexpr int most_orders = 64;

/// A value and its derivative.
struct Dual {
  double v = 0, d = 0;
  Dual() = default;
  Dual(double value, double derivative = 0) : v(value), d(derivative) {} // NOLINT: constants are duals
};
Dual operator+(Dual a, Dual b) {
  return {a.v + b.v, a.d + b.d};
}
Dual operator-(Dual a, Dual b) {
  return {a.v - b.v, a.d - b.d};
}
Dual operator*(Dual a, Dual b) {
  return {a.v * b.v, a.d * b.v + a.v * b.d};
}
Dual operator/(Dual a, Dual b) {
  const double q = a.v / b.v;
  return {q, (a.d - q * b.d) / b.v};
}
Dual root(Dual a) {
  const double r = std::sqrt(a.v);
  return {r, r > 0 ? a.d / (2 * r) : 0};
}

struct Vector {
  Dual x, y;
};
Dual dot(const Vector& a, const Vector& b) {
  return a.x * b.x + a.y * b.y;
}
Vector along(const Vector& a, Dual s, const Vector& b) {
  return {a.x + s * b.x, a.y + s * b.y};
}

/// One ray of one order on leaving; `out` is false where it is reflected totally instead.
struct Leaving {
  bool out = false;
  double phi = 0, turn = 0; ///< azimuth less the light's, any turn; its derivative by g
  double energy = 0;        ///< A_p
};

/// Where the light of a ray went: logarithms of the shares that remained, and what is inside at last.
struct Losses {
  double left = 0, absorbed = 0, inside = 0;
};

class Tracer {
public:
  Tracer(double eta, double sigma_a, double a, double b, double theta_d, double phi_i)
      : a_(a), b_(b), sigma_a_(sigma_a), eta2_(eta * eta), phi_i_(phi_i) {
    const double c = std::cos(theta_d);
    cos_d_ = c;
    contrast_ = (eta - 1) * (eta + 1);
    excess_ = contrast_ / (c * c);
    index_ = std::sqrt(1 + excess_);
    cos_t_ = std::sqrt(contrast_ + c * c) / eta;
    start_ = std::atan2(a * std::sin(phi_i), b * std::cos(phi_i));
    width_ = std::hypot(a * std::sin(phi_i), b * std::cos(phi_i));
  }

  /// Calls left(order, Leaving) for order 0, 1, ... until it returns false or no light is left.
  template <typename Left>
  void trace(double g, Left&& left, Losses* losses = nullptr) const {
    const Dual sine(std::sin(start_ + g), std::cos(start_ + g)),
        cosine(std::cos(start_ + g), -std::sin(start_ + g));
    Vector at{a_ * cosine, b_ * sine};
    const Dual size = root(b_ * b_ * cosine * cosine + a_ * a_ * sine * sine);
    Vector normal{b_ * cosine / size, a_ * sine / size};
    const Vector d{-std::cos(phi_i_), -std::sin(phi_i_)};
    const Dual c1 = Dual(width_ * std::cos(g), -width_ * std::sin(g)) / size; // -d . normal
    const double F = reflectivity(c1.v);
    if (losses != nullptr) losses->inside = through(c1.v);
    if (!left(0, leaving(along(d, 2 * c1, normal), F))) return;
    const Dual W = root(excess_ + c1 * c1); // eta' times the cosine inside
    Vector t = along({d.x / index_, d.y / index_}, (c1 - W) / index_, normal);
    double light = through(c1.v);
    for (int order = 1; light > 1e-18; ++order) {
      const Dual px = at.x / (a_ * a_), py = at.y / (b_ * b_);
      const Dual length = -2 * (px * t.x + py * t.y) / (t.x * t.x / (a_ * a_) + t.y * t.y / (b_ * b_));
      at = along(at, length, t);
      const double depth = sigma_a_ * length.v / cos_t_;
      light *= std::exp(-depth);
      if (losses != nullptr) losses->absorbed += depth;
      const Dual nx = at.x / (a_ * a_), ny = at.y / (b_ * b_), n = root(nx * nx + ny * ny);
      normal = {nx / n, ny / n};
      const Dual ci = dot(t, normal), square = index_ * index_ * ci * ci - excess_;
      if (square.v > 0) {
        const Dual co = root(square);
        const Vector out = along({index_ * t.x, index_ * t.y}, co - index_ * ci, normal);
        const double passed = through(co.v);
        const double before = light;
        light *= reflectivity(co.v);
        if (losses != nullptr) {
          losses->left -= std::log1p(-passed);
          losses->inside = light;
        }
        if (!left(order, leaving(out, before * passed))) return;
      } else {
        if (losses != nullptr) losses->inside = light;
        if (!left(order, Leaving{})) return;
      }
      t = along(t, -2 * ci, normal);
    }
  }

  [[nodiscard]] Leaving at(double g, int order) const {
    Leaving found;
    trace(g, [&](int p, const Leaving& leaving) {
      if (p == order) found = leaving;
      return p < order;
    });
    return found;
  }

  /// Of the orders from first on. What is inside after many crossings, where total reflection guides it, is
  /// shared out as it was lost until then: to the outside and to absorption.
  [[nodiscard]] double energy_from(double g, int first) const {
    // Without absorption all that is inside leaves at last.
    const int last = sigma_a_ > 0 ? first + 1000 : first - 1;
    if (last < 0) return 1;
    double sum = 0;
    Losses losses;
    trace(
        g,
        [&](int p, const Leaving& leaving) {
          if (p >= first) sum += leaving.energy;
          return p < last;
        },
        &losses);
    const double all = losses.left + losses.absorbed;
    return sum + losses.inside * (all > 0 ? losses.left / all : 1);
  }

private:
  [[nodiscard]] double reflectivity(double cos_gamma) const {
    const double c = cos_d_ * cos_gamma, w = std::sqrt(contrast_ + c * c), s = c + w, p = eta2_ * c + w;
    const double r_s = contrast_ / (s * s), r_p = contrast_ * (1 - (eta2_ + 1) * c * c) / (p * p);
    return (r_s * r_s + r_p * r_p) / 2;
  }
  [[nodiscard]] double through(double cos_gamma) const {
    const double c = cos_d_ * cos_gamma, w = std::sqrt(contrast_ + c * c), s = c + w, p = eta2_ * c + w;
    return 2 * c * w * (1 / (s * s) + eta2_ / (p * p));
  }
  [[nodiscard]] Leaving leaving(const Vector& out, double energy) const {
    Leaving result;
    result.out = true;
    result.phi = std::atan2(out.y.v, out.x.v) - phi_i_;
    result.turn = (out.x.v * out.y.d - out.y.v * out.x.d) / (out.x.v * out.x.v + out.y.v * out.y.v);
    result.energy = energy;
    return result;
  }

  double a_, b_, sigma_a_, eta2_, phi_i_;
  double cos_d_ = 1, contrast_ = 0, excess_ = 0, index_ = 1, cos_t_ = 1, start_ = 0, width_ = 1;
};

/// Halves [a, b], where `first` holds at a and not at b, until nothing lies between.
template <typename Holds>
std::pair<double, double> boundary(double a, double b, Holds&& holds) {
  for (int step = 0; step < 80; ++step) {
    const double middle = 0.5 * (a + b);
    if (middle == a || middle == b) break;
    (holds(middle) ? a : b) = middle;
  }
  return {a, b};
}

/// The pieces of an order: stretches of g where its rays leave and their azimuth turns one way.
struct Piece {
  double from, to;
};

struct Pieces {
  std::vector<Piece> pieces;
  std::vector<double> turning; ///< g of caustics
  std::vector<double> cuts;    ///< g where rays begin or cease to leave
};

Pieces pieces_of(const Tracer& tracer, int order) {
  const int count = 600 * (order + 1);
  Pieces found;
  double begin = -pi / 2, last = -pi / 2;
  Leaving before = tracer.at(last, order);
  const auto end_piece = [&](double to) {
    if (to > begin) found.pieces.push_back({begin, to});
  };
  // Evenly, and ever denser toward the rims, where light creeps around the ends.
  std::vector<double> samples;
  for (int i = 1; i < count; ++i) samples.push_back(pi * (static_cast<double>(i) / count - 0.5));
  for (int k = 1; k <= 40; ++k)
    for (const int side : {-1, 1}) samples.push_back(side * (pi / 2 - std::ldexp(pi / count, -k)));
  samples.push_back(pi / 2);
  std::ranges::sort(samples);
  for (const double g : samples) {
    const Leaving now = tracer.at(g, order);
    if (before.out != now.out) {
      const auto [a, b] = boundary(last, g, [&](double x) { return tracer.at(x, order).out == before.out; });
      found.cuts.push_back(a);
      if (before.out) end_piece(a);
      begin = b;
      // beside the cut the azimuth may turn once more
      const Leaving edge = tracer.at(before.out ? a : b, order);
      const Leaving& inside = before.out ? before : now;
      const double other = before.out ? last : g;
      if (edge.out && (edge.turn > 0) != (inside.turn > 0)) {
        const double at_edge = before.out ? a : b;
        const double turning = boundary(other, at_edge, [&](double x) {
                                 return (tracer.at(x, order).turn > 0) == (inside.turn > 0);
                               }).first;
        found.turning.push_back(turning);
        if (before.out) {
          found.pieces.back().to = std::max(turning, found.pieces.back().from);
          found.pieces.push_back({turning, a});
        } else {
          found.pieces.push_back({b, turning});
          begin = turning;
        }
      }
    } else if (now.out && (before.turn > 0) != (now.turn > 0)) {
      const double turning = boundary(last, g, [&](double x) {
                               return (tracer.at(x, order).turn > 0) == (before.turn > 0);
                             }).first;
      found.turning.push_back(turning);
      end_piece(turning);
      begin = turning;
    }
    before = now;
    last = g;
  }
  if (before.out) end_piece(pi / 2);
  return found;
}

/// g of every ray of the order that leaves toward phi.
std::vector<double> roots(const Tracer& tracer, int order, const Pieces& pieces, double phi) {
  std::vector<double> found;
  const auto miss = [&](double g) { return std::remainder(tracer.at(g, order).phi - phi, 2 * pi); };
  for (const Piece& piece : pieces.pieces) {
    // A piece may turn by more than pi: in steps over which it cannot wrap.
    const int steps = std::max(2, static_cast<int>(std::ceil((piece.to - piece.from) * 40 * (order + 1))));
    double a = piece.from, at_a = miss(a);
    for (int i = 1; i <= steps; ++i) {
      const double b = i == steps ? piece.to : piece.from + (piece.to - piece.from) * i / steps;
      const double at_b = miss(b);
      if ((at_a > 0) != (at_b > 0) && std::abs(at_a - at_b) < pi) {
        const auto [x, y] = boundary(a, b, [&](double g) { return (miss(g) > 0) == (at_a > 0); });
        found.push_back(0.5 * (x + y));
      }
      a = b;
      at_a = at_b;
    }
  }
  return found;
}

/// 16 nodes of Gauss and Legendre, right half.
constexpr double nodes[8] = {0.0950125098376374401853, 0.2816035507792589132305, 0.4580167776572273863424,
                             0.6178762444026437484467, 0.7554044083550030338951, 0.8656312023878317438805,
                             0.9445750230732325760779, 0.9894009349916499325962};
constexpr double weights[8] = {0.1894506104550684962854, 0.1826034150449235888668, 0.1691565193950025381893,
                               0.1495959888165767320815, 0.1246289712555338720525, 0.0951585116824927848099,
                               0.0622535239386478928628, 0.0271524594117540948518};

/// Integral of f(g) cos(g) / 2 over -pi/2..pi/2 in panels that halve toward the rims and the cuts.
template <typename Function>
void integrate(std::vector<double> cuts, int order, Function&& f) {
  cuts.push_back(-pi / 2);
  cuts.push_back(pi / 2);
  std::ranges::sort(cuts);
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
    const double from = cuts[i], width = cuts[i + 1] - from;
    if (!(width > 1e-14)) continue;
    std::vector<double> edges{0.5};
    for (int k = 2; k <= 36; ++k) {
      edges.push_back(std::ldexp(1.0, -k));
      edges.push_back(1 - std::ldexp(1.0, -k));
    }
    const int middle = 2 + 4 * order; // the azimuth of high orders turns fast
    for (int k = 1; k < middle; ++k) edges.push_back(0.25 + 0.5 * k / middle);
    edges.push_back(0);
    edges.push_back(1);
    std::ranges::sort(edges);
    for (std::size_t e = 0; e + 1 < edges.size(); ++e) {
      const double half = 0.5 * (edges[e + 1] - edges[e]) * width,
                   centre = from + 0.5 * (edges[e + 1] + edges[e]) * width;
      if (!(half > 0)) continue;
      for (int n = 0; n < 8; ++n)
        for (const double x : {-nodes[n], nodes[n]}) {
          const double g = centre + half * x;
          f(g, weights[n] * half * 0.5 * std::cos(g));
        }
    }
  }
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
    : eta_(eta), sigma_a_(sigma_a) {
  (void)RaySection(eta, sigma_a); // refuses what is no fibre
  if (!(axis_ratio >= 0.1 && axis_ratio <= 1))
    throw InputError(
        fmt::format("an axis ratio of {} is outside 0.1..1: short axis over long axis", axis_ratio));
  short_ = std::sqrt(axis_ratio);
  long_ = 1 / short_;
}

double EllipticalSection::width(double phi_i) const {
  return std::hypot(long_ * std::sin(phi_i), short_ * std::cos(phi_i));
}

double EllipticalSection::distribution(int order, double theta_d, double phi_i, double phi) const {
  check(order, theta_d, phi_i);
  if (!std::isfinite(phi)) throw InputError(fmt::format("an azimuth phi of {} is not possible", phi));
  const Tracer tracer(eta_, sigma_a_, long_, short_, theta_d, phi_i);
  double sum = 0;
  for (const double g : roots(tracer, order, pieces_of(tracer, order), phi)) {
    const Leaving ray = tracer.at(g, order);
    const double cosine = std::max(std::cos(g), 0.0);
    if (ray.energy > 0 && cosine > 0) sum += ray.energy * cosine / (2 * std::abs(ray.turn));
  }
  return sum;
}

OrderMoments EllipticalSection::moments(int order, double theta_d, double phi_i) const {
  check(order, theta_d, phi_i);
  const Tracer tracer(eta_, sigma_a_, long_, short_, theta_d, phi_i);
  const Pieces pieces = pieces_of(tracer, order);
  auto cuts = pieces.cuts;
  // Where the weights have kinks.
  for (const double phi : {0.0, pi / 2, -pi / 2, pi})
    for (const double g : roots(tracer, order, pieces, phi)) cuts.push_back(g);
  // Rays that a reflection before was total for change their share at its limit, too.
  for (int p = 1; p < order; ++p)
    for (const double g : pieces_of(tracer, p).cuts) cuts.push_back(g);
  OrderMoments sum;
  integrate(std::move(cuts), order, [&](double g, double dh) {
    const Leaving ray = tracer.at(g, order);
    if (!ray.out) return;
    const double phi = std::abs(std::remainder(ray.phi, 2 * pi)), energy = ray.energy * dh;
    sum.energy += energy;
    sum.forward += energy * phi / pi;
    if (phi >= pi / 2) sum.forward_half += energy;
  });
  return sum;
}

double EllipticalSection::residual_energy(int first_order, double theta_d, double phi_i) const {
  check(first_order, theta_d, phi_i);
  const Tracer tracer(eta_, sigma_a_, long_, short_, theta_d, phi_i);
  std::vector<double> cuts;
  for (int p = 1; p < std::min(first_order + 12, most_orders); ++p)
    for (const double g : pieces_of(tracer, p).cuts) cuts.push_back(g);
  double sum = 0;
  integrate(std::move(cuts), first_order, [&](double g, double dh) {
    sum += tracer.energy_from(g, first_order) * dh;
  });
  return sum;
}

std::vector<double> EllipticalSection::caustics(int order, double theta_d, double phi_i) const {
  check(order, theta_d, phi_i);
  const Tracer tracer(eta_, sigma_a_, long_, short_, theta_d, phi_i);
  std::vector<double> found;
  for (const double g : pieces_of(tracer, order).turning)
    found.push_back(std::remainder(tracer.at(g, order).phi, 2 * pi));
  std::ranges::sort(found);
  return found;
}

} // namespace scatter::fiber
