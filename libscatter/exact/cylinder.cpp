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
// over the imaginary parts of m^2 and p in closed form. Nothing is anchored on a number that may vanish.
//
// Everything is in long double first. On a resonance of width w in x a rounding of x or m moves the
// coefficients by x / w as much: where the estimate says that digits are missing the same formulas are
// computed once more in 32 digits, and so is the sum over n at angles where its terms cancel.
//
// Debye terms: the same with the inward wave H^(2) in place of J inside, B_0 = (J/H) K_2 (J'/J - L_2), and
// B_p = -(2i / (pi xi H^2)) g K_2 (L_1 - L_2) (R g)^(p-1) K_2, g = H^(1)/H^(2) at eta, R = K_2 (L_1 - L_2)
// - 1.

#include <scatter/exact/azimuth_sum.hpp>
#include <scatter/exact/bessel.hpp>
#include <scatter/exact/cylinder.hpp>
#include <scatter/exact/extended_azimuth_sum.hpp>
#include <scatter/exact/partial_waves.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <sstream>
#include <utility>

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;
constexpr real pi = std::numbers::pi_v<real>;
constexpr int most_orders = 1000;
/// Estimated error of an amplitude above which it is summed again in 32 digits.
constexpr double sure = 1e-11;
/// That of the coefficients. They cost less, and a resonance may move a rounding either way: an estimate well
/// above that of the sums may be a hundred times too large by chance.
double sure_of_coefficients(double x) {
  return 1e-13 * std::max(1.0, x / 5000);
}

/// The cylinder and the wave in the numbers that the formulas take, here and below in long double or in 32
/// digits.
template <class Complex>
struct Setting {
  using Real = RealOf<Complex>;
  Real x{}, c{}, s{}, xi{};
  Complex m, m_squared, contrast; ///< contrast = m^2 - 1
  Complex e, eta_squared;

  Setting(double size_parameter, std::complex<double> index, const Real& sine, const Real& cosine)
      : x(exactly<Real>(size_parameter)), c(sine), s(cosine),
        xi(x * s), m{exactly<Real>(index.real()), exactly<Real>(index.imag())}, m_squared(m * m) {
    const Complex one{exactly<Real>(1), {}};
    contrast = (m - one) * (m + one);
    e = contrast + Complex{s * s, {}};
    eta_squared = (x * x) * e;
  }
};

/// B of one order.
template <class Complex>
struct Wave {
  Complex b1, a2, a1; ///< b_nI, a_nII, a_nI
};

/// A symmetric matrix.
template <class Complex>
struct Symmetric {
  Complex I, cross, II;
};
template <class Complex>
real norm(const Symmetric<Complex>& k) {
  return norm(rounded(k.I)) + 2 * norm(rounded(k.cross)) + norm(rounded(k.II));
}

/// What the outside contributes to one order.
template <class Complex>
struct Outside {
  using Real = RealOf<Complex>;
  Real n{}, n_over_xi{};
  Real J{}, J_ratio{}; ///< J_ratio: J_{n+1} / J_n
  Complex H, sigma;    ///< H_n, H_{n+1} / H_n
  Real wronskian{};    ///< 2 / (pi xi)
  Complex e, alpha;    ///< of order 0, where alpha = 0 and e cancels: e = 1
};

/// One kind of wave inside (J, or the inward H^(2)) against the outgoing wave outside.
template <class Complex>
struct Meeting {
  Complex p, u, w, determinant; ///< determinant: e det(H'/H - L)

  Meeting(const Setting<Complex>& setting, const Outside<Complex>& out, const Complex& q) {
    p = setting.xi * q;
    u = out.sigma - p;
    w = out.sigma - setting.m_squared * p;
    determinant = out.e * u * w - out.alpha * (w + (setting.c * setting.c) * u);
  }

  /// How many times larger than the determinant the terms are that cancel in it.
  [[nodiscard]] real loss(const Setting<Complex>& setting, const Outside<Complex>& out) const {
    const real sigma = abs(rounded(out.sigma)), c = rounded(setting.c);
    const real u_terms = sigma + abs(rounded(p)), w_terms = sigma + abs(rounded(setting.m_squared * p));
    const real terms =
        abs(rounded(out.e)) * u_terms * w_terms + abs(rounded(out.alpha)) * (w_terms + c * c * u_terms);
    return terms / abs(rounded(determinant));
  }

