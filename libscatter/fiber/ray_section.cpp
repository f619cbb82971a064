// Everything is a function of gamma = asin h, 0..pi/2; the other half of the section is its mirror image.
// With W = eta' cos gamma_t = sqrt(eta'^2 - 1 + cos^2 gamma), where eta'^2 - 1 = (eta^2 - 1) / cos^2 theta_d,
// nothing cancels at the rim or at grazing inclinations. u_p = 2 p gamma_t - 2 gamma is odd and, for gamma >
// 0, concave: it rises to its one maximum, if p > eta', and falls from there to the rim. Roots are sought in
// long double: near a caustic phi's rounding counts, and nothing else.

#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/errors.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace scatter::fiber {
namespace {

using real = long double;
constexpr real pi = std::numbers::pi_v<real>;
constexpr int most_orders = 1000;

void check(double theta_d) {
  if (!(std::abs(theta_d) < std::numbers::pi / 2))
    throw InputError(fmt::format(
        "theta_d = {} rad is not possible: half the difference of two inclinations lies between -pi/2 and "
        "pi/2, without the ends",
        theta_d));
}

void check(int order, double theta_d) {
  check(theta_d);
  if (order < 0 || order > most_orders)
    throw InputError(fmt::format("order {} is outside 0..{}", order, most_orders));
}

/// A fibre and an inclination in the numbers that the formulas take.
template <typename Real>
struct Optics {
  Real eta2, contrast; ///< eta^2, eta^2 - 1
  Real cos_d, excess;  ///< cos theta_d, eta'^2 - 1
  Real eta_prime;      ///< Bravais' index
  Real sin_t, cos_t;   ///< of theta_t, the inclination inside
  Real sigma_a;
  Polarisation polarisation;

  Optics(const RaySection& section, double theta_d)
      : sigma_a(section.sigma_a()), polarisation(section.polarisation()) {
    const Real eta = section.eta(), d = std::abs(static_cast<Real>(theta_d));
    eta2 = eta * eta;
    contrast = (eta - 1) * (eta + 1);
    cos_d = std::cos(d);
    excess = contrast / (cos_d * cos_d);
    eta_prime = std::sqrt(1 + excess);
    sin_t = std::sin(d) / eta;
    cos_t = std::sqrt(contrast + cos_d * cos_d) / eta;
  }
};

/// What both polarisations lose where a ray meets the surface.
template <typename Real>
struct Surface {
  Real r_s, r_p;             ///< amplitudes reflected outside, signs of Bohren & Huffman
  Real through_s, through_p; ///< shares of energy let through

  Surface(const Optics<Real>& o, Real cos_gamma) {
    const Real c = o.cos_d * cos_gamma, w = std::sqrt(o.contrast + c * c);
    const Real s = c + w, p = o.eta2 * c + w;
    r_s = -o.contrast / (s * s);
    r_p = o.contrast * (1 - (o.eta2 + 1) * c * c) / (p * p);
    through_s = 4 * c * w / (s * s);
    through_p = 4 * o.eta2 * c * w / (p * p);
  }
  [[nodiscard]] Real reflected() const { return (r_s * r_s + r_p * r_p) / 2; }
  [[nodiscard]] Real through() const { return (through_s + through_p) / 2; }
};

/// A ray at one offset.
template <typename Real>
struct Ray {
  Real sin_gamma, cos_gamma;
  Real W; ///< eta' cos gamma_t

