// Method. The amplitudes are Legendre series: by (2n+1) P_n = pi_{n+1} - pi_{n-1} and tau_n = n (n+1) P_n -
// mu pi_n, S1 = sum s_n P_n with
//   s_n = n^2 w b_n + (2n+1) (A_n - B_{n+1}),   A_n = sum of w a_k over k = n+1, n+3, .., B_n alike,
// where w a_n and w b_n are the weights of pi_n and tau_n; S2 has a and b exchanged. Nothing cancels: s_n is
// about 2 n b_n.
//
// Low orders, n < n_0, become Fourier series: n_0^2 / 4 complex multiply-adds for each of S1 and S2
// (sine_series.cpp), and one transform. They are sine series, of sin(theta) S, for the rounding: an FFT's is
// relative to the root mean square over the circle, and without the sine that would be the forward peak's,
// x^(3/2) against x at the sides.
//
// High orders, n >= n_0, by the asymptotic series (Stieltjes; Szego, Orthogonal Polynomials, 8.21.14; Hale &
// Townsend 2014, SIAM J. Sci. Comput. 36, A148)
//   P_n = C_n sum_{k<M} h_{k,n} cos((n + k + 1/2) theta - (k + 1/2) pi/2) / (2 sin theta)^(k + 1/2) + R,
//   C_n = 2 / sqrt(pi) Gamma(n+1) / Gamma(n+3/2),  h_{k,n} = prod_{j<=k} (j - 1/2)^2 / (j (n + j + 1/2)),
//   |R| < 2 C_n h_{M,n} / (2 sin theta)^(M + 1/2):
// one transform per term and real series. The root of the sine is divided out here by itself. What is left of
// the forward peak would leak, by roundings in the transform's last stages, to angles that are simple parts
// of the circle, which shows where S is smallest, with m next to 1. So the transform takes the differences of
// neighbouring coefficients, which have no such peak, and its result is divided by 1 - exp(-i theta).
//
// Angles with n_0 sin theta too small for M terms are left to the direct sum.
//
// Count, for 14401 angles at x = 50000 on one core of 2.6 GHz: the direct sum takes 14401 x 50343 steps of
// 0.105 ns, 76 ms. With n_0 = 2900 and M = 9: low orders 2.1e6 products for all series at 0.22 ns, 0.5 ms; 40
// transforms of 28800 at 0.09 ms, 3.6 ms; folding their coefficients and adding them up, 3 ms; 2 % of the
// angles directly, 3 ms; Legendre series, tables, estimates 3 ms: 13 ms. The other ways cost more. Without
// Fourier series of the low orders, the direct sum would do them at all angles (n_0 / x of 76 ms, 4 ms), or
// dyadic blocks of sin theta would, with M transforms each. Fourier series of all orders are 6e8 products,
// 140 ms, at this x, but the cheapest below x = 7000 (x = 2000 for 1801 angles). Asymptotics without FFT cost
// as much as the direct sum.
//
// For 1801 angles at x = 1000 all orders are low: 0.3e6 products, 0.06 ms; 4 transforms of 3600, 0.04 ms; 4
// deg at either end directly, 0.02 ms; what is left is memory, estimates and the like. 0.19 ms, the direct
// sum 0.25.
//
// Rounding. The FFT's error at one angle is about 2.5 roundings of the root mean square over the circle, so
// that S keeps 1e-15 of what it typically is at the sides; the direct sum's recurrence walks off by the root
// of x roundings. Cancellation at an angle shows in the estimate as it does in the direct sum's.

#include <scatter/exact/fourier_sum.hpp>
#include <scatter/exact/sine_series.hpp>
#include <scatter/exact/vector_clones.hpp>
#include <scatter/optics/fftw_planner.hpp>

#include <fftw3.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <numbers>

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;

