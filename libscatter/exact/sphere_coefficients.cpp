// Method. psi_n(x) and psi_n(m x) by downward recurrence, started above the argument and without a norm;
// chi_n(x) by upward recurrence. All three are f_next = (2n+1)/z f - f_before, where one step waits for the
// other: they run side by side in the lanes of one vector, in pairs of doubles that are left unnormalised, so
// that a step takes no longer than its multiplication and addition. Everything else is done for eight n at
// once, each formula in the form that does not cancel:
//   - the norm of psi_n(x) from the Wronskian at the same n, and only the ratio rho_n = psi_{n+1} / psi_n of
//   m x:
//     nothing is anchored on sin x or on any other number that may vanish;
//   - a_n = N / (N - i M) with N and M from differences of rho, and the absorbed share Re a_n - |a_n|^2 in
//   closed
//     form.
// N and M are in pairs of doubles, as all the digits of a resonance are lost in them; what follows is so only
// where all digits are asked for.

#include <scatter/exact/double_lanes.hpp>
#include <scatter/exact/sphere_coefficients.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

namespace scatter::exact {
namespace {

constexpr std::size_t lanes = 8; ///< n at once; a block
constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;

// A lambda has no instruction set of its own unless it is inlined.
#define SCATTER_INLINE_LAMBDA __attribute__((always_inline))

template <class Lanes>
using Pair = DoubleDouble<Lanes>;

/// Numbers as pairs of doubles, apart, as vectors load them; the pairs need not be normalised.
struct Column {
  std::vector<double> hi, lo;
  explicit Column(std::size_t size) : hi(size), lo(size) {}
};

/// What the recurrences give. psi_n stands, times a factor of its block's own, at place(n); the next n's too,
/// for the last n of each block as well.
struct Functions {
  Column outside, inside_re, inside_im; ///< psi_n(x), psi_n(m x)
  Column chi;                           ///< chi_n(x), at n
};
constexpr std::size_t place(std::size_t block, std::size_t i) {
  return (lanes + 1) * block + i;
}

/// The sphere in the numbers that the formulas take. R, N and M of a_n are multiplied by `unit`, a power of 2
/// that keeps them in range for small m.
struct Constants {
  double x = 0;
  std::size_t blocks = 0;
  std::size_t outer_start = 0, inner_start = 0; ///< n where the downward recurrences start
  Extended inverse_x, sine, cosine;             ///< of x
  double walk = 0;                              ///< of a recurrence's roundings, in units of one
  double unit = 1;
  ExtendedComplex from_contrast; ///< unit (1/m^2 - 1) / x
  ExtendedComplex over_m;        ///< unit / m
  ExtendedComplex m, inverse_z;
};

// ---- recurrences ----

// Plain vectors, and whole ones: what is wrapped, or written lane by lane, goes through memory from step to
// step.
using Four = VectorOfDoubles<4>::type;
using FourPairs = DoubleDouble<Four>;

template <Instructions instructions>
SCATTER_INLINE FourPairs exact_product(const Four& a, const Four& b) {
#if SCATTER_X86_LANES
  if constexpr (instructions != Instructions::plain) {
    const Four p = a * b;
    return {p, rest_of_product(a, b, p)};
  }
#endif
  return twofold::product(a, b);
}

template <Instructions instructions, bool transparent>
class Recurrences {
public:
  using Lane = std::size_t;
  static constexpr Lane outside = 0, inside = 1, chi = 2;

