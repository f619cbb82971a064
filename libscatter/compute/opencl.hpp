#pragma once

#include <scatter/compute/device.hpp>

#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#define CL_HPP_ENABLE_EXCEPTIONS
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wignored-attributes"
#include <CL/opencl.hpp>
#pragma GCC diagnostic pop

#include <deque>
#include <map>
#include <mutex>
#include <span>
#include <string_view>
#include <type_traits>

namespace scatter::compute {

/// What a Device holds. Not installed: users of the library need no OpenCL headers. program() and lane() may
/// be called from several threads at once.
struct OpenCL {
  cl::Device device;
  cl::Context context;
  cl::CommandQueue queue;
  DeviceInfo info;
  std::mutex growing;                          ///< guards the two below
  std::map<std::string, cl::Program> programs; ///< by options and source
  std::deque<cl::CommandQueue> lanes;

  /// Builds the concatenated sources, or takes them from the cache. Throws DeviceError with the first line of
  /// the compiler's log.
  cl::Program& program(std::span<const std::string_view> sources, const std::string& options);

  /// A queue of its own for work that runs beside other work: lane 0, 1, .. are made when first asked for and
  /// kept.
  cl::CommandQueue& lane(std::size_t index);

  /// A read-only copy of host data. An empty span gives one byte, so that it can be passed to a kernel.
  template <typename T>
  cl::Buffer upload(std::span<const T> data) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (data.empty()) return cl::Buffer(context, CL_MEM_READ_ONLY, 1);
    return cl::Buffer(
        context, CL_MEM_READ_ONLY | CL_MEM_COPY_HOST_PTR, data.size_bytes(), const_cast<T*>(data.data()));
  }
  template <typename T>
  cl::Buffer upload(const std::vector<T>& data) {
    return upload(std::span<const T>(data));
  }
  template <typename T>
  cl::Buffer allocate(std::size_t count) {
    return cl::Buffer(context, CL_MEM_READ_WRITE, std::max<std::size_t>(count, 1) * sizeof(T));
  }
  template <typename T>
  void download(const cl::Buffer& buffer, std::span<T> to) {
    if (!to.empty()) queue.enqueueReadBuffer(buffer, CL_TRUE, 0, to.size_bytes(), to.data());
  }
};

/// Runs f and turns OpenCL's exceptions into DeviceError with the failing call's name.
template <typename F>
decltype(auto) guarded(F&& f) {
  try {
    return f();
  } catch (const cl::Error& error) {
    throw DeviceError(
        std::string("OpenCL failed in ") + error.what() + " with error " + std::to_string(error.err()) +
        (error.err() == CL_MEM_OBJECT_ALLOCATION_FAILURE || error.err() == CL_OUT_OF_HOST_MEMORY ||
                 error.err() == CL_OUT_OF_RESOURCES
             ? " (out of memory)"
             : ""));
  }
}

/// Sets all arguments of a kernel and returns it.
template <typename... Arguments>
cl::Kernel with_arguments(cl::Kernel kernel, const Arguments&... arguments) {
  cl_uint index = 0;
  (kernel.setArg(index++, arguments), ...);
  return kernel;
}

} // namespace scatter::compute
