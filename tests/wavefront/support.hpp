#pragma once

#include <scatter/wavefront/far_field.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

/// What the tests of rays share.
namespace support {

using namespace scatter;
using namespace scatter::wavefront;
using std::numbers::pi;
inline constexpr double degree = pi / 180;

inline const compute::Device& device() {
  static const compute::Device shared;
  return shared;
}

inline Tracer tracer(const drop::Shape& shape, double sun_deg = 0, int rays = 64) {
  Tracing tracing;
  tracing.shape = shape;
  tracing.sun_elevation_deg = sun_deg;
  tracing.rays = rays;
  return {tracing, device()};
}

inline const Light red{650e-9, 1.331};
inline Light with_index(std::complex<double> index) {
  return {650e-9, index};
}

/// first, first + step, ..., last.
inline std::vector<double> range(double first, double last, double step) {
  std::vector<double> values;
  const int count = static_cast<int>(std::lround((last - first) / step));
  for (int i = 0; i <= count; ++i) values.push_back(first + (last - first) * i / std::max(count, 1));
  return values;
}

/// Largest number seen, and what it belonged to: one expectation for thousands of comparisons. NaN counts as
/// infinite.
struct Worst {
  double value = 0;
  std::string where = "nothing was compared";
  template <typename Describe>
  void see(double error, Describe&& describe) {
    if (std::isnan(error)) error = std::numeric_limits<double>::infinity();
    if (error > value || (count == 0 && error == 0)) {
      value = error;
      where = describe();
    }
    ++count;
  }
  long count = 0;
};
inline void expect_below(const Worst& worst, double limit, const std::string& what) {
  EXPECT_GT(worst.count, 0) << what << ": nothing was compared";
  EXPECT_LT(worst.value, limit) << what << " at " << worst.where << " of " << worst.count << " comparisons";
}

inline FarField far_field(Tracer& tracer, const Light& light, const Wanted& wanted) {
  FarField result;
  tracer.far_field(std::span<const Light>(&light, 1), wanted, [&](std::size_t, FarField& field) {
    result = std::move(field);
  });
  return result;
}

inline FarField far_field(const Tracing& tracing, const Light& light, const Wanted& wanted) {
  Tracer made(tracing, device());
  return far_field(made, light, wanted);
}

inline double largest(const std::vector<Amplitude>& amplitudes) {
  double most = 0;
  for (const Amplitude& a : amplitudes)
    most = std::max({most, std::abs(a.S1), std::abs(a.S2), std::abs(a.S3), std::abs(a.S4)});
  return most;
}
inline double difference(const Amplitude& a, const Amplitude& b) {
  return std::max(
      {std::abs(a.S1 - b.S1), std::abs(a.S2 - b.S2), std::abs(a.S3 - b.S3), std::abs(a.S4 - b.S4)});
}

} // namespace support