// Costs [ns] as measured on a core with AVX-512 at 2.6 GHz; their ratios matter.
constexpr double cost_of_product = 0.22;   ///< one (n, l) of the low orders, all four series
constexpr double cost_of_fft = 0.2;        ///< times N log2 N, one series
constexpr double cost_of_low_place = 0.6;  ///< one of N, of the low orders' transform
constexpr double cost_of_fold = 0.5;       ///< one coefficient of one term
constexpr double cost_of_high_place = 1.4; ///< one of N, of one term
constexpr double cost_of_order = 15;       ///< Legendre series and memory, four series
constexpr double cost_of_angle = 10;       ///< estimates
constexpr double cost_of_start = 1e4;      ///< with plans and tables at hand

/// 2 pi j / steps, 0 <= j <= steps / 2.
struct Turns {
  explicit Turns(std::size_t steps);
  std::vector<double> sine; ///< up to j = steps / 4
  std::vector<double> inverse,
      inverse_half; ///< 1 / (2 sin theta) and 1 / (2 sin(theta / 2)) for 0 < j < steps / 2
};

Turns::Turns(std::size_t steps) : sine(steps / 4 + 1), inverse(steps / 2), inverse_half(steps / 2) {
  // Half angles up to 45 deg by the addition theorem from two short tables, the others by symmetry.
  struct Pair {
    double sine, cosine;
  };
  const std::size_t quarter = steps / 4;
  std::size_t fine = 1;
  while (fine * fine < quarter) fine *= 2;
  const auto at = [&](std::size_t j) {
    const long double angle =
        std::numbers::pi_v<long double> * static_cast<long double>(j) / static_cast<long double>(steps);
    return Pair{static_cast<double>(std::sin(angle)), static_cast<double>(std::cos(angle))};
  };
  std::vector<Pair> fine_table, coarse_table;
  for (std::size_t j = 0; j < fine; ++j) fine_table.push_back(at(j));
  for (std::size_t j = 0; j <= quarter; j += fine) coarse_table.push_back(at(j));
  for (std::size_t j = 1; j <= quarter; ++j) {
    const Pair &a = coarse_table[j / fine], &b = fine_table[j % fine];
    const Pair half{a.sine * b.cosine + a.cosine * b.sine, a.cosine * b.cosine - a.sine * b.sine};
    const std::size_t mirrored = steps / 2 - j;
    sine[j] = 2 * half.sine * half.cosine;
    inverse[j] = inverse[mirrored] = 1 / (4 * half.sine * half.cosine);
    inverse_half[mirrored] = 1 / (2 * half.cosine);
    inverse_half[j] = 1 / (2 * half.sine);
  }
}

/// Real and imaginary parts of two numbers, of four.
using Quad = double __attribute__((vector_size(32)));
using Octet = double __attribute__((vector_size(64)));

/// The transform of `size` real numbers from the complex one of size / 2 pairs of them, in place; size / 2 +
/// 1 numbers. sine: of 2 pi j / size, up to j = size / 4.
SCATTER_VECTOR_CLONES
void separate(fftw_complex* values, const double* sine, std::size_t size) {
  const std::size_t half = size / 2, quarter = size / 4;
  const double first = values[0][0], second = values[0][1];
  values[0][0] = first + second;
  values[half][0] = first - second;
  values[0][1] = values[half][1] = 0;
  // Own and mirrored numbers are (own + conj mirrored) / 2, the transform of numbers at even places, plus
  // that of those at odd places, turned.
  const Octet conjugate{1, -1, 1, -1, 1, -1, 1, -1};
  std::size_t j = 1;
  for (; j + 4 <= quarter; j += 4) {
    Octet own, mirrored;
    Quad s, c;
    std::memcpy(&own, values + j, sizeof own);
    std::memcpy(&mirrored, values + (half - j - 3), sizeof mirrored);
    std::memcpy(&s, sine + j, sizeof s);
    std::memcpy(&c, sine + (quarter - j - 3), sizeof c);
    mirrored = conjugate * __builtin_shufflevector(mirrored, mirrored, 6, 7, 4, 5, 2, 3, 0, 1);
    const Octet even = 0.5 * (own + mirrored), odd = 0.5 * (own - mirrored);
    const Octet across = conjugate * __builtin_shufflevector(odd, odd, 1, 0, 3, 2, 5, 4, 7, 6);
    const Octet turned = __builtin_shufflevector(c, c, 3, 3, 2, 2, 1, 1, 0, 0) * across -
                         __builtin_shufflevector(s, s, 0, 0, 1, 1, 2, 2, 3, 3) * odd;
    own = even + turned;
    mirrored = conjugate * (even - turned);
    mirrored = __builtin_shufflevector(mirrored, mirrored, 6, 7, 4, 5, 2, 3, 0, 1);
    std::memcpy(values + j, &own, sizeof own);
    std::memcpy(values + (half - j - 3), &mirrored, sizeof mirrored);
  }
  for (; j <= quarter; ++j) {
    double* const own = values[j];
    double* const mirrored = values[half - j];
    const double even_re = 0.5 * (own[0] + mirrored[0]), even_im = 0.5 * (own[1] - mirrored[1]);
    const double odd_re = 0.5 * (own[0] - mirrored[0]), odd_im = 0.5 * (own[1] + mirrored[1]);
    const double c = sine[quarter - j], s = sine[j];
    const double turned_re = c * odd_im - s * odd_re, turned_im = -(c * odd_re + s * odd_im);
    mirrored[0] = even_re - turned_re;
    mirrored[1] = turned_im - even_im;
    own[0] = even_re + turned_re;
    own[1] = even_im + turned_im;
  }
}

