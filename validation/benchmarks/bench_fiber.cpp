// How many directions a second fibres are evaluated in: cloth/* threads and fabrics, hair/* hair.

#include "peak.hpp"
#include <scatter/compute/device.hpp>
#include <scatter/fiber/artist_hair.hpp>
#include <scatter/fiber/cloth_program.hpp>
#include <scatter/fiber/fabric.hpp>
#include <scatter/fiber/hair.hpp>
#include <scatter/fiber/hair_program.hpp>
#include <scatter/fiber/weave.hpp>

#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
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

/// Inclinations and azimuths of pairs of directions, even over the sphere.
struct Inclinations {
  std::vector<double> theta_i, theta_o, phi;

  explicit Inclinations(std::size_t count) {
    std::mt19937_64 random(1);
    const auto draw = [&] { return 2 * std::generate_canonical<double, 53>(random) - 1; };
    for (std::size_t k = 0; k < count; ++k) {
      theta_i.push_back(std::asin(draw()));
      theta_o.push_back(std::asin(draw()));
      phi.push_back(3.141592653589793 * draw());
    }
  }
};

/// Three colours, R, TT, TRT and the residual lobe.
void hair_batch(benchmark::State& state) {
  const fiber::HairScattering hair{fiber::HairParameters{}};
  const Inclinations at(4096);
  std::vector<double> values(3 * at.phi.size());
  for (auto _ : state) {
    hair.eval(at.theta_i, at.theta_o, at.phi, values);
    benchmark::DoNotOptimize(values.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(at.phi.size()));
}

void hair_opencl(benchmark::State& state) {
  const fiber::HairProgram program(fiber::HairScattering{fiber::HairParameters{}}, compute::Device());
  const Inclinations at(1 << 20);
  std::vector<double> values(3 * at.phi.size());
  program.eval(at.theta_i, at.theta_o, at.phi, values); // builds the kernel
  for (auto _ : state) program.eval(at.theta_i, at.theta_o, at.phi, values);
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(at.phi.size()));
}

template <typename Hair>
void hair_single(benchmark::State& state, const Hair& hair) {
  const Inclinations at(256);
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(hair.eval(fiber::Angles{at.theta_i[k], at.theta_o[k], at.phi[k]}));
    k = (k + 1) % at.phi.size();
  }
  state.SetItemsProcessed(state.iterations());
}

template <typename Hair>
void hair_sample(benchmark::State& state, const Hair& hair) {
  const Inclinations at(256);
  std::mt19937_64 random(1);
  std::size_t k = 0;
  for (auto _ : state) {
    std::array<double, 3> u;
    for (double& x : u) x = std::generate_canonical<double, 53>(random);
    benchmark::DoNotOptimize(hair.sample(at.theta_i[k], u));
    k = (k + 1) % at.phi.size();
  }
  state.SetItemsProcessed(state.iterations());
}

void hair_dual(benchmark::State& state) {
  const auto hair = std::make_shared<const fiber::HairScattering>(fiber::HairParameters{});
  const fiber::DualScattering dual(hair, hair);
  const Inclinations at(256);
  std::size_t k = 0;
  for (auto _ : state) {
    const fiber::Angles angles{at.theta_i[k], at.theta_o[k], at.phi[k]};
    benchmark::DoNotOptimize(dual.eval(angles, dual.estimated(angles.theta_i, 0.5, 8)));
    k = (k + 1) % at.phi.size();
  }
  state.SetItemsProcessed(state.iterations());
}

void hair_tables(benchmark::State& state) {
  for (auto _ : state) {
    const fiber::HairScattering hair{fiber::HairParameters{}};
    benchmark::DoNotOptimize(fiber::AssemblyTable(hair).error_estimate());
  }
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
  benchmark::RegisterBenchmark("hair/batch", hair_batch);
  benchmark::RegisterBenchmark("hair/one_by_one", [](benchmark::State& state) {
    hair_single(state, fiber::HairScattering{fiber::HairParameters{}});
  });
  benchmark::RegisterBenchmark("hair/sample", [](benchmark::State& state) {
    hair_sample(state, fiber::HairScattering{fiber::HairParameters{}});
  });
  benchmark::RegisterBenchmark("hair/artist/one_by_one", [](benchmark::State& state) {
    hair_single(state, fiber::ArtistHair{fiber::ArtistHairParameters{}});
  });
  benchmark::RegisterBenchmark("hair/artist/sample", [](benchmark::State& state) {
    hair_sample(state, fiber::ArtistHair{fiber::ArtistHairParameters{}});
  });
  benchmark::RegisterBenchmark("hair/opencl", hair_opencl)->UseRealTime();
  benchmark::RegisterBenchmark("hair/dual_scattering", hair_dual);
  benchmark::RegisterBenchmark("hair/tables", hair_tables)->Unit(benchmark::kMillisecond);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  std::fprintf(
      stderr, "Measured peak of one core: %.0f GFLOP/s in double precision (%s)\n", measure_peak() / 1e9,
      exact::vector_units()[0].name);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
