#include <scatter/compute/opencl.hpp>
#include <scatter/fiber/cloth_program.hpp>
#include <scatter/fiber/weave_kernel.hpp>
#include <scatter/optics/errors.hpp>

#include <embedded/kernel_cloth.hpp>

#include <algorithm>
#include <array>

namespace scatter::fiber {
namespace {

constexpr std::size_t strand_fields = 13; // cloth.cl
constexpr std::size_t lanes = 8;
constexpr std::size_t chunk = 1 << 20;

static_assert(sizeof(glm::dvec3) == 3 * sizeof(double) && sizeof(Rgb) == 3 * sizeof(double));

} // namespace

ClothProgram::ClothProgram(const Cloth& cloth, const compute::Device& device) : device_(device) {
  if (cloth.masking() != FamilyMasking::none)
    throw InputError("cloth: devices do not know threads that hide those of other directions; use the host");
  const WeaveConstants& weave = cloth.constants();
  strand_count_ = static_cast<int>(weave.count);
  gap_ = weave.gap;
  masking_rate_ = weave.masking_rate;
  for (std::size_t j = 0; j < weave.count; ++j) {
    const StrandConstants& s = weave.strands[j];
    const std::array<double, strand_fields> fields{
        s.cos_direction,
        s.sin_direction,
        s.coverage,
        s.contrast,
        s.surface_height,
        s.surface_rate,
        s.volume_height,
        s.volume_rate,
        s.isotropic,
        s.albedo[0],
        s.albedo[1],
        s.albedo[2],
        static_cast<double>(s.tangents)};
    strands_.insert(strands_.end(), fields.begin(), fields.end());
    for (std::size_t k = 0; k < s.tangents; ++k)
      tangents_.insert(tangents_.end(), {s.cos_offset[k], s.sin_offset[k], s.share[k]});
  }
}

void ClothProgram::eval(
    std::span<const glm::dvec3> light, std::span<const glm::dvec3> view, std::span<Rgb> value) const {
  check_pairs(light, view, value.size());
  compute::guarded([&] {
    compute::OpenCL& cl = device_.opencl();
    const std::array<std::string_view, 1> sources{embedded::kernel_cloth};
    cl::Program& program =
        cl.program(sources, "-cl-std=CL1.2 -w -DSTRAND_FIELDS=" + std::to_string(strand_fields));
    const cl::Buffer strands = cl.upload(strands_), tangents = cl.upload(tangents_);
    for (std::size_t begin = 0; begin < light.size(); begin += chunk) {
      const std::size_t count = std::min(chunk, light.size() - begin);
      const cl::Buffer lights = cl.upload(light.subspan(begin, count));
      const cl::Buffer views = cl.upload(view.subspan(begin, count));
      const cl::Buffer values = cl.allocate<Rgb>(count);
      const cl::Kernel kernel = compute::with_arguments(
          cl::Kernel(program, "cloth"), static_cast<cl_ulong>(count), static_cast<cl_int>(strand_count_),
          gap_, masking_rate_, strands, tangents, lights, views, values);
      cl.queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange((count + lanes - 1) / lanes));
      cl.download(values, value.subspan(begin, count));
    }
  });
}

} // namespace scatter::fiber