/// Real transforms of one length, a multiple of 4. By complex ones of half the length, as those take FFTW a
/// fraction of a millisecond to plan, real ones ten.
class Transform {
public:
  explicit Transform(std::size_t size) : size_(size) {
    const Memory memory(size);
    const std::lock_guard lock(fftw_planner());
    // No measuring: the same plan, and so the same bits, every time.
    plan_ = fftw_plan_dft_1d(
        static_cast<int>(size / 2), memory.pairs(), memory.out, FFTW_FORWARD,
        FFTW_ESTIMATE | FFTW_DESTROY_INPUT);
    if (!plan_) throw std::bad_alloc();
  }
  ~Transform() {
    const std::lock_guard lock(fftw_planner());
    fftw_destroy_plan(plan_);
  }
  Transform(const Transform&) = delete;
  Transform& operator=(const Transform&) = delete;

  /// What a transform works in, aligned as FFTW likes it.
  struct Memory {
    explicit Memory(std::size_t size) : in(fftw_alloc_real(size)), out(fftw_alloc_complex(size / 2 + 1)) {
      if (in && out) return;
      fftw_free(in);
      fftw_free(out);
      throw std::bad_alloc();
    }
    ~Memory() {
      fftw_free(in);
      fftw_free(out);
    }
    Memory(const Memory&) = delete;
    Memory& operator=(const Memory&) = delete;
    [[nodiscard]] fftw_complex* pairs() const { return reinterpret_cast<fftw_complex*>(in); }
    double* in;
    fftw_complex* out;
  };

  /// out_j = sum in_l exp(-2 pi i j l / size); spoils `in`. From any thread.
  void run(const Memory& memory, const Turns& turns) const {
    fftw_execute_dft(plan_, memory.pairs(), memory.out);
    separate(memory.out, turns.sine.data(), size_);
  }

private:
  std::size_t size_;
  fftw_plan plan_ = nullptr;
};

/// What depends on the number of steps alone.
class Circle {
public:
  explicit Circle(std::size_t steps) : turns(steps), transform_(steps) {}
  const Turns turns;
  void transform(const Transform::Memory& memory) const { transform_.run(memory, turns); }

private:
  Transform transform_;
};

/// Plans take longer to make than to run: the last few circles are kept, unless they are large.
std::shared_ptr<const Circle> circle_of(std::size_t steps) {
  constexpr std::size_t most_kept = 4, largest_kept = 1'000'000;
  if (steps > largest_kept) return std::make_shared<const Circle>(steps);
  (void)fftw_planner(); // made before, and so destroyed after, what locks it
  static std::mutex mutex;
  static std::map<std::size_t, std::shared_ptr<const Circle>> kept;
  const std::lock_guard lock(mutex);
  if (const auto found = kept.find(steps); found != kept.end()) return found->second;
  if (kept.size() >= most_kept) kept.clear();
  return kept[steps] = std::make_shared<const Circle>(steps);
}

