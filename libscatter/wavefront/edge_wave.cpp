#include <scatter/optics/units.hpp>
#include <scatter/wavefront/airy_edge.hpp>
#include <scatter/wavefront/edge_wave.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::wavefront {
namespace {

using Complex = std::complex<double>;
constexpr Complex i{0, 1};

constexpr double furthest_scaled = 6;
/// The reflected ray's next order comes in between these (x/2)^(1/3) theta: below it does not hold.
constexpr double next_order_begin = 3.5, next_order_end = 5.5;
/// Up to here, in -tau, Airy functions; then Debye's approximation.
constexpr double airy_end = 30;
/// The next order's terms are singular one by one at 180 deg: the angle where they stop changing [rad].
constexpr double next_order_stop = 2.9;
/// How far the path goes, in tau: on it S falls like exp(-4/3 r^(3/2)), against exp(0.87 r T).
constexpr double longest = 25;
/// Between nodes of the double exponential rule r = exp(t - exp(-t)).
constexpr double rule_step = 1.0 / 32;

/// beta with sin(beta) - beta cos(beta) = value, value (3/2) = (-tau)^(3/2) / x given as root = sqrt(-tau).
Complex rim_angle(Complex root, double x) {
  const Complex value = 2.0 / 3 * root * root * root / x;
  Complex beta = std::cbrt(2 / x) * root;
  for (int step = 0; step < 20; ++step) {
    const Complex b2 = beta * beta;
    Complex f = 0;
    if (std::abs(beta) < 0.5) {
      // sum of (-1)^(k+1) 2 k beta^(2k+1) / (2k+1)!
      Complex power = beta * b2 / 6.0;
      for (int k = 1; k < 12; ++k) {
        f += 2.0 * k * power;
        power *= -b2 / ((2.0 * k + 2) * (2.0 * k + 3));
      }
    } else {
      f = std::sin(beta) - beta * std::cos(beta);
    }
    const Complex change = (f - value) / (beta * std::sin(beta));
    beta -= change;
    if (std::abs(change) < 1e-15 * std::abs(beta)) break;
  }
  return beta;
}

/// Logarithmic derivatives by x of the Riccati-Hankel functions outside: their change by tau over themselves
/// (w'/w for both kinds), with what the slowly varying factor adds.
struct Outside {
  Complex scale, slope;
};
Outside outside(Complex tau, Complex root, Complex beta, double x) {
  const Complex cosine = std::sin(beta), sine = std::cos(beta);
  const Complex scale = cosine / root;
  return {scale, sine * sine / (x * cosine * cosine) + scale / (2.0 * tau)};
}

/// A Riccati-Hankel function's Airy function and its derivative by tau, with the next term of Olver's series:
/// w + b w'. b follows from Debye's approximation, whose first correction it must give back far from the rim.
struct Wave {
  Complex value, slope;
};
Complex next_term(Complex beta, Complex root, double x) {
  // The difference tends to beta / 70.
  const Complex cosine = std::sin(beta), cotangent = std::cos(beta) / cosine;
  const Complex phase = std::abs(beta) < 0.1 ? beta / 70.0
                                             : (1.0 + 5.0 / 3 * cotangent * cotangent) / (8.0 * cosine) -
                                                   5.0 / (72.0 * (cosine - beta * std::cos(beta)));
  return phase / (x * root);
}
Wave corrected(Complex w, Complex slope, Complex b, Complex tau) {
  return {w + b * slope, slope + b * tau * w};
}

} // namespace

Polarised EdgeWave::S_over(Complex ratio, Complex in, Complex out, Complex cos_squared) const {
  const Complex sine_squared = (1.0 - cos_squared) / (m_ * m_), inside = std::sqrt(1.0 - sine_squared);
  // The wave that goes inwards, inside: Debye's approximation with its first correction.
  const Complex inner = i * inside + sine_squared / (inside * inside) / (2.0 * m_ * x_);
  return {-ratio * (in + m_ * inner) / (out + m_ * inner), -ratio * (in + inner / m_) / (out + inner / m_)};
}

