// Method. With c = sin(tilt), s = cos(tilt), the radial arguments are xi = x s outside and eta = x sqrt(e), e
// = m^2 - c^2, inside. Per order n the waves E_z and H_z couple; in their basis (case I, case II) the
// scattered wave is
//   B = (J/H) K (J'/J - L),  K = (H'/H - L)^-1,  L = [[m^2 l, d], [d, l]],  l = (s / sqrt(e)) J'(eta) /
//   J(eta), d = n c (xi^2 / eta^2 - 1) / xi,
// which is Bohren & Huffman's b_nI = B_11, a_nII = B_22, a_nI = -b_nII = i B_21 divided through by J_n(eta).
// Written with sigma = H_{n+1}/H_n, p = xi q_n(eta), q_n(z) = J_{n+1}(z) / (z J_n(z)), alpha = n (m^2 - 1) /
// xi and u = sigma - p, w = sigma - m^2 p, the square d^2 cancels on paper and
//   e det(H'/H - L) = e u w - alpha (w + c^2 u),
// finite at the critical tilt e = 0 and a function of eta^2 alone, so that imaginary eta needs no care. The
// numerators have differences q_n(xi) - q_n(eta) by a recurrence of their own; the absorbed share is a sum
// over the imaginary parts of m^2 and p in closed form. Everything is in long double; nothing is anchored on
// a number that may vanish.
//
// Debye terms: the same with the inward wave H^(2) in place of J inside, B_0 = (J/H) K_2 (J'/J - L_2), and
// B_p = -(2i / (pi xi H^2)) g K_2 (L_1 - L_2) (R g)^(p-1) K_2, g = H^(1)/H^(2) at eta, R = K_2 (L_1 - L_2)
// - 1.

#include <scatter/exact/azimuth_sum.hpp>
#include <scatter/exact/bessel.hpp>
#include <scatter/exact/cylinder.hpp>
#include <scatter/exact/long_complex.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <sstream>
#include <utility>

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;
constexpr real pi = std::numbers::pi_v<real>;
constexpr int most_orders = 1000;

/// The cylinder and the wave in the numbers that the formulas take.
struct Setting {
  real x = 0, c = 0, s = 0, xi = 0;
  LongComplex m, m_squared, contrast; ///< contrast = m^2 - 1
  LongComplex e, eta_squared;

  Setting(real size_parameter, std::complex<double> index, real sine, real cosine)
      : x(size_parameter), c(sine), s(cosine), xi(x * s), m{index.real(), index.imag()}, m_squared(m * m),
        contrast(LongComplex{m.re - 1, m.im} * LongComplex{m.re + 1, m.im}),
        e(contrast + LongComplex{s * s, 0}), eta_squared((x * x) * e) {}
};

/// B of one order.
struct Wave {
  LongComplex b1, a2, a1; ///< b_nI, a_nII, a_nI
};

/// A symmetric matrix.
struct Symmetric {
  LongComplex I, cross, II;
};
real norm(const Symmetric& k) {
  return norm(k.I) + 2 * norm(k.cross) + norm(k.II);
}

/// What the outside contributes to one order.
struct Outside {
  real n = 0, J = 0, J_ratio = 0; ///< J_ratio: J_{n+1} / J_n
  LongComplex H, sigma;           ///< H_n, H_{n+1} / H_n
  real wronskian = 0;             ///< 2 / (pi xi)
  LongComplex e, alpha;           ///< of order 0, where alpha = 0 and e cancels: e = 1
};

/// One kind of wave inside (J, or the inward H^(2)) against the outgoing wave outside.
struct Meeting {
  LongComplex p, u, w, determinant; ///< determinant: e det(H'/H - L)

  Meeting(const Setting& setting, const Outside& out, LongComplex q) {
    p = setting.xi * q;
    u = out.sigma - p;
    w = out.sigma - setting.m_squared * p;
    determinant = out.e * u * w - out.alpha * (w + (setting.c * setting.c) * u);
  }

  /// How many times larger than the determinant the terms are that cancel in it.
  [[nodiscard]] real loss(const Setting& setting, const Outside& out) const {
    const real sigma = abs(out.sigma), u_terms = sigma + abs(p), w_terms = sigma + abs(setting.m_squared * p);
    const real terms =
        abs(out.e) * u_terms * w_terms + abs(out.alpha) * (w_terms + setting.c * setting.c * u_terms);
    return terms / abs(determinant);
  }

