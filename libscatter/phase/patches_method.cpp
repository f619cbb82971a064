#include <scatter/optics/errors.hpp>
#include <scatter/phase/methods.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace scatter::phase {

wavefront::Tracing tracing_of(const Request& request) {
  wavefront::Tracing tracing;
  tracing.shape = request.shape;
  tracing.sun_elevation_deg = request.sun_elevation_deg;
  tracing.rays = request.rays;
  tracing.orders = request.orders;
  tracing.interference = request.interference;
  tracing.focal_lines = request.focal_lines;
  tracing.search = request.search;
  return tracing;
}

wavefront::Wanted wanted_of(const Request& request) {
  wavefront::Wanted wanted;
  wanted.theta_deg = request.theta_deg;
  wanted.phi_deg = request.phi_deg;
  wanted.matrix = request.matrix;
  wanted.amplitudes = request.amplitudes;
  wanted.per_order = request.per_order;
  if (request.diffraction == Diffraction::gaussian)
    wanted.filter_sigma_deg = gaussian_filter_width_deg(request.shape.radius_m);
  wanted.integral = request.diffraction == Diffraction::integral;
  wanted.sun_disc_deg = request.sun_disc_deg;
  return wanted;
}

namespace {

std::vector<table::Amplitude> to_table(const std::vector<wavefront::Amplitude>& from) {
  std::vector<table::Amplitude> to;
  to.reserve(from.size());
  for (const wavefront::Amplitude& a : from) to.push_back({a.S1, a.S2, a.S3, a.S4});
  return to;
}

} // namespace

Outcome run_patches(const Plan& plan, table::Sink& sink, const Progress& progress) {
  const Request& request = plan.request;
  try {
    const std::vector<std::vector<double>> errors =
        plan.errors->all(request.diffraction, request.rays, request.orders);
    const auto start = std::chrono::steady_clock::now();
    const compute::Device device(request.threads);
    wavefront::Tracer tracer(tracing_of(request), device);
    std::vector<wavefront::Light> lights;
    for (std::size_t w = 0; w < request.wavelength_m.size(); ++w)
      lights.push_back({request.wavelength_m[w], plan.header.index[w]});
    ErrorSum sum;
    sink.begin(plan.header);
    tracer.far_field(lights, wanted_of(request), [&](std::size_t w, wavefront::FarField& field) {
      table::Slab slab;
      slab.phase_function.swap(field.phase_function);
      slab.phase_matrix.swap(field.phase_matrix);
      slab.amplitude = to_table(field.amplitude);
      slab.order_amplitude = to_table(field.order_amplitude);
      slab.order_energy = field.order_energy;
      slab.scattering_cross_section = field.scattering_cross_section;
      slab.extinction_cross_section = field.extinction_cross_section;
      slab.error_estimate = errors[w];
      sum.add(errors[w]);
      sink.write(w, slab);
      // The big arrays go back, to be filled again without touching new memory.
      slab.phase_function.swap(field.phase_function);
      slab.phase_matrix.swap(field.phase_matrix);
      if (progress) progress(static_cast<double>(w + 1) / static_cast<double>(lights.size()));
    });
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const double judging_seconds = plan.errors->seconds();
    sink.finish(seconds + judging_seconds);
    return {sum.root_mean_square(), seconds, judging_seconds};
  } catch (const compute::DeviceError& error) {
    throw RunError(error.what());
  }
}

} // namespace scatter::phase
