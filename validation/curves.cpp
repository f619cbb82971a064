#include "curves.hpp"

#include <scatter/exact/mie.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/job.hpp>

#include <chrono>

namespace scatter::validation {

namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Keeps of every wavelength what the comparison needs: a full matrix of each would not fit.
class CurveSink final : public table::Sink {
public:
  CurveSink(double geometric_cross_section, bool matrix)
      : geometric_(geometric_cross_section), matrix_(matrix) {}
  void begin(const table::TableHeader&) override {}
  void write(std::size_t, const table::Slab& slab) override {
    const double scale = slab.scattering_cross_section / geometric_;
    Curve curve;
    for (std::size_t t = 0; t < slab.phase_function.size(); ++t) {
      curve.s11.push_back(scale * slab.phase_function[t]);
      curve.s12.push_back(matrix_ ? scale * slab.phase_matrix[16 * t + 1] : 0);
    }
    found.curves.push_back(std::move(curve));
    found.scattering_efficiency.push_back(scale);
  }
  void finish(double) override {}
  Curves found;

private:
  double geometric_;
  bool matrix_;
};

} // namespace

Curves exact_sphere(
    double radius_m, const std::vector<double>& wavelength_m, const IndexSource& index, const ThetaGrid& grid,
    int threads, const Progress& progress) {
  Curves found;
  for (const double wavelength : wavelength_m) {
    const auto start = std::chrono::steady_clock::now();
    const double x = 2 * pi * radius_m / wavelength;
    const exact::MieResult mie =
        exact::mie_at_degrees(x, refractive_index(index, wavelength), grid.theta_deg, threads);
    Curve curve;
    const double scale = 1 / (2 * pi * x * x); // 1 / (2 k^2 pi a^2)
    for (std::size_t t = 0; t < grid.theta_deg.size(); ++t) {
      const double parallel = std::norm(mie.S2[t]), perpendicular = std::norm(mie.S1[t]);
      curve.s11.push_back(scale * (parallel + perpendicular));
      curve.s12.push_back(scale * (parallel - perpendicular));
    }
    found.curves.push_back(std::move(curve));
    found.scattering_efficiency.push_back(mie.Qsca);
    found.seconds.push_back(seconds_since(start));
    if (progress)
      progress(static_cast<double>(found.curves.size()) / static_cast<double>(wavelength_m.size()));
  }
  return found;
}

Curves traced_sphere(phase::Request request, const ThetaGrid& grid, const Progress& progress) {
  request.method = phase::Method::patches;
  request.theta_deg = grid.theta_deg;
  request.phi_deg = {0};
  request.matrix = true;
  // The first job of its kind compiles its kernels; later ones, of any size, find them in the driver's cache.
  phase::Request small = request;
  small.rays = 16;
  small.theta_deg = {90};
  small.wavelength_m = {request.wavelength_m.front()};
  (void)phase::compute(small);
  const auto start = std::chrono::steady_clock::now();
  const phase::Plan plan = phase::plan(request);
  CurveSink sink(pi * request.shape.radius_m * request.shape.radius_m, request.matrix);
  phase::run(plan, sink, progress);
  const double each = seconds_since(start) / static_cast<double>(request.wavelength_m.size());
  sink.found.seconds.assign(request.wavelength_m.size(), each);
  return std::move(sink.found);
}

} // namespace scatter::validation
