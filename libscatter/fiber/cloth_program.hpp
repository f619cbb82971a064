#pragma once

#include <scatter/compute/device.hpp>
#include <scatter/fiber/weave.hpp>

#include <span>

namespace scatter::fiber {

/// Cloth::eval on an OpenCL device, for big batches: one million pairs at a time.
class ClothProgram {
public:
  /// Copies what it needs of the cloth. Builds the kernel when first used: one or two seconds when the
  /// driver has not kept it. Throws compute::DeviceError; InputError for a cloth whose families hide each
  /// other, which devices do not know.
  ClothProgram(const Cloth& cloth, const compute::Device& device);

  /// As Cloth::eval(), and agrees with it to 1e-12 relative. Throws as it does, and compute::DeviceError.
  void eval(std::span<const glm::dvec3> light, std::span<const glm::dvec3> view, std::span<Rgb> value) const;

private:
  compute::Device device_;
  std::vector<double> strands_, tangents_;
  int strand_count_ = 0;
  double gap_ = 0, masking_rate_ = 0;
};

} // namespace scatter::fiber
