// Method. With N the middle of a block of orders and j = 1..half,
//   c_{N+j} cos((N+j) t) + c_{N-j} cos((N-j) t) = (sum_j cos jt) cos Nt - (less_j sin jt) sin Nt,
// and alike for sines. The tables of cos jt and sin jt serve all blocks and all series, each entry rounded
// once from long double: no recurrence in double gathers error. Half the multiplications of a plain sum do.
#include <scatter/exact/azimuth_sum.hpp>
#include <scatter/exact/partial_waves.hpp>
#include <scatter/exact/vector_clones.hpp>

#include <algorithm>
#include <cstring>

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;

using Lanes = double __attribute__((vector_size(64)));
/// The same in memory, at any alignment.
using StoredLanes = double __attribute__((vector_size(64), aligned(8), may_alias));
constexpr std::size_t lanes = sizeof(Lanes) / sizeof(double);
constexpr std::size_t rows = 3; ///< vectors in flight: hides the latency of the additions
constexpr std::size_t angles_at_once = lanes * rows;
constexpr std::size_t half = AzimuthSeries::half;

/// cos and sin of one multiple of the angles in flight. Aligned: a vector across two cache lines takes a
/// quarter longer, by chance of where the table lies.
struct alignas(sizeof(Lanes)) Turn {
  double cosine[angles_at_once], sine[angles_at_once];
};

struct Tables {
  Turn offsets[half];        ///< j theta, j = 1..half
  std::vector<Turn> middles; ///< N theta
};

/// exp(i angle), |angle| < 1000. Libraries reduce a long double by pi / 2 for any size, which takes long.
LongComplex rotation(real angle) {
  // pi / 2 as a double, whose multiples by up to 11 bits are exact, and the rest.
  constexpr double quarter = 1.5707963267948966;
  constexpr real low = 6.12323399573676588613e-17L;
  const real k = std::nearbyint(angle / quarter);
  const real rest = (angle - k * quarter) - k * low;
  const real cosine = std::cos(rest), sine = std::sin(rest);
  switch (static_cast<int>(k) & 3) {
  case 0:
    return {cosine, sine};
  case 1:
    return {-sine, cosine};
  case 2:
    return {-cosine, -sine};
  default:
    return {sine, -cosine};
  }
}

/// One angle's multiples, rotated forward in long double: their error stays far below a double's rounding.
void fill(Tables& tables, real theta, std::size_t slot) {
  const auto put = [&](Turn& turn, LongComplex value) {
    turn.cosine[slot] = static_cast<double>(value.re);
    turn.sine[slot] = static_cast<double>(value.im);
  };
  const LongComplex step = rotation(theta);
  LongComplex turn = step, last;
  for (Turn& offset : tables.offsets) {
    put(offset, turn);
    last = turn;
    turn = turn * step;
  }
  constexpr auto middle = static_cast<real>(half);
  turn = last;
  const LongComplex stride = rotation((2 * middle + 1) * theta);
  for (Turn& centre : tables.middles) {
    put(centre, turn);
    turn = turn * stride;
  }
}

struct Sums {
  double re[angles_at_once], im[angles_at_once];
  double largest[angles_at_once]; ///< of |partial sum|^2
};

SCATTER_VECTOR_CLONES
void sum_blocks(
    const AzimuthSeries::Block* blocks, std::size_t count, bool sine, const Tables& tables, Sums& sums) {
  const Turn* const middles = tables.middles.data();
  Lanes re[rows], im[rows], largest[rows];
  for (std::size_t r = 0; r < rows; ++r) re[r] = im[r] = largest[r] = Lanes{};
  for (std::size_t b = 0; b < count; ++b) {
    const AzimuthSeries::Block& block = blocks[b];
    Lanes even_re[rows], even_im[rows], odd_re[rows], odd_im[rows];
    for (std::size_t r = 0; r < rows; ++r) {
      even_re[r] = Lanes{} + block.middle_re;
      even_im[r] = Lanes{} + block.middle_im;
      odd_re[r] = odd_im[r] = Lanes{};
    }
    for (std::size_t j = 0; j < half; ++j)
      for (std::size_t r = 0; r < rows; ++r) {
        const Lanes cosine = *reinterpret_cast<const StoredLanes*>(tables.offsets[j].cosine + r * lanes);
        const Lanes sine_j = *reinterpret_cast<const StoredLanes*>(tables.offsets[j].sine + r * lanes);
        even_re[r] += block.sum_re[j] * cosine;
        even_im[r] += block.sum_im[j] * cosine;
        odd_re[r] += block.less_re[j] * sine_j;
        odd_im[r] += block.less_im[j] * sine_j;
      }
    for (std::size_t r = 0; r < rows; ++r) {
      // cos: even cos N - odd sin N; sin: even sin N + odd cos N.
      const Lanes cosine = *reinterpret_cast<const StoredLanes*>(middles[b].cosine + r * lanes),
                  sine_N = *reinterpret_cast<const StoredLanes*>(middles[b].sine + r * lanes);
      const Lanes even_factor = sine ? sine_N : cosine, odd_factor = sine ? cosine : -sine_N;
      re[r] += even_re[r] * even_factor + odd_re[r] * odd_factor;
      im[r] += even_im[r] * even_factor + odd_im[r] * odd_factor;
      const Lanes partial = re[r] * re[r] + im[r] * im[r];
      largest[r] = partial > largest[r] ? partial : largest[r];
    }
  }
  std::memcpy(sums.re, re, sizeof re);
  std::memcpy(sums.im, im, sizeof im);
  std::memcpy(sums.largest, largest, sizeof largest);
}

} // namespace

