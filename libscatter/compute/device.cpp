#include <scatter/compute/opencl.hpp>

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>

namespace scatter::compute {

namespace {

bool has_double_precision(const cl::Device& device) {
  return device.getInfo<CL_DEVICE_EXTENSIONS>().find("cl_khr_fp64") != std::string::npos;
}

cl::Device find_device() {
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    // The loader reports "no platform" as an error of its own.
  }
  if (platforms.empty())
    throw DeviceError("no OpenCL platform found: install one with double precision, e.g. the Debian package "
                      "pocl-opencl-icd");
  std::string seen;
  for (const cl::Platform& platform : platforms) {
    std::vector<cl::Device> devices;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
    } catch (const cl::Error&) {
      continue;
    }
    for (const cl::Device& device : devices) {
      if (has_double_precision(device)) return device;
      seen += (seen.empty() ? "" : ", ") + device.getInfo<CL_DEVICE_NAME>();
    }
  }
  throw DeviceError(
      "no OpenCL device with double precision (cl_khr_fp64)" + (seen.empty() ? "" : " among: " + seen) +
      "; the Debian package pocl-opencl-icd brings one");
}

std::uint64_t read_number(const char* path, std::uint64_t otherwise) {
  std::ifstream file(path);
  std::uint64_t value = 0;
  return file >> value ? value : otherwise;
}

} // namespace

Device::Device(int threads) {
  // Contexts live as long as the process. PoCL 3.1 releases the last event of a queue on its own thread,
  // sometimes after clFinish has returned, and crashes when the event's context is gone by then. Besides, a
  // second job with as many threads finds its kernels built.
  static std::mutex making;
  static auto& kept = *new std::map<unsigned, std::shared_ptr<OpenCL>>();
  opencl_ = guarded([&] {
    const std::lock_guard lock(making);
    cl::Device device = find_device();
    const unsigned all = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
    const unsigned units = threads > 0 ? std::min(static_cast<unsigned>(threads), all) : all;
    std::shared_ptr<OpenCL>& entry = kept[units];
    if (entry) return entry;
    auto made = std::make_shared<OpenCL>();
    if (units < all) {
      const cl_device_partition_property parts[] = {
          CL_DEVICE_PARTITION_BY_COUNTS, static_cast<cl_device_partition_property>(units),
          CL_DEVICE_PARTITION_BY_COUNTS_LIST_END, 0};
      std::vector<cl::Device> devices;
      device.createSubDevices(parts, &devices);
      device = devices.at(0);
    }
    made->device = device;
    made->context = cl::Context(made->device);
    made->queue = cl::CommandQueue(made->context, made->device);
    made->info.name = made->device.getInfo<CL_DEVICE_NAME>();
    made->info.version = made->device.getInfo<CL_DEVICE_VERSION>();
    made->info.compute_units = made->device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
    made->info.memory_bytes = made->device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
    made->info.allocation_bytes = made->device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
    return entry = made;
  });
}

const DeviceInfo& Device::info() const {
  return opencl_->info;
}

cl::Program& OpenCL::program(std::span<const std::string_view> sources, const std::string& options) {
  std::string text;
  for (const std::string_view source : sources) text.append(source).append("\n");
  const std::string key = options + "\n" + text;
  const std::lock_guard lock(growing);
  const auto known = programs.find(key);
  if (known != programs.end()) return known->second;
  cl::Program made(context, text);
  try {
    made.build(device, options.c_str());
  } catch (const cl::Error&) {
    std::string log = made.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device);
    const std::size_t error = log.find("error:");
    if (error != std::string::npos) log.erase(0, error);
    throw DeviceError("the OpenCL compiler refused a kernel: " + log.substr(0, log.find('\n')));
  }
  return programs.emplace(key, made).first->second;
}

cl::CommandQueue& OpenCL::lane(std::size_t index) {
  const std::lock_guard lock(growing);
  while (lanes.size() <= index) lanes.emplace_back(context, device);
  return lanes[index];
}

std::uint64_t available_memory() {
  std::uint64_t available = std::numeric_limits<std::uint64_t>::max();
  std::ifstream meminfo("/proc/meminfo");
  for (std::string name; meminfo >> name;) {
    std::uint64_t kilobytes = 0;
    meminfo >> kilobytes;
    if (name == "MemAvailable:") available = kilobytes * 1024;
    meminfo.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  // Control groups, version 2 and then 1. "max" is not a number and leaves the default.
  const std::uint64_t unlimited = std::numeric_limits<std::uint64_t>::max();
  for (const auto& [limit, used] :
       {std::pair{"/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"},
        std::pair{
            "/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes"}}) {
    const std::uint64_t most = read_number(limit, unlimited);
    if (most != unlimited) available = std::min(available, most - std::min(most, read_number(used, 0)));
  }
  return available;
}

} // namespace scatter::compute
