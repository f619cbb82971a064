// Trigonometry is done away with: gamma is carried as t = tan(gamma / 2), gamma_t by its sine h / eta' and
// W = eta' cos gamma_t. TRT needs the roots of u(gamma) = 4 gamma_t - 2 gamma = +-|phi|; u rises to a maximum
// while eta' < 2 and falls from there to the rim. Steps solve a parabola through value, slope and curvature
// for the root on the side wanted, so that they converge beside the maximum, where two roots meet, as fast as
// elsewhere: the error's third power. Starts are within a tenth of the way to the maximum. Directions that
// have such roots are gathered first, so that every vector is full of them; most directions have none.
//
// With c = cos theta_d all of Bravais' numbers come from A = c^2 + eta^2 - 1: eta' = sqrt(A) / c, and what a
// ray meets at the surface depends on X = c cos gamma and w = c W = sqrt(X^2 + eta^2 - 1) alone.

#include <scatter/fiber/lane_math.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/fiber/ray_section_kernel.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <stdexcept>

namespace scatter::fiber {
namespace {

using lane::absolute;
using lane::inverse;
using lane::inverse_root;
using lane::Lanes;
using lane::power_of_two;
using lane::quick_root;
using lane::root;
using lane::Two;

constexpr std::size_t block = 256;     ///< directions at a time: all lists stay in the first cache
constexpr std::size_t most_lanes = 32; ///< that are computed side by side
constexpr std::size_t most_roots = 3 * block + most_lanes;
constexpr int steps = 3;

/// Lists of a block.
struct alignas(64) Directions {
  double cos_d[block], sine[block], cosine[block]; ///< theta_d's; of |phi| / 2
  double R[block], TT[block], path[block];         ///< TT before absorption; its path
};

/// The TRT rays to be found.
struct alignas(64) Problems {
  double cos_d[most_roots];
  double sine[most_roots], cosine[most_roots];    ///< of half the turn wanted, -pi/2 .. pi/2
  double side[most_roots];                        ///< -1 rising, +1 falling
  double amplitude[most_roots], path[most_roots]; ///< found: N_2 is amplitude exp(-sigma_a path)
  std::uint16_t direction[most_roots];
  std::size_t rays = 0, count = 0; ///< those wanted; with those that fill up the last vectors
};

/// Indices of directions, with room for one write too many.
struct List {
  std::uint16_t entry[block + 4];
  std::size_t count = 0;

