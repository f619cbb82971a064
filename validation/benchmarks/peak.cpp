#include "peak.hpp"

#include <scatter/exact/vector_unit.hpp>

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstddef>

namespace {

#if defined(__x86_64__) && defined(__GNUC__)
#define SCATTER_TARGET(name) __attribute__((target(name), noinline))
#else
#define SCATTER_TARGET(name) __attribute__((noinline))
#endif

/// Twelve chains of multiply-adds: four cycles' latency of two units, with room to spare.
template <class Lanes>
[[gnu::always_inline]] inline double chains(int steps) {
  Lanes x[12];
  for (int i = 0; i < 12; ++i) x[i] = Lanes{} + i;
  const double a = 0.999999, b = 1e-6;
  for (int step = 0; step < steps; ++step)
#pragma GCC unroll 12
    for (int i = 0; i < 12; ++i) x[i] = x[i] * a + b;
  Lanes sum{};
  for (int i = 0; i < 12; ++i) sum += x[i];
  return sum[0];
}

typedef double Eight __attribute__((vector_size(64)));
typedef double Four __attribute__((vector_size(32)));
typedef double Two __attribute__((vector_size(16)));
SCATTER_TARGET("avx512f") double chains_of_eight(int steps) {
  return chains<Eight>(steps);
}
SCATTER_TARGET("avx2,fma") double chains_of_four(int steps) {
  return chains<Four>(steps);
}
double chains_of_two(int steps) {
  return chains<Two>(steps);
}

} // namespace

double measure_peak() {
  constexpr int steps = 20'000;
  const std::size_t width = scatter::exact::vector_units()[0].width;
  double best = 0;
  for (int run = 0; run < 2000; ++run) {
    const auto start = std::chrono::steady_clock::now();
    benchmark::DoNotOptimize(
        width == 8   ? chains_of_eight(steps)
        : width == 4 ? chains_of_four(steps)
                     : chains_of_two(steps));
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    best = std::max(best, 2.0 * 12 * static_cast<double>(width) * steps / seconds);
  }
  return best;
}