  /// (H'/H - L)^-1
  [[nodiscard]] Symmetric resolvent(const Setting& setting, const Outside& out) const {
    const LongComplex scale = inverse(determinant);
    return {
        scale * (out.alpha - out.e * u), -(setting.c * (scale * out.alpha)),
        scale * ((setting.c * setting.c) * out.alpha - out.e * w)};
  }

  /// difference: q_n(xi) less the q of the wave inside, which is q.
  [[nodiscard]] Wave
  wave(const Setting& setting, const Outside& out, LongComplex q, LongComplex difference) const {
    const real c_squared = setting.c * setting.c;
    const LongComplex u_J = setting.xi * difference, w_J = setting.xi * (difference - setting.contrast * q);
    const LongComplex scale = inverse(determinant), J_over_H = out.J * inverse(out.H);
    return {
        J_over_H * scale * (out.e * u * w_J - out.alpha * (w_J + c_squared * u)),
        J_over_H * scale * (out.e * u_J * w - out.alpha * (w + c_squared * u_J)),
        -((setting.c * out.wronskian) * (out.alpha * scale / (out.H * out.H)))};
  }
};

/// H_n^(1)(eta) and H_n^(2)(eta), n rising, in the combinations that the Debye terms need.
class InnerWaves {
public:
  explicit InnerWaves(const Setting& setting) : eta_squared_(setting.eta_squared) {
    const LongComplex eta = sqrt(eta_squared_); // Im >= 0: H^(1) decays along Im eta
    const HankelStart start = hankel_start(eta);
    q1_ = start.ratio / eta;
    inverse_square_ = inverse(start.value * start.value);
    exponent_ = -2 * start.exponent;
  }

  struct At {
    LongComplex q1, q2; ///< H_{n+1} / (eta H_n) of H^(1) and H^(2)
    LongComplex q2_less_q1;
    LongComplex ratio; ///< H^(1) / H^(2)
  };

  /// q_J: q_n(eta) of J, for the n that is due.
  [[nodiscard]] At at(LongComplex q_J) const {
    // H2 = 2J - H1 and J from its Wronskian with H1: H1 J = (2i / (pi eta^2)) / (q_J - q1).
    const LongComplex unit = 2 / pi * times_i(inverse(eta_squared_)); // 2i / (pi eta^2)
    const LongComplex twice_JH = 2 * (unit / (q_J - q1_));
    At result;
    result.q1 = q1_;
    LongComplex inverse_product; // 1 / (H1 H2)
    if (exponent_ > 8000) {      // H1^2 is nothing beside J H1: no light gets through
      inverse_product = inverse(twice_JH);
    } else {
      const LongComplex inverse_H1_squared = std::ldexp(1.0L, static_cast<int>(exponent_)) * inverse_square_;
      const LongComplex H2_over_H1 = twice_JH * inverse_H1_squared - LongComplex{1, 0};
      result.ratio = inverse(H2_over_H1);
      inverse_product = inverse_H1_squared * result.ratio;
    }
    result.q2_less_q1 = 2 * (unit * inverse_product);
    result.q2 = q1_ + result.q2_less_q1;
    return result;
  }

  /// From n to n + 1.
  void advance(std::size_t n) {
    const LongComplex ratio_squared = eta_squared_ * q1_ * q1_; // (H_{n+1} / H_n)^2
    inverse_square_ = inverse_square_ / ratio_squared;
    const real size = std::max(std::abs(inverse_square_.re), std::abs(inverse_square_.im));
    int shift = 0;
    (void)std::frexp(size, &shift);
    inverse_square_ = std::ldexp(1.0L, -shift) * inverse_square_;
    exponent_ += shift;
    q1_ = (LongComplex{static_cast<real>(2 * n + 2), 0} - inverse(q1_)) / eta_squared_;
  }

private:
  LongComplex eta_squared_, q1_;
  LongComplex inverse_square_; ///< 1 / H_n^(1)^2 = inverse_square * 2^exponent
  long exponent_ = 0;
};