  Ray(const Optics<Real>& o, Real sine, Real cosine)
      : sin_gamma(sine), cos_gamma(cosine), W(std::sqrt(o.excess + cosine * cosine)) {}
  [[nodiscard]] Real refracted() const { return std::atan2(sin_gamma, W); }
  [[nodiscard]] Real chord(const Optics<Real>& o) const { return 2 * W / (o.eta_prime * o.cos_t); }
  /// 1 / |2 d phi / d h|
  [[nodiscard]] Real spread(int p) const {
    return cos_gamma * W / (4 * std::abs(static_cast<Real>(p) * cos_gamma - W));
  }
};

/// Coherency of light inside, in the directions across and in the plane of incidence: symmetric and real,
/// because no reflection inside is total.
template <typename Real>
struct Coherency {
  Real ss = 0, sp = 0, pp = 0;
};

/// From one point of the surface to the next: the plane of incidence turns about the ray by rho with
/// tan(rho / 2) = tan gamma_t / sin theta_t.
template <typename Real>
struct Passage {
  Real cosine, sine;
  Passage(const Optics<Real>& o, const Ray<Real>& ray) {
    const Real x = o.sin_t * ray.W, y = ray.sin_gamma, size = x * x + y * y;
    cosine = size > 0 ? (x - y) * (x + y) / size : -1;
    sine = size > 0 ? 2 * x * y / size : 0;
  }
  [[nodiscard]] Coherency<Real> operator()(const Coherency<Real>& c) const {
    const Real a = cosine * cosine, b = cosine * sine, d = sine * sine;
    return {
        a * c.ss - 2 * b * c.sp + d * c.pp, b * (c.ss - c.pp) + (a - d) * c.sp,
        d * c.ss + 2 * b * c.sp + a * c.pp};
  }
};

/// Unpolarised light inside, from one point of the surface to the next, without absorption.
template <typename Real>
class Chain {
public:
  /// p: how often it has crossed the section, >= 1.
  Chain(const Optics<Real>& o, const Surface<Real>& surface, const Ray<Real>& ray, int p)
      : surface_(surface), tracked_(o.polarisation == Polarisation::tracked), passage_(o, ray) {
    if (!tracked_) {
      light_.ss = surface.through() * std::pow(surface.reflected(), static_cast<Real>(p - 1));
      return;
    }
    light_ = passage_({surface.through_s / 2, 0, surface.through_p / 2});
    for (int k = 1; k < p && light_.ss + light_.pp > 0; ++k) reflect();
  }
  void reflect() {
    if (!tracked_) {
      light_.ss *= surface_.reflected();
      return;
    }
    // In a right-handed frame the parallel amplitude changes its sign once more: fresnel.hpp.
    const Real s = surface_.r_s, p = -surface_.r_p;
    light_ = passage_({s * s * light_.ss, s * p * light_.sp, p * p * light_.pp});
  }
  [[nodiscard]] Real let_out() const {
    return tracked_ ? surface_.through_s * light_.ss + surface_.through_p * light_.pp
                    : surface_.through() * light_.ss;
  }
  [[nodiscard]] const Coherency<Real>& light() const { return light_; }

private:
  Surface<Real> surface_;
  bool tracked_;
  Passage<Real> passage_;
  Coherency<Real> light_; ///< ss alone, for both, where polarisation is not tracked
};

template <typename Real>
Real attenuation(const Optics<Real>& o, const Ray<Real>& ray, int p) {
  const Surface<Real> surface(o, ray.cos_gamma);
  if (p == 0) return surface.reflected();
  return Chain<Real>(o, surface, ray, p).let_out() *
         std::exp(-static_cast<Real>(p) * o.sigma_a * ray.chord(o));
}

/// Sum of A_p over p >= first: a geometric series.
double attenuation_from(const Optics<double>& o, const Ray<double>& ray, int first) {
  const Surface<double> surface(o, ray.cos_gamma);
  if (first == 0) return surface.reflected() + attenuation_from(o, ray, 1);
  const double depth = o.sigma_a * ray.chord(o), passed = std::exp(-depth), lost = -std::expm1(-depth);
  const double before = std::exp(-first * depth);
  if (o.polarisation == Polarisation::mean) {
    const double F = surface.reflected(), through = surface.through();
    // 1 - F T without cancellation
    const double rest = through + F * lost;
    return rest > 0 ? through * through * std::pow(F, first - 1) * before / rest : 0;
  }
  // light = passage(entered); then sum over k of (T passage R)^k light: 3 linear equations. Their determinant
  // is small where the surface lets little through; the sum of energy is then through / (through + lost),
  // which the equations give in the form (1 - passage R T) with 1 - R and 1 - T taken as such.
  const Passage<double> passage(o, ray);
  const Coherency<double> light = Chain<double>(o, surface, ray, first).light();
  const double ss = surface.r_s * surface.r_s, sp = -surface.r_s * surface.r_p,
               pp = surface.r_p * surface.r_p;
  // Unknown X with X = light + T passage(R X). Written in trace I = ss + pp, difference Q = ss - pp and sp:
  // passage keeps I and turns (Q, 2 sp) by 2 rho. R: I -> mean I + half Q, Q -> half I + mean Q, sp -> sp.
  const double mean = (ss + pp) / 2, half = (ss - pp) / 2;
  const double loss = (surface.through_s + surface.through_p) / 2; // 1 - mean
  const double c2 = passage.cosine * passage.cosine - passage.sine * passage.sine,
               s2 = 2 * passage.cosine * passage.sine;
  // I (1 - T mean) - T half Q = I0
  // Q - T (c2 (half I + mean Q) - s2 sp U) = Q0,   U = 2 sp
  // U - T (s2 (half I + mean Q) + c2 sp U) = U0
  const double a11 = loss + mean * lost, a12 = -passed * half;
  const double a21 = -passed * c2 * half, a22 = 1 - passed * c2 * mean, a23 = passed * s2 * sp;
  const double a31 = -passed * s2 * half, a32 = -passed * s2 * mean, a33 = 1 - passed * c2 * sp;
  const double I0 = light.ss + light.pp, Q0 = light.ss - light.pp, U0 = 2 * light.sp;
  const double inner = a22 * a33 - a23 * a32;
  // The inner 2 x 2 block may be near singular only where the ray leaves nothing: no light comes in there.
  if (!(std::abs(inner) > 0)) return 0;
  const double qi = (a23 * a31 - a21 * a33) / inner, q0 = (Q0 * a33 - U0 * a23) / inner;
  const double det = a11 + a12 * qi;
  if (!(std::abs(det) > 0)) return 0;
  const double I = (I0 - a12 * q0) / det, Q = qi * I + q0;
  const double X_ss = (I + Q) / 2, X_pp = (I - Q) / 2;
  return (surface.through_s * X_ss + surface.through_p * X_pp) * before;
}

/// u_p over gamma, its maximum and its roots, p >= 1.
class Turns {
public:
  /// Of the offsets with gamma >= least alone.
  Turns(const Optics<real>& optics, int p, real least = 0) : o_(optics), p_(p) {
    const real square = static_cast<real>(p) * static_cast<real>(p);
    const real at_rim = std::atan2(1.0L, std::sqrt(o_.excess));
    last_ = 2 * static_cast<real>(p) * at_rim - pi;
    if (p > 1 && square - 1 >= o_.excess) {
      const real cos2 = o_.excess / (square - 1); // p cos gamma = W
      has_maximum_ = true;
      top_ = std::atan2(std::sqrt(1 - cos2), std::sqrt(cos2));
      highest_ = u(top_);
    }
    if (least > top_) {
      has_maximum_ = false;
      top_ = least;
      highest_ = u(least);
    }
  }

