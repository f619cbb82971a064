#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/airy_edge.hpp>
#include <scatter/wavefront/ray_program.hpp>

#include <embedded/kernel_curvature.hpp>
#include <embedded/kernel_double_double.hpp>
#include <embedded/kernel_fresnel.hpp>
#include <embedded/kernel_grazing.hpp>
#include <embedded/kernel_job.hpp>
#include <embedded/kernel_rays.hpp>
#include <embedded/kernel_surface.hpp>
#include <embedded/kernel_trace.hpp>
#include <embedded/kernel_vector.hpp>

#include <array>
#include <cmath>
#include <complex>

namespace scatter::wavefront {

using compute::guarded;
using compute::with_arguments;

namespace {

constexpr int ray_lanes = 16;

} // namespace

RayProgram::RayProgram(const Tracing& request, const compute::Device& on) : tracing(request), device(on) {
  if (tracing.rays < 2 || tracing.rays > 20000)
    throw InputError("--rays " + std::to_string(tracing.rays) + ": the grid needs 2 to 20000 rays across");
  if (tracing.orders.empty() || tracing.orders.front() < 0)
    throw InputError("--orders: at least one order p >= 0 is needed, e.g. 0..3");
  surface = surface_parameters(tracing.shape, tracing.sun_elevation_deg);
  axisymmetric = tracing.shape.is_sphere() || std::abs(tracing.sun_elevation_deg - 90) < 1e-9;
  area = wavefront::shadow_area(tracing.shape, tracing.sun_elevation_deg);
  // The kernels find the series behind the surface.
  const std::vector<double>& series = airy_edge_series();
  surface.values.insert(surface.values.end(), series.begin(), series.end());
  guarded([&] { surface_buffer = cl().upload(surface.values); });
}

cl::Program& RayProgram::build(
    const Light& light, std::span<const std::string_view> further, bool curvature,
    const std::string& further_options) {
  using namespace embedded;
  // Without the compiler's warnings, of which PoCL prints the number on standard error.
  std::string options = "-cl-std=CL1.2 -w -DTILE=" + std::to_string(tile_cells);
  if (tracing.shape.kind == drop::Shape::Kind::spheroid)
    options += " -DSURFACE_SPHEROID";
  else
    options += " -DSURFACE_DEGREE=" + std::to_string(tracing.shape.polynomial().size() - 1);
  if (curvature) options += " -DCURVATURE";
  if (light.index.imag() > 0) options += " -DABSORBING";
  std::vector<std::string_view> sources{kernel_vector, kernel_double_double, kernel_surface};
  if (curvature) sources.push_back(kernel_curvature);
  sources.push_back(kernel_fresnel);
  if (curvature) {
    sources.push_back(kernel_grazing);
    options += " -DEDGE_REACH=" + std::to_string(edge_reach) + " -DEDGE_TERMS=" + std::to_string(edge_terms) +
               " -DSURFACE_EDGE=" + std::to_string(surface.values.size() - 3 * edge_terms);
  }
  sources.push_back(kernel_trace);
  sources.push_back(kernel_job);
  sources.insert(sources.end(), further.begin(), further.end());
  return cl().program(sources, options + further_options);
}

Job RayProgram::make_job(const Light& light, int rays, int order) const {
  Job job{};
  job.n = light.index.real();
  job.k = light.index.imag();
  job.wave = 2 * tracing.shape.radius_m / light.wavelength_m;
  job.attenuation = pi * job.wave * job.k;
  job.step = 2 * surface.largest_radius / rays;
  job.origin = -surface.largest_radius + 0.5 * job.step;
  job.rays = rays;
  job.last_order = order;
  job.focal_lines = tracing.focal_lines == FocalLines::rule;
  // Newton's steps from the hull: more than the interior needs, where they end early.
  job.interior_steps = surface.hull_margin < 1e-9 ? 3 : surface.hull_margin < 0.02 ? 5 : 7;
  job.rim_steps = 24;
  return job;
}

cl::Buffer RayProgram::job_buffer(const Job& job) const {
  return cl().upload(std::span<const Job>(&job, 1));
}

RawRays RayProgram::trace_raw(
    const Light& light, std::span<const double> u, std::span<const double> v, int last, bool tunnelling) {
  const int count = static_cast<int>((u.size() + ray_lanes - 1) / ray_lanes * ray_lanes);
  std::vector<double> padded_u(u.begin(), u.end()), padded_v(v.begin(), v.end());
  padded_u.resize(count, 0.0);
  padded_v.resize(count, 0.0);
  const cl::Buffer job = job_buffer(make_job(light, tracing.rays, last));
  const cl::Buffer u_data = cl().upload(padded_u), v_data = cl().upload(padded_v);
  RawRays rays{static_cast<std::size_t>(count), {}};
  rays.values.resize(static_cast<std::size_t>(last + 1) * RawRays::fields * count);
  const cl::Buffer out = cl().allocate<double>(rays.values.size());
  const std::string_view sources[] = {embedded::kernel_rays};
  cl().queue.enqueueNDRangeKernel(
      with_arguments(
          cl::Kernel(build(light, sources, true, tunnelling ? " -DUNIFORM -DBEYOND" : ""), "trace_rays"),
          surface_buffer, job, u_data, v_data, count, out),
      cl::NullRange, cl::NDRange(device.info().compute_units), cl::NDRange(1));
  cl().download(out, std::span<double>(rays.values));
  return rays;
}

std::vector<std::vector<TracedRay>>
RayProgram::trace(const Light& light, std::span<const double> u, std::span<const double> v, int last) {
  const RawRays raw = trace_raw(light, u, v, last);
  std::vector<std::vector<TracedRay>> rays(u.size(), std::vector<TracedRay>(last + 1));
  for (std::size_t i = 0; i < u.size(); ++i)
    for (int p = 0; p <= last; ++p) {
      const auto field = [&](int f) { return raw.field(p, f, i); };
      TracedRay& ray = rays[i][p];
      ray.valid = field(0) > 0.5;
      ray.direction = {field(1), field(2), field(3)};
      ray.path = field(4);
      ray.axis_crossings = static_cast<int>(field(5));
      const auto vector = [&](int f) { return std::array<double, 3>{field(f), field(f + 1), field(f + 2)}; };
      ray.point = vector(14);
      ray.point_u = vector(17);
      ray.point_v = vector(20);
      ray.direction_u = vector(23);
      ray.direction_v = vector(26);
      ray.foci_inside = static_cast<int>(field(29));
      ray.foci = static_cast<int>(field(30));
      const auto element = [&](int e) { return std::complex<double>(field(6 + e), field(10 + e)); };
      const double h = field(3) < 0 ? -1 : 1, rho = std::hypot(field(1), field(2));
      const double c = rho > 0 ? field(1) / rho : 1, s = rho > 0 ? field(2) / rho : 0;
      const auto along_theta = [&](int x) { return h * c * element(x) + s * element(x + 1); };
      const auto along_phi = [&](int x) { return h * c * element(x + 1) - s * element(x); };
      ray.jones.S2 = c * along_theta(0) + s * along_theta(2);
      ray.jones.S3 = s * along_theta(0) - c * along_theta(2);
      ray.jones.S4 = -(c * along_phi(0) + s * along_phi(2));
      ray.jones.S1 = -(s * along_phi(0) - c * along_phi(2));
    }
  return rays;
}

} // namespace scatter::wavefront