/// Coefficients of T1, T2, T3 as the sums over theta take them.
struct Coefficients {
  std::vector<LongComplex> T1, T2, T3;
  real lost = 0; ///< of a Debye term: sum of squares, coefficients times what their roundings grow by
  void add(std::size_t n, const Wave& wave) {
    const real weight = n == 0 ? 1 : 2;
    T1.push_back(weight * wave.b1);
    T2.push_back(weight * wave.a2);
    T3.push_back(-(weight * times_i(wave.a1)));
  }
  /// What is cut off: of the size of the last term.
  [[nodiscard]] real rest() const { return std::sqrt(norm(T1.back()) + norm(T2.back()) + norm(T3.back())); }
  [[nodiscard]] real size() const {
    real total = 0;
    for (const auto* list : {&T1, &T2, &T3})
      for (const LongComplex& value : *list) total += norm(value);
    return std::sqrt(total);
  }
};

/// All that does not depend on theta.
struct Solution {
  Coefficients total, remainder;
  std::vector<Coefficients> orders;
  ByCase Qext, Qsca, Qabs;
  double relative_error = 0; ///< of the coefficients, against the largest of them
};

/// The Debye terms of one order n, p = 0 and up.
class DebyeTerms {
public:
  DebyeTerms(const Setting& setting, const Outside& out, const InnerWaves::At& inside, LongComplex q_outside)
      : m_squared_(setting.m_squared), ratio_(inside.ratio) {
    const Meeting meeting(setting, out, inside.q2);
    loss_ = meeting.loss(setting, out);
    first_ = meeting.wave(setting, out, inside.q2, q_outside - inside.q2);
    K_ = meeting.resolvent(setting, out);
    const LongComplex L1_less_L2 = setting.xi * inside.q2_less_q1; // of l; m^2 times it for case I
    front_ = -(out.wronskian * times_i(inverse(out.H * out.H))) * L1_less_L2 * ratio_;
    // R g = (K (L1 - L2) - 1) g
    cross_I_ = L1_less_L2 * m_squared_ * K_.cross * ratio_;
    cross_II_ = L1_less_L2 * K_.cross * ratio_;
    R_I_ = (L1_less_L2 * m_squared_ * K_.I - LongComplex{1, 0}) * ratio_;
    R_II_ = (L1_less_L2 * K_.II - LongComplex{1, 0}) * ratio_;
    X11_ = K_.I;
    X21_ = K_.cross;
    X22_ = K_.II;
    X12_ = K_.cross;
  }

  /// Roundings of a term grow by this: large where the waves do not travel at this n.
  [[nodiscard]] real loss() const { return loss_; }

  /// The next p, from 0.
  Wave next() {
    if (p_++ == 0) return first_;
    if (p_ > 2) {
      const auto apply = [&](LongComplex& first, LongComplex& second) {
        const LongComplex old = first;
        first = R_I_ * old + cross_II_ * second;
        second = cross_I_ * old + R_II_ * second;
      };
      apply(X11_, X21_);
      apply(X12_, X22_);
    }
    return {
        front_ * (m_squared_ * K_.I * X11_ + K_.cross * X21_),
        front_ * (m_squared_ * K_.cross * X12_ + K_.II * X22_),
        times_i(front_ * (m_squared_ * K_.cross * X11_ + K_.II * X21_))};
  }

private:
  int p_ = 0;
  real loss_ = 0;
  LongComplex m_squared_, ratio_, front_;
  Wave first_;
  Symmetric K_;
  LongComplex R_I_, R_II_, cross_I_, cross_II_;
  LongComplex X11_, X12_, X21_, X22_; ///< (R g)^(p-1) K
};