  /// (H'/H - L)^-1
  [[nodiscard]] Symmetric<Complex>
  resolvent(const Setting<Complex>& setting, const Outside<Complex>& out) const {
    const Complex scale = inverse(determinant);
    return {
        scale * (out.alpha - out.e * u), -(setting.c * (scale * out.alpha)),
        scale * ((setting.c * setting.c) * out.alpha - out.e * w)};
  }

  /// difference: q_n(xi) less the q of the wave inside, which is q.
  [[nodiscard]] Wave<Complex> wave(
      const Setting<Complex>& setting, const Outside<Complex>& out, const Complex& q,
      const Complex& difference) const {
    const RealOf<Complex> c_squared = setting.c * setting.c;
    const Complex u_J = setting.xi * difference, w_J = setting.xi * (difference - setting.contrast * q);
    const Complex scale = inverse(determinant), inverse_H = inverse(out.H), J_over_H = out.J * inverse_H;
    return {
        J_over_H * scale * (out.e * u * w_J - out.alpha * (w_J + c_squared * u)),
        J_over_H * scale * (out.e * u_J * w - out.alpha * (w + c_squared * u_J)),
        -((setting.c * out.wronskian) * (out.alpha * scale * inverse_H * inverse_H))};
  }
};

/// H_n^(1)(eta) and H_n^(2)(eta), n rising, in the combinations that the Debye terms need.
class InnerWaves {
public:
  explicit InnerWaves(const Setting<LongComplex>& setting) : eta_squared_(setting.eta_squared) {
    const LongComplex eta = sqrt(eta_squared_); // Im >= 0: H^(1) decays along Im eta
    const auto start = hankel_start(eta);
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
  void add(const Wave<LongComplex>& wave) {
    const real weight = T1.empty() ? 1 : 2;
    T1.push_back(weight * wave.b1);
    T2.push_back(weight * wave.a2);
    T3.push_back(-(weight * times_i(wave.a1)));
  }
  /// Moves by the way from `before` to `after`.
  void shift(const Coefficients& before, const Coefficients& after) {
    for (const auto list : {&Coefficients::T1, &Coefficients::T2, &Coefficients::T3})
      for (std::size_t n = 0; n < (this->*list).size(); ++n)
        (this->*list)[n] = (this->*list)[n] + ((after.*list)[n] - (before.*list)[n]);
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

/// What all orders n of the whole add up to.
struct Totals {
  ByCase Qext, Qsca, Qabs;
  double relative_error = 0;    ///< of the Q's
  double coefficient_error = 0; ///< of T from all coefficients together, absolute
};

/// The whole in 32 digits.
struct ExtendedSolution {
  Totals totals;
  std::vector<ExtendedAzimuthWave> waves;
  Coefficients whole; ///< the same, rounded
};

/// The whole and the Debye terms asked for, without anything that depends on theta.
struct Solution {
  Totals totals;
  Coefficients whole, remainder;
  std::vector<Coefficients> orders;

  void replace_whole(const ExtendedSolution& better) {
    if (!orders.empty()) remainder.shift(whole, better.whole);
    totals = better.totals;
    whole = better.whole;
  }
};

/// The Debye terms of one order n, p = 0 and up.
class DebyeTerms {
public:
  DebyeTerms(
      const Setting<LongComplex>& setting, const Outside<LongComplex>& out, const InnerWaves::At& inside,
      LongComplex q_outside)
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
  Wave<LongComplex> next() {
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
  Wave<LongComplex> first_;
  Symmetric<LongComplex> K_;
  LongComplex R_I_, R_II_, cross_I_, cross_II_;
  LongComplex X11_, X12_, X21_, X22_; ///< (R g)^(p-1) K
};

/// What the estimate needs to know of a setting.
struct Sizes {
  real xi, m_squared, eta_size;
  LongComplex eta;
  real walk;     ///< of the roundings of so many orders
  real strength; ///< below 1 where the cylinder hardly turns a phase: all coefficients are small then
  template <class Complex>
  Sizes(const Setting<Complex>& setting, std::size_t count)
      : xi(rounded(setting.xi)), m_squared(abs(rounded(setting.m_squared))),
        eta(sqrt(rounded(setting.eta_squared))), walk(std::sqrt(static_cast<real>(count))) {
    eta_size = abs(eta);
    const real s = rounded(setting.s);
    strength = std::min<real>(1, abs(rounded(setting.contrast)) / (s * s) * std::max<real>(xi, 1));
  }
};

/// Errors of one order, in units of a rounding.
struct OrderError {
  real coefficients; ///< absolute
  real determinant;  ///< relative; that of the absorbed share is twice it
};

/// size: of the largest coefficient.
template <class Complex>
OrderError error_of_order(
    const Setting<Complex>& setting, const Sizes& sizes, const Outside<Complex>& out,
    const Meeting<Complex>& meeting, real size, LongComplex q_inside) {
  const auto& [xi, m_squared, eta_size, eta, walk, strength] = sizes;
  const real n = rounded(out.n);
  const LongComplex ratio = eta * q_inside;
  // Nothing oscillates: every factor keeps its digits, and the error is the coefficient's own.
  if (n + 1 > std::max(xi, eta_size)) {
    const real relative = walk + 8 + meeting.loss(setting, out);
    return {relative * size, relative};
  }
  // To first order an error of L enters as (2 / (pi xi |H|^2)) K dL K; one of the outside waves as K times
  // their derivatives, against their common amplitude where they oscillate, their own size beyond.
  const real K_squared = norm(meeting.resolvent(setting, out)), H_squared = norm(rounded(out.H));
  const LongComplex slope = LongComplex{1, 0} + ratio * ratio - (2 * n + 1) * q_inside;
  // An error of the argument moves the ratio where it oscillates; beyond, the ratio keeps its digits.
  const real ratio_error =
      2 * abs(ratio) + (n + 1 < eta_size ? abs(slope) * (eta_size / 2 + walk) : walk * abs(ratio));
  const real inner_error = xi / eta_size * ratio_error * std::max<real>(m_squared, 1);
  const real K = std::sqrt(K_squared),
             outer_error = walk * (1 + K * (abs(rounded(out.sigma)) + rounded(out.n_over_xi)));
  return {
      strength * (rounded(out.wronskian) / H_squared * K_squared * inner_error +
                  outer_error * (n < xi ? 1 : size + std::abs(rounded(out.J)) / std::sqrt(H_squared))),
      K * inner_error + outer_error};
}

/// Solves for the whole. each(index, out, q_outside, q_inside, wave): called for every order n = 0, 1, ...
template <class Complex, class Each>
Totals solve_whole(const Setting<Complex>& setting, const Each& each) {
  using Real = RealOf<Complex>;
  const Real xi = setting.xi, c_squared = setting.c * setting.c, s_squared = setting.s * setting.s;
  const real rough_xi = rounded(xi);
  const auto count = static_cast<std::size_t>(rough_xi + 9 * std::cbrt(rough_xi) + 12);
  const auto q = bessel_ratios<Complex>(
      xi * xi, setting.eta_squared, -((setting.x * setting.x) * setting.contrast), count + 1);
  const Sizes sizes(setting, count);
  const bool absorbs = rounded(setting.m.im) > 0;

  const auto start = hankel_start(Complex{xi, {}});
  Real Y = start.value.im, Y_next = (start.value * start.ratio).im;
  Outside<Complex> out;
  out.wronskian = exactly<Real>(2) / (Constants<Real>::pi * xi);
  Real scattered[2] = {}, absorbed[2] = {};
  real largest = 0, worst = 0, error_squares = 0, absorbed_error[2] = {};
  for (std::size_t index = 0; index < count; ++index) {
    const Real n = exactly<Real>(static_cast<double>(index));
    const Complex& q_inside = q.inside[index];
    out.n = n;
    out.n_over_xi = n / xi;
    out.J_ratio = xi * q.outside[index];
    out.J = out.wronskian / (out.J_ratio * Y - Y_next);
    out.H = {out.J, Y};
    const Real H_squared = norm(out.H);
    // J_n Y_{n+1} - J_{n+1} Y_n = -2 / (pi xi)
    out.sigma = {(out.J * out.J * out.J_ratio + Y * Y_next) / H_squared, -(out.wronskian / H_squared)};
    out.e = index == 0 ? Complex{exactly<Real>(1), {}} : setting.e;
    out.alpha = out.n_over_xi * setting.contrast;

    const Meeting<Complex> meeting(setting, out, q_inside);
    Wave<Complex> wave = meeting.wave(setting, out, q_inside, q.difference[index]);
    Real lost[2] = {};
    if (absorbs) { // Poynting's theorem for one order: a sum over the imaginary parts of m^2 and p
      const Real share = out.wronskian / (H_squared * norm(meeting.determinant));
      const Real turn = out.n_over_xi * s_squared * setting.m_squared.im;
      const Complex m_squared_p = setting.m_squared * meeting.p;
      const Real coupling = c_squared * norm(out.alpha);
      lost[0] = share * (turn * c_squared * norm(meeting.u) +
                         m_squared_p.im * norm(out.alpha - out.e * meeting.u) + meeting.p.im * coupling);
      lost[1] =
          share * (turn * norm(meeting.w) + meeting.p.im * norm(c_squared * out.alpha - out.e * meeting.w) +
                   m_squared_p.im * coupling);
    }
    const Real cross = norm(wave.a1);
    const Real gone[2] = {norm(wave.b1) + cross, norm(wave.a2) + cross};
    // The real part is small where little is scattered: energy gives it all its digits.
    wave.b1.re = gone[0] + lost[0];
    wave.a2.re = gone[1] + lost[1];
    const double weight = index == 0 ? 1 : 2;
    for (const int which : {0, 1}) {
      scattered[which] = scattered[which] + exactly<Real>(weight) * gone[which];
      absorbed[which] = absorbed[which] + exactly<Real>(weight) * lost[which];
    }

    const real size =
        std::sqrt(std::max({norm(rounded(wave.b1)), norm(rounded(wave.a2)), norm(rounded(wave.a1))}));
    const OrderError error = error_of_order(setting, sizes, out, meeting, size, rounded(q_inside));
    largest = std::max(largest, size);
    worst = std::max(worst, error.coefficients);
    error_squares += error.coefficients * error.coefficients;
    if (absorbs) {
      const real growth = static_cast<real>(4 * weight) * error.determinant;
      for (const int which : {0, 1}) absorbed_error[which] += growth * rounded(lost[which]);
    }
    each(index, out, q.outside[index], q_inside, wave);
    Y = std::exchange(Y_next, exactly<Real>(static_cast<double>(2 * index + 2)) / xi * Y_next - Y);
  }
  const Real scale = exactly<Real>(2) / setting.x;
  const auto pair = [&](const Real& I, const Real& II) {
    return ByCase{static_cast<double>(rounded(scale * I)), static_cast<double>(rounded(scale * II))};
  };
  Totals totals;
  totals.Qsca = pair(scattered[0], scattered[1]);
  totals.Qabs = pair(absorbed[0], absorbed[1]);
  totals.Qext = pair(scattered[0] + absorbed[0], scattered[1] + absorbed[1]);
  constexpr double rounding = Constants<Real>::rounding;
  real relative = worst / largest;
  // Next to a resonance it may absorb far more than all the rest, where its coefficient is small already. The
  // share goes with the determinant's square, and the argument may be off by a whole rounding.
  for (const int which : {0, 1})
    if (const real all = rounded(absorbed[which]); all > 0)
      relative = std::max(relative, absorbed_error[which] / all);
  totals.relative_error = rounding * static_cast<double>(relative);
  // Roundings of different orders are independent; n and -n are not.
  totals.coefficient_error = 2 * rounding * static_cast<double>(std::sqrt(error_squares));
  // 32 digits have the range of a double only.
  if (!std::isfinite(totals.Qext.I + totals.Qext.II))
    totals.relative_error = totals.coefficient_error = std::numeric_limits<double>::infinity();
  return totals;
}

Solution solve_orders(const Setting<LongComplex>& setting, std::span<const int> orders) {
  Solution solution;
  solution.orders.resize(orders.size());
  const int last_order = orders.empty() ? -1 : *std::ranges::max_element(orders);
  std::optional<InnerWaves> inner;
  if (!orders.empty()) inner.emplace(setting);
  const auto each = [&](std::size_t index, const Outside<LongComplex>& out, real q_outside,
                        const LongComplex& q_inside, const Wave<LongComplex>& wave) {
    solution.whole.add(wave);
    if (!inner) return;
    DebyeTerms terms(setting, out, inner->at(q_inside), {q_outside, 0});
    Wave<LongComplex> rest = wave;
    for (int p = 0; p <= last_order; ++p) {
      const Wave<LongComplex> term = terms.next();
      for (std::size_t k = 0; k < orders.size(); ++k) {
        if (orders[k] != p) continue;
        solution.orders[k].add(term);
        const real term_size = norm(term.b1) + norm(term.a2) + norm(term.a1);
        solution.orders[k].lost += terms.loss() * terms.loss() * term_size;
        rest = {rest.b1 - term.b1, rest.a2 - term.a2, rest.a1 - term.a1};
      }
    }
    solution.remainder.add(rest);
    inner->advance(index);
  };
  solution.totals = solve_whole(setting, each);
  return solution;
}

ExtendedSolution solve_in_32_digits(const Setting<ExtendedComplex>& setting) {
  ExtendedSolution solution;
  const auto each = [&](std::size_t index, const Outside<ExtendedComplex>&, const Extended&,
                        const ExtendedComplex&, const Wave<ExtendedComplex>& wave) {
    const double weight = index == 0 ? 1 : 2;
    solution.waves.push_back(
        {times(wave.b1, weight), times(wave.a2, weight), times(times_i(wave.a1), -weight)});
    solution.whole.add({rounded(wave.b1), rounded(wave.a2), rounded(wave.a1)});
  };
  solution.totals = solve_whole(setting, each);
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

/// Of an exact number of degrees.
Extended radians(double degrees) {
  return times(extended_pi, degrees) / number(180);
}

/// The cylinder and the wave as given, for either precision.
struct Task {
  double x;
  std::complex<double> m;
  double tilt;
  std::span<const double> theta;
  AngleUnit unit; ///< of tilt and theta

  [[nodiscard]] Setting<LongComplex> setting() const {
    const real wide = tilt;
    if (unit == AngleUnit::radian) return {x, m, std::sin(wide), std::cos(wide)};
    // The cosine from the complement: it keeps its digits near 90 deg.
    constexpr real degree = pi / 180;
    return {x, m, std::sin(wide * degree), std::sin((90 - std::abs(wide)) * degree)};
  }
  [[nodiscard]] Setting<ExtendedComplex> setting_in_32_digits() const {
    const auto [sine, cosine] = sine_cosine(unit == AngleUnit::radian ? number(tilt) : radians(tilt));
    return {x, m, sine, cosine};
  }

  /// In radians, folded into [-pi, pi].
  [[nodiscard]] real angle(std::size_t i) const {
    if (unit == AngleUnit::degree) return static_cast<real>(folded_degrees(i)) * (pi / 180);
    const real wide = theta[i];
    return std::abs(wide) <= pi ? wide : wide - std::copysign(2 * pi, wide);
  }
  /// In radians, unfolded where they were given.
  [[nodiscard]] Extended angle_in_32_digits(std::size_t i) const {
    return unit == AngleUnit::degree ? radians(folded_degrees(i)) : number(theta[i]);
  }

private:
  [[nodiscard]] double folded_degrees(std::size_t i) const { // exact
    return std::abs(theta[i]) <= 180 ? theta[i] : theta[i] - std::copysign(360.0, theta[i]);
  }
};

/// Computes the whole in 32 digits at most once, and only where something asks for it.
class Exact {
public:
  explicit Exact(const Task& task) : task_(task) {}
  const ExtendedSolution& operator()() {
    if (!solution_) solution_ = solve_in_32_digits(task_.setting_in_32_digits());
    return *solution_;
  }

private:
  const Task& task_;
  std::optional<ExtendedSolution> solution_;
};

/// Sums again, in 32 digits, the amplitudes whose error is above `sure`.
void sum_unsure_again(
    const Task& task, Exact& exact, int threads, CylinderAmplitudes& amplitudes,
    std::vector<double>& errors) {
  std::vector<std::size_t> unsure;
  std::vector<Extended> theta;
  for (std::size_t i = 0; i < errors.size(); ++i)
    if (!(errors[i] <= sure)) {
      unsure.push_back(i);
      theta.push_back(task.angle_in_32_digits(i));
    }
  if (unsure.empty()) return;
  const ExtendedSolution& solution = exact();
  const double rounding = extended_epsilon * static_cast<double>(12 + 2 * solution.waves.size()) *
                          static_cast<double>(solution.whole.size());
  const auto left_out = static_cast<double>(8 * solution.whole.rest());
  if (!std::isfinite(solution.totals.coefficient_error)) return;
  const auto sums = sum_over_azimuth(solution.waves, theta, threads);
  for (std::size_t k = 0; k < unsure.size(); ++k) {
    const std::size_t i = unsure[k];
    const double largest = std::max({std::abs(sums.T1[k]), std::abs(sums.T2[k]), std::abs(sums.T3[k])});
    const double error = 4 * epsilon + (rounding + left_out + solution.totals.coefficient_error) / largest;
    if (!(error < errors[i])) continue;
    errors[i] = error;
    amplitudes.T1[i] = sums.T1[k];
    amplitudes.T2[i] = sums.T2[k];
    amplitudes.T3[i] = sums.T3[k];
    amplitudes.T4[i] = {0 - sums.T3[k].real(), 0 - sums.T3[k].imag()};
  }
}

CylinderResult solve(const Task& task, std::span<const int> orders, int threads) {
  const Setting<LongComplex> setting = task.setting();
  if (!orders.empty() && setting.eta_squared.re == 0 && setting.eta_squared.im == 0)
    throw InputError("no wave travels inside at the critical tilt, sin(tilt) = m: ask for no orders there");
  Solution solution = solve_orders(setting, orders);
  Exact exact(task);
  const auto efficiencies_error = [&] { return 8 * epsilon + solution.totals.relative_error; };
  if (efficiencies_error() > sure_of_coefficients(task.x) &&
      exact().totals.relative_error < solution.totals.relative_error)
    solution.replace_whole(exact());

  CylinderResult result;
  result.size_parameter = task.x;
  result.index = task.m;
  result.Qext = solution.totals.Qext;
  result.Qsca = solution.totals.Qsca;
  result.Qabs = solution.totals.Qabs;

  std::vector<AzimuthSeries> series;
  const auto add = [&](const Coefficients& coefficients) {
    series.emplace_back(AzimuthSeries::Kind::cosine, coefficients.T1);
    series.emplace_back(AzimuthSeries::Kind::cosine, coefficients.T2);
    series.emplace_back(AzimuthSeries::Kind::sine, coefficients.T3);
  };
  add(solution.whole);
  if (!orders.empty()) add(solution.remainder);
  for (const auto& order : solution.orders) add(order);
  std::vector<real> theta;
  theta.reserve(task.theta.size());
  for (std::size_t i = 0; i < task.theta.size(); ++i) theta.push_back(task.angle(i));
  auto sums = sum_over_azimuth(series, theta, threads);
  const std::span<AzimuthSum> all(sums);
  const auto rounding_at = [&](std::size_t first, std::size_t i) {
    return std::max({all[first].rounding[i], all[first + 1].rounding[i], all[first + 2].rounding[i]});
  };

  result.amplitudes = amplitudes(all.subspan(0, 3));
  std::vector<double> errors(theta.size());
  for (std::size_t i = 0; i < theta.size(); ++i)
    errors[i] = (rounding_at(0, i) + solution.totals.coefficient_error) / largest_at(result.amplitudes, i) +
                4 * epsilon;
  sum_unsure_again(task, exact, threads, result.amplitudes, errors);
  result.error_estimate = efficiencies_error();
  for (const double error : errors) result.error_estimate = std::max(result.error_estimate, error);
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

void check_angles(std::span<const double> theta, double half_turn, const char* unit) {
  for (const double angle : theta)
    if (!(std::abs(angle) <= 2 * half_turn)) {
      std::ostringstream message;
      message << "angle " << angle << ' ' << unit << " is outside -" << 2 * half_turn << ".." << 2 * half_turn
              << ' ' << unit;
      refuse(message);
    }
}

} // namespace

CylinderResult cylinder(
    double size_parameter, std::complex<double> index, double tilt, std::span<const double> theta,
    std::span<const int> orders, int threads) {
  check(size_parameter, index, tilt, std::numbers::pi / 2, "rad", orders);
  check_angles(theta, std::numbers::pi, "rad");
  auto result = solve({size_parameter, index, tilt, theta, AngleUnit::radian}, orders, threads);
  result.tilt_deg = tilt * (180 / std::numbers::pi);
  return result;
}

CylinderResult cylinder_at_degrees(
    double size_parameter, std::complex<double> index, double tilt_deg, std::span<const double> theta_deg,
    std::span<const int> orders, int threads) {
  check(size_parameter, index, tilt_deg, 90, "deg", orders);
  check_angles(theta_deg, 180, "deg");
  auto result = solve({size_parameter, index, tilt_deg, theta_deg, AngleUnit::degree}, orders, threads);
  result.tilt_deg = tilt_deg;
  return result;
}

} // namespace scatter::exact