/// s_n, n = 0..count, to s[series][n], from the weights of partial waves.
SCATTER_VECTOR_CLONES
void to_legendre_series(const double* given, std::size_t count, double* const* s) {
  // Sums of every other weight of a and of b (real, imaginary), of orders above the one in hand and of its
  // own parity, or the other: pairs of doubles.
  Quad own{}, own_rest{}, other{}, other_rest{};
  for (std::size_t n = count + 1; n-- > 0;) {
    Quad weight{}; // w a_n, w b_n
    if (n > 0) {
      const double* const from = given + 4 * (n - 1);
      weight = Quad{from[0], from[1], from[0], from[1]} + Quad{from[2], from[3], -from[2], -from[3]};
    }
    // S1 sums a_n pi_n + b_n tau_n, S2 b_n pi_n + a_n tau_n. A_n has the other parity than n, B_{n+1} its
    // own.
    const Quad with_tau = __builtin_shufflevector(weight, weight, 2, 3, 0, 1);
    const Quad above = __builtin_shufflevector(own, own, 2, 3, 0, 1);
    const Quad above_rest = __builtin_shufflevector(own_rest, own_rest, 2, 3, 0, 1);
    const auto order = static_cast<double>(static_cast<long>(n));
    const Quad value =
        order * order * with_tau + (2 * order + 1) * ((other - above) + (other_rest - above_rest));
    for (std::size_t c = 0; c < series_count; ++c) s[c][n] = value[c];
    const Quad sum = own + weight, added = sum - own;
    const Quad rest = own_rest + ((own - (sum - added)) + (weight - added));
    own = other;
    own_rest = other_rest;
    other = sum;
    other_rest = rest;
  }
}

LegendreSeries legendre_series(const PartialWaves& waves) {
  LegendreSeries result;
  double* s[series_count];
  for (std::size_t c = 0; c < series_count; ++c) {
    result.s[c].resize(waves.count() + 1);
    s[c] = result.s[c].data();
  }
  to_legendre_series(waves.weights().data(), waves.count(), s);
  return result;
}

/// C_n = leading (1 + rest) for n = first + i, by the series of the quotient of Gamma functions in 1 / v, v =
/// n
/// + 3/4: to 1e-16 for n >= 64. C_n rounded would not do: the rounding of a smooth function swings evenly
/// with n over long stretches, which at some angles adds up to more than random roundings do.
SCATTER_VECTOR_CLONES
void leading_factors(std::size_t first, std::size_t count, double* leading, double* rest) {
  constexpr double square = 1.2732395447351628, square_rest = -7.871470670072994e-17; // 4 / pi
  const double root = std::sqrt(square);
  for (std::size_t i = 0; i < count; ++i) {
    const double v = static_cast<double>(first + i) + 0.75, w = 1 / (v * v);
    const double exponent = w * (-1.0 / 64 + w * (5.0 / 2048 - w * (61.0 / 49152)));
    leading[i] = root / std::sqrt(v); // 2 / sqrt(pi v), less `missing` of itself
    const double squared = leading[i] * leading[i], squared_rest = std::fma(leading[i], leading[i], -squared);
    const double missing = (std::fma(-squared, v, square) + (square_rest - squared_rest * v)) / (2 * square);
    rest[i] = missing + exponent * (1 + exponent / 2);
  }
}

/// t_n = s_n C_n.
SCATTER_VECTOR_CLONES
void multiply(const double* s, const double* leading, const double* rest, std::size_t count, double* t) {
  for (std::size_t i = 0; i < count; ++i) {
    const double product = s[i] * leading[i];
    t[i] = product + product * rest[i];
  }
}

/// Adds t to a ring of `size` from position `at` on, and multiplies each by what leads to the next term.
SCATTER_VECTOR_CLONES
void fold(
    double* ring, std::size_t size, std::size_t at, double* t, std::size_t count, const double* inverse,
    double factor) {
  std::size_t done = 0;
  while (done < count) {
    const std::size_t some = std::min(count - done, size - at);
    for (std::size_t i = 0; i < some; ++i) {
      ring[at + i] += t[done + i];
      t[done + i] *= factor * inverse[done + i];
    }
    done += some;
    at = 0;
  }
}