EdgeWave::EdgeWave(double x, Complex m) : x_(x), gamma_(std::cbrt(0.5 * x)), m_(m) {
  const Complex third = std::polar(1.0, 2 * pi / 3);
  for (double t = -3.5; t < 4; t += rule_step) {
    const double r = std::exp(t - std::exp(-t)), weight = r * (1 + std::exp(-t)) * rule_step;
    if (r > longest) break;
    const Airy a = airy(r);
    for (const bool lit : {true, false}) {
      // On the lit side along tau = r exp(2 pi i / 3), where Ai and Bi of tau are those of r (DLMF 9.2.11).
      const Complex tau = lit ? r * third : r;
      const Complex root = lit ? std::polar(std::sqrt(r), -pi / 6) : Complex(0, std::sqrt(r));
      const Complex beta = rim_angle(root, x);
      Complex w1, w2, w1_slope, w2_slope;
      if (lit) {
        w1 = (a.Ai + i * a.Bi) / third;
        w2 = 2 * a.Ai * std::polar(1.0, pi / 3);
        w1_slope = (a.Ai_slope + i * a.Bi_slope) / (third * third);
        w2_slope = 2 * a.Ai_slope * std::polar(1.0, -pi / 3);
      } else {
        w1 = a.Ai - i * a.Bi;
        w2 = a.Ai + i * a.Bi;
        w1_slope = a.Ai_slope - i * a.Bi_slope;
        w2_slope = a.Ai_slope + i * a.Bi_slope;
      }
      const auto [scale, slope] = outside(tau, root, beta, x);
      const Complex b = next_term(beta, root, x), cosine = std::sin(beta);
      const Wave first = corrected(w1, w1_slope, b, tau), second = corrected(w2, w2_slope, b, tau);
      const Complex out = -scale * first.slope / first.value - 0.5 * slope;
      const Complex in = -scale * second.slope / second.value - 0.5 * slope;
      Polarised S = S_over(second.value / first.value, in, out, cosine * cosine);
      Complex change = weight * root / beta;
      // The path comes in from infinity on the lit side.
      if (lit) change *= -third;
      for (Complex& value : S) value = (lit ? value : value - 1.0) * change;
      const Complex half = std::sin(0.5 * beta);
      nodes_.push_back({-2 * x * half * half, std::sqrt(std::cos(beta)), S});
    }
  }
}

double EdgeWave::furthest() const {
  return std::min(furthest_scaled / gamma_, 2.0);
}

EdgeWave::At EdgeWave::at(double theta) const {
  At made{};
  for (int q = 0; q < 2; ++q) {
    made.weight[q] = made.line_weight[q] = 1;
  }
  for (const Node& node : nodes_) {
    const Complex phasor = std::exp(-i * theta * node.step);
    const Complex line = (i * theta - 0.5 / (x_ + node.step)) * node.line;
    for (int q = 0; q < 2; ++q) {
      const Complex term = node.S[q] * phasor;
      made.tail[q] += term;
      made.moment[q] -= term * (1.0 - i * theta * node.step);
      made.second_moment[q] -= term * node.step * (2.0 - i * theta * node.step);
      made.line_weight[q] += term * line;
    }
  }
  for (int q = 0; q < 2; ++q) made.weight[q] += i * theta * made.tail[q];
  if (theta > 0) {
    // x/2 exp(-2 i x sin(theta/2)) against what a sharp edge sends there.
    const Polarised r = reflection(theta);
    const Complex edge = i * std::sqrt(x_ / (2 * pi * theta)) / theta * std::polar(1.0, pi / 4) /
                         std::sqrt(std::sin(theta) / theta);
    const double half = 0.5 * theta;
    // 2 sin(theta/2) - theta without cancellation.
    double excess = 0, power = theta;
    for (int k = 1; k < 14; ++k) {
      power *= -half * half / ((2.0 * k) * (2.0 * k + 1));
      excess += power;
    }
    for (int q = 0; q < 2; ++q) made.reflected[q] = 0.5 * x_ * r[q] * std::polar(1.0, -x_ * excess) / edge;
  }
  return made;
}