AzimuthSeries::AzimuthSeries(Kind kind, std::span<const LongComplex> coefficients) : kind_(kind) {
  const auto at = [&](std::size_t n) {
    if (n >= coefficients.size() || (n == 0 && kind == Kind::sine)) return LongComplex{};
    return coefficients[n];
  };
  real total = 0;
  for (std::size_t n = 0; n < coefficients.size(); ++n) total += norm(at(n));
  size_ = static_cast<double>(std::sqrt(total));
  if (total == 0) return; // nothing to sum
  for (std::size_t middle = half; middle < coefficients.size() + half; middle += 2 * half + 1) {
    Block& block = blocks_.emplace_back();
    block.middle_re = static_cast<double>(at(middle).re);
    block.middle_im = static_cast<double>(at(middle).im);
    for (std::size_t j = 1; j <= half; ++j) {
      const LongComplex sum = at(middle + j) + at(middle - j), less = at(middle + j) - at(middle - j);
      block.sum_re[j - 1] = static_cast<double>(sum.re);
      block.sum_im[j - 1] = static_cast<double>(sum.im);
      block.less_re[j - 1] = static_cast<double>(less.re);
      block.less_im[j - 1] = static_cast<double>(less.im);
    }
  }
}

std::vector<AzimuthSum>
sum_over_azimuth(std::span<const AzimuthSeries> series, std::span<const real> theta, int threads) {
  std::vector<AzimuthSum> result(series.size());
  std::size_t most_blocks = 0;
  for (std::size_t s = 0; s < series.size(); ++s) {
    result[s].value.resize(theta.size());
    result[s].rounding.resize(theta.size());
    most_blocks = std::max(most_blocks, series[s].blocks().size());
  }
  std::size_t terms = 0;
  for (const auto& one : series) terms += one.blocks().size() * (2 * half + 1);
  const std::size_t groups = (theta.size() + angles_at_once - 1) / angles_at_once;
  const auto work = [&](std::size_t group) {
    const std::size_t first = group * angles_at_once;
    // A group that is not full repeats an angle: every lane does the same arithmetic.
    const std::size_t used = std::min(angles_at_once, theta.size() - first);
    Tables tables;
    tables.middles.resize(most_blocks);
    for (std::size_t slot = 0; slot < angles_at_once; ++slot)
      fill(tables, theta[first + std::min(slot, used - 1)], slot);
    for (std::size_t s = 0; s < series.size(); ++s) {
      const auto& blocks = series[s].blocks();
      Sums sums;
      sum_blocks(blocks.data(), blocks.size(), series[s].kind() == AzimuthSeries::Kind::sine, tables, sums);
      for (std::size_t slot = 0; slot < used; ++slot) {
        result[s].value[first + slot] = {sums.re[slot], sums.im[slot]};
        // Roundings of coefficients and factors add at random; those of the running total follow its size.
        result[s].rounding[first + slot] =
            epsilon *
            (8 * series[s].size() + 4 * std::sqrt(static_cast<double>(blocks.size()) * sums.largest[slot]));
      }
    }
  };
  // In steps of one vector; a group's rotations take as long as thousands.
  in_parallel(groups, static_cast<double>(groups * (rows * terms + 4000)), threads, work);
  return result;
}

} // namespace scatter::exact
