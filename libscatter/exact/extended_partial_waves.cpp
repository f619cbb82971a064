// The same recurrences as in partial_waves.cpp, in pairs of doubles. The products with the weights are added
// up as Ogita, Rump & Oishi do for dot products (2005, SIAM J. Sci. Comput. 26, 1955): their roundings go to
// a second sum, which halves the work of full pairs.

#include <scatter/exact/double_lanes.hpp>
#include <scatter/exact/extended_partial_waves.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::exact {
namespace {

constexpr std::size_t lanes = 8;     ///< angles at once
constexpr std::size_t stretch = 16;  ///< terms at once
constexpr std::size_t most_sets = 8; ///< side by side in one pass over the recurrence

/// Sums of one set over a block of angles, index part and angle: weights' products with pi_n +- tau_n.
struct Sums {
  Extended of[4][lanes];
};
enum Part { plus_re, plus_im, minus_re, minus_im };

template <Instructions instructions>
SCATTER_INLINE void sum_sets(
    const ExtendedWaves* const* sets, std::size_t set_count, const Extended* inverse, const double* t_hi,
    const double* t_lo, bool backward, Sums* results) {
  using Lanes = DoubleLanes<instructions, lanes>;
  using Pair = DoubleDouble<Lanes>;
  const Pair t{Lanes::load(t_hi), Lanes::load(t_lo)};
  Pair pi_n{Lanes::all(1), {}}, e{};
  Pair sums[most_sets][4];
  for (std::size_t set = 0; set < set_count; ++set)
    for (Pair& sum : sums[set]) sum = {};
  const std::size_t count = sets[0]->waves.size();
  // A stretch of functions for all sets: then a set's sums stay in registers.
  Pair plus[stretch], minus[stretch], plus_halves[stretch], minus_halves[stretch];
  for (std::size_t first = 0; first < count; first += stretch) {
    const std::size_t terms = std::min(stretch, count - first);
    for (std::size_t j = 0; j < terms; ++j) {
      const std::size_t k = first + j;
      const double n = static_cast<double>(k + 1);
      const Pair s = t * pi_n;
      const Pair twice{2.0 * pi_n.hi, 2.0 * pi_n.lo};
      const Pair less = e + times(s, n), more = twice - less;
      if (backward) {
        // pi_n(pi - theta) = (-1)^(n+1) pi_n(theta), tau_n(pi - theta) = (-1)^n tau_n(theta).
        const double sign = k % 2 ? -1 : 1;
        plus[j] = {sign * less.hi, sign * less.lo};
        minus[j] = {sign * more.hi, sign * more.lo};
      } else {
        plus[j] = more;
        minus[j] = less;
      }
      if constexpr (!is_fused<Lanes>) {
        minus_halves[j] = twofold::halves(minus[j].hi);
        plus_halves[j] = twofold::halves(plus[j].hi);
      }
      e = e + times(s, 2 * n + 1);
      pi_n = pi_n + (twice - e) * inverse[k];
    }
    for (std::size_t set = 0; set < set_count; ++set) {
      const ExtendedWaves::Wave* const waves = sets[set]->waves.data() + first;
      Pair sum_0 = sums[set][0], sum_1 = sums[set][1], sum_2 = sums[set][2], sum_3 = sums[set][3];
      for (std::size_t j = 0; j < terms; ++j) {
        accumulate(sum_0, waves[j].plus_re, plus[j], plus_halves[j]);
        accumulate(sum_1, waves[j].plus_im, plus[j], plus_halves[j]);
        accumulate(sum_2, waves[j].minus_re, minus[j], minus_halves[j]);
        accumulate(sum_3, waves[j].minus_im, minus[j], minus_halves[j]);
      }
      sums[set][0] = sum_0;
      sums[set][1] = sum_1;
      sums[set][2] = sum_2;
      sums[set][3] = sum_3;
    }
  }
  for (std::size_t set = 0; set < set_count; ++set)
    for (std::size_t part = 0; part < 4; ++part)
      for (std::size_t i = 0; i < lanes; ++i)
        results[set].of[part][i] = {sums[set][part].hi.v[i], sums[set][part].lo.v[i]};
}

using SumSets = void (*)(
    const ExtendedWaves* const*, std::size_t, const Extended*, const double*, const double*, bool, Sums*);

void sum_plain(
    const ExtendedWaves* const* sets, std::size_t set_count, const Extended* inverse, const double* t_hi,
    const double* t_lo, bool backward, Sums* sums) {
  sum_sets<Instructions::plain>(sets, set_count, inverse, t_hi, t_lo, backward, sums);
}
#if SCATTER_X86_LANES
__attribute__((target("avx2,fma"))) void sum_avx2(
    const ExtendedWaves* const* sets, std::size_t set_count, const Extended* inverse, const double* t_hi,
    const double* t_lo, bool backward, Sums* sums) {
  sum_sets<Instructions::avx2>(sets, set_count, inverse, t_hi, t_lo, backward, sums);
}
__attribute__((target("avx512f,avx512dq,avx2,fma"))) void sum_avx512(
    const ExtendedWaves* const* sets, std::size_t set_count, const Extended* inverse, const double* t_hi,
    const double* t_lo, bool backward, Sums* sums) {
  sum_sets<Instructions::avx512>(sets, set_count, inverse, t_hi, t_lo, backward, sums);
}
#endif

SumSets sum_here() {
#if SCATTER_X86_LANES
  return widest_of(sum_plain, sum_avx2, sum_avx512);
#else
  return sum_plain;
#endif
}

/// t = 1 - cos(theta') of the folded angle.
Extended one_minus_cosine(const Angle& angle) {
  const Extended given{angle.theta, angle.theta_rest};
  const bool degrees = angle.unit == AngleUnit::degree;
  const Extended half_turn = degrees ? Extended{180, 0} : extended_pi;
  const Extended folded = angle.backward ? half_turn - given : given;
  const Extended half = degrees ? folded * extended_pi / Extended{360, 0} : times(folded, 0.5);
  const Extended sine = sine_cosine(half).sine;
  return times(sine * sine, 2);
}

} // namespace

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

  const SumSets sum_block = sum_here();
  const auto blocks = blocks_of_one_half(angles, lanes);
  const auto work = [&](std::size_t block) {
    const auto& members = blocks[block];
    double t_hi[lanes], t_lo[lanes];
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const Extended value = one_minus_cosine(angles[members[std::min(lane, members.size() - 1)]]);
      t_hi[lane] = value.hi;
      t_lo[lane] = value.lo;
    }
    for (std::size_t start = 0; start < sets.size(); start += most_sets) {
      Sums sums[most_sets];
      const std::size_t some = std::min(most_sets, sets.size() - start);
      sum_block(sets.data() + start, some, inverse.data(), t_hi, t_lo, angles[members[0]].backward, sums);
      for (std::size_t set = 0; set < some; ++set)
        for (std::size_t lane = 0; lane < members.size(); ++lane) {
          const auto value = [&](Part part) { return sums[set].of[part][lane]; };
          const Extended plus_real = value(plus_re), plus_imaginary = value(plus_im);
          const Extended minus_real = value(minus_re), minus_imaginary = value(minus_im);
          const auto rounded = [](Extended re, Extended im) {
            return std::complex<double>{re.hi + re.lo, im.hi + im.lo};
          };
          results[start + set].S1[members[lane]] =
              rounded(plus_real + minus_real, plus_imaginary + minus_imaginary);
          results[start + set].S2[members[lane]] =
              rounded(plus_real - minus_real, plus_imaginary - minus_imaginary);
        }
    }
  };
  // A step in pairs costs about 20 steps in double.
  in_parallel(blocks.size(), 20.0 * static_cast<double>(count * blocks.size() * sets.size()), threads, work);
  return results;
}

} // namespace scatter::exact
