// Functions of vectors, on every instruction set that the machine has.
#include <scatter/exact/vector_unit.hpp>
#include <scatter/fiber/lane_math.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

namespace {

using namespace scatter::fiber;
using scatter::exact::vector_units;
using scatter::exact::VectorUnit;

enum class Function { inverse, inverse_root, quick_root, rough_cube_root, power_of_two, arc_squared };

/// y[i] for x[i], whole vectors.
template <class T>
SCATTER_LANE void apply(Function function, const std::vector<double>& x, double* y) {
  for (std::size_t i = 0; i < x.size(); i += T::width) {
    const T at = T::load(&x[i]);
    switch (function) {
    case Function::inverse:
      inverse(at).store(y + i);
      break;
    case Function::inverse_root:
      inverse_root(at).store(y + i);
      break;
    case Function::quick_root:
      quick_root(at).store(y + i);
      break;
    case Function::rough_cube_root:
      rough_cube_root(at).store(y + i);
      break;
    case Function::power_of_two:
      power_of_two(at).store(y + i);
      break;
    case Function::arc_squared:
      arc_squared(at).store(y + i);
      break;
    }
  }
}

#if SCATTER_FIBER_X86_LANES
SCATTER_FIBER_AVX512 void apply_on_avx512(Function function, const std::vector<double>& x, double* y) {
  apply<lane::Two<lane::Lanes<8>>>(function, x, y);
}
SCATTER_FIBER_AVX2 void apply_on_avx2(Function function, const std::vector<double>& x, double* y) {
  apply<lane::Two<lane::Lanes<4>>>(function, x, y);
}
#endif

std::vector<double> values(const VectorUnit& unit, Function function, std::vector<double> x) {
  while (x.size() % 16 != 0) x.push_back(x.back());
  std::vector<double> y(x.size());
#if SCATTER_FIBER_X86_LANES
  if (unit.width == 8) apply_on_avx512(function, x, y.data());
  if (unit.width == 4) apply_on_avx2(function, x, y.data());
#endif
  if (std::string(unit.name) == "plain" || !SCATTER_FIBER_X86_LANES)
    apply<lane::Two<lane::Lanes<2>>>(function, x, y.data());
  return y;
}

/// Largest relative error.
template <class Exact>
double worst(const VectorUnit& unit, Function function, const std::vector<double>& x, Exact exact) {
  const std::vector<double> y = values(unit, function, x);
  double error = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const long double right = exact(static_cast<long double>(x[i]));
    error = std::max(error, std::abs(static_cast<double>((y[i] - right) / right)));
  }
  return error;
}

TEST(LaneMath, KeepsItsAccuracy) {
  std::vector<double> size, exponent, part;
  for (int k = 0; k <= 100000; ++k) {
    const double u = k / 100000.0;
    size.push_back(std::pow(10.0, 40 * u - 30));
    exponent.push_back(-700 * u * u);
    part.push_back((u + 1e-9) * (u + 1e-9));
  }
  std::erase_if(part, [](double q) { return q > 1; });
  for (const VectorUnit& unit : vector_units()) {
    SCOPED_TRACE(unit.name);
    EXPECT_LT(worst(unit, Function::inverse, size, [](long double x) { return 1 / x; }), 3e-16);
    EXPECT_LT(
        worst(unit, Function::inverse_root, size, [](long double x) { return 1 / std::sqrt(x); }), 4e-16);
    EXPECT_LT(worst(unit, Function::quick_root, size, [](long double x) { return std::sqrt(x); }), 1e-3);
    EXPECT_LT(worst(unit, Function::rough_cube_root, size, [](long double x) { return std::cbrt(x); }), 0.03);
    EXPECT_LT(
        worst(unit, Function::power_of_two, exponent, [](long double x) { return std::exp2(x); }), 5e-16);
    // acos(1 - q) = 2 asin(sqrt(q / 2)) keeps its digits for small q.
    const auto arc_squared = [](long double q) {
      const long double angle = 2 * std::asin(std::sqrt(q / 2));
      return angle * angle;
    };
    EXPECT_LT(worst(unit, Function::arc_squared, part, arc_squared), 1e-15);
    const auto powers = values(unit, Function::power_of_two, {0, -10, -1e9});
    EXPECT_EQ(powers[0], 1);
    EXPECT_EQ(powers[1], 0x1p-10);
    EXPECT_EQ(powers[2], 0x1p-700);
    EXPECT_EQ(values(unit, Function::arc_squared, {0})[0], 0);
  }
}

} // namespace
