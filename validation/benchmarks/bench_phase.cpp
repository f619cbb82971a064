// How fast the patches method is, and how its time grows with rays, orders, directions and wavelengths.
//
// Every figure of one run stands against the machine's own peak, measured first: fused multiply-adds in
// double precision on all compute units. Floating-point operations of a ray are counted, one per addition,
// multiplication, division or root: about 550 per order, from the instructions of the compiled kernel with
// three of Newton's steps.

#include <scatter/compute/opencl.hpp>
#include <scatter/drop/shape.hpp>
#include <scatter/phase/job.hpp>

#include <benchmark/benchmark.h>

#include <cstdio>
#include <numeric>

namespace {

using namespace scatter;

constexpr double flop_per_ray_and_order = 550;

/// Peak of fused multiply-adds on all compute units [flop/s].
double measure_peak() {
  constexpr int chains = 10, lanes = 16, steps = 4'000'000;
  const char* source = R"(
    #pragma OPENCL FP_CONTRACT ON
    kernel void peak(global double* out, int steps, double a, double b) {
      double16 x0 = a, x1 = a + 1, x2 = a + 2, x3 = a + 3, x4 = a + 4, x5 = a + 5, x6 = a + 6, x7 = a + 7, x8 = a + 8,
               x9 = a + 9;
      for (int i = 0; i < steps; ++i) {
        x0 = x0 * a + b; x1 = x1 * a + b; x2 = x2 * a + b; x3 = x3 * a + b; x4 = x4 * a + b;
        x5 = x5 * a + b; x6 = x6 * a + b; x7 = x7 * a + b; x8 = x8 * a + b; x9 = x9 * a + b;
      }
      const double16 x = x0 + x1 + x2 + x3 + x4 + x5 + x6 + x7 + x8 + x9;
      out[get_global_id(0)] = x.s0 + x.s1 + x.s2 + x.s3 + x.s4 + x.s5 + x.s6 + x.s7 + x.s8 + x.s9 + x.sa + x.sb +
                              x.sc + x.sd + x.se + x.sf;
    })";
  const compute::Device device;
  compute::OpenCL& opencl = device.opencl();
  const std::string_view sources[] = {source};
  const unsigned units = device.info().compute_units;
  const cl::Buffer out = opencl.allocate<double>(units);
  cl::Kernel kernel(opencl.program(sources, "-cl-std=CL1.2"), "peak");
  compute::with_arguments(kernel, out, steps, 0.999999, 1e-6);
  double best = 0;
  for (int run = 0; run < 4; ++run) {
    const auto start = std::chrono::steady_clock::now();
    opencl.queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(units), cl::NDRange(1));
    opencl.queue.finish();
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    best = std::max(best, 2.0 * chains * lanes * steps * units / seconds);
  }
  return best;
}

double peak = 0;

std::vector<double> range(double first, double last, double step) {
  std::vector<double> values;
  for (int i = 0; first + i * step <= last * (1 + 1e-12); ++i) values.push_back(first + i * step);
  return values;
}

/// The dissertation's drop under the dissertation's sun; quarter of its resolution unless a benchmark says
/// otherwise.
phase::Request base_request() {
  phase::Request request;
  request.shape = drop::beard_chuang(0.5e-3);
  request.sun_elevation_deg = 20;
  request.wavelength_m = {550e-9};
  request.theta_deg = range(0, 180, 0.05);
  request.phi_deg = range(0, 360, 0.8);
  request.rays = 1000;
  request.method = phase::Method::patches;
  return request;
}