  SCATTER_INLINE explicit Recurrences(const Constants& c)
      : inverse_re_{Four{c.inverse_x.hi, c.inverse_z.re.hi, c.inverse_x.hi, 0}, Four{c.inverse_x.lo, c.inverse_z.re.lo, c.inverse_x.lo, 0}},
        inverse_im_{Four{0, c.inverse_z.im.hi, 0, 0}, Four{0, c.inverse_z.im.lo, 0, 0}} {}
  /// From here on psi_n of this lane, 0 so far, is not 0: the step to n - 1 is due.
  SCATTER_INLINE void start(Lane lane, std::size_t n) {
    const Four chosen = lane == outside ? Four{1, 0, 0, 0} : Four{0, 1, 0, 0};
    own_re_.hi += chosen;
    odd_ += static_cast<double>(2 * n + 1) * chosen;
    change_ -= 2 * chosen;
  }
  /// chi_1 from chi_0 = cos x and chi_{-1} = -sin x.
  SCATTER_INLINE void start_chi(const Constants& c) {
    const Extended first = c.inverse_x * c.cosine + c.sine;
    own_re_.hi += Four{0, 0, first.hi, 0};
    own_re_.lo += Four{0, 0, first.lo, 0};
    before_re_.hi += Four{0, 0, c.cosine.hi, 0};
    before_re_.lo += Four{0, 0, c.cosine.lo, 0};
    odd_ += Four{0, 0, 3, 0};
    change_ += Four{0, 0, 2, 0};
  }
  SCATTER_INLINE void step() {
    const FourPairs p = exact_product<instructions>(inverse_re_.hi, odd_);
    const FourPairs c{p.hi, p.lo + odd_ * inverse_re_.lo};
    if constexpr (transparent) {
      const FourPairs next = after(c, own_re_, before_re_);
      before_re_ = own_re_;
      own_re_ = next;
    } else {
      const FourPairs q = exact_product<instructions>(inverse_im_.hi, odd_);
      const FourPairs d{q.hi, q.lo + odd_ * inverse_im_.lo};
      // (c + i d) own - before: the products with d first.
      const FourPairs re = after(c, own_re_, after(d, own_im_, before_re_, 1));
      const FourPairs im = after(c, own_im_, after(d, own_re_, before_im_, -1), 1);
      before_re_ = own_re_;
      before_im_ = own_im_;
      own_re_ = re;
      own_im_ = im;
    }
    odd_ += change_;
  }
  SCATTER_INLINE void steps(std::size_t count) {
    for (; count >= lanes; count -= lanes) {
      for (std::size_t i = 0; i < lanes; ++i) step();
      scale();
    }
    for (; count > 0; --count) step();
    scale();
  }
  /// Brings psi back to numbers of the size of 1, by powers of 2.
  SCATTER_INLINE void scale() {
    const double outer = power_for(sizes(outside)), inner = power_for(sizes(inside));
    if (outer == 1 && inner == 1) [[likely]]
      return;
    const Four power{outer, inner, 1, 1};
    own_re_ = {power * own_re_.hi, power * own_re_.lo};
    own_im_ = {power * own_im_.hi, power * own_im_.lo};
    before_re_ = {power * before_re_.hi, power * before_re_.lo};
    before_im_ = {power * before_im_.hi, power * before_im_.lo};
  }
  SCATTER_INLINE void store_psi(Functions& f, std::size_t at) const {
    f.outside.hi[at] = own_re_.hi[outside];
    f.outside.lo[at] = own_re_.lo[outside];
    f.inside_re.hi[at] = own_re_.hi[inside];
    f.inside_re.lo[at] = own_re_.lo[inside];
    if constexpr (!transparent) {
      f.inside_im.hi[at] = own_im_.hi[inside];
      f.inside_im.lo[at] = own_im_.lo[inside];
    }
  }
  SCATTER_INLINE void store_chi(Functions& f, std::size_t at) const {
    f.chi.hi[at] = own_re_.hi[chi];
    f.chi.lo[at] = own_re_.lo[chi];
  }

private:
  /// c own + sign before, the pairs left as they come.
  SCATTER_INLINE static FourPairs
  after(const FourPairs& c, const FourPairs& own, const FourPairs& before, double sign = -1) {
    const FourPairs p = exact_product<instructions>(c.hi, own.hi);
    const FourPairs s = twofold::sum<Four>(p.hi, sign * before.hi);
    return {s.hi, (c.hi * own.lo + c.lo * own.hi) + ((p.lo + s.lo) + sign * before.lo)};
  }
  SCATTER_INLINE double sizes(Lane lane) const {
    double size = std::abs(own_re_.hi[lane]) + std::abs(before_re_.hi[lane]);
    if constexpr (!transparent) size += std::abs(own_im_.hi[lane]) + std::abs(before_im_.hi[lane]);
    return size;
  }
  SCATTER_INLINE static double power_for(double size) {
    return size == 0 || (size > 0x1p-60 && size < 0x1p60) ? 1 : std::ldexp(1, -std::ilogb(size));
  }

