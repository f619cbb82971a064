#include <scatter/compute/opencl.hpp>
#include <scatter/fiber/hair_program.hpp>
#include <scatter/optics/errors.hpp>

#include <embedded/kernel_hair.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace scatter::fiber {
namespace {

constexpr std::size_t lanes = 8; // hair.cl
constexpr std::size_t chunk = 1 << 20;

} // namespace

HairProgram::HairProgram(const HairScattering& hair, const compute::Device& device)
    : device_(device), parameters_(hair.parameters()) {
  const std::vector<ResidualEnergy>& residual = hair.residual_series();
  if (residual.empty()) throw InputError("hair on an OpenCL device must have a round section");
  for (std::size_t lobe = 0; lobe < 3; ++lobe) {
    const LongitudinalKernel& kernel = hair.kernel(lobe);
    lobes_.insert(
        lobes_.end(), {kernel.shift(), 0.5 / (kernel.width() * kernel.width()), kernel(kernel.shift())});
  }
  if (!parameters_.residual) return;
  std::size_t most = 0;
  for (const ResidualEnergy& one : residual) most = std::max(most, one.terms());
  terms_ = static_cast<int>(most);
  for (const ResidualEnergy& one : residual) {
    residuals_.insert(residuals_.end(), one.coefficients().begin(), one.coefficients().end());
    residuals_.resize(residuals_.size() + most - one.terms(), 0.0);
  }
}

void HairProgram::eval(
    std::span<const double> theta_i, std::span<const double> theta_o, std::span<const double> phi,
    std::span<double> value) const {
  check_directions(theta_i, theta_o, phi, value.size());
  const std::size_t all = theta_i.size();
  compute::guarded([&] {
    compute::OpenCL& cl = device_.opencl();
    const std::array<std::string_view, 1> sources{embedded::kernel_hair};
    cl::Program& program =
        cl.program(sources, fmt::format("-cl-std=CL1.2 -w -DLARGEST_THETA_D={:.17g}", largest_theta_d));
    const cl::Buffer lobes = cl.upload(lobes_), residuals = cl.upload(residuals_);
    for (std::size_t begin = 0; begin < all; begin += chunk) {
      const std::size_t count = std::min(chunk, all - begin);
      const cl::Buffer i = cl.upload(theta_i.subspan(begin, count)),
                       o = cl.upload(theta_o.subspan(begin, count)), f = cl.upload(phi.subspan(begin, count)),
                       values = cl.allocate<double>(3 * count);
      const cl::Kernel kernel = compute::with_arguments(
          cl::Kernel(program, "hair"), static_cast<cl_ulong>(count), parameters_.eta, parameters_.sigma_a[0],
          parameters_.sigma_a[1], parameters_.sigma_a[2], static_cast<cl_int>(terms_), lobes, residuals, i, o,
          f, values);
      cl.queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange((count + lanes - 1) / lanes));
      for (std::size_t c = 0; c < 3; ++c)
        cl.queue.enqueueReadBuffer(
            values, CL_TRUE, c * count * sizeof(double), count * sizeof(double), &value[c * all + begin]);
    }
  });
}

} // namespace scatter::fiber