Solution solve_orders(const Setting& setting, std::span<const int> orders) {
  const real xi = setting.xi, c_squared = setting.c * setting.c, s_squared = setting.s * setting.s;
  const auto count = static_cast<std::size_t>(xi + 9 * std::cbrt(xi) + 12);
  const auto q =
      bessel_ratios(xi * xi, setting.eta_squared, -((setting.x * setting.x) * setting.contrast), count + 1);
  const LongComplex eta = sqrt(setting.eta_squared);
  const real eta_size = abs(eta), walk = std::sqrt(static_cast<real>(count));
  const real m_squared_size = abs(setting.m_squared);

  Solution solution;
  solution.orders.resize(orders.size());
  const int last_order = orders.empty() ? -1 : *std::ranges::max_element(orders);
  std::optional<InnerWaves> inner;
  if (!orders.empty()) inner.emplace(setting);

  const HankelStart start = hankel_start({xi, 0});
  real Y = start.value.im, Y_next = (start.value * start.ratio).im;
  Outside out;
  out.wronskian = 2 / (pi * xi);
  real scattered[2] = {}, absorbed[2] = {}, largest = 0, worst = 0;
  for (std::size_t index = 0; index < count; ++index) {
    const auto n = static_cast<real>(index);
    const LongComplex q_inside = q.inside[index];
    out.n = n;
    out.J_ratio = xi * q.outside[index];
    out.J = out.wronskian / (out.J_ratio * Y - Y_next);
    out.H = {out.J, Y};
    const real H_squared = norm(out.H);
    // J_n Y_{n+1} - J_{n+1} Y_n = -2 / (pi xi)
    out.sigma = {(out.J * out.J * out.J_ratio + Y * Y_next) / H_squared, -out.wronskian / H_squared};
    out.e = index == 0 ? LongComplex{1, 0} : setting.e;
    out.alpha = n / xi * setting.contrast;

    const Meeting meeting(setting, out, q_inside);
    Wave wave = meeting.wave(setting, out, q_inside, q.difference[index]);
    // Poynting's theorem for one order: a sum over the imaginary parts of m^2 and p.
    const real share = out.wronskian / (H_squared * norm(meeting.determinant));
    const real turn = n / xi * s_squared * setting.m_squared.im;
    const LongComplex m_squared_p = setting.m_squared * meeting.p;
    const real coupling = c_squared * norm(out.alpha);
    const real lost[2] = {
        share * (turn * c_squared * norm(meeting.u) + m_squared_p.im * norm(out.alpha - out.e * meeting.u) +
                 meeting.p.im * coupling),
        share * (turn * norm(meeting.w) + meeting.p.im * norm(c_squared * out.alpha - out.e * meeting.w) +
                 m_squared_p.im * coupling)};
    const real gone[2] = {norm(wave.b1) + norm(wave.a1), norm(wave.a2) + norm(wave.a1)};
    // The real part is small where little is scattered: energy gives it all its digits.
    wave.b1.re = gone[0] + lost[0];
    wave.a2.re = gone[1] + lost[1];
    const real weight = index == 0 ? 1 : 2;
    for (const int which : {0, 1}) {
      scattered[which] += weight * gone[which];
      absorbed[which] += weight * lost[which];
    }
    solution.total.add(index, wave);

    // To first order an error of L enters as (2 / (pi xi |H|^2)) K dL K; one of the outside waves as K times
    // their derivatives, against their common amplitude where they oscillate, their own size beyond.
    const Symmetric K = meeting.resolvent(setting, out);
    const LongComplex ratio = eta * q_inside;
    const LongComplex slope = LongComplex{1, 0} + ratio * ratio - (2 * n + 1) * q_inside;
    // An error of the argument moves the ratio where it oscillates; beyond, the ratio keeps its digits.
    const real ratio_error =
        2 * abs(ratio) + (n + 1 < eta_size ? abs(slope) * (eta_size / 2 + walk) : walk * abs(ratio));
    const real inner_error = xi / eta_size * ratio_error * std::max<real>(m_squared_size, 1);
    const real size = std::sqrt(std::max({norm(wave.b1), norm(wave.a2), norm(wave.a1)}));
    largest = std::max(largest, size);
    if (n + 1 > std::max(xi, eta_size)) {
      // Nothing oscillates: every factor keeps its digits, and the error is the coefficient's own.
      worst = std::max(worst, (walk + 8 + meeting.loss(setting, out)) * size);
    } else {
      const real outer_error = walk * (1 + std::sqrt(norm(K)) * (abs(out.sigma) + n / xi)) *
                               (n < xi ? 1 : size + std::abs(out.J) / std::sqrt(H_squared));
      worst = std::max(worst, out.wronskian / H_squared * norm(K) * inner_error + outer_error);
    }

    if (inner) {
      DebyeTerms terms(setting, out, inner->at(q_inside), {q.outside[index], 0});
      Wave rest = wave;
      for (int p = 0; p <= last_order; ++p) {
        const Wave term = terms.next();
        for (std::size_t k = 0; k < orders.size(); ++k) {
          if (orders[k] != p) continue;
          solution.orders[k].add(index, term);
          const real term_size = norm(term.b1) + norm(term.a2) + norm(term.a1);
          solution.orders[k].lost += terms.loss() * terms.loss() * term_size;
          rest = {rest.b1 - term.b1, rest.a2 - term.a2, rest.a1 - term.a1};
        }
      }
      solution.remainder.add(index, rest);
      inner->advance(index);
    }
    Y = std::exchange(Y_next, 2 * (n + 1) / xi * Y_next - Y);
  }
  const real scale = 2 / setting.x;
  const auto pair = [&](real I, real II) {
    return ByCase{static_cast<double>(scale * I), static_cast<double>(scale * II)};
  };
  solution.Qsca = pair(scattered[0], scattered[1]);
  solution.Qabs = pair(absorbed[0], absorbed[1]);
  solution.Qext = pair(scattered[0] + absorbed[0], scattered[1] + absorbed[1]);
  solution.relative_error = static_cast<double>(real_epsilon / 2 * worst / largest);
  return solution;
}

