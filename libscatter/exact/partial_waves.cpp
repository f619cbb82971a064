// The sum over partial waves is done per angle in double, eight angles to a vector, with recurrences for the
// differences of pi_n in t = 1 - cos(theta), which keep their digits near the forward direction; angles
// beyond 90 deg are mirrored.

#include <scatter/exact/partial_waves.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>
#include <system_error>
#include <thread>

// Clones of the inner loop for wider vectors, picked at start-up. Not under sanitizers, whose start-up comes
// later.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) &&     \
    !defined(__SANITIZE_THREAD__)
#define SCATTER_VECTOR_CLONES __attribute__((target_clones("avx512f", "fma", "default")))
#define SCATTER_HAS_FMA __builtin_cpu_supports("fma")
#else
#define SCATTER_VECTOR_CLONES
#ifdef FP_FAST_FMA
#define SCATTER_HAS_FMA true
#else
#define SCATTER_HAS_FMA false
#endif
#endif

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;

Angle fold(long double theta, bool backward, double given, AngleUnit unit) {
  const long double half = std::sin(std::max<long double>(theta, 0) / 2);
  const long double t = 2 * half * half;
  Angle angle{static_cast<double>(t), 0, backward, given, unit};
  angle.t_rest = static_cast<double>(t - static_cast<long double>(angle.t));
  return angle;
}

using Lanes = double __attribute__((vector_size(64)));
constexpr std::size_t lanes = sizeof(Lanes) / sizeof(double);
constexpr std::size_t rows = 3; ///< vectors in flight: hides the latency of the recurrence
constexpr std::size_t block = lanes * rows;

/// Inputs and outputs of one block of angles.
struct Block {
  double t[block], t_rest[block];
  double S1_re[block], S1_im[block], S2_re[block], S2_im[block];
  double largest_partial[block]; ///< max over the sum's course of (|S1|^2 + |S2|^2) / 2
};

/// Sums over all partial waves; S2 comes out with the sign of the forward half.
SCATTER_VECTOR_CLONES
void sum_block(const Weights& weights, Block& io) {
  // With s = t pi_n: pi_n - tau_n = e_n + n s, e_{n+1} = e_n + (2n+1) s, pi_{n+1} = pi_n + (2 pi_n - e_{n+1})
  // / n; it follows from n pi_{n+1} = (2n+1) cos(theta) pi_n - (n+1) pi_{n-1}. All of it keeps its digits for
  // small t.
  Lanes pi[rows], e[rows], t[rows], t_rest[rows];
  Lanes plus_re[rows], plus_im[rows], minus_re[rows], minus_im[rows], largest[rows];
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t i = 0; i < lanes; ++i) {
      t[r][i] = io.t[r * lanes + i];
      t_rest[r][i] = io.t_rest[r * lanes + i];
    }
    pi[r] = Lanes{} + 1;
    e[r] = plus_re[r] = plus_im[r] = minus_re[r] = minus_im[r] = largest[r] = Lanes{};
  }
  const std::size_t count = weights.plus_re.size();
  const std::size_t stride = std::max<std::size_t>(1, count / 256);
  for (std::size_t first = 0; first < count; first += stride) {
    const std::size_t last = std::min(first + stride, count);
    for (std::size_t k = first; k < last; ++k) {
      const double n = static_cast<double>(k + 1), inverse_n = 1 / n;
      for (std::size_t r = 0; r < rows; ++r) {
        const Lanes s = t[r] * pi[r] + t_rest[r] * pi[r];
        const Lanes minus = e[r] + n * s;     // pi_n - tau_n
        const Lanes plus = 2 * pi[r] - minus; // pi_n + tau_n
        plus_re[r] += weights.plus_re[k] * plus;
        plus_im[r] += weights.plus_im[k] * plus;
        minus_re[r] += weights.minus_re[k] * minus;
        minus_im[r] += weights.minus_im[k] * minus;
        e[r] += (2 * n + 1) * s;
        pi[r] += inverse_n * (2 * pi[r] - e[r]);
      }
    }
    for (std::size_t r = 0; r < rows; ++r) {
      const Lanes partial = plus_re[r] * plus_re[r] + plus_im[r] * plus_im[r] + minus_re[r] * minus_re[r] +
                            minus_im[r] * minus_im[r];
      largest[r] = partial > largest[r] ? partial : largest[r];
    }
  }
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t i = 0; i < lanes; ++i) {
      io.S1_re[r * lanes + i] = plus_re[r][i] + minus_re[r][i];
      io.S1_im[r * lanes + i] = plus_im[r][i] + minus_im[r][i];
      io.S2_re[r * lanes + i] = plus_re[r][i] - minus_re[r][i];
      io.S2_im[r * lanes + i] = plus_im[r][i] - minus_im[r][i];
      io.largest_partial[r * lanes + i] = largest[r][i];
    }
}

/// Whether the compiler's a * b + c above rounds once.
bool sums_are_fused() {
  return SCATTER_HAS_FMA;
}

} // namespace

void PartialWaves::add(std::complex<double> plus, std::complex<double> minus) {
  const auto append = [](Weights& weights, std::complex<double> first, std::complex<double> second) {
    weights.plus_re.push_back(first.real());
    weights.plus_im.push_back(first.imag());
    weights.minus_re.push_back(second.real());
    weights.minus_im.push_back(second.imag());
  };
  append(forward, plus, minus);
  // pi_n(pi - theta) = (-1)^(n+1) pi_n(theta), tau_n(pi - theta) = (-1)^n tau_n(theta).
  const double sign = count() % 2 ? 1 : -1;
  append(backward, sign * minus, sign * plus);
}