Polarised EdgeWave::coefficients(double theta) const {
  const double cosine = std::sin(0.5 * theta), sine = std::cos(0.5 * theta);
  const double ray = x_ * (cosine - sine * 0.5 * theta), tau = -std::pow(1.5 * std::max(ray, 1e-12), 2.0 / 3);
  Complex out, ratio; // of the waves, without the ray's phase
  if (tau < -airy_end) {
    const double tangent2 = sine * sine / (cosine * cosine);
    out = {-tangent2 / (2 * x_), cosine * (1 - 5 / (32 * tau * tau * tau))};
    ratio = i * std::polar(1.0, (1 + 5.0 / 3 * tangent2) / (4 * x_ * cosine));
  } else {
    const Airy a = airy(tau);
    const Complex root = std::sqrt(-tau), beta = rim_angle(root, x_);
    const auto [scale, slope] = outside(tau, root, beta, x_);
    const Wave w = corrected({a.Ai, -a.Bi}, {a.Ai_slope, -a.Bi_slope}, next_term(beta, root, x_), tau);
    out = -scale * w.slope / w.value - 0.5 * slope;
    ratio = std::conj(w.value) / w.value * std::polar(1.0, 2 * std::max(ray, 1e-12));
  }
  Polarised r = S_over(ratio, std::conj(out), out, cosine * cosine);
  for (Complex& value : r) value = -value;
  return r;
}

Polarised EdgeWave::reflection(double theta) const {
  Polarised r = coefficients(theta);
  const double s =
      std::clamp((gamma_ * theta - next_order_begin) / (next_order_end - next_order_begin), 0.0, 1.0);
  if (s == 0) return r;
  // Stationary phase to the next order (Bleistein & Handelsman 1975, Asymptotic Expansions of Integrals,
  // section 6.1) of sqrt(lambda) r(lambda) exp(-2 i x (c - s acos s) - i lambda theta), s = lambda / x, by
  // lambda; with the next order of Legendre's functions.
  const double weight = s * s * (3 - 2 * s), at = std::min(theta, next_order_stop);
  const double c = std::sin(0.5 * at), sine = std::cos(0.5 * at), lambda = x_ * sine;
  constexpr double step = 0.01;
  const Polarised here = coefficients(at), before = coefficients(at - step), after = coefficients(at + step);
  // By lambda: d theta / d lambda = -2 / (x c).
  const double turn = -2 / (x_ * c), turn_slope = -2 * sine / (x_ * x_ * c * c * c);
  const double third = sine / (x_ * c * c), fourth = (1 + 3 * sine * sine / (c * c)) / (x_ * x_ * c * c);
  Polarised factor;
  for (int q = 0; q < 2; ++q) {
    const Complex by_theta = (after[q] - before[q]) / (2 * step);
    const Complex twice = (after[q] - 2.0 * here[q] + before[q]) / (step * step);
    const Complex first = by_theta * turn, second = twice * turn * turn + by_theta * turn_slope;
    // Those of sqrt(lambda) r over sqrt(lambda).
    const Complex g1 = first + here[q] / (2 * lambda);
    const Complex g2 = second + first / lambda - here[q] / (4 * lambda * lambda);
    factor[q] =
        -0.25 * i * x_ * c * (g2 - third * g1 + (5.0 / 12 * third * third - 0.25 * fourth) * here[q]) +
        i * std::cos(at) / (8 * lambda * std::sin(at)) * here[q] +
        i / (lambda * std::sin(at)) * (here[1 - q] - std::cos(at) * here[q]);
  }
  // At a critical angle (m < 1) the series fails: then nothing large comes of it.
  for (int q = 0; q < 2; ++q) r[q] += weight * factor[q] / std::max(1.0, std::abs(factor[q]) / 0.3);
  return r;
}

} // namespace scatter::wavefront