  [[nodiscard]] bool has_maximum() const { return has_maximum_; }
  [[nodiscard]] real top() const { return top_; }         ///< gamma of the maximum, 0 if there is none
  [[nodiscard]] real highest() const { return highest_; } ///< u there
  [[nodiscard]] real last() const { return last_; }       ///< u at the rim

  [[nodiscard]] real u(real gamma) const {
    const Ray<real> ray(o_, std::sin(gamma), std::cos(gamma));
    return 2 * (static_cast<real>(p_) * ray.refracted() - gamma);
  }

  /// Calls found(gamma, other side) for each ray that leaves toward `azimuth`; other side: h < 0.
  template <typename Found>
  void roots_toward(real azimuth, Found&& found) const {
    const real base = azimuth - (p_ % 2 == 0 ? 0 : pi);
    const bool with_axis = top_ == 0 || has_maximum_;
    const auto one_side = [&](real first, bool other_side) {
      const real lowest = has_maximum_ ? std::min(last_, 0.0L) : last_;
      real target = first + 2 * pi * std::ceil((lowest - first) / (2 * pi) - 1e-9L);
      for (; target <= highest_; target += 2 * pi)
        on_one_side(target, with_axis && !other_side, [&](real gamma) { found(gamma, other_side); });
    };
    one_side(base, false);
    one_side(-base, true);
  }

private:
  template <typename Found>
  void on_one_side(real target, bool with_axis, Found&& found) const {
    if (!(target <= highest_)) return;
    if (has_maximum_ && (target > 0 || (target == 0 && with_axis))) found(newton(target, 0, 1));
    // The ray along the axis of symmetry belongs to both sides, and counts once.
    const bool counts = has_maximum_ || top_ > 0 || target < 0 || with_axis;
    if (counts && target >= last_) found(newton(target, pi / 2, -1));
  }

