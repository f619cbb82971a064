#pragma once

#include <scatter/compute/opencl.hpp>
#include <scatter/wavefront/far_field.hpp>
#include <scatter/wavefront/ray_grid.hpp>

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// What all that traces rays through one drop on the device shares: the drop's parameters there, the kernels'
/// programs, and single rays.
namespace scatter::wavefront {

/// Layout of job_t in kernels/job.cl.
struct Job {
  double n, k, wave, attenuation, origin, step;
  double row_origin = 0, rows_per_radian = 1, column_origin = 0, columns_per_radian = 1;
  double row_margin = 1e-6, column_margin = 1e-6;
  int rays, last_order, rows = 0, columns = 0, focal_lines, interior_steps, rim_steps, unused = 0;
};
static_assert(sizeof(Job) == 128);

/// Single rays as the kernel gives them: fields of trace_rays() in kernels/rays.cl.
struct RawRays {
  static constexpr int fields = 31; ///< RAY_FIELDS there
  std::size_t count = 0;
  std::vector<double> values;
  [[nodiscard]] double field(int order, int f, std::size_t ray) const {
    return values[(static_cast<std::size_t>(order) * fields + f) * count + ray];
  }
};

/// A drop under a sun on a device.
struct RayProgram {
  Tracing tracing;
  compute::Device device;
  SurfaceParameters surface;
  bool axisymmetric = false; ///< about the sunlight
  double area = 0;           ///< of the shadow, units of a^2
  cl::Buffer surface_buffer;

  /// Throws InputError for rays or orders out of range.
  RayProgram(const Tracing& request, const compute::Device& on);

  [[nodiscard]] compute::OpenCL& cl() const { return device.opencl(); }
  [[nodiscard]] int last_order() const { return tracing.orders.back(); }

  /// trace.cl with all that it needs, then `further` sources; ABSORBING by the light, CURVATURE and UNIFORM
  /// (which needs CURVATURE) where asked.
  cl::Program& build(
      const Light& light, std::span<const std::string_view> further, bool curvature,
      const std::string& further_options = "");

  [[nodiscard]] Job make_job(const Light& light, int rays, int order) const;
  [[nodiscard]] cl::Buffer job_buffer(const Job& job) const;

  /// Rays from (u, v) of the incident plane in units of a, orders 0..last; count is padded. Those that
  /// reflect totally where they should leave go out by tunnelling, if `tunnelling`: field 0 is 2 for them
  /// then, and coefficients are those of the curved surface.
  RawRays trace_raw(
      const Light& light, std::span<const double> u, std::span<const double> v, int last,
      bool tunnelling = false);
  /// The same as Tracer::trace() gives them.
  std::vector<std::vector<TracedRay>>
  trace(const Light& light, std::span<const double> u, std::span<const double> v, int last);
};

} // namespace scatter::wavefront
