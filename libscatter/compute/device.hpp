#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

/// The OpenCL device that everything over rays or directions runs on. Nothing of physics here.
namespace scatter::compute {

/// No OpenCL platform, no device with double precision, or the device failed. One line.
struct DeviceError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct DeviceInfo {
  std::string name;                   ///< as the driver calls it
  std::string version;                ///< of the device's OpenCL
  unsigned compute_units = 0;         ///< work-groups that run side by side
  std::uint64_t memory_bytes = 0;     ///< of the device
  std::uint64_t allocation_bytes = 0; ///< largest single buffer
};

struct OpenCL; // compute/opencl.hpp, for the library's own sources

/// A device with a context. Cheap to copy: copies share it, and so do all devices of as many threads; the
/// context is kept to the end of the process.
class Device {
public:
  /// The first device with double precision, limited to `threads` compute units (0: all).
  /// Throws DeviceError when there is none, and says which package brings one.
  explicit Device(int threads = 0);

  [[nodiscard]] const DeviceInfo& info() const;
  [[nodiscard]] OpenCL& opencl() const { return *opencl_; }

private:
  std::shared_ptr<OpenCL> opencl_;
};

/// Memory that can be had without swapping [bytes]: what the system reports as available, within a control
/// group's limit.
[[nodiscard]] std::uint64_t available_memory();

} // namespace scatter::compute