  /// From the outer end of a piece, away from the maximum: the tangent of a concave function lies above it,
  /// so no step passes the root. Slow only where target is all but the maximum: half the way each step.
  [[nodiscard]] real newton(real target, real gamma, int direction) const {
    for (int step = 0; step < 200; ++step) {
      const real sine = std::sin(gamma), cosine = std::cos(gamma);
      const Ray<real> ray(o_, sine, cosine);
      const real miss = target - 2 * (static_cast<real>(p_) * ray.refracted() - gamma);
      const real slope = 2 * (static_cast<real>(p_) * cosine - ray.W) / ray.W;
      if (!(miss > 0) || slope * static_cast<real>(direction) <= 0) break; // rounding has the rest
      const real next = gamma + miss / slope;
      if (next == gamma) break;
      gamma = direction > 0 ? std::min(next, top_) : std::max(next, top_);
      if (gamma == top_) break;
    }
    return gamma;
  }

  const Optics<real>& o_;
  int p_;
  bool has_maximum_ = false;
  real top_ = 0, highest_ = 0, last_ = 0;
};

/// Nodes and weights of Gauss and Legendre on [-1, 1].
template <int count>
struct Legendre {
  std::array<double, count> node{}, weight{};
  Legendre() {
    for (int i = 0; i < count; ++i) {
      real x = std::cos(pi * (static_cast<real>(i) + 0.75L) / (static_cast<real>(count) + 0.5L)), slope = 1;
      for (int step = 0; step < 10; ++step) {
        real before = 1, value = x;
        for (int n = 2; n <= count; ++n) {
          const real next = (static_cast<real>(2 * n - 1) * x * value - static_cast<real>(n - 1) * before) /
                            static_cast<real>(n);
          before = value;
          value = next;
        }
        slope = static_cast<real>(count) * (x * value - before) / (x * x - 1);
        x -= value / slope;
      }
      node[static_cast<std::size_t>(i)] = static_cast<double>(x);
      weight[static_cast<std::size_t>(i)] = static_cast<double>(2 / ((1 - x * x) * slope * slope));
    }
  }
};

/// Integrates f(ray, complement of gamma, weight d h) over h = 0..1 in panels that halve toward the rim,
/// where Fresnel's values change fastest: within pi/2 .. `inside` [complement], and splits them at `cuts`.
template <typename Function>
void integrate(
    const Optics<double>& o, std::vector<double> cuts, double widest_panel, double outermost, Function&& f) {
  static const Legendre<16> rule;
  constexpr int halvings = 28;
  const double start = std::min(outermost, std::numbers::pi / 2);
  cuts.push_back(0);
  for (int k = 0; k <= halvings; ++k) cuts.push_back(std::ldexp(start, -k));
  std::ranges::sort(cuts);
  for (std::size_t i = 0; i + 1 < cuts.size() && cuts[i] < start; ++i) {
    const double from = cuts[i], to = std::min(cuts[i + 1], start);
    if (!(to > from)) continue;
    const int pieces = static_cast<int>(std::min(std::ceil((to - from) / widest_panel), 1e6));
    const double width = (to - from) / pieces;
    for (int piece = 0; piece < pieces; ++piece)
      for (std::size_t n = 0; n < rule.node.size(); ++n) {
        const double c = from + width * (piece + 0.5 + 0.5 * rule.node[n]);
        const Ray<double> ray(o, std::cos(c), std::sin(c));
        f(ray, c, 0.5 * width * rule.weight[n] * ray.cos_gamma);
      }
  }
}

/// |azimuth| in 0..pi of a ray at the complement c, order p.
double exit_azimuth(const Ray<double>& ray, double c, int p) {
  const double phi = 2 * p * ray.refracted() + 2 * c - std::numbers::pi + (p % 2) * std::numbers::pi;
  return std::abs(std::remainder(phi, 2 * std::numbers::pi));
}

/// Complements of gamma where the ray of order p leaves toward +-azimuth, for all of `azimuths`, 0..pi.
std::vector<double>
complements(const Optics<real>& o, int p, double outermost, std::initializer_list<double> azimuths) {
  std::vector<double> found;
  for (const double azimuth : azimuths) {
    if (p == 0) {
      found.push_back((std::numbers::pi - azimuth) / 2);
      continue;
    }
    const Turns turns(o, p, std::max(pi / 2 - static_cast<real>(outermost), 0.0L));
    turns.roots_toward(
        azimuth, [&](real gamma, bool) { found.push_back(static_cast<double>(pi / 2 - gamma)); });
  }
  return found;
}

/// Beyond this complement of gamma, A_p is below 1e-20 of what it may be.
double outermost(const Optics<double>& o, int p) {
  if (p < 8) return std::numbers::pi / 2;
  double bound = std::numbers::pi / 2;
  for (double c = bound; c > 1e-9; c /= 2) {
    const Ray<double> ray(o, std::cos(c), std::sin(c));
    const Surface<double> surface(o, ray.cos_gamma);
    const double F = std::max(surface.r_s * surface.r_s, surface.r_p * surface.r_p);
    if (std::pow(F, p - 1) > 1e-20) break;
    bound = c;
  }
  return bound;
}

OrderMoments moments_of(const Optics<double>& o, const Optics<real>& wide, int p) {
  OrderMoments sum;
  const double half = std::numbers::pi / 2, end = outermost(o, p);
  auto cuts = complements(wide, p, end, {0, half, std::numbers::pi});
  integrate(o, std::move(cuts), 1, end, [&](const Ray<double>& ray, double c, double dh) {
    const double energy = attenuation(o, ray, p) * dh, phi = exit_azimuth(ray, c, p);
    sum.energy += energy;
    sum.forward += energy * (phi / std::numbers::pi);
    if (phi >= half) sum.forward_half += energy;
  });
  return sum;
}

/// Of the orders first <= p < last together, p >= 1, one set of rays for all.
OrderMoments unsplit_moments(const Optics<double>& o, int first, int last) {
  OrderMoments sum;
  integrate(o, {}, 1, outermost(o, first), [&](const Ray<double>& ray, double c, double dh) {
    const Surface<double> surface(o, ray.cos_gamma);
    const double turn = 2 * ray.refracted() + std::numbers::pi;
    const double passed = std::exp(-o.sigma_a * ray.chord(o));
    Chain<double> chain(o, surface, ray, first);
    double absorbed = std::pow(passed, first) * dh;
    for (int p = first; p < last; ++p, absorbed *= passed, chain.reflect()) {
      const double energy = chain.let_out() * absorbed;
      if (!(energy > 1e-22)) break; // of 1; only falls
      const double phi = std::abs(std::remainder(p * turn + 2 * c - std::numbers::pi, 2 * std::numbers::pi));
      sum.energy += energy;
      sum.forward += energy * (phi / std::numbers::pi);
      if (phi >= std::numbers::pi / 2) sum.forward_half += energy;
    }
  });
  return sum;
}

double energy_from(const Optics<double>& o, int first) {
  double sum = 0;
  integrate(o, {}, 1, outermost(o, first), [&](const Ray<double>& ray, double, double dh) {
    sum += attenuation_from(o, ray, first) * dh;
  });
  return sum;
}

} // namespace