  FourPairs inverse_re_, inverse_im_;
  FourPairs own_re_{}, own_im_{}, before_re_{}, before_im_{};
  Four odd_{}, change_{};
};

template <Instructions instructions, bool transparent>
SCATTER_INLINE void recur(const Constants& c, Functions& f) {
  Recurrences<instructions, transparent> all(c);
  using R = Recurrences<instructions, transparent>;
  const bool outer_first = c.outer_start > c.inner_start;
  const std::size_t first = std::max(c.outer_start, c.inner_start),
                    second = std::min(c.outer_start, c.inner_start);
  all.start(outer_first ? R::outside : R::inside, first);
  all.steps(first - second);
  all.start(outer_first ? R::inside : R::outside, second);
  all.steps(second - (lanes * c.blocks + 1));

  all.start_chi(c);
  std::size_t up = 1;
  all.store_chi(f, up++);
  for (std::size_t block = c.blocks; block-- > 0;) {
    all.scale();
    all.store_psi(f, place(block, lanes));
    for (std::size_t i = lanes; i-- > 0;) {
      all.step();
      all.store_psi(f, place(block, i));
      all.store_chi(f, up++);
    }
  }
}

// ---- eight n at once ----

template <class Lanes>
struct ComplexPair {
  Pair<Lanes> re, im;
};

// The same names for real and complex.
template <class L>
SCATTER_INLINE Pair<L> add(const Pair<L>& a, const Pair<L>& b) {
  return quick_sum(a, b);
}
template <class L>
SCATTER_INLINE ComplexPair<L> add(const ComplexPair<L>& a, const ComplexPair<L>& b) {
  return {quick_sum(a.re, b.re), quick_sum(a.im, b.im)};
}
template <class L>
SCATTER_INLINE ComplexPair<L> add(const ComplexPair<L>& a, const Pair<L>& b) {
  return {quick_sum(a.re, b), a.im};
}
template <class L>
SCATTER_INLINE ComplexPair<L> operator-(const ComplexPair<L>& a) {
  return {-a.re, -a.im};
}
template <class L>
SCATTER_INLINE ComplexPair<L> operator*(const Pair<L>& a, const ComplexPair<L>& b) {
  return {a * b.re, a * b.im};
}
/// A constant times a function.
template <class L>
SCATTER_INLINE Pair<L> constant_times(const ExtendedComplex& a, const Pair<L>& b) {
  return b * a.re;
}
template <class L>
SCATTER_INLINE ComplexPair<L> constant_times(const ExtendedComplex& a, const ComplexPair<L>& b) {
  return {add(b.re * a.re, -(b.im * a.im)), add(b.re * a.im, b.im * a.re)};
}
template <class L>
SCATTER_INLINE Pair<L> ratio(const Pair<L>& a, const Pair<L>& b) {
  return a * inverse(b);
}
template <class L>
SCATTER_INLINE ComplexPair<L> ratio(const ComplexPair<L>& a, const ComplexPair<L>& b) {
  const Pair<L> scale = inverse(add(b.re * b.re, b.im * b.im));
  return {
      scale * add(a.re * b.re, a.im * b.im),
      // Where little is absorbed this is a small difference of small products: they are in full pairs.
      scale * add(a.im * b.re, -(a.re * b.im))};
}
/// |Re| + |Im| to a few digits: between the modulus and its 1.5-fold.
template <class L>
SCATTER_INLINE L size(const Pair<L>& a) {
  return abs(a.hi);
}
template <class L>
SCATTER_INLINE L size(const ComplexPair<L>& a) {
  return abs(a.re.hi) + abs(a.im.hi);
}
double size(const ExtendedComplex& a) {
  return std::abs(a.re.hi) + std::abs(a.im.hi);
}
/// Times a power of 2.
template <class L>
SCATTER_INLINE Pair<L> scaled(const Pair<L>& a, double power) {
  return {power * a.hi, power * a.lo};
}

/// A coefficient's parts: doubles, or pairs where all digits are asked for.
template <class Number, class Lanes>
struct Coefficient {
  Number re, im;
  Number scattered, absorbed; ///< |a|^2 and Re a - |a|^2
  Number below_re, below_im;  ///< N - i M
  Number inverse_square;      ///< 1 / |N - i M|^2
  Lanes error;                ///< of a, in units of a pair's rounding
};

/// Outside, at eight n.
template <class Lanes>
struct Outside {
  Pair<Lanes> psi, psi_next, chi, chi_next;
  Lanes psi_error, chi_error, psi_next_error, chi_next_error;
};

template <Instructions instructions, std::size_t count>
SCATTER_INLINE DoubleLanes<instructions, count>
add(const DoubleLanes<instructions, count>& a, const DoubleLanes<instructions, count>& b) {
  return a + b;
}
template <Instructions instructions, std::size_t count>
SCATTER_INLINE DoubleLanes<instructions, count> inverse(const DoubleLanes<instructions, count>& a) {
  return DoubleLanes<instructions, count>::all(1) / a;
}
template <class Number, class Lanes>
SCATTER_INLINE Number as(const Pair<Lanes>& a) {
  if constexpr (std::is_same_v<Number, Lanes>)
    return a.hi;
  else
    return a;
}
template <class Lanes>
SCATTER_INLINE Lanes rounded(const Pair<Lanes>& a) {
  return a.hi;
}
template <Instructions instructions, std::size_t count>
SCATTER_INLINE DoubleLanes<instructions, count> rounded(const DoubleLanes<instructions, count>& a) {
  return a;
}

template <class Number, class Lanes, class Value>
SCATTER_INLINE Coefficient<Number, Lanes>
coefficient(const Outside<Lanes>& out, const Value& R, const Lanes& R_error, double unit) {
  const Value N = add(out.psi * R, scaled(out.psi_next, unit));
  const Value M = add(out.chi * R, scaled(out.chi_next, unit));
  Coefficient<Number, Lanes> result;
  if constexpr (std::is_same_v<Value, Pair<Lanes>>) {
    // N / (N - i M) = N (N + i M) / (N^2 + M^2)
    const Number n = as<Number>(N), m = as<Number>(M), square = n * n;
    result.below_re = n;
    result.below_im = -m;
    result.inverse_square = inverse(add(square, m * m));
    result.scattered = result.re = square * result.inverse_square;
    result.im = (n * m) * result.inverse_square;
    result.absorbed = {};
  } else {
    const Number re = as<Number>(N.re), im = as<Number>(N.im);
    result.below_re = as<Number>(add(N.re, M.im));
    result.below_im = as<Number>(add(N.im, -M.re));
    result.inverse_square =
        inverse(add(result.below_re * result.below_re, result.below_im * result.below_im));
    result.scattered = add(re * re, im * im) * result.inverse_square;
    // Im(N conj M) = unit Im R (Wronskian 1), so that Re a = (|N|^2 - unit Im R) / |N - i M|^2 is a sum of
    // positive terms.
    const auto absorbs = R.im.hi.v < 0;
    const Pair<Lanes> share = scaled(-R.im, unit),
                      kept{{absorbs ? share.hi.v : 0 * share.hi.v}, {absorbs ? share.lo.v : 0 * share.lo.v}};
    result.absorbed = as<Number>(kept) * result.inverse_square;
    result.re = add(result.scattered, result.absorbed);
    result.im = add(im * result.below_re, -(re * result.below_im)) * result.inverse_square;
  }
  // First-order effects on N / (N - i M): of R (the Wronskian makes it one term), and of psi and chi.
  const Lanes R_size = size(R);
  const Lanes N_error = out.psi_error * R_size + unit * out.psi_next_error,
              M_error = out.chi_error * R_size + unit * out.chi_next_error;
  result.error = (unit * (2 * R_size + R_error) + size(M) * N_error + size(N) * M_error) *
                 rounded(result.inverse_square);
  return result;
}

template <class Lanes>
SCATTER_INLINE Pair<Lanes> load(const Column& column, std::size_t at) {
  return twofold::sum(Lanes::load(column.hi.data() + at), Lanes::load(column.lo.data() + at));
}

/// Where the coefficients go.
struct Output {
  double* weights = nullptr;      ///< four per n from n = 1
  ExtendedWaves* exact = nullptr; ///< the same; may be missing
  double* coefficients[4] = {};   ///< Re and Im of a_n, of b_n, from n = 0
};
struct Totals {
  Extended scattered, absorbed, asymmetry, back_re, back_im;
  double back_squares = 0, largest_square = 0, worst = 0;
};

template <class Lanes>
SCATTER_INLINE Extended total(const Pair<Lanes>& sum) {
  Extended result{};
  for (std::size_t i = 0; i < lanes; ++i) result = result + Extended{sum.hi.v[i], sum.lo.v[i]};
  return result;
}
/// Adds without loss.
template <class Lanes>
SCATTER_INLINE void accumulate(Pair<Lanes>& sum, const Lanes& value) {
  const auto s = twofold::sum(sum.hi, value);
  sum = {s.hi, sum.lo + s.lo};
}
template <class Lanes>
SCATTER_INLINE void accumulate(Pair<Lanes>& sum, const Pair<Lanes>& value) {
  sum = quick_sum(sum, value);
}

template <Instructions instructions, bool transparent, bool exact>
SCATTER_INLINE Totals combine(const Constants& c, const Functions& f, const Output& output) {
  using Lanes = DoubleLanes<instructions, lanes>;
  using P = Pair<Lanes>;
  using Value = std::conditional_t<transparent, P, ComplexPair<Lanes>>;
  using Number = std::conditional_t<exact, P, Lanes>;
  const Lanes one = Lanes::all(1), zero{};
  const auto number = [&](const Lanes& a) SCATTER_INLINE_LAMBDA {
    if constexpr (exact)
      return P{a, zero};
    else
      return a;
  };
  const double over_m_size = size(c.over_m), m_size = size(c.m);
  P scattered{}, absorbed{}, asymmetry{}, back_re{}, back_im{};
  Lanes back_squares{}, largest_square{}, worst{};
  Lanes n, sign; // sign: -1 for odd n
  for (std::size_t i = 0; i < lanes; ++i) {
    n.v[i] = static_cast<double>(i + 1);
    sign.v[i] = i % 2 ? 1 : -1;
  }
  for (std::size_t block = 0; block < c.blocks; ++block, n = n + Lanes::all(lanes)) {
    const std::size_t first = lanes * block + 1, at = place(block, 0);
    Outside<Lanes> out;
    out.chi = load<Lanes>(f.chi, first);
    out.chi_next = load<Lanes>(f.chi, first + 1);
    // psi_n's norm, from the Wronskian.
    const P any_psi = load<Lanes>(f.outside, at), any_next = load<Lanes>(f.outside, at + 1);
    const P norm = inverse(add(out.chi_next * any_psi, -(out.chi * any_next)));
    out.psi = norm * any_psi;
    out.psi_next = norm * any_next;
    // rho_n(m x). A psi of 0 to the last bit stands for a small one.
    Value rho;
    P own = load<Lanes>(f.inside_re, at), next = load<Lanes>(f.inside_re, at + 1);
    if constexpr (transparent) {
      own.hi = {own.hi.v == 0 ? 1e-40 * next.hi.v : own.hi.v};
      rho = ratio(next, own);
    } else {
      rho = ratio(Value{next, load<Lanes>(f.inside_im, at + 1)}, Value{own, load<Lanes>(f.inside_im, at)});
    }

    // R = D_n(mx)/m for a_n, m D_n(mx) for b_n, less (n+1)/x, with D_n = (n+1)/z - rho_n.
    const P n_plus_1{n + one, zero};
    Value from_contrast;
    if constexpr (transparent)
      from_contrast = n_plus_1 * c.from_contrast.re;
    else
      from_contrast = {n_plus_1 * c.from_contrast.re, n_plus_1 * c.from_contrast.im};
    const Value R_a = add(from_contrast, -constant_times(c.over_m, rho));
    const Value R_b = -constant_times(c.m, rho);

    // The rounding that rho(mx) has picked up: a random walk of the recurrence's steps, along rho' = 1 +
    // rho^2 - (2n+2) rho / z.
    const Lanes twice = 2 * n + Lanes::all(2);
    Lanes slope;
    if constexpr (transparent) {
      slope = abs(one + rho.hi * (rho.hi - twice * c.inverse_z.re.hi));
    } else {
      const Lanes re = rho.re.hi - twice * c.inverse_z.re.hi, im = rho.im.hi - twice * c.inverse_z.im.hi;
      slope = abs(one + rho.re.hi * re - rho.im.hi * im) + abs(rho.re.hi * im + rho.im.hi * re);
    }
    const Lanes rho_error = 2 * size(rho) + slope * c.walk;
    // The same walk of psi and chi: against their common amplitude where they oscillate, their own beyond.
    const auto oscillates = n.v < c.x;
    const auto walked = [&](const P& value, const P& other) SCATTER_INLINE_LAMBDA {
      const Lanes size = abs(value.hi), both = size + abs(other.hi);
      return c.walk * Lanes{oscillates ? both.v : size.v};
    };
    out.psi_error = walked(out.psi, out.chi);
    out.chi_error = walked(out.chi, out.psi);
    out.psi_next_error = walked(out.psi_next, out.chi_next);
    out.chi_next_error = walked(out.chi_next, out.psi_next);
    const auto a = coefficient<Number>(out, R_a, over_m_size * rho_error, c.unit);
    const auto b = coefficient<Number>(out, R_b, m_size * rho_error, 1);

    const Lanes odd = 2 * n + one, product = n * (n + one);
    accumulate(scattered, number(odd) * add(a.scattered, b.scattered));
    if constexpr (!transparent) accumulate(absorbed, number(odd) * add(a.absorbed, b.absorbed));
    const Lanes parts[] = {rounded(a.re), rounded(a.im), rounded(b.re), rounded(b.im)};
    largest_square =
        max(largest_square,
            max(parts[0] * parts[0] + parts[1] * parts[1], parts[2] * parts[2] + parts[3] * parts[3]));
    worst = max(worst, max(a.error, b.error));

    // Weights (2n+1) / (n (n+1)) (a +- b) / 2.
    Number weight;
    const Lanes half = 0.5 * odd / product;
    if constexpr (exact) {
      const auto back = twofold::product(half, product);
      weight = twofold::ordered_sum<Lanes>(half, ((0.5 * odd - back.hi) - back.lo) / product);
    } else {
      weight = half;
    }
    Number minus_re, minus_im;
    if constexpr (exact) {
      minus_re = add(a.re, -b.re);
      minus_im = add(a.im, -b.im);
    } else {
      // a_n - b_n = -i (R_a - R_b) / (product of both N - i M), by the Wronskian: for m next to 1 the rounded
      // coefficients' difference has few digits left.
      const Lanes p = a.below_re * b.below_re - a.below_im * b.below_im,
                  q = a.below_re * b.below_im + a.below_im * b.below_re;
      const auto over_both = [&](const Lanes& value) SCATTER_INLINE_LAMBDA {
        return (value * a.inverse_square) * b.inverse_square;
      };
      if constexpr (transparent) {
        const Lanes d = rounded(add(R_a, -scaled(R_b, c.unit)));
        minus_re = -over_both(d * q);
        minus_im = -over_both(d * p);
      } else {
        const Lanes d_re = rounded(add(R_a.re, -scaled(R_b.re, c.unit))),
                    d_im = rounded(add(R_a.im, -scaled(R_b.im, c.unit)));
        minus_re = over_both(d_im * p - d_re * q);
        minus_im = -over_both(d_re * p + d_im * q);
      }
    }
    const Number terms[4] = {
        weight * add(a.re, b.re), weight * add(a.im, b.im), weight * minus_re, weight * minus_im};
    for (std::size_t part = 0; part < 4; ++part) {
      const Lanes term = rounded(terms[part]);
      for (std::size_t i = 0; i < lanes; ++i) output.weights[4 * (first - 1 + i) + part] = term.v[i];
    }
    if constexpr (exact)
      for (std::size_t i = 0; i < lanes && first - 1 + i < output.exact->waves.size(); ++i) {
        const auto term = [&](std::size_t part) SCATTER_INLINE_LAMBDA {
          return Extended{terms[part].hi.v[i], terms[part].lo.v[i]};
        };
        output.exact->waves[first - 1 + i] = {term(0), term(1), term(2), term(3)};
      }
    accumulate(back_re, number(sign * odd) * minus_re);
    accumulate(back_im, number(sign * odd) * minus_im);
    const Lanes back_one =
        odd * odd * (rounded(minus_re) * rounded(minus_re) + rounded(minus_im) * rounded(minus_im));
    back_squares = back_squares + back_one;
    for (std::size_t part = 0; part < 4; ++part) parts[part].store(output.coefficients[part] + first);
  }

  // g: neighbours in n, and a_n with b_n.
  for (std::size_t i = 0; i < lanes; ++i) n.v[i] = static_cast<double>(i + 1);
  for (std::size_t block = 0; block < c.blocks; ++block, n = n + Lanes::all(lanes)) {
    const auto at = [&](std::size_t part, std::size_t before) SCATTER_INLINE_LAMBDA {
      return Lanes::load(output.coefficients[part] + lanes * block + 1 - before);
    };
    const Lanes own = at(0, 0) * at(2, 0) + at(1, 0) * at(3, 0);
    const Lanes neighbours =
        (at(0, 0) * at(0, 1) + at(1, 0) * at(1, 1)) + (at(2, 0) * at(2, 1) + at(3, 0) * at(3, 1));
    accumulate(asymmetry, ((2 * n + one) / (n * (n + one))) * own + ((n - one) * (n + one) / n) * neighbours);
  }

  Totals totals{total(scattered), total(absorbed), total(asymmetry), total(back_re), total(back_im)};
  for (std::size_t i = 0; i < lanes; ++i) {
    totals.back_squares += back_squares.v[i];
    totals.largest_square = std::max(totals.largest_square, largest_square.v[i]);
    totals.worst = std::max(totals.worst, worst.v[i]);
  }
  return totals;
}

// ---- one instance per set of vector instructions ----

using Recur = void (*)(const Constants&, Functions&);
using Combine = Totals (*)(const Constants&, const Functions&, const Output&);

template <bool transparent>
void recur_plain(const Constants& c, Functions& f) {
  recur<Instructions::plain, transparent>(c, f);
}
template <bool transparent, bool exact>
Totals combine_plain(const Constants& c, const Functions& f, const Output& output) {
  return combine<Instructions::plain, transparent, exact>(c, f, output);
}
#if SCATTER_X86_LANES
template <bool transparent>
__attribute__((target("avx2,fma"))) void recur_avx2(const Constants& c, Functions& f) {
  recur<Instructions::avx2, transparent>(c, f);
}
template <bool transparent, bool exact>
__attribute__((target("avx2,fma"))) Totals
combine_avx2(const Constants& c, const Functions& f, const Output& output) {
  return combine<Instructions::avx2, transparent, exact>(c, f, output);
}
template <bool transparent, bool exact>
__attribute__((target("avx512f,avx512dq,avx2,fma"))) Totals
combine_avx512(const Constants& c, const Functions& f, const Output& output) {
  return combine<Instructions::avx512, transparent, exact>(c, f, output);
}
#endif

template <bool transparent, bool exact>
Totals solve(const Constants& c, Functions& f, const Output& output) {
  Recur recurrences = recur_plain<transparent>;
  Combine combination = combine_plain<transparent, exact>;
#if SCATTER_X86_LANES
  const std::size_t width = vector_units()[0].width;
  if (width >= 4) recurrences = recur_avx2<transparent>;
  if (width == 4) combination = combine_avx2<transparent, exact>;
  if (width == 8) combination = combine_avx512<transparent, exact>;
#endif
  recurrences(c, f);
  return combination(c, f, output);
}

} // namespace

SphereCoefficients sphere_coefficients(double x, std::complex<double> index, ExtendedWaves* exact) {
  const auto count = static_cast<std::size_t>(x + 9 * std::cbrt(x) + 12);
  const ExtendedComplex m{number(index.real()), number(index.imag())};
  const auto product = [x](double part) {
    const auto p = twofold::product(x, part);
    return Extended{p.hi, p.lo};
  };
  const ExtendedComplex z{product(index.real()), product(index.imag())};
  const bool transparent = z.im.hi == 0;

  Constants c;
  c.x = x;
  c.blocks = (count + lanes - 1) / lanes;
  const std::size_t padded = lanes * c.blocks;
  // Where the start's error has decayed below the last digit.
  const auto start = [&](double size) {
    return static_cast<std::size_t>(
        std::max(size, static_cast<double>(padded + 1)) + 12 * std::cbrt(size) + 40);
  };
  c.outer_start = start(x);
  c.inner_start = start(abs(z));
  c.inverse_x = inverse(number(x));
  const SineCosine outer = sine_cosine(number(x));
  c.sine = outer.sine;
  c.cosine = outer.cosine;
  c.walk = 2 * std::sqrt(static_cast<double>(count) + abs(z));
  c.m = m;
  c.inverse_z = inverse(z);
  const ExtendedComplex over_m = inverse(m), one{number(1), {}};
  c.unit = std::ldexp(1, 2 * std::min(0, std::ilogb(std::abs(index))));
  c.over_m = scaled(over_m, c.unit);
  // 1/m^2 - 1 without the difference.
  c.from_contrast = c.inverse_x * ((one - m) * (one + m) * c.over_m * over_m);

  const std::size_t psi_size = place(c.blocks, 0);
  Functions f{Column(psi_size), Column(psi_size), Column(transparent ? 0 : psi_size), Column(padded + 2)};
  std::vector<double> weights(4 * padded), coefficients(4 * (padded + 1));
  Output output;
  output.weights = weights.data();
  output.exact = exact;
  for (std::size_t part = 0; part < 4; ++part)
    output.coefficients[part] = coefficients.data() + part * (padded + 1);
  if (exact) exact->waves.resize(count);
  const Totals totals = transparent ? (exact ? solve<true, true> : solve<true, false>)(c, f, output)
                                    : (exact ? solve<false, true> : solve<false, false>)(c, f, output);

  SphereCoefficients result;
  const Extended scale = number(2) / (number(x) * number(x));
  const auto rounded = [](const Extended& a) { return a.hi + a.lo; };
  result.Qsca = rounded(scale * totals.scattered);
  result.Qabs = rounded(scale * totals.absorbed);
  result.Qext = rounded(scale * (totals.scattered + totals.absorbed));
  const Extended back = totals.back_re * totals.back_re + totals.back_im * totals.back_im;
  result.Qback = rounded(times(scale, 0.5) * back);
  result.g = rounded(times(totals.asymmetry, 2) / totals.scattered);
  result.relative_error = extended_epsilon * totals.worst / std::sqrt(totals.largest_square);
  result.back_error = 2 * ((exact ? extended_epsilon : 6 * epsilon) + result.relative_error) *
                          std::sqrt(totals.back_squares / back.hi) +
                      4 * epsilon;
  weights.resize(4 * count);
  result.waves = PartialWaves(std::move(weights));
  return result;
}

} // namespace scatter::exact
