#include <scatter/compute/device.hpp>
#include <scatter/compute/opencl.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>
#include <thread>

namespace {

using namespace scatter::compute;
using testing::HasSubstr;

TEST(Device, KnowsWhatItIs) {
  const Device device;
  EXPECT_FALSE(device.info().name.empty());
  EXPECT_THAT(device.info().version, HasSubstr("OpenCL"));
  EXPECT_GE(device.info().compute_units, 1U);
  EXPECT_GT(device.info().memory_bytes, std::uint64_t{1} << 28);
  EXPECT_GT(device.info().allocation_bytes, std::uint64_t{1} << 26);
}

TEST(Device, TakesNoMoreThreadsThanItIsGiven) {
  EXPECT_EQ(Device(1).info().compute_units, 1U);
  const unsigned all = Device(0).info().compute_units;
  EXPECT_EQ(Device(100000).info().compute_units, all);
  EXPECT_EQ(Device(static_cast<int>(all)).info().compute_units, all);
}

TEST(Device, IsSharedByItsCopies) {
  const Device device;
  const Device copy = device;
  EXPECT_EQ(&device.opencl(), &copy.opencl());
}

TEST(Kernels, WorkInDoublePrecision) {
  const Device device(1);
  OpenCL& cl = device.opencl();
  const std::string_view sources[] = {
      "#pragma OPENCL EXTENSION cl_khr_fp64 : enable\n",
      "kernel void third(global const double* x, global double* y) { int i = get_global_id(0); y[i] = x[i] / "
      "3.0; }"};
  std::vector<double> x(64), y(64);
  std::iota(x.begin(), x.end(), 1.0);
  const cl::Buffer from = cl.upload(x), to = cl.allocate<double>(y.size());
  guarded([&] {
    cl.queue.enqueueNDRangeKernel(
        with_arguments(cl::Kernel(cl.program(sources, "-cl-std=CL1.2"), "third"), from, to), cl::NullRange,
        cl::NDRange(64), cl::NDRange(8));
    cl.download(to, std::span<double>(y));
  });
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_EQ(y[i], x[i] / 3.0);
}

TEST(Kernels, AreBuiltOncePerSourceAndOptions) {
  const Device device;
  OpenCL& cl = device.opencl();
  const std::string_view sources[] = {"kernel void nothing(global float* x) { x[0] = VALUE; }"};
  cl::Program& first = cl.program(sources, "-DVALUE=1.0f");
  EXPECT_EQ(&first, &cl.program(sources, "-DVALUE=1.0f"));
  EXPECT_NE(&first, &cl.program(sources, "-DVALUE=2.0f"));
}

TEST(Kernels, ThatDoNotCompileAreRefusedInOneLine) {
  const Device device;
  const std::string_view sources[] = {"kernel void broken(global float* x) { x[0] = no_such_name; }"};
  try {
    device.opencl().program(sources, "");
    FAIL() << "the kernel was accepted";
  } catch (const DeviceError& error) {
    const std::string message = error.what();
    EXPECT_THAT(message, HasSubstr("no_such_name"));
    EXPECT_EQ(message.find('\n'), std::string::npos);
  }
}

TEST(Kernels, FailuresNameTheCall) {
  const Device device;
  try {
    guarded([&] { cl::Buffer(device.opencl().context, CL_MEM_READ_WRITE, 0); });
    FAIL() << "an empty buffer was made";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("clCreateBuffer"));
  }
}

TEST(Buffers, OfNothingCanStillBePassed) {
  const Device device;
  EXPECT_NO_THROW(device.opencl().upload(std::vector<double>{}));
  EXPECT_NO_THROW(device.opencl().allocate<double>(0));
}

TEST(AvailableMemory, IsPlausible) {
  EXPECT_GT(available_memory(), std::uint64_t{1} << 24);
  EXPECT_LT(available_memory(), std::uint64_t{1} << 50);
}

} // namespace