double bravais_index(double eta, double theta_d) {
  check(theta_d);
  return static_cast<double>(Optics<real>(RaySection(eta, 0), theta_d).eta_prime);
}

RaySection::RaySection(double eta, double sigma_a, Polarisation polarisation)
    : eta_(eta), sigma_a_(sigma_a), polarisation_(polarisation) {
  if (!(eta > 1 && std::isfinite(eta)))
    throw InputError(fmt::format(
        "an index of refraction eta = {} is not possible for rays: it must be finite and greater than 1, "
        "such as 1.55",
        eta));
  if (!(sigma_a >= 0 && std::isfinite(sigma_a)))
    throw InputError(fmt::format(
        "an absorption sigma_a = {} per radius is not possible: it must be finite and not "
        "negative, such as 0.2",
        sigma_a));
}

std::vector<RayEvent> RaySection::events(int order, double theta_d, double phi) const {
  check(order, theta_d);
  if (!std::isfinite(phi)) throw InputError(fmt::format("an azimuth phi of {} is not possible", phi));
  const Optics<real> o(*this, theta_d);
  const real wrapped = std::remainder(static_cast<real>(phi), 2 * pi), azimuth = std::abs(wrapped);
  std::vector<RayEvent> found;
  const auto add = [&](real sine, real cosine, bool other_side) {
    const Ray<real> ray(o, sine, cosine);
    const auto h = static_cast<double>(sine);
    found.push_back(
        {other_side != (wrapped < 0) ? -h : h, static_cast<double>(cosine),
         static_cast<double>(ray.W / o.eta_prime), static_cast<double>(ray.spread(order)),
         static_cast<double>(attenuation(o, ray, order))});
  };
  if (order == 0) {
    add(std::sin(azimuth / 2), std::cos(azimuth / 2), true);
    found[0].spread = found[0].cos_incidence / 4;
  } else if (order == 1) {
    // tan gamma = eta' sin delta / (eta' cos delta - 1) for half the deflection delta; no light beyond.
    const real delta = (pi - azimuth) / 2, sine = o.eta_prime * std::sin(delta);
    const real cosine = o.eta_prime * std::cos(delta) - 1, size = std::hypot(sine, cosine);
    if (cosine >= 0 && size > 0) add(sine / size, cosine / size, false);
  } else {
    const Turns turns(o, order);
    turns.roots_toward(
        azimuth, [&](real gamma, bool other_side) { add(std::sin(gamma), std::cos(gamma), other_side); });
  }
  return found;
}

