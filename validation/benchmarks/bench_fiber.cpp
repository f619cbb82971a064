// How many directions a second fibres are evaluated in: cloth/* threads and fabrics.

#include <scatter/compute/device.hpp>
#include <scatter/fiber/cloth_program.hpp>
#include <scatter/fiber/fabric.hpp>
#include <scatter/fiber/weave.hpp>

#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace scatter;

/// Pairs of directions above the cloth, even over the hemisphere.
struct Pairs {
  std::vector<glm::dvec3> light, view;

  explicit Pairs(std::size_t count) {
    std::mt19937_64 random(1);
    const auto draw = [&] {
      const double z = std::generate_canonical<double, 53>(random);
      const double phi = 6.283185307179586 * std::generate_canonical<double, 53>(random),
                   r = std::sqrt(1 - z * z);
      return glm::normalize(glm::dvec3(r * std::cos(phi), r * std::sin(phi), z));
    };
    for (std::size_t k = 0; k < count; ++k) {
      light.push_back(draw());
      view.push_back(draw());
    }
  }
};

/// One thread along its whole curve: 64 tangents, all of them different.
fiber::Weave one_thread() {
  fiber::Weave weave = fiber::load_fabric("linen-plain").weave;
  weave.threads.resize(1);
  weave.threads[0].coverage = 1;
  return weave;
}

/// items_per_second: evaluations by the processor time of the one thread that makes them.
void cloth_batch(benchmark::State& state, const fiber::Weave& weave) {
  const fiber::Cloth cloth(weave);
  const Pairs pairs(4096);
  std::vector<fiber::Rgb> values(pairs.light.size());
  for (auto _ : state) {
    cloth.eval(pairs.light, pairs.view, values);
    benchmark::DoNotOptimize(values.data());
  }
  std::size_t tangents = 0;
  for (const auto& strand : cloth.strands()) tangents += strand.tangents.size();
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(values.size()));
  state.counters["tangents"] = static_cast<double>(tangents);
}

void cloth_single(benchmark::State& state) {
  const fiber::Cloth cloth(one_thread());
  const Pairs pairs(256);
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(cloth.eval(pairs.light[k], pairs.view[k]));
    k = (k + 1) % pairs.light.size();
  }
  state.SetItemsProcessed(state.iterations());
}

void cloth_sample(benchmark::State& state) {
  const fiber::Cloth cloth(fiber::load_fabric("polyester-satin-front").weave);
  const Pairs pairs(256);
  std::mt19937_64 random(1);
  std::size_t k = 0;
  for (auto _ : state) {
    std::array<double, 4> u;
    for (double& x : u) x = std::generate_canonical<double, 53>(random);
    benchmark::DoNotOptimize(cloth.sample(pairs.view[k], u));
    k = (k + 1) % pairs.light.size();
  }
  state.SetItemsProcessed(state.iterations());
}

void cloth_opencl(benchmark::State& state, const fiber::Weave& weave) {
  const fiber::Cloth cloth(weave);
  const fiber::ClothProgram program(cloth, compute::Device());
  const Pairs pairs(1 << 18);
  std::vector<fiber::Rgb> values(pairs.light.size());
  program.eval(pairs.light, pairs.view, values); // builds the kernel
  for (auto _ : state) program.eval(pairs.light, pairs.view, values);
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(values.size()));
}

} // namespace

int main(int argc, char** argv) {
  benchmark::RegisterBenchmark(
      "cloth/64_tangents", [](benchmark::State& state) { cloth_batch(state, one_thread()); });
  for (const std::string& name : fiber::fabric_names())
    benchmark::RegisterBenchmark(("cloth/" + name).c_str(), [name](benchmark::State& state) {
      cloth_batch(state, fiber::load_fabric(name).weave);
    });
  benchmark::RegisterBenchmark("cloth/one_by_one/64_tangents", cloth_single);
  benchmark::RegisterBenchmark("cloth/sample/polyester-satin-front", cloth_sample);
  benchmark::RegisterBenchmark("cloth/opencl/64_tangents", [](benchmark::State& state) {
    cloth_opencl(state, one_thread());
  })->UseRealTime();
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