[[noreturn]] void refuse(const std::ostringstream& message) {
  throw InputError(message.str());
}

void check(
    double x, std::complex<double> m, double tilt, double quarter_turn, const char* unit,
    std::span<const int> orders) {
  std::ostringstream message;
  message.precision(17);
  if (!(x >= 1e-6 && x <= 1e5)) {
    message << "size parameter " << x << " is outside 1e-6..1e5";
  } else if (!std::isfinite(m.real()) || !std::isfinite(m.imag()) || m.real() <= 0 || m.imag() < 0) {
    message << "index " << m.real() << (m.imag() < 0 ? "" : "+") << m.imag()
            << "i is not possible: use n + ik with n > 0 and k >= 0 (k > 0 absorbs)";
  } else if (m == 1.0) {
    message << "index 1 is no cylinder: nothing is scattered; use an index relative to the surroundings "
               "other than 1";
  } else if (std::abs(m) * x > 1e7) {
    message << "index times size parameter is " << std::abs(m) * x << ", more than 1e7";
  } else if (const double limit = quarter_turn * (89.9 / 90); !(std::abs(tilt) <= limit)) {
    message.precision(6);
    message << "tilt " << tilt << ' ' << unit << " is outside -" << limit << ".." << limit << ' ' << unit
            << "; 0 is light at right angles to the axis";
  } else {
    for (const int p : orders)
      if (p < 0 || p > most_orders) {
        message << "order " << p << " is outside 0.." << most_orders;
        refuse(message);
      }
    return;
  }
  refuse(message);
}

CylinderAmplitudes amplitudes(std::span<AzimuthSum> sums) {
  CylinderAmplitudes result{std::move(sums[0].value), std::move(sums[1].value), std::move(sums[2].value), {}};
  result.T4.reserve(result.T3.size());
  for (const auto& value : result.T3) result.T4.emplace_back(0 - value.real(), 0 - value.imag());
  return result;
}

/// max |T| at one angle
double largest_at(const CylinderAmplitudes& amplitudes, std::size_t i) {
  return std::max({std::abs(amplitudes.T1[i]), std::abs(amplitudes.T2[i]), std::abs(amplitudes.T3[i])});
}