double RaySection::distribution(int order, double theta_d, double phi) const {
  double sum = 0;
  for (const RayEvent& event : events(order, theta_d, phi)) {
    // Infinitely many rays of no energy are none.
    if (event.attenuation > 0 && event.spread > 0) sum += event.attenuation * event.spread;
  }
  return sum;
}

OrderMoments RaySection::moments(int order, double theta_d) const {
  check(order, theta_d);
  return moments_of(Optics<double>(*this, theta_d), Optics<real>(*this, theta_d), order);
}

OrderMoments RaySection::residual(int first_order, double theta_d) const {
  check(first_order, theta_d);
  const Optics<double> o(*this, theta_d);
  const Optics<real> wide(*this, theta_d);
  OrderMoments sum;
  sum.energy = energy_from(o, first_order);
  // Energy has a closed sum; where the light goes has not. The first orders are split where the weights have
  // kinks, those after them, of 1e-5 of the energy, are not; what is left in the end goes around evenly.
  constexpr int split = 16, unsplit = 256;
  OrderMoments listed;
  for (int p = first_order; p < first_order + split; ++p) {
    const OrderMoments order = moments_of(o, wide, p);
    listed.energy += order.energy;
    listed.forward += order.forward;
    listed.forward_half += order.forward_half;
    if (sum.energy - listed.energy < 1e-14) break;
  }
  if (sum.energy - listed.energy > 1e-12) {
    const OrderMoments rest = unsplit_moments(o, first_order + split, first_order + split + unsplit);
    listed.forward += rest.forward;
    listed.forward_half += rest.forward_half;
    const double left = energy_from(o, first_order + split + unsplit);
    listed.forward += left / 2;
    listed.forward_half += left / 2;
  }
  return {sum.energy, listed.forward, listed.forward_half};
}