/// Sum += power_j i^turn out_j; then power_j *= inverse_j.
SCATTER_VECTOR_CLONES
void add_term(
    double* re, double* im, double* power, const double* inverse, const fftw_complex* out, std::size_t count,
    std::size_t turn) {
  const std::size_t real = turn % 2, imaginary = 1 - real;
  const double real_sign = turn % 4 == 1 || turn % 4 == 2 ? -1 : 1, imaginary_sign = turn % 4 >= 2 ? -1 : 1;
  for (std::size_t j = 0; j < count; ++j) {
    re[j] += real_sign * power[j] * out[j][real];
    im[j] += imaginary_sign * power[j] * out[j][imaginary];
    power[j] *= inverse[j];
  }
}

/// Each number of a ring less the one before it.
SCATTER_VECTOR_CLONES
void differences(const double* ring, std::size_t size, double* out) {
  out[0] = ring[0] - ring[size - 1];
  for (std::size_t l = 1; l < size; ++l) out[l] = ring[l] - ring[l - 1];
}

SCATTER_VECTOR_CLONES
double sum_of_squares(const double* values, std::size_t count) {
  double parts[8] = {};
  std::size_t i = 0;
  for (; i + 8 <= count; i += 8)
    for (std::size_t k = 0; k < 8; ++k) parts[k] += values[i + k] * values[i + k];
  for (; i < count; ++i) parts[0] += values[i] * values[i];
  return ((parts[0] + parts[1]) + (parts[2] + parts[3])) + ((parts[4] + parts[5]) + (parts[6] + parts[7]));
}

/// value_j = -2 inverse_j Im out_j.
SCATTER_VECTOR_CLONES
void divide_by_sine(const fftw_complex* out, const double* inverse, std::size_t count, double* value) {
  for (std::size_t j = 0; j < count; ++j) value[j] = -2 * inverse[j] * out[j][1];
}

/// Amplitudes from their parts; rounding_j = inverse_j rounding_share, and largest_partial alike.
SCATTER_VECTOR_CLONES
void join(
    const double* const* values, const double* inverse, double rounding_share, double partial_share,
    std::size_t count, std::complex<double>* S1, std::complex<double>* S2, double* rounding,
    double* largest_partial) {
  const double *const S1_re = values[0], *const S1_im = values[1], *const S2_re = values[2],
                      *const S2_im = values[3];
  auto* const S1_parts = reinterpret_cast<double*>(S1);
  auto* const S2_parts = reinterpret_cast<double*>(S2);
#pragma GCC ivdep
  for (std::size_t j = 0; j < count; ++j) {
    S1_parts[2 * j] = S1_re[j];
    S1_parts[2 * j + 1] = S1_im[j];
    S2_parts[2 * j] = S2_re[j];
    S2_parts[2 * j + 1] = S2_im[j];
    rounding[j] = inverse[j] * rounding_share;
    largest_partial[j] = inverse[j] * partial_share + ((S1_re[j] * S1_re[j] + S1_im[j] * S1_im[j]) +
                                                       (S2_re[j] * S2_re[j] + S2_im[j] * S2_im[j]));
  }
}

/// One real series on the grid, and what its rounding is made of.
struct RealSums {
  std::vector<double> value;
  double low_square = 0; ///< sum of squares of the sine series' coefficients
  struct Term {
    double square = 0;            ///< sum of squares of the coefficients
    double difference_square = 0; ///< of their differences
    double peak = 0;              ///< modulus of the differences' transform at 180 deg
  };
  std::vector<Term> high;
  double neglected = 0; ///< sum of moduli of the first neglected term's coefficients
};

