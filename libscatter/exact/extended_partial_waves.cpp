// The same recurrences as in partial_waves.cpp, in pairs of doubles. The products with the weights are added
// up as Ogita, Rump & Oishi do for dot products (2005, SIAM J. Sci. Comput. 26, 1955): their roundings go to
// a second sum, which halves the work of full pairs.

#include <scatter/exact/extended_partial_waves.hpp>
#include <scatter/exact/vector_clones.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::exact {
namespace {

using Lanes = double __attribute__((vector_size(64)));
using Pair = DoubleDouble<Lanes>;
constexpr std::size_t lanes = sizeof(Lanes) / sizeof(double);
constexpr std::size_t most_sets = 8; ///< side by side in one pass over the recurrence

constexpr Extended pi{3.141592653589793116, 1.224646799147353207e-16};

/// Sums of one set: weights' products with pi_n +- tau_n.
struct Sums {
  Pair plus_re, plus_im, minus_re, minus_im;
};

/// sum += weight f, where f_halves are f.hi's.
SCATTER_INLINE void accumulate(Pair& sum, const Extended& weight, const Pair& f, const Pair& f_halves) {
  const auto p = twofold::product(f.hi, f_halves, weight.hi, twofold::halves(weight.hi));
  const auto added = twofold::sum(sum.hi, p.hi);
  sum.hi = added.hi;
  sum.lo += added.lo + (p.lo + (f.lo * weight.hi + f.hi * weight.lo));
}

SCATTER_VECTOR_CLONES
void sum_block(
    const ExtendedWaves* const* sets, std::size_t set_count, const Extended* inverse, const Pair& t,
    bool backward, Sums* sums) {
  Pair pi_n{Lanes{} + 1, Lanes{}}, e{};
  for (std::size_t set = 0; set < set_count; ++set) sums[set] = {};
  const std::size_t count = sets[0]->waves.size();
  for (std::size_t k = 0; k < count; ++k) {
    const double n = static_cast<double>(k + 1);
    const Pair s = t * pi_n;
    const Pair twice{2 * pi_n.hi, 2 * pi_n.lo};
    Pair minus = e + times(s, n);
    Pair plus = twice - minus;
    if (backward) {
      // pi_n(pi - theta) = (-1)^(n+1) pi_n(theta), tau_n(pi - theta) = (-1)^n tau_n(theta).
      const double sign = k % 2 ? -1 : 1;
      const Pair mirrored{sign * minus.hi, sign * minus.lo};
      minus = {sign * plus.hi, sign * plus.lo};
      plus = mirrored;
    }
    const Pair minus_halves = twofold::halves(minus.hi), plus_halves = twofold::halves(plus.hi);
    for (std::size_t set = 0; set < set_count; ++set) {
      const auto& wave = sets[set]->waves[k];
      auto& sum = sums[set];
      accumulate(sum.plus_re, wave.plus_re, plus, plus_halves);
      accumulate(sum.plus_im, wave.plus_im, plus, plus_halves);
      accumulate(sum.minus_re, wave.minus_re, minus, minus_halves);
      accumulate(sum.minus_im, wave.minus_im, minus, minus_halves);
    }
    e = e + times(s, 2 * n + 1);
    pi_n = pi_n + (twice - e) * inverse[k];
  }
}

/// t = 1 - cos(theta') of the folded angle.
Extended one_minus_cosine(const Angle& angle) {
  const Extended given{angle.theta, angle.theta_rest};
  const bool degrees = angle.unit == AngleUnit::degree;
  const Extended half_turn = degrees ? Extended{180, 0} : pi;
  const Extended folded = angle.backward ? half_turn - given : given;
  const Extended half = degrees ? folded * pi / Extended{360, 0} : times(folded, 0.5);
  const Extended sine = sine_cosine(half).sine;
  return times(sine * sine, 2);
}

} // namespace

SineCosine sine_cosine(Extended a) {
  // Off by k quarter turns, in three parts (the third of pi / 2 is -1.5e-33).
  const double k = std::nearbyint(a.hi / (pi.hi / 2));
  Extended r = a - times(Extended{pi.hi / 2, 0}, k);
  r = r - times(Extended{pi.lo / 2, 0}, k);
  r = r - Extended{-1.497384904859169777e-33 * k, 0};
  // Taylor's series; |r| <= pi / 4: 28! 1e-30 stands for 32 digits.
  const Extended square = r * r;
  Extended sine = r, cosine{1, 0}, sine_term = r, cosine_term{1, 0};
  for (int i = 1; i <= 14; ++i) {
    cosine_term = -(cosine_term * square / Extended{(2.0 * i - 1) * (2.0 * i), 0});
    sine_term = -(sine_term * square / Extended{(2.0 * i) * (2.0 * i + 1), 0});
    cosine = cosine + cosine_term;
    sine = sine + sine_term;
  }
  switch (static_cast<long long>(k) & 3) {
  case 0:
    return {sine, cosine};
  case 1:
    return {cosine, -sine};
  case 2:
    return {-sine, -cosine};
  default:
    return {-cosine, sine};
  }
}

std::vector<ExtendedSums>
sum_partial_waves(std::span<const ExtendedWaves* const> sets, std::span<const Angle> angles, int threads) {
  std::vector<ExtendedSums> results(sets.size());
  for (auto& result : results) {
    result.S1.resize(angles.size());
    result.S2.resize(angles.size());
  }
  if (sets.empty() || angles.empty()) return results;
  const std::size_t count = sets[0]->waves.size();
  std::vector<Extended> inverse(count);
  for (std::size_t k = 0; k < count; ++k)
    inverse[k] = Extended{1, 0} / Extended{static_cast<double>(k + 1), 0};

  const auto blocks = blocks_of_one_half(angles, lanes);
  const auto work = [&](std::size_t block) {
    const auto& members = blocks[block];
    Pair t;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const Extended value = one_minus_cosine(angles[members[std::min(lane, members.size() - 1)]]);
      t.hi[lane] = value.hi;
      t.lo[lane] = value.lo;
    }
    for (std::size_t start = 0; start < sets.size(); start += most_sets) {
      Sums sums[most_sets];
      const std::size_t some = std::min(most_sets, sets.size() - start);
      sum_block(sets.data() + start, some, inverse.data(), t, angles[members[0]].backward, sums);
      for (std::size_t set = 0; set < some; ++set)
        for (std::size_t lane = 0; lane < members.size(); ++lane) {
          const auto value = [&](const Pair& sum) { return Extended{sum.hi[lane], sum.lo[lane]}; };
          const auto& sum = sums[set];
          const Extended plus_re = value(sum.plus_re), plus_im = value(sum.plus_im);
          const Extended minus_re = value(sum.minus_re), minus_im = value(sum.minus_im);
          const auto rounded = [](Extended re, Extended im) {
            return std::complex<double>{re.hi + re.lo, im.hi + im.lo};
          };
          results[start + set].S1[members[lane]] = rounded(plus_re + minus_re, plus_im + minus_im);
          results[start + set].S2[members[lane]] = rounded(plus_re - minus_re, plus_im - minus_im);
        }
    }
  };
  // A step in pairs costs about 20 steps in double.
  in_parallel(blocks.size(), 20.0 * static_cast<double>(count * blocks.size() * sets.size()), threads, work);
  return results;
}

} // namespace scatter::exact