double RaySection::residual_energy(int first_order, double theta_d) const {
  check(first_order, theta_d);
  return energy_from(Optics<double>(*this, theta_d), first_order);
}

std::vector<double> RaySection::caustics(int order, double theta_d) const {
  check(order, theta_d);
  const Optics<real> o(*this, theta_d);
  if (order < 2) return {};
  const Turns turns(o, order);
  if (!turns.has_maximum()) return {};
  const real azimuth = turns.highest() + (order % 2 == 0 ? 0 : pi);
  return {static_cast<double>(std::abs(std::remainder(azimuth, 2 * pi)))};
}

double RaySection::error_estimate(int order, double theta_d, double phi) const {
  if (!std::isfinite(phi)) throw InputError(fmt::format("an azimuth phi of {} is not possible", phi));
  std::vector<double> edges = caustics(order, theta_d);
  constexpr double half_turn = std::numbers::pi;
  const double rim = 2 * order * std::asin(1 / bravais_index(eta_, theta_d)) + (order - 1) * half_turn;
  edges.push_back(std::abs(std::remainder(rim, 2 * half_turn)));
  const double around = std::abs(std::remainder(phi, 2 * half_turn));
  double distance = half_turn;
  for (const double edge : edges) distance = std::min(distance, std::abs(around - edge));
  return distance > 1e-15 ? std::clamp(1e-15 / distance, 1e-12, 1.0) : 1;
}

double RaySection::energy_between(int order, double theta_d, double from, double to) const {
  check(order, theta_d);
  if (!(from >= -std::numbers::pi && to <= std::numbers::pi && from <= to))
    throw InputError(
        fmt::format("a window of azimuths from {} to {} is not possible: -pi <= from <= to <= pi", from, to));
  const Optics<double> o(*this, theta_d);
  const Optics<real> wide(*this, theta_d);
  const double end = outermost(o, order);
  const auto below = [&](double bound) { // integral over |phi| < bound
    double sum = 0;
    integrate(
        o, complements(wide, order, end, {bound}), 1, end, [&](const Ray<double>& ray, double c, double dh) {
          if (exit_azimuth(ray, c, order) < bound) sum += attenuation(o, ray, order) * dh;
        });
    return sum;
  };
  const double first = below(std::abs(from)) / 2, last = below(std::abs(to)) / 2;
  return (to < 0 ? -last : last) - (from < 0 ? -first : first);
}

double RaySection::averaged(int order, double theta_d, double phi, double width) const {
  check(order, theta_d);
  if (!std::isfinite(phi)) throw InputError(fmt::format("an azimuth phi of {} is not possible", phi));
  if (!(width >= 1e-3 && width <= 10))
    throw InputError(fmt::format("an average over {} rad is not possible: 0.001..10", width));
  const Optics<double> o(*this, theta_d);
  const double turn = 2 * std::numbers::pi, norm = 1 / (width * std::sqrt(turn));
  double sum = 0;
  // d phi / d gamma is below 2 p + 2 in size.
  integrate(
      o, {}, width / (order + 1), outermost(o, order), [&](const Ray<double>& ray, double c, double dh) {
        const double out = exit_azimuth(ray, c, order);
        double window = 0;
        for (const double side : {phi - out, phi + out}) {
          const double nearest = std::remainder(side, turn);
          // Whole turns that bring it within 9 widths: mostly none.
          for (double k = std::ceil((-9 * width - nearest) / turn); nearest + k * turn <= 9 * width; ++k) {
            const double x = (nearest + k * turn) / width;
            window += std::exp(-0.5 * x * x);
          }
        }
        if (window > 0) sum += attenuation(o, ray, order) * dh * 0.5 * norm * window;
      });
  return sum;
}

} // namespace scatter::fiber
