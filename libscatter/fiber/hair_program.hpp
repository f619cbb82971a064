#pragma once

#include <scatter/compute/device.hpp>
#include <scatter/fiber/hair.hpp>

#include <span>
#include <vector>

namespace scatter::fiber {

/// HairScattering::eval of many directions on an OpenCL device, for big batches: one million directions at a
/// time.
class HairProgram {
public:
  /// Copies what it needs of the hair. Builds the kernel when first used: one or two seconds when the driver
  /// has not kept it. Throws compute::DeviceError, and InputError for hair whose section is not round.
  HairProgram(const HairScattering& hair, const compute::Device& device);

  /// As HairScattering::eval() of lists, and agrees with it to 1e-12 where that agrees with the exact value.
  /// Throws as it does, and compute::DeviceError.
  void eval(
      std::span<const double> theta_i, std::span<const double> theta_o, std::span<const double> phi,
      std::span<double> value) const;

private:
  compute::Device device_;
  HairParameters parameters_;
  std::vector<double> lobes_, residuals_;
  int terms_ = 0;
};

} // namespace scatter::fiber
