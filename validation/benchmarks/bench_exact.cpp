// How long the exact theories take: a sphere's coefficients alone, the infinite cylinder, and the Debye
// series. The sphere's sum over angles and whole calls are bench_mie's.

#include <scatter/exact/cylinder.hpp>
#include <scatter/exact/debye.hpp>
#include <scatter/exact/mie.hpp>

#include <benchmark/benchmark.h>

#include <chrono>
#include <complex>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

namespace {

using namespace scatter;

/// first..last deg in `count` - 1 steps.
std::vector<double> grid(double first, double last, int count) {
  std::vector<double> theta;
  for (int i = 0; i < count; ++i) theta.push_back(first + (last - first) * i / (count - 1));
  return theta;
}

std::vector<int> orders_below(int count) {
  std::vector<int> orders(count);
  std::iota(orders.begin(), orders.end(), 0);
  return orders;
}

/// Runs `work` as often as the benchmark wants and reports its fastest run, which a busy machine disturbs
/// least.
template <class Work>
void time_best(benchmark::State& state, Work work) {
  double best = std::numeric_limits<double>::infinity();
  for (auto _ : state) {
    const auto start = std::chrono::steady_clock::now();
    work();
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  state.counters["best_ms"] = 1e3 * best;
}

template <class Work>
void add(const std::string& name, Work work) {
  benchmark::RegisterBenchmark(name.c_str(), [work](benchmark::State& state) { time_best(state, work); })
      ->Unit(benchmark::kMillisecond)
      ->UseRealTime();
}

std::string at_x(double x) {
  return "/x:" + std::to_string(static_cast<int>(x));
}

} // namespace

int main(int argc, char** argv) {
  const std::pair<const char*, std::complex<double>> spheres[] = {
      {"real", 1.333}, {"hardly_absorbing", {1.333, 1e-8}}, {"metal", {0.2, 3}}};
  for (const auto& [name, m] : spheres)
    for (const double x : {10.0, 100.0, 1000.0, 10000.0, 50000.0})
      // No angles: what remains are the coefficients and the efficiencies.
      add(std::string("coefficients/") + name + at_x(x),
          [x, m = m] { benchmark::DoNotOptimize(exact::mie(x, m, {})); });
  for (const int threads : {1, 0}) {
    const std::string cores = threads == 1 ? "/one_core" : "/all_cores";
    for (const auto& [x, count] : {std::pair{1000.0, 1801}, {50000.0, 1801}})
      add("debye/p:0..3" + at_x(x) + "/angles:" + std::to_string(count) + cores,
          [x = x, threads, theta = grid(0, 180, count), orders = orders_below(4)] {
            benchmark::DoNotOptimize(exact::debye_at_degrees(x, 1.333, orders, theta, threads));
          });
  }
  for (const double tilt : {0.0, 30.0})
    for (const auto& [x, count] : {std::pair{1000.0, 3601}, {50000.0, 3601}})
      add("cylinder/tilt:" + std::to_string(static_cast<int>(tilt)) + at_x(x) +
              "/angles:" + std::to_string(count),
          [x = x, tilt, theta = grid(-180, 180, count)] {
            benchmark::DoNotOptimize(exact::cylinder_at_degrees(x, 1.333, tilt, theta));
          });
  add("cylinder/p:0..3/tilt:30/x:1000/angles:3601",
      [theta = grid(-180, 180, 3601), orders = orders_below(4)] {
        benchmark::DoNotOptimize(exact::cylinder_at_degrees(1000, 1.333, 30, theta, orders));
      });
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
}