/// The smallest sine for which `terms` terms do for orders from low_orders to count.
double sine_for(std::size_t count, std::size_t low_orders, std::size_t terms) {
  // The neglected terms' moduli add up to four roundings of the sum's size, with s_n = 2n.
  const auto n = static_cast<double>(low_orders), M = static_cast<double>(terms),
             x = static_cast<double>(count);
  double h = 1;
  for (std::size_t j = 1; j <= terms; ++j) {
    const auto i = static_cast<double>(j);
    h *= (i - 0.5) * (i - 0.5) / (i * (n + i + 0.5));
  }
  const double size = 4 * std::numbers::inv_sqrtpi * std::pow(n, 1.5) / (M - 1.5) * h;
  return 0.5 * std::pow(2 * size / (4 * epsilon * x), 1 / (M + 0.5));
}

} // namespace

FourierSplit
cheapest_split(std::size_t count, std::size_t steps, const std::function<double(double)>& direct_below) {
  const auto N = static_cast<double>(steps), x = static_cast<double>(count);
  // Closer to the axis the direct sum rounds less.
  const double nearest = 2 / std::sqrt(x);
  FourierSplit best; // serves no angle, as befits a handful of partial waves
  best.smallest_sine = 2;
  best.cost = std::numeric_limits<double>::infinity();
  const auto consider = [&](std::size_t low_orders, std::size_t terms) {
    FourierSplit split{steps, low_orders, terms, nearest, 0};
    if (terms > 0) split.smallest_sine = std::max(nearest, sine_for(count, low_orders, terms));
    if (split.smallest_sine >= 1) return;
    const auto n_0 = static_cast<double>(low_orders), M = static_cast<double>(terms);
    const double transform = cost_of_fft * std::log2(N);
    const double sums =
        cost_of_product * n_0 * n_0 / 4 + cost_of_order * x +
        series_count * (N * (transform + cost_of_low_place) + M * N * (transform + cost_of_high_place) +
                        cost_of_fold * M * (x - n_0));
    split.cost = cost_of_start + sums + cost_of_angle * N / 2 + direct_below(split.smallest_sine);
    if (split.cost < best.cost) best = split;
  };
  consider(count + 1, 0);
  for (double n_0 = 128; n_0 < x / 2; n_0 *= std::numbers::sqrt2)
    for (std::size_t terms = 3; terms <= 16; ++terms) consider(static_cast<std::size_t>(n_0), terms);
  return best;
}

