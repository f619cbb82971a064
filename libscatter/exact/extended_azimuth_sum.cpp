// cos(n theta) and sin(n theta) by rotation, eight angles at once, in pairs of doubles; the sums as in
// extended_partial_waves.cpp.

#include <scatter/exact/double_lanes.hpp>
#include <scatter/exact/extended_azimuth_sum.hpp>
#include <scatter/exact/extended_functions.hpp>
#include <scatter/exact/partial_waves.hpp>

#include <algorithm>

namespace scatter::exact {
namespace {

constexpr std::size_t lanes = 8; ///< angles at once

/// One block of angles: their rotation by one step, and the sums T1, T2, T3, real and imaginary.
struct Block {
  double cosine_hi[lanes], cosine_lo[lanes], sine_hi[lanes], sine_lo[lanes];
  Extended sums[6][lanes];
};

template <Instructions instructions>
SCATTER_INLINE void sum_block(std::span<const ExtendedAzimuthWave> waves, Block& block) {
  using Lanes = DoubleLanes<instructions, lanes>;
  using Pair = DoubleDouble<Lanes>;
  const Pair step_re{Lanes::load(block.cosine_hi), Lanes::load(block.cosine_lo)};
  const Pair step_im{Lanes::load(block.sine_hi), Lanes::load(block.sine_lo)};
  Pair cosine{Lanes::all(1), {}}, sine{}, sums[6]{};
  for (const ExtendedAzimuthWave& wave : waves) {
    Pair cosine_halves{}, sine_halves{};
    if constexpr (!is_fused<Lanes>) {
      cosine_halves = twofold::halves(cosine.hi);
      sine_halves = twofold::halves(sine.hi);
    }
    accumulate(sums[0], wave.T1.re, cosine, cosine_halves);
    accumulate(sums[1], wave.T1.im, cosine, cosine_halves);
    accumulate(sums[2], wave.T2.re, cosine, cosine_halves);
    accumulate(sums[3], wave.T2.im, cosine, cosine_halves);
    accumulate(sums[4], wave.T3.re, sine, sine_halves);
    accumulate(sums[5], wave.T3.im, sine, sine_halves);
    const Pair next = cosine * step_re - sine * step_im;
    sine = cosine * step_im + sine * step_re;
    cosine = next;
  }
  for (std::size_t part = 0; part < 6; ++part)
    for (std::size_t i = 0; i < lanes; ++i) block.sums[part][i] = {sums[part].hi.v[i], sums[part].lo.v[i]};
}

using SumBlock = void (*)(std::span<const ExtendedAzimuthWave>, Block&);

void sum_plain(std::span<const ExtendedAzimuthWave> waves, Block& block) {
  sum_block<Instructions::plain>(waves, block);
}
#if SCATTER_X86_LANES
__attribute__((target("avx2,fma"))) void sum_avx2(std::span<const ExtendedAzimuthWave> waves, Block& block) {
  sum_block<Instructions::avx2>(waves, block);
}
__attribute__((target("avx512f,avx512dq,avx2,fma"))) void
sum_avx512(std::span<const ExtendedAzimuthWave> waves, Block& block) {
  sum_block<Instructions::avx512>(waves, block);
}
#endif

SumBlock sum_here() {
#if SCATTER_X86_LANES
  return widest_of(sum_plain, sum_avx2, sum_avx512);
#else
  return sum_plain;
#endif
}

} // namespace

ExtendedAzimuthSums
sum_over_azimuth(std::span<const ExtendedAzimuthWave> waves, std::span<const Extended> theta, int threads) {
  ExtendedAzimuthSums result;
  for (auto* list : {&result.T1, &result.T2, &result.T3}) list->resize(theta.size());
  const SumBlock sum = sum_here();
  const std::size_t blocks = (theta.size() + lanes - 1) / lanes;
  const auto work = [&](std::size_t index) {
    const std::size_t first = index * lanes, used = std::min(lanes, theta.size() - first);
    Block block;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const auto [sine, cosine] = sine_cosine(theta[first + std::min(lane, used - 1)]);
      block.cosine_hi[lane] = cosine.hi;
      block.cosine_lo[lane] = cosine.lo;
      block.sine_hi[lane] = sine.hi;
      block.sine_lo[lane] = sine.lo;
    }
    sum(waves, block);
    for (std::size_t lane = 0; lane < used; ++lane) {
      const auto value = [&](std::size_t part) {
        const Extended &re = block.sums[part][lane], &im = block.sums[part + 1][lane];
        return std::complex<double>{re.hi + re.lo, im.hi + im.lo};
      };
      result.T1[first + lane] = value(0);
      result.T2[first + lane] = value(2);
      result.T3[first + lane] = value(4);
    }
  };
  // A wave in pairs costs about 40 steps in double.
  in_parallel(blocks, 40.0 * static_cast<double>(waves.size() * blocks), threads, work);
  return result;
}

} // namespace scatter::exact