/// theta in radians, [-pi, pi].
CylinderResult solve(
    const Setting& setting, double x, std::complex<double> m, std::span<const real> theta,
    std::span<const int> orders, int threads) {
  if (!orders.empty() && setting.eta_squared.re == 0 && setting.eta_squared.im == 0)
    throw InputError("no wave travels inside at the critical tilt, sin(tilt) = m: ask for no orders there");
  const Solution solution = solve_orders(setting, orders);
  CylinderResult result;
  result.size_parameter = x;
  result.index = m;
  result.Qext = solution.Qext;
  result.Qsca = solution.Qsca;
  result.Qabs = solution.Qabs;

  std::vector<AzimuthSeries> series;
  const auto add = [&](const Coefficients& coefficients) {
    series.emplace_back(AzimuthSeries::Kind::cosine, coefficients.T1);
    series.emplace_back(AzimuthSeries::Kind::cosine, coefficients.T2);
    series.emplace_back(AzimuthSeries::Kind::sine, coefficients.T3);
  };
  add(solution.total);
  if (!orders.empty()) add(solution.remainder);
  for (const auto& order : solution.orders) add(order);
  auto sums = sum_over_azimuth(series, theta, threads);
  const std::span<AzimuthSum> all(sums);
  const auto rounding_at = [&](std::size_t first, std::size_t i) {
    return std::max({all[first].rounding[i], all[first + 1].rounding[i], all[first + 2].rounding[i]});
  };

  result.amplitudes = amplitudes(all.subspan(0, 3));
  // Qabs follows the squared width of a resonance: twice the coefficients' error, and once more for the width
  // itself.
  result.error_estimate = 8 * epsilon + (m.imag() > 0 ? 4 : 1) * solution.relative_error;
  for (std::size_t i = 0; i < theta.size(); ++i)
    result.error_estimate = std::max(
        result.error_estimate,
        rounding_at(0, i) / largest_at(result.amplitudes, i) + 4 * epsilon + solution.relative_error);
  if (orders.empty()) return result;

  result.remainder = amplitudes(all.subspan(3, 3));
  for (std::size_t k = 0; k < orders.size(); ++k) {
    CylinderOrder& order = result.orders.emplace_back();
    order.p = orders[k];
    order.amplitudes = amplitudes(all.subspan(6 + 3 * k, 3));
    double largest = 0, error = 0;
    // Each passage turns the phase by up to 2 |eta|, known to a rounding of eta.
    const real passage = abs(sqrt(setting.eta_squared)) + std::sqrt(setting.xi) + 10;
    // Through an opaque cylinder most of what little light there is takes the short way near the rim, beyond
    // the orders n that matter to the whole.
    const auto coefficient_error = static_cast<double>(
        real_epsilon * static_cast<real>(order.p + 1) *
            (passage * solution.orders[k].size() + 4 * std::sqrt(solution.orders[k].lost)) +
        8 * solution.orders[k].rest());
    for (std::size_t i = 0; i < theta.size(); ++i) {
      largest = std::max(largest, largest_at(order.amplitudes, i));
      error = std::max(error, rounding_at(6 + 3 * k, i) + coefficient_error);
    }
    order.error_estimate = largest > 0 ? error / largest + 4 * epsilon : 0;
  }
  return result;
}

/// to_radians: of any angle, as a long double. Turns theta into [-pi, pi] and refuses what is beyond a turn.
std::vector<real>
fold(std::span<const double> theta, double half_turn, const char* unit, real (*to_radians)(double)) {
  std::vector<real> folded;
  folded.reserve(theta.size());
  for (const double angle : theta) {
    if (!(std::abs(angle) <= 2 * half_turn)) {
      std::ostringstream message;
      message << "angle " << angle << ' ' << unit << " is outside -" << 2 * half_turn << ".." << 2 * half_turn
              << ' ' << unit;
      refuse(message);
    }
    folded.push_back(to_radians(angle));
  }
  return folded;
}

} // namespace

CylinderResult cylinder(
    double size_parameter, std::complex<double> index, double tilt, std::span<const double> theta,
    std::span<const int> orders, int threads) {
  check(size_parameter, index, tilt, std::numbers::pi / 2, "rad", orders);
  const auto folded = fold(theta, std::numbers::pi, "rad", [](double angle) {
    const real wide = angle;
    return std::abs(wide) <= pi ? wide : wide - std::copysign(2 * pi, wide);
  });
  const real sine = std::sin(static_cast<real>(tilt)), cosine = std::cos(static_cast<real>(tilt));
  auto result = solve({size_parameter, index, sine, cosine}, size_parameter, index, folded, orders, threads);
  result.tilt_deg = tilt * (180 / std::numbers::pi);
  return result;
}

CylinderResult cylinder_at_degrees(
    double size_parameter, std::complex<double> index, double tilt_deg, std::span<const double> theta_deg,
    std::span<const int> orders, int threads) {
  check(size_parameter, index, tilt_deg, 90, "deg", orders);
  constexpr real degree = pi / 180;
  const auto folded = fold(theta_deg, 180, "deg", [](double angle) {
    const double rest = std::abs(angle) <= 180 ? angle : angle - std::copysign(360.0, angle); // exact
    return static_cast<real>(rest) * degree;
  });
  // The cosine from the complement: it keeps its digits near 90 deg.
  const real tilt = tilt_deg, sine = std::sin(tilt * degree),
             cosine = std::sin((90 - std::abs(tilt)) * degree);
  auto result = solve({size_parameter, index, sine, cosine}, size_parameter, index, folded, orders, threads);
  result.tilt_deg = tilt_deg;
  return result;
}

} // namespace scatter::exact