void run(benchmark::State& state, const phase::Request& request) {
  const phase::Plan plan = phase::plan(request);
  table::NullSink sink;
  phase::run(plan, sink); // compiles kernels and touches memory
  for (auto _ : state) phase::run(plan, sink);
  const double wavelengths = static_cast<double>(request.wavelength_m.size());
  const double rays = static_cast<double>(request.rays) * request.rays * wavelengths;
  const double directions = static_cast<double>(request.theta_deg.size()) *
                            static_cast<double>(request.phi_deg.size()) * wavelengths;
  state.counters["rays/s"] = benchmark::Counter(rays, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["directions/s"] =
      benchmark::Counter(directions, benchmark::Counter::kIsIterationInvariantRate);
}

/// Rays alone: every ray is traced through all orders, one direction is looked up.
void tracing(benchmark::State& state) {
  phase::Request request = base_request();
  request.rays = static_cast<int>(state.range(0));
  request.theta_deg = {179.9};
  request.phi_deg = {90};
  request.diffraction = phase::Diffraction::none;
  request.search = phase::Search::raster;
  run(state, request);
  // Mirror symmetry traces half of the grid, and the drop fills pi/4 of that.
  const double traced =
      0.5 * 0.785 * request.rays * request.rays * static_cast<double>(request.orders.size());
  state.counters["flop/s"] =
      benchmark::Counter(traced * flop_per_ray_and_order, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["share_of_peak"] = benchmark::Counter(
      traced * flop_per_ray_and_order / peak, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(tracing)->Arg(1000)->Arg(3000)->Unit(benchmark::kMillisecond)->UseRealTime();

/// Focal lines counted ray by ray against the rule, by turns in one run: rays alone, and a whole table.
void focal_lines(benchmark::State& state, phase::FocalLines counted, bool table) {
  phase::Request request = base_request();
  request.focal_lines = counted;
  if (!table) {
    request.theta_deg = {179.9};
    request.phi_deg = {90};
    request.diffraction = phase::Diffraction::none;
    request.search = phase::Search::raster;
  }
  run(state, request);
}
BENCHMARK_CAPTURE(focal_lines, rays_rule, phase::FocalLines::rule, false)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(focal_lines, rays_exact, phase::FocalLines::exact, false)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(focal_lines, table_rule, phase::FocalLines::rule, true)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();
BENCHMARK_CAPTURE(focal_lines, table_exact, phase::FocalLines::exact, true)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void rays(benchmark::State& state) {
  phase::Request request = base_request();
  request.rays = static_cast<int>(state.range(0));
  run(state, request);
}
BENCHMARK(rays)
    ->Arg(250)
    ->Arg(500)
    ->Arg(1000)
    ->Arg(2000)
    ->Arg(4000)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void orders(benchmark::State& state) {
  phase::Request request = base_request();
  request.orders.resize(state.range(0));
  std::iota(request.orders.begin(), request.orders.end(), 0);
  run(state, request);
}
BENCHMARK(orders)->Arg(1)->Arg(2)->Arg(4)->Arg(8)->Arg(16)->Unit(benchmark::kMillisecond)->UseRealTime();

/// The argument divides the spacing of both angles: directions grow with its square.
void directions(benchmark::State& state) {
  phase::Request request = base_request();
  const double finer = static_cast<double>(state.range(0));
  request.theta_deg = range(0, 180, 0.1 / finer);
  request.phi_deg = range(0, 360, 1.6 / finer);
  run(state, request);
}
BENCHMARK(directions)->Arg(1)->Arg(2)->Arg(4)->Arg(8)->Unit(benchmark::kMillisecond)->UseRealTime();

void wavelengths(benchmark::State& state) {
  phase::Request request = base_request();
  request.wavelength_m.clear();
  for (int i = 0; i < state.range(0); ++i) request.wavelength_m.push_back((400 + 10 * i) * 1e-9);
  run(state, request);
}
BENCHMARK(wavelengths)->Arg(1)->Arg(2)->Arg(4)->Arg(8)->Arg(16)->Unit(benchmark::kMillisecond)->UseRealTime();

/// The dissertation's whole job: 33 wavelengths, 3000 x 3000 rays, orders 0..3, 14401 x 1801 directions. 350
/// minutes in print.
void dissertation(benchmark::State& state) {
  phase::Request request = base_request();
  request.wavelength_m.clear();
  for (int i = 0; i < 33; ++i) request.wavelength_m.push_back((380 + 10 * i) * 1e-9);
  request.theta_deg = range(0, 180, 0.0125);
  request.phi_deg = range(0, 360, 0.2);
  request.rays = 3000;
  const phase::Plan plan = phase::plan(request);
  table::NullSink sink;
  for (auto _ : state) phase::run(plan, sink);
  state.counters["rays/s"] = benchmark::Counter(33.0 * 9e6, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["directions/s"] =
      benchmark::Counter(33.0 * 14401 * 1801, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(dissertation)->Iterations(1)->Unit(benchmark::kSecond)->UseRealTime();

} // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  peak = measure_peak();
  std::printf(
      "Measured peak: %.0f GFLOP/s in double precision on %u compute units\n", peak / 1e9,
      compute::Device().info().compute_units);
  benchmark::RunSpecifiedBenchmarks();
}
