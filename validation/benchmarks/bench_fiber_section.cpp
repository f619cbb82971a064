// How long fibres take: R, TT and TRT of many directions at once, one direction in the careful way, energies,
// and waves. items_per_second counts directions.

#include <scatter/fiber/ray_section.hpp>
#include <scatter/fiber/ray_section_kernel.hpp>
#include <scatter/fiber/wave_section.hpp>

#include <benchmark/benchmark.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace {

using namespace scatter::fiber;
constexpr double pi = std::numbers::pi;

/// Light and view anywhere: uniform in azimuth and in inclination.
struct Directions {
  std::vector<double> theta_d, phi, cosine, S, C;
  explicit Directions(std::size_t count) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> unit(0, 1);
    for (std::size_t i = 0; i < count; ++i) {
      theta_d.push_back(0.5 * pi * (unit(random) - unit(random)));
      phi.push_back(pi * unit(random));
      cosine.push_back(std::cos(theta_d[i]));
      S.push_back(std::sin(phi[i] / 2));
      C.push_back(std::cos(phi[i] / 2));
    }
  }
};

void lobes_of_many_directions(benchmark::State& state) {
  const Directions directions(4096);
  const std::vector<double> three{0.2, 0.3, 0.5};
  const std::span<const double> sigma_a(three.data(), static_cast<std::size_t>(state.range(0)));
  std::vector<double> N(3 * sigma_a.size() * directions.phi.size());
  for (auto _ : state) {
    ray_lobes(1.55, sigma_a, {directions.cosine, directions.S, directions.C}, N);
    benchmark::DoNotOptimize(N.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(directions.phi.size()));
}
BENCHMARK(lobes_of_many_directions)->ArgName("colours")->Arg(1)->Arg(3);

void residual_of_many_directions(benchmark::State& state) {
  const Directions directions(4096);
  const ResidualEnergy residual(1.55, 0.2, 3);
  std::vector<double> energy(directions.phi.size());
  for (auto _ : state) {
    residual.evaluate(directions.cosine, energy);
    benchmark::DoNotOptimize(energy.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(directions.phi.size()));
}
BENCHMARK(residual_of_many_directions);

void order_of_one_direction(benchmark::State& state) {
  const Directions directions(1024);
  const RaySection section(1.55, 0.2);
  const int order = static_cast<int>(state.range(0));
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(section.distribution(order, directions.theta_d[i], directions.phi[i]));
    i = (i + 1) % directions.phi.size();
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(order_of_one_direction)->ArgName("order")->Arg(0)->Arg(1)->Arg(2)->Arg(8);

void moments_of_an_order(benchmark::State& state) {
  const RaySection section(1.55, 0.2);
  for (auto _ : state)
    benchmark::DoNotOptimize(section.moments(static_cast<int>(state.range(0)), 0.3).energy);
}
BENCHMARK(moments_of_an_order)->ArgName("order")->Arg(0)->Arg(2)->Unit(benchmark::kMicrosecond);

void moments_of_the_residual(benchmark::State& state) {
  const RaySection section(1.55, 0.2);
  for (auto _ : state) benchmark::DoNotOptimize(section.residual(3, 0.3).energy);
}
BENCHMARK(moments_of_the_residual)->Unit(benchmark::kMicrosecond);

void waves_of_three_orders(benchmark::State& state) {
  const std::vector<int> orders{0, 1, 2};
  const double x = 2 * pi * static_cast<double>(state.range(0)) / 0.55;
  for (auto _ : state) benchmark::DoNotOptimize(wave_profiles(1.55, 0, x, 0.3, orders).error_estimate);
}
BENCHMARK(waves_of_three_orders)
    ->ArgName("radius_um")
    ->Arg(5)
    ->Arg(40)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

} // namespace