  /// from + k for every bit k of four. Without branches, which nothing would predict: what is not wanted is
  /// overwritten.
  void append(std::uint32_t four, std::size_t from) {
    static constexpr auto places = [] {
      std::array<std::uint64_t, 16> packed{};
      for (std::uint32_t bits = 0; bits < 16; ++bits)
        for (std::uint32_t k = 0, shift = 0; k < 4; ++k)
          if ((bits >> k & 1) != 0) {
            packed[bits] |= std::uint64_t{k} << shift;
            shift += 16;
          }
      return packed;
    }();
    const std::uint64_t entries = places[four] + from * 0x0001'0001'0001'0001U;
    std::memcpy(entry + count, &entries, sizeof entries);
    count += static_cast<std::size_t>(std::popcount(four));
  }
};

/// Which TRT rays there are: those that rise, fall, and fall on the other side.
struct Rays {
  List rising, falling, other;
};

/// Unpolarised; r and T in terms of 1 / (X + w) and 1 / (eta^2 X + w).
template <class T>
SCATTER_LANE T reflected(double contrast, const T& X, const T& inverse_s, const T& inverse_p) {
  const T E = T::all(contrast), rs = E * (inverse_s * inverse_s);
  const T rp = E * (subtract_product(T::all(1), T::all(contrast + 2) * X, X) * (inverse_p * inverse_p));
  return T::all(0.5) * multiply_add(rs, rs, rp * rp);
}
template <class T>
SCATTER_LANE T let_through(double contrast, const T& X, const T& w, const T& inverse_s, const T& inverse_p) {
  return T::all(2) * (X * w) *
         multiply_add(T::all(contrast + 1) * inverse_p, inverse_p, inverse_s * inverse_s);
}

/// R, TT without absorption, and which TRT rays there are; lists hold whole vectors.
template <class T>
SCATTER_LANE void closed_forms(double contrast, std::size_t count, Directions& d, Rays& rays) {
  const T E = T::all(contrast), eta2 = T::all(contrast + 1), zero = T::all(0), one = T::all(1);
  const double twice_eta = 2 * std::sqrt(contrast + 1);
  for (std::size_t i = 0; i < count; i += T::width) {
    const T S = T::load(d.sine + i), C = T::load(d.cosine + i), c = T::load(d.cos_d + i);
    const T c2 = c * c, A = c2 + E, inverse_a = inverse_root(A), a = A * inverse_a,
            inverse_A = inverse_a * inverse_a;
    // The light that R comes from meets the surface at |phi| / 2.
    const T X_0 = c * C, w_0 = root(multiply_add(X_0, X_0, E));
    const T s_0 = X_0 + w_0, p_0 = multiply_add(eta2, X_0, w_0);
    // TT: half the deflection has the cosine S and the sine C. D = w - X.
    const T edge = multiply_subtract(a, S, c),
            D2 = multiply_add(edge, edge, larger(A * (C * C), T::all(1e-300)));
    const T inverse_D = inverse_root(D2);
    const T cos_g = larger(edge, zero) * inverse_D, X_1 = c * cos_g;
    const T w_1 = a * (subtract_product(a, c, S) * inverse_D);
    const T s_1 = X_1 + w_1, p_1 = multiply_add(eta2, X_1, w_1);
    // One division for four quotients.
    const T sp_0 = s_0 * p_0, sp_1 = s_1 * p_1, both = inverse(sp_0 * sp_1);
    const T sp_0_inverse = both * sp_1, sp_1_inverse = both * sp_0;
    (T::all(0.25) * (C * reflected(contrast, X_0, p_0 * sp_0_inverse, s_0 * sp_0_inverse))).store(d.R + i);
    const T through = let_through(contrast, X_1, w_1, p_1 * sp_1_inverse, s_1 * sp_1_inverse);
    (T::all(0.25) * (through * through) * (cos_g * w_1) * inverse_D).store(d.TT + i);
    (T::all(twice_eta) * (w_1 * inverse_A)).store(d.path + i);
    // TRT. At the turn's maximum cos^2 gamma = (eta'^2 - 1) / 3, the sine of half the turn is
    // sin^3 gamma / eta'^2; at the rim it is 2 / eta'^2 - 1.
    const T bend = multiply_subtract(T::all(3), c2, E); // 3 c^2 sin^2 gamma
    const T square = (S * A) * (S * A);
    const T room = T::all(27) * (square * c2), highest = bend * (bend * bend);
    const T rim = multiply_subtract(T::all(2), c2 * inverse_A, one);
    const std::uint32_t wanted = count - i < T::width ? (1U << (count - i)) - 1 : ~0U;
    const std::uint32_t rising = wanted & T::bits(less(zero, bend)) & T::bits(less_or_equal(room, highest));
    const std::uint32_t falling = rising & T::bits(less_or_equal(rim, S));
    const std::uint32_t other = wanted & T::bits(less_or_equal(S, -rim));
    for (std::size_t k = 0; k < T::width; k += 4) {
      rays.rising.append(rising >> k & 15, i + k);
      rays.falling.append(falling >> k & 15, i + k);
      rays.other.append(other >> k & 15, i + k);
    }
  }
}

/// The problems that rays are, whole vectors of them.
void gather(const Directions& d, const Rays& rays, std::size_t lanes, Problems& p) {
  p.count = 0;
  const auto add = [&](const List& list, double side, double sign) {
    for (std::size_t k = 0; k < list.count; ++k) {
      const std::size_t i = list.entry[k], to = p.count + k;
      p.direction[to] = list.entry[k];
      p.cos_d[to] = d.cos_d[i];
      p.sine[to] = sign * d.sine[i];
      p.cosine[to] = d.cosine[i];
      p.side[to] = side;
    }
    p.count += list.count;
  };
  add(rays.rising, -1, 1);
  add(rays.falling, 1, 1);
  add(rays.other, 1, -1);
  p.rays = p.count;
  for (; p.count % lanes != 0; ++p.count) {
    p.cos_d[p.count] = p.cosine[p.count] = p.side[p.count] = 1;
    p.sine[p.count] = 0;
  }
}

/// A ray near the one that turns by 2 asin(sine): t for those that rise or fall from the turn's maximum.
template <class T>
SCATTER_LANE T
near_maximum(const T& excess, const T& inverse_square, const T& sine, const T& cosine, const T& side) {
  const T one = T::all(1), two = T::all(2), least = T::all(1e-300);
  // 2 cos gamma = W there; the sine and cosine of half the turn are sin^3 gamma and cos gamma (3 + cos^2
  // gamma) over eta'^2. Beyond eta' = 2, where there is no maximum, numbers stay finite.
  const T excess_root = root(excess), cos_g = smaller(excess_root * T::all(0.57735026918962576), one);
  const T sin_g = root(larger(subtract_product(one, cos_g, cos_g), T::all(1e-30)));
  const T top_sine = inverse_square * (sin_g * (sin_g * sin_g));
  const T top_cosine = inverse_square * (cos_g * multiply_add(cos_g, cos_g, T::all(3)));
  const T top = sin_g * inverse(one + cos_g);
  // With V, whose sine is the goal, t is top + slope sqrt(V) at first; from there a parabola in sqrt(V) to
  // the end of the side, the rim or the axis.
  const T goal = larger(multiply_subtract(top_sine, cosine, top_cosine * sine), least);
  const T rim_sine = multiply_subtract(two, inverse_square, one),
          rim_cosine = two * (excess_root * inverse_square);
  const auto falls = less(T::all(0), side);
  const T at_rim = multiply_subtract(top_sine, rim_cosine, top_cosine * rim_sine);
  const T end = larger(select(falls, at_rim, top_sine), least), end_t = select(falls, one, T::all(0));
  const T share = smaller(goal * rough_inverse(end), one);
  const T curvature = T::all(8.0 / 3) * (cos_g * rough_inverse(sin_g));
  const T slope = T::all(0.5) * (side * multiply_add(top, top, one)) * quick_root(curvature * end);
  return multiply_add(
      slope, quick_root(larger(share, least)), multiply_add((end_t - top) - slope, share, top));
}

/// The same for those beyond the axis, where the tangent of half the half turn is nearly a t + b t^3.
template <class T>
SCATTER_LANE T beyond_axis(const T& excess, const T& inverse_square, const T& sine, const T& cosine) {
  const T one = T::all(1), zero = T::all(0), two = T::all(2);
  const T tangent = larger(sine * rough_inverse(one + cosine), T::all(1e-30));
  const T square_root = quick_root(inverse_square), a = subtract_product(one, two, square_root);
  const T at_rim = subtract_product(one, two, inverse_square) *
                   rough_inverse(multiply_add(two * quick_root(excess), inverse_square, one));
  const T b = larger(at_rim - a, T::all(1e-12));
  // t = third y, y^3 + k y = 1, y to some per cent; then a step of Newton's.
  const T third = rough_cube_root(tangent * rough_inverse(b)), k = a * (third * rough_inverse(tangent));
  const T up = larger(k, zero), down = larger(-k, zero);
  const T bottom = multiply_add(up, multiply_add(up, T::all(0.45), T::all(2.0 / 3)), one);
  const T y_up = bottom * rough_inverse(multiply_add(up, bottom, one));
  const T y_down = quick_root(down + quick_root(rough_inverse(one + down)));
  const T t = third * select(less(zero, k), y_up, y_down), b_square = b * (t * t);
  return multiply_add(two * b_square, t, tangent) * rough_inverse(multiply_add(T::all(3), b_square, a));
}

/// The rays of all problems, whole vectors.
template <class T>
SCATTER_LANE void solve(double contrast, Problems& p) {
  const T E = T::all(contrast), eta2 = T::all(contrast + 1), zero = T::all(0), one = T::all(1),
          two = T::all(2);
  const double four_eta = 4 * std::sqrt(contrast + 1);
  for (std::size_t i = 0; i < p.count; i += T::width) {
    const T c = T::load(p.cos_d + i), sine = T::load(p.sine + i), cosine = T::load(p.cosine + i);
    const T side = T::load(p.side + i);
    const T c2 = c * c, A = c2 + E, c2_A_inverse = inverse(c2 * A);
    const T excess = E * (A * c2_A_inverse);           // eta'^2 - 1
    const T inverse_square = c2 * (c2 * c2_A_inverse); // 1 / eta'^2
    T t = select(
        less(sine, zero), beyond_axis(excess, inverse_square, -sine, cosine),
        near_maximum(excess, inverse_square, sine, cosine, side));
    t = smaller(larger(t, zero), one);
#pragma GCC unroll 1
    for (int step = 0; step < steps; ++step) {
      const T square = one + t * t, turned = inverse(square);
      const T sin_g = two * (t * turned), cos_g = ((one - t) * (one + t)) * turned;
      const T W2 = multiply_add(cos_g, cos_g, excess), W_inverse = inverse_root(W2), W = W2 * W_inverse;
      // The sine of half the angle by which the turn misses, as one difference.
      const T with_sine = multiply_add(sin_g, cosine, cos_g * sine);
      const T with_cosine = multiply_subtract(cos_g, cosine, sin_g * sine);
      const T miss =
          inverse_square *
          multiply_subtract(two * (sin_g * W), with_cosine, ((W - sin_g) * (W + sin_g)) * with_sine);
      // Derivatives of half the turn by gamma: the first, and -2 times the second.
      const T first = multiply_subtract(two * cos_g, W_inverse, one);
      const T second = (T::all(4) * (excess * sin_g)) * (W_inverse * (W_inverse * W_inverse));
      const T there = root(larger(multiply_add(second, miss, first * first), T::all(1e-300)));
      const T divisor = subtract_product(first, side, there);
      const T safe = select(less(absolute(divisor), T::all(1e-140)), T::all(1e140), divisor);
      const T half = -miss * inverse(safe); // of the change of gamma
      t = multiply_add(half * square, multiply_add(t, half, one), t);
      t = smaller(larger(t, zero), one);
    }
    const T square = t * t, X = c * (((one - t) * (one + t)) * inverse(one + square));
    const T w = root(multiply_add(X, X, E)), s = X + w, ps = multiply_add(eta2, X, w);
    // c^2 (2 cos gamma - W) (2 cos gamma + W); the floor keeps the caustic finite
    const T gap = larger(absolute(multiply_subtract(T::all(3) * X, X, E)), T::all(1e-30));
    // One division for all quotients.
    const T sp = s * ps, rest = (T::all(4) * gap) * c, sp_rest = sp * rest,
            all_inverse = inverse(sp_rest * A);
    const T A_inverse = all_inverse * sp_rest, most = all_inverse * A;
    const T sp_inverse = most * rest, rest_inverse = most * sp;
    const T inverse_s = ps * sp_inverse, inverse_p = s * sp_inverse;
    const T through = let_through(contrast, X, w, inverse_s, inverse_p);
    const T kept = (through * through) * reflected(contrast, X, inverse_s, inverse_p);
    (kept * ((X * w) * (multiply_add(two, X, w) * rest_inverse))).store(p.amplitude + i);
    (T::all(four_eta) * (w * A_inverse)).store(p.path + i);
  }
}

/// T::width - 1 more than count may be read and written.
template <class T>
SCATTER_LANE void copy(const double* from, std::size_t count, double* to) {
  for (std::size_t i = 0; i < count; i += T::width) T::load(from + i).store(to + i);
}

/// to[i] = amplitude[i] exp(-sigma_a path[i]); the same of reading and writing.
template <class T>
SCATTER_LANE void
absorb(const double* amplitude, const double* path, double sigma_a, std::size_t count, double* to) {
  const T rate = T::all(-sigma_a * std::numbers::log2e);
  for (std::size_t i = 0; i < count; i += T::width)
    (T::load(amplitude + i) * power_of_two(rate * T::load(path + i))).store(to + i);
}

/// All of ray_lobes(), T lanes at a time.
template <class T>
SCATTER_LANE void
lobes(double eta, std::span<const double> sigma_a, const RayLobeDirections& directions, std::span<double> N) {
  const std::size_t count = directions.cos_theta_d.size(), colours = sigma_a.size();
  const double contrast = (eta - 1) * (eta + 1);
  Directions d;
  Problems problems;
  alignas(64) double value[most_roots], part[block];
  for (std::size_t from = 0; from < count; from += block) {
    // Whole vectors, filled up where data end: a result then comes from the same instructions whatever stands
    // beside it.
    const std::size_t n = std::min(block, count - from), whole = (n + T::width - 1) / T::width * T::width;
    std::copy_n(&directions.cos_theta_d[from], n, d.cos_d);
    std::copy_n(&directions.sin_half_phi[from], n, d.sine);
    std::copy_n(&directions.cos_half_phi[from], n, d.cosine);
    std::fill(d.cos_d + n, d.cos_d + whole, 1.0);
    std::fill(d.sine + n, d.sine + whole, 1.0);
    std::fill(d.cosine + n, d.cosine + whole, 0.0);
    Rays rays;
    closed_forms<T>(contrast, n, d, rays);
    gather(d, rays, 2 * T::width, problems);
    solve<Two<T>>(contrast, problems);
    for (std::size_t colour = 0; colour < colours; ++colour) {
      const auto out = [&](std::size_t order) { return &N[(order * colours + colour) * count + from]; };
      // Where whole vectors fit, straight to where they belong.
      double* const TT = whole == n ? out(1) : part;
      absorb<T>(d.TT, d.path, sigma_a[colour], whole, TT);
      if (TT == part) std::copy_n(part, n, out(1));
      if (whole == n)
        copy<T>(d.R, n, out(0));
      else
        std::copy_n(d.R, n, out(0));
      absorb<T>(problems.amplitude, problems.path, sigma_a[colour], problems.count, value);
      double* const TRT = out(2);
      std::fill_n(TRT, n, 0.0);
      for (std::size_t k = 0; k < problems.rays; ++k) TRT[problems.direction[k]] += value[k];
    }
  }
}

/// energy[i] of a series.
template <class T>
SCATTER_LANE void
clenshaw(const std::vector<double>& coefficient, std::size_t count, const double* cosine, double* energy) {
  for (std::size_t from = 0; from < count; from += T::width) {
    const std::size_t n = std::min(T::width, count - from);
    double padded[T::width];
    std::fill(std::copy_n(cosine + from, n, padded), padded + T::width, 1.0);
    const T twice = multiply_add(T::all(4), root(T::load(padded)), T::all(-2));
    T last = T::all(0), before = T::all(0);
    for (std::size_t k = coefficient.size() - 1; k > 0; --k) {
      const T next = multiply_add(twice, last, T::all(coefficient[k]) - before);
      before = last;
      last = next;
    }
    multiply_add(T::all(0.5) * twice, last, T::all(coefficient[0]) - before).store(padded);
    std::copy_n(padded, n, energy + from);
  }
}

#if SCATTER_FIBER_X86_LANES
using Wide = Two<Lanes<8>>;
using Medium = Two<Lanes<4>>;
SCATTER_FIBER_AVX512 void lobes_on_avx512(
    double eta, std::span<const double> sigma_a, const RayLobeDirections& directions, std::span<double> N) {
  lobes<Wide>(eta, sigma_a, directions, N);
}
SCATTER_FIBER_AVX2 void lobes_on_avx2(
    double eta, std::span<const double> sigma_a, const RayLobeDirections& directions, std::span<double> N) {
  lobes<Medium>(eta, sigma_a, directions, N);
}
SCATTER_FIBER_AVX512 void clenshaw_on_avx512(
    const std::vector<double>& coefficient, std::size_t count, const double* cosine, double* energy) {
  clenshaw<Wide>(coefficient, count, cosine, energy);
}
SCATTER_FIBER_AVX2 void clenshaw_on_avx2(
    const std::vector<double>& coefficient, std::size_t count, const double* cosine, double* energy) {
  clenshaw<Medium>(coefficient, count, cosine, energy);
}
#endif
using Narrow = Two<Lanes<2>>;
void lobes_plainly(
    double eta, std::span<const double> sigma_a, const RayLobeDirections& directions, std::span<double> N) {
  lobes<Narrow>(eta, sigma_a, directions, N);
}
void clenshaw_plainly(
    const std::vector<double>& coefficient, std::size_t count, const double* cosine, double* energy) {
  clenshaw<Narrow>(coefficient, count, cosine, energy);
}

} // namespace

void ray_lobes(
    double eta, std::span<const double> sigma_a, const RayLobeDirections& directions, std::span<double> N,
    const exact::VectorUnit& unit) {
  const std::size_t count = directions.cos_theta_d.size();
  if (directions.sin_half_phi.size() != count || directions.cos_half_phi.size() != count ||
      N.size() != 3 * sigma_a.size() * count)
    throw std::invalid_argument("ray_lobes: lists of directions and of results do not match");
#if SCATTER_FIBER_X86_LANES
  if (unit.width == 8) return lobes_on_avx512(eta, sigma_a, directions, N);
  if (unit.width == 4) return lobes_on_avx2(eta, sigma_a, directions, N);
#endif
  (void)unit;
  lobes_plainly(eta, sigma_a, directions, N);
}

ResidualEnergy::ResidualEnergy(double eta, double sigma_a, int first_order) {
  const RaySection section(eta, sigma_a);
  if (first_order < 1) throw InputError("a residual begins at order 1 or later");
  for (std::size_t count = 16;; count *= 2) {
    std::vector<double> value(count);
    for (std::size_t k = 0; k < count; ++k) {
      const double x =
          std::cos(std::numbers::pi * (static_cast<double>(k) + 0.5) / static_cast<double>(count));
      const double root = (x + 1) / 2;
      value[k] = section.residual_energy(first_order, std::acos(root * root));
    }
    coefficient_.assign(count, 0.0);
    for (std::size_t j = 0; j < count; ++j) {
      for (std::size_t k = 0; k < count; ++k)
        coefficient_[j] += value[k] * std::cos(
                                          std::numbers::pi * static_cast<double>(j) *
                                          (static_cast<double>(k) + 0.5) / static_cast<double>(count));
      coefficient_[j] *= (j == 0 ? 1.0 : 2.0) / static_cast<double>(count);
    }
    double tail = 0;
    for (std::size_t j = count - count / 8; j < count; ++j) tail = std::max(tail, std::abs(coefficient_[j]));
    if (tail < 1e-15 || count >= 1024) break;
  }
  while (coefficient_.size() > 2 && std::abs(coefficient_.back()) < 2e-15) coefficient_.pop_back();
}

void ResidualEnergy::evaluate(
    std::span<const double> cos_theta_d, std::span<double> energy, const exact::VectorUnit& unit) const {
  if (energy.size() != cos_theta_d.size())
    throw std::invalid_argument("ResidualEnergy: lists of cosines and of energies do not match");
#if SCATTER_FIBER_X86_LANES
  if (unit.width == 8)
    return clenshaw_on_avx512(coefficient_, cos_theta_d.size(), cos_theta_d.data(), energy.data());
  if (unit.width == 4)
    return clenshaw_on_avx2(coefficient_, cos_theta_d.size(), cos_theta_d.data(), energy.data());
#endif
  (void)unit;
  clenshaw_plainly(coefficient_, cos_theta_d.size(), cos_theta_d.data(), energy.data());
}

} // namespace scatter::fiber