void fourier_sums(
    std::span<const PartialWaves> sets, const FourierSplit& split, std::size_t first, std::size_t last,
    std::span<const FourierSums> results, int threads) {
  const std::size_t orders = sets[0].count() + 1, steps = split.steps, angles = last - first + 1;
  const std::size_t low = std::min(split.low_orders, orders);
  const auto circle = circle_of(steps);
  const double* const inverse_sine = circle->turns.inverse.data() + first;
  const double* const inverse_half = circle->turns.inverse_half.data() + first;
  const double cost = split.cost * static_cast<double>(sets.size());

  std::vector<LegendreSeries> legendre(sets.size());
  in_parallel(
      sets.size(), cost, threads, [&](std::size_t set) { legendre[set] = legendre_series(sets[set]); });
  const std::vector<SineSeries> low_orders = sine_series(legendre, low, cost, threads);

  // High orders' factors from n = low on: C_n and 1 / (n + 1/2).
  const std::size_t high = split.terms > 0 ? orders - low : 0;
  std::vector<double> leading(high), rest(high), inverse(high > 0 ? high + split.terms + 1 : 0);
  for (std::size_t i = 0; i < inverse.size(); ++i) inverse[i] = 1 / (static_cast<double>(low + i) + 0.5);

  leading_factors(low, high, leading.data(), rest.data());

  std::vector<std::array<RealSums, series_count>> sums(sets.size());
  in_parallel(series_count * sets.size(), cost, threads, [&](std::size_t item) {
    const std::size_t set = item / series_count, c = item % series_count;
    RealSums& sum = sums[set][c];
    const Transform::Memory memory(steps);
    std::fill(memory.in, memory.in + steps, 0.0);
    const auto& sines = low_orders[set].b[c];
    for (std::size_t start = 0; start <= low; start += steps) {
      const std::size_t some = std::min(steps, low + 1 - start);
      for (std::size_t l = 0; l < some; ++l) memory.in[l] += sines[start + l];
    }
    // Where s_n hardly changes, the terms p >= 1 take away most of p = 0, but not its rounding.
    sum.low_square = sum_of_squares(memory.in, steps) + low_orders[set].leading_square[c];
    circle->transform(memory);
    sum.value.resize(angles);
    divide_by_sine(memory.out + first, inverse_sine, angles, sum.value.data());
    if (high == 0) return;

    std::vector<double> t(high), re(angles), im(angles), power(angles, 1.0), ring(steps);
    multiply(legendre[set].s[c].data() + low, leading.data(), rest.data(), high, t.data());
    for (std::size_t k = 0; k < split.terms; ++k) {
      std::fill(ring.begin(), ring.end(), 0.0);
      const double next = static_cast<double>(k) + 1;
      fold(
          ring.data(), steps, (low + k) % steps, t.data(), high, inverse.data() + k + 1,
          (next - 0.5) * (next - 0.5) / next);
      differences(ring.data(), steps, memory.in);
      RealSums::Term term;
      term.square = sum_of_squares(ring.data(), steps);
      term.difference_square = sum_of_squares(memory.in, steps);
      circle->transform(memory);
      term.peak = std::abs(memory.out[steps / 2][0]);
      sum.high.push_back(term);
      add_term(re.data(), im.data(), power.data(), inverse_sine, memory.out + first, angles, k % 4);
    }
    for (const double value : t) sum.neglected += std::abs(value);
    // exp(-i (theta / 2 - pi / 4)) / (1 - exp(-i theta)) = exp(-i pi / 4) / (2 sin(theta / 2)).
    for (std::size_t j = 0; j < angles; ++j)
      sum.value[j] += std::sqrt(inverse_sine[j] / 2) * inverse_half[j] * (re[j] + im[j]);
  });

  // The transform's rounding walks at random through log2(steps) stages; coefficients bring their own, and
  // that of adding them up where the ring goes round several times. A last stage leaks part of one rounding
  // of a backward peak to angles that are simple parts of the circle. The factors hold with room to spare for
  // everything that was compared with 32 digits.
  const double rounds = static_cast<double>(high) / static_cast<double>(steps);
  const double walk = (4 + std::log2(static_cast<double>(steps))) * epsilon,
               own = (4 + std::sqrt(rounds)) * epsilon, leak = 0.5 * epsilon;
  for (std::size_t set = 0; set < sets.size(); ++set) {
    const FourierSums& result = results[set];
    const auto& parts = sums[set];
    /// The larger of S1 and S2, each from the squares of its parts.
    const auto larger = [&](const auto& square) {
      return std::sqrt(std::max(square(parts[0]) + square(parts[1]), square(parts[2]) + square(parts[3])));
    };
    const double low_rounding = walk * larger([](const RealSums& part) { return part.low_square; });
    std::vector<double> high_rounding;
    for (std::size_t k = 0; k < parts[0].high.size(); ++k)
      high_rounding.push_back(
          own * larger([k](const RealSums& part) { return part.high[k].square; }) +
          walk * larger([k](const RealSums& part) { return part.high[k].difference_square; }) +
          leak * larger([k](const RealSums& part) { return part.high[k].peak * part.high[k].peak; }));
    const double neglected = 2 * larger([](const RealSums& part) { return part.neglected * part.neglected; });
    const double* values[series_count];
    for (std::size_t c = 0; c < series_count; ++c) values[c] = parts[c].value.data();
    join(
        values, inverse_sine, 2 * low_rounding, 2 * result.typical, angles, result.S1.data(),
        result.S2.data(), result.rounding.data(), result.largest_partial.data());
    if (high == 0) continue;
    for (std::size_t j = 0; j < angles; ++j) {
      const double turn = inverse_sine[j];
      double rounding = 0, power = std::sqrt(turn);
      for (const double term : high_rounding) {
        rounding += term * power;
        power *= turn;
      }
      result.rounding[j] += rounding * inverse_half[j] + neglected * power;
    }
  }
}

} // namespace scatter::exact
