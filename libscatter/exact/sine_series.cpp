// Method. P_n = sum_p g_p g_{n-p} cos (n - 2p) theta has g_p = (1/2)_p / p! all positive; times sin theta,
// the differences of neighbours are again products of two tables,
//   sin theta P_n = sum_p l u_p v_{p+l} sin l theta,   l = n + 1 - 2p,
//   v_q = g_{q-1} / q,   u_0 = 1,   u_p = -v_p / 2.
// Even and odd l stand apart. With l = 1 + parity + 2i, b_l / l = sum_p u_p v_{p+l} s_{n/2 = i + p}: for
// eight i at once five multiplications per p, as the four series share u v.
//
// Loads, too, go at two per cycle, but only those that cross no line of the cache. Hence p = shift + 8k: for
// each shift, the numbers s_{i+shift} are copied to where eight from i + 8k on are a line; v, of which every
// other p is in the other half, takes a copy for even k and one for odd k. Some vectors of i go side by side,
// which hides the latency of the additions, and share what they load.

#include <scatter/exact/partial_waves.hpp>
#include <scatter/exact/sine_series.hpp>
#include <scatter/exact/vector_clones.hpp>

#include <algorithm>
#include <cstring>
#include <memory>
#include <mutex>

namespace scatter::exact {
namespace {

constexpr std::size_t lanes = 8;     ///< of a line of the cache
constexpr std::size_t most_rows = 3; ///< lines of i at once
template <std::size_t width>
struct VectorOf {
  typedef double type __attribute__((vector_size(8 * width), may_alias));
};
/// Numbers, zeros or not, that loops may read beyond the last one.
constexpr std::size_t spare = lanes * (most_rows + 3);

/// Doubles from the beginning of a line of the cache on, of any value at first.
class Lines {
public:
  explicit Lines(std::size_t size) : lines_(std::make_unique_for_overwrite<Line[]>(size / lanes + 1)) {}
  [[nodiscard]] double* data() { return lines_[0].values; }
  [[nodiscard]] const double* data() const { return lines_[0].values; }

private:
  struct alignas(64) Line {
    double values[lanes];
  };
  std::unique_ptr<Line[]> lines_;
};

/// u_p and v_q; v split by the parity of q. first[n] = (n + 1) v_{n+1} is what p = 0 comes to.
struct Tables {
  explicit Tables(std::size_t orders_) : orders(orders_) {
    const std::size_t size = orders + 2 * spare;
    for (auto& half : v) half.resize(size / 2 + 1);
    u.resize(orders / 2 + spare);
    first.resize(orders);
    u[0] = 1;
    long double g = 1; // g_{q-1}
    for (std::size_t q = 1; q < size; ++q) {
      const auto index = static_cast<long double>(q);
      const auto value = static_cast<double>(g / index);
      v[q % 2][q / 2] = value;
      if (q < u.size()) u[q] = -value / 2;
      if (q <= orders) first[q - 1] = static_cast<double>(g);
      g *= (index - 0.5L) / index;
    }
  }
  std::size_t orders;
  std::vector<double> u, first;
  std::array<std::vector<double>, 2> v;
};

/// Tables for `orders` or more, kept for the next call while they are small.
std::shared_ptr<const Tables> tables_for(std::size_t orders) {
  constexpr std::size_t most_kept = 16384;
  if (orders > most_kept) return std::make_shared<const Tables>(orders);
  static std::mutex mutex;
  static std::shared_ptr<const Tables> kept;
  const std::lock_guard lock(mutex);
  if (!kept || kept->orders < orders)
    kept = std::make_shared<const Tables>(std::min(most_kept, orders + orders / 4 + 64));
  return kept;
}

/// What is to be added up for one shift, as lines from i = 0 on.
struct Shifted {
  std::array<const double*, series_count> s; ///< from i + shift on
  const double* v_even = nullptr;            ///< v_{p+l} for k = 0
  const double* v_odd = nullptr;             ///< for k = 1; two k further on lie 8 numbers
  const double* u = nullptr;                 ///< u_p for k = 0
  std::size_t count = 0;                     ///< of the s that are not 0
};

/// out[series][i] += what one shift comes to, `rows` vectors of i side by side.
template <std::size_t width, std::size_t rows>
[[gnu::always_inline]] inline void add_shifted(const Shifted& in, double* const* out) {
  using Lanes = typename VectorOf<width>::type;
  // So many pairs of k at once that their s, and those of the next i, stay in the nearest cache. The small
  // terms of large p go first: so they gather no rounding.
  constexpr std::size_t longest = 32;
  const auto pairs_at = [&](std::size_t i) { return (in.count - i + 2 * lanes - 1) / (2 * lanes); };
  const std::size_t all_pairs = pairs_at(0);
  for (std::size_t chunk = (all_pairs + longest - 1) / longest; chunk-- > 0;)
    for (std::size_t i = 0; i < in.count; i += rows * width) {
      const std::size_t first = chunk * longest, last = std::min(first + longest, pairs_at(i));
      if (last <= first) break;
      Lanes sums[rows][series_count];
#pragma GCC unroll 4
      for (std::size_t r = 0; r < rows; ++r)
#pragma GCC unroll 4
        for (std::size_t c = 0; c < series_count; ++c) sums[r][c] = Lanes{};
      for (std::size_t pair = last; pair-- > first;)
#pragma GCC unroll 2
        for (std::size_t even = 0; even < 2; ++even) {
          const std::size_t k = 1 - even;
          const double u = in.u[(2 * pair + k) * lanes];
          const double* const v = (even ? in.v_even : in.v_odd) + i + pair * lanes;
#pragma GCC unroll 4
          for (std::size_t r = 0; r < rows; ++r) {
            const Lanes product = u * *reinterpret_cast<const Lanes*>(v + r * width);
#pragma GCC unroll 4
            for (std::size_t c = 0; c < series_count; ++c)
              sums[r][c] +=
                  product * *reinterpret_cast<const Lanes*>(in.s[c] + i + (2 * pair + k) * lanes + r * width);
          }
        }
#pragma GCC unroll 4
      for (std::size_t r = 0; r < rows; ++r)
#pragma GCC unroll 4
        for (std::size_t c = 0; c < series_count; ++c)
          *reinterpret_cast<Lanes*>(out[c] + i + r * width) += sums[r][c];
    }
}

// One instance per set of vector instructions: 32 registers hold the sums of three rows, 16 those of two.
using AddShifted = void (*)(const Shifted&, double* const*);
#if defined(__x86_64__) && defined(__GNUC__)
__attribute__((target("avx512f,fma"))) void add_shifted_avx512(const Shifted& in, double* const* out) {
  add_shifted<8, 3>(in, out);
}
__attribute__((target("avx2,fma"))) void add_shifted_avx2(const Shifted& in, double* const* out) {
  add_shifted<4, 2>(in, out);
}
#endif
void add_shifted_plain(const Shifted& in, double* const* out) {
  add_shifted<2, 2>(in, out);
}
AddShifted add_shifted_here() {
#if defined(__x86_64__) && defined(__GNUC__)
  return widest_of(add_shifted_plain, add_shifted_avx2, add_shifted_avx512);
#else
  return add_shifted_plain;
#endif
}

/// Legendre coefficients of one parity of n: s[series][n / 2].
struct Half {
  std::array<std::vector<double>, series_count> s;
  std::size_t count = 0;
};

/// The sums over p for one parity of l, in as many parts as threads may share: part number j takes every
/// second shift.
constexpr std::size_t parts = 2;
struct Part {
  std::size_t stride;
  Lines sums; ///< [series][i], series `stride` apart
};

Part add_part(const Half& half, std::size_t parity, std::size_t part, const Tables& tables) {
  const AddShifted add = add_shifted_here();
  const std::size_t stride = (half.count + spare) / lanes * lanes;
  Part result{stride, Lines(series_count * stride)};
  std::fill_n(result.sums.data(), series_count * stride, 0.0);
  double* out[series_count];
  for (std::size_t c = 0; c < series_count; ++c) out[c] = result.sums.data() + c * stride;
  Lines s(series_count * stride), v(2 * stride);
  for (std::size_t shift = part; shift < std::min(lanes, half.count); shift += parts) {
    Shifted in;
    in.count = half.count - shift;
    for (std::size_t c = 0; c < series_count; ++c) {
      double* const copy = s.data() + c * stride;
      std::copy_n(half.s[c].data() + shift, in.count, copy);
      std::fill_n(copy + in.count, stride - in.count, 0.0);
      in.s[c] = copy;
    }
    // q = p + l = shift + 8k + 1 + parity + 2i.
    const std::size_t q = shift + 1 + parity;
    const double* const from = tables.v[q % 2].data() + q / 2;
    const std::size_t needed = half.count + (most_rows + 1) * lanes;
    std::copy_n(from, needed, v.data());
    std::copy_n(from + lanes / 2, needed, v.data() + stride);
    in.v_even = v.data();
    in.v_odd = v.data() + stride;
    in.u = tables.u.data() + shift;
    add(in, out);
  }
  return result;
}

/// b_l for l = 1 + 2i and, if l <= orders, 2 + 2i, from the parts' sums over p for either.
SCATTER_VECTOR_CLONES
void add_up(const double* const* odd, const double* const* even, std::size_t orders, double* b) {
  static_assert(parts == 2);
  const double *const odd_first = odd[0], *const odd_second = odd[1];
  const double *const even_first = even[0], *const even_second = even[1];
  const std::size_t pairs = orders / 2;
#pragma GCC ivdep
  for (std::size_t i = 0; i < pairs; ++i) {
    const auto l = static_cast<double>(static_cast<long>(2 * i + 1));
    b[2 * i + 1] = l * (odd_first[i] + odd_second[i]);
    b[2 * i + 2] = (l + 1) * (even_first[i] + even_second[i]);
  }
  if (orders % 2) b[orders] = static_cast<double>(orders) * (odd_first[pairs] + odd_second[pairs]);
}

SCATTER_VECTOR_CLONES
double sum_of_squared_products(const double* a, const double* b, std::size_t count) {
  double sums[lanes] = {};
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes)
    for (std::size_t k = 0; k < lanes; ++k) {
      const double product = a[i + k] * b[i + k];
      sums[k] += product * product;
    }
  for (; i < count; ++i) sums[0] += a[i] * b[i] * a[i] * b[i];
  return ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
}

} // namespace

