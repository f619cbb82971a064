// How fast Lorenz-Mie is, per angle and term (an angle's S1 and S2, one n), on each set of vector
// instructions that the machine has, and as users call it.
//
// Sums by FFT, for grids that make even parts of the circle, count as if every angle were summed: their ns
// per angle and term are equivalents, and stand beside the same direct sum. as_if_of_peak is the share of the
// peak that a direct sum of mirror images would need for that.
//
// Every figure stands against one core's own peak, measured first with the widest vectors: fused
// multiply-adds in double precision. Floating-point operations are counted as the recurrence of two terms
// needs them: an angle takes 4 multiply-adds and 2 of the recurrence, one that comes with its mirror image
// half of that. The sum itself takes 2 to 3 for the recurrence, so that the count is neither flattery nor a
// bound. Rates are those of the fastest run, as is the peak: what else the machine does disturbs that less.

#include "peak.hpp"
#include <scatter/exact/mie.hpp>
#include <scatter/exact/partial_waves.hpp>

#include <benchmark/benchmark.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

namespace {

using namespace scatter;

double peak = 0; ///< of one core [flop/s]

/// 0..180 deg in `count` - 1 steps.
std::vector<double> grid(int count) {
  std::vector<double> theta;
  for (int i = 0; i < count; ++i) theta.push_back(180.0 * i / (count - 1));
  return theta;
}

/// Smooth coefficients of the right size and number; their values do not change the time.
exact::PartialWaves some_waves(double x) {
  exact::PartialWaves waves;
  const auto count = static_cast<std::size_t>(x + 9 * std::cbrt(x) + 12);
  for (std::size_t k = 1; k <= count; ++k) {
    const double n = static_cast<double>(k), factor = (2 * n + 1) / (n * (n + 1)) / 2;
    waves.add(
        {factor * std::cos(1.1 * n), factor * std::sin(0.7 * n)},
        {factor * std::sin(2 * n), factor * std::cos(0.3 * n)});
  }
  return waves;
}

/// Runs `work` as often as the benchmark wants and reports its fastest run. flop_per_sum = 0: the sums were
/// not made one by one, so that there are no operations to count.
template <class Work>
void time_best(benchmark::State& state, double sums, double flop_per_sum, Work work) {
  double best = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    const auto start = std::chrono::steady_clock::now();
    work();
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  state.counters["best_ms"] = 1e3 * best;
  state.counters["ns/angle/term"] = 1e9 * best / sums;
  if (flop_per_sum == 0) {
    state.counters["as_if_of_peak"] = sums * 6 / best / peak;
    return;
  }
  state.counters["GFLOP/s"] = 1e-9 * sums * flop_per_sum / best;
  state.counters["share_of_peak"] = sums * flop_per_sum / best / peak;
}

/// The sum over partial waves alone, on one core: a grid whose angles come in pairs, or angles without
/// partners.
void angle_sum(benchmark::State& state, const exact::VectorUnit& unit, double x, int count, bool pairs) {
  auto theta = grid(count);
  if (!pairs)
    for (double& angle : theta) angle = std::min(180.0, angle * 1.0000001);
  const auto angles = exact::fold_angles(theta, exact::AngleUnit::degree);
  const auto waves = some_waves(x);
  time_best(state, count * static_cast<double>(waves.count()), pairs ? 6 : 12, [&] {
    benchmark::DoNotOptimize(
        exact::sum_partial_waves({&waves, 1}, angles, 1, unit, exact::SumMethod::direct));
  });
}

/// The same for a grid of the half circle, by FFT or directly, with the widest vectors.
void grid_sum(benchmark::State& state, double x, int count, exact::SumMethod method) {
  const auto angles = exact::fold_angles(grid(count), exact::AngleUnit::degree);
  const auto waves = some_waves(x);
  const double sums = count * static_cast<double>(waves.count());
  time_best(state, sums, method == exact::SumMethod::direct ? 6 : 0, [&] {
    benchmark::DoNotOptimize(
        exact::sum_partial_waves({&waves, 1}, angles, 1, exact::vector_units()[0], method));
  });
}

/// What a user calls: coefficients, angles, sums and error estimate.
void whole(benchmark::State& state, double x, int count, int threads) {
  const auto theta = grid(count);
  time_best(state, count * (x + 9 * std::cbrt(x) + 12), 0, [&] {
    benchmark::DoNotOptimize(exact::mie_at_degrees(x, 1.333, theta, threads));
  });
}

} // namespace

int main(int argc, char** argv) {
  for (const auto& unit : exact::vector_units())
    for (const bool pairs : {true, false})
      for (const auto& [x, count] : {std::pair{1000.0, 1801}, {50000.0, 1801}})
        benchmark::RegisterBenchmark(
            (std::string("angle_sum/") + unit.name + (pairs ? "/pairs" : "/single") +
             "/x:" + std::to_string(static_cast<int>(x)))
                .c_str(),
            [&unit, x = x, count = count, pairs](benchmark::State& state) {
              angle_sum(state, unit, x, count, pairs);
            })
            ->Unit(benchmark::kMillisecond);
  for (const auto& [x, count] :
       {std::pair{1000.0, 14401}, {5000.0, 14401}, {50000.0, 1801}, {50000.0, 14401}})
    for (const bool direct : {true, false})
      benchmark::RegisterBenchmark(
          ("grid_sum/" + std::string(direct ? "direct" : "fft") +
           "/x:" + std::to_string(static_cast<int>(x)) + "/angles:" + std::to_string(count))
              .c_str(),
          [x = x, count = count, direct](benchmark::State& state) {
            grid_sum(state, x, count, direct ? exact::SumMethod::direct : exact::SumMethod::fourier);
          })
          ->Unit(benchmark::kMillisecond);
  const auto add = [](double x, int count, int threads) {
    benchmark::RegisterBenchmark(
        ("mie/x:" + std::to_string(static_cast<int>(x)) + "/angles:" + std::to_string(count) +
         (threads == 1 ? "/one_core" : "/all_cores"))
            .c_str(),
        [=](benchmark::State& state) { whole(state, x, count, threads); })
        ->Unit(benchmark::kMillisecond)
        ->UseRealTime();
  };
  for (const int threads : {1, 0}) {
    add(10, 1801, threads);
    add(1000, 1801, threads);
    add(50000, 14401, threads);
  }
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  peak = measure_peak();
  std::printf(
      "Measured peak of one core: %.0f GFLOP/s in double precision (%s)\n", peak / 1e9,
      exact::vector_units()[0].name);
  benchmark::RunSpecifiedBenchmarks();
}