std::vector<Angle> fold_angles(std::span<const double> angles, AngleUnit unit) {
  constexpr long double pi = std::numbers::pi_v<long double>;
  const bool degrees = unit == AngleUnit::degree;
  // The half turn in the unit of the angles, exactly or as near as a double comes.
  const double half_turn = degrees ? 180 : std::numbers::pi;
  std::vector<Angle> folded;
  folded.reserve(angles.size());
  for (const double angle : angles) {
    if (!(angle >= 0 && angle <= half_turn)) {
      const char* const name = degrees ? "deg" : "rad";
      std::ostringstream message;
      message << "scattering angle " << angle << ' ' << name << " is outside 0.." << half_turn << ' ' << name;
      throw InputError(message.str());
    }
    const bool backward = angle > half_turn / 2;
    const auto given = static_cast<long double>(angle);
    const long double theta =
        degrees ? (backward ? 180 - given : given) * (pi / 180) : (backward ? pi - given : given);
    folded.push_back(fold(theta, backward, angle, unit));
  }
  return folded;
}

std::vector<std::vector<std::size_t>> blocks_of_one_half(std::span<const Angle> angles, std::size_t size) {
  std::vector<std::vector<std::size_t>> blocks;
  for (const bool backward : {false, true}) {
    bool open = false;
    for (std::size_t i = 0; i < angles.size(); ++i) {
      if (angles[i].backward != backward) continue;
      if (!open) blocks.emplace_back();
      blocks.back().push_back(i);
      open = blocks.back().size() < size;
    }
  }
  return blocks;
}

std::vector<AngleSums>
sum_partial_waves(std::span<const PartialWaves> sets, std::span<const Angle> angles, int threads) {
  std::vector<AngleSums> sums(sets.size());
  for (auto& sum : sums) {
    sum.S1.resize(angles.size());
    sum.S2.resize(angles.size());
    sum.largest_partial.resize(angles.size());
  }
  if (sets.empty() || angles.empty()) return sums;
  // A block that is not full repeats an angle: every lane does the same arithmetic.
  const auto blocks = blocks_of_one_half(angles, block);
  const auto work = [&](std::size_t i) {
    const auto& members = blocks[i];
    Block io;
    for (std::size_t lane = 0; lane < block; ++lane) {
      const auto& angle = angles[members[std::min(lane, members.size() - 1)]];
      io.t[lane] = angle.t;
      io.t_rest[lane] = angle.t_rest;
    }
    const bool backward = angles[members[0]].backward;
    for (std::size_t set = 0; set < sets.size(); ++set) {
      sum_block(backward ? sets[set].backward : sets[set].forward, io);
      for (std::size_t lane = 0; lane < members.size(); ++lane) {
        const std::complex<double> S2{io.S2_re[lane], io.S2_im[lane]};
        sums[set].S1[members[lane]] = {io.S1_re[lane], io.S1_im[lane]};
        sums[set].S2[members[lane]] = backward ? -S2 : S2;
        sums[set].largest_partial[members[lane]] = io.largest_partial[lane];
      }
    }
  };
  const auto cost = static_cast<double>(sets[0].count() * sets.size() * blocks.size());
  in_parallel(blocks.size(), cost, threads, work);
  return sums;
}

double sum_rounding(std::size_t count) {
  // The roundings of the sum walk at random. Without fused multiply-add t_rest is rounded away, and t's own
  // rounding turns every partial wave the same way. The factors hold with room to spare for everything that
  // was compared with 60 digits.
  const auto terms = static_cast<double>(count);
  return (12 + 8 * std::sqrt(terms) + (sums_are_fused() ? 0 : terms / 2)) * epsilon;
}

void in_parallel(std::size_t items, double cost, int threads, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  const auto share = [&] {
    for (std::size_t i = next++; i < items; i = next++) work(i);
  };
  std::size_t wanted = threads > 0 ? static_cast<std::size_t>(threads) : std::thread::hardware_concurrency();
  wanted = std::min({wanted, items, static_cast<std::size_t>(cost / 1e5) + 1});
  std::vector<std::thread> others;
  try {
    for (std::size_t i = 1; i < wanted; ++i) others.emplace_back(share);
  } catch (const std::system_error&) {
    // No more threads to be had: those that run, and this one, do the work.
  }
  share();
  for (auto& thread : others) thread.join();
}

void check_sphere(double x, std::complex<double> m) {
  std::ostringstream message;
  message.precision(17);
  if (!(x >= 1e-6 && x <= 5e5))
    message << "size parameter " << x << " is outside 1e-6..5e5";
  else if (!std::isfinite(m.real()) || !std::isfinite(m.imag()) || m.real() <= 0 || m.imag() < 0)
    message << "index " << m.real() << (m.imag() < 0 ? "" : "+") << m.imag()
            << "i is not possible: use n + ik with n > 0 and k >= 0 (k > 0 absorbs)";
  else if (m == 1.0)
    message << "index 1 is no sphere: nothing is scattered; use an index relative to the surroundings other "
               "than 1";
  else if (std::abs(m) * x > 1e8)
    message << "index times size parameter is " << std::abs(m) * x << ", more than 1e8";
  else
    return;
  throw InputError(message.str());
}

} // namespace scatter::exact