std::vector<SineSeries>
sine_series(std::span<const LegendreSeries> sets, std::size_t orders, double cost, int threads) {
  const auto tables = tables_for(orders);
  std::vector<std::array<Half, 2>> halves(sets.size());
  std::vector<std::vector<Part>> sums(sets.size());
  for (std::size_t set = 0; set < sets.size(); ++set)
    for (std::size_t parity = 0; parity < 2; ++parity) {
      Half& half = halves[set][parity];
      half.count = (orders + 1 - parity) / 2;
      for (std::size_t c = 0; c < series_count; ++c) {
        half.s[c].resize(half.count);
        for (std::size_t i = 0; i < half.count; ++i) half.s[c][i] = sets[set].s[c][2 * i + parity];
      }
      for (std::size_t part = 0; part < parts; ++part) sums[set].push_back({0, Lines(0)});
    }
  in_parallel(2 * parts * sets.size(), cost, threads, [&](std::size_t item) {
    const std::size_t set = item / (2 * parts), place = item % (2 * parts), parity = place / parts;
    sums[set][place] = add_part(halves[set][parity], parity, place % parts, *tables);
  });
  std::vector<SineSeries> result(sets.size());
  for (std::size_t set = 0; set < sets.size(); ++set)
    for (std::size_t c = 0; c < series_count; ++c) {
      auto& b = result[set].b[c];
      b.resize(orders + 1);
      const double* from[2][parts];
      for (std::size_t parity = 0; parity < 2; ++parity)
        for (std::size_t part = 0; part < parts; ++part) {
          const Part& sum = sums[set][parts * parity + part];
          from[parity][part] = sum.sums.data() + c * sum.stride;
        }
      add_up(from[0], from[1], orders, b.data());
      result[set].leading_square[c] =
          sum_of_squared_products(sets[set].s[c].data(), tables->first.data(), orders);
    }
  return result;
}

} // namespace scatter::exact
