#include "example_table.hpp"
#include <scatter/table/grid.hpp>

#include <gtest/gtest.h>

#include <functional>

namespace scatter::table {
namespace {

std::vector<double> range(double first, double last, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(first + (last - first) * i / (count - 1));
  return values;
}

std::vector<double> sample(
    const std::vector<double>& theta, const std::vector<double>& phi,
    const std::function<double(double, double)>& f) {
  std::vector<double> values;
  for (const double t : theta)
    for (const double p : phi) values.push_back(f(t, p));
  return values;
}

TEST(SphereIntegral, OfOneIsFourPiOnEveryGridThatCoversTheSphere) {
  const std::vector<std::vector<double>> phis{{17},
                                              range(0, 360, 13),
                                              range(0, 350, 36),
                                              range(-180, 180, 5),
                                              {0, 100, 130, 270},
                                              range(0, 180, 7),
                                              {0, 180}};
  std::vector<double> uneven{0, 0.001, 3, 70, 70.5, 179, 180};
  for (const auto& theta : {range(0, 180, 2), range(0, 180, 181), range(0, 180, 14401), uneven})
    for (const auto& phi : phis) {
      const auto integral = sphere_integral(theta, phi, std::vector<double>(theta.size() * phi.size(), 1.0));
      ASSERT_TRUE(integral.has_value());
      EXPECT_NEAR(*integral, 4 * pi, 1e-12);
    }
}

TEST(SphereIntegral, IsExactForWhatIsLinearInThetaAndConvergesWithTheSquareOfTheStep) {
  const auto linear = sphere_integral(
      range(0, 180, 4), range(0, 350, 36),
      sample(range(0, 180, 4), range(0, 350, 36), [](double t, double) { return t * radians_per_degree; }));
  EXPECT_NEAR(linear.value(), 2 * pi * pi, 1e-12);
  const auto error = [](int rows) {
    const auto theta = range(0, 180, rows), phi = range(0, 355, 72);
    const auto values =
        sample(theta, phi, [](double t, double f) { return example::phase_function(t, f, 5e-7); });
    return std::abs(sphere_integral(theta, phi, values).value() - 1);
  };
  EXPECT_LT(error(1801), 1e-4);
  EXPECT_NEAR(error(901) / error(1801), 4, 0.1);
}

TEST(SphereIntegral, IsNotClaimedForAPartOfTheSphere) {
  const auto none = [](const std::vector<double>& theta, const std::vector<double>& phi) {
    return !sphere_integral(theta, phi, std::vector<double>(theta.size() * phi.size(), 1.0)).has_value();
  };
  EXPECT_TRUE(none(range(1, 180, 5), {0}));
  EXPECT_TRUE(none(range(0, 179, 5), {0}));
  EXPECT_TRUE(none({90}, {0}));
  EXPECT_TRUE(none(range(0, 180, 5), range(0, 170, 18)));
  EXPECT_TRUE(none(range(0, 180, 5), range(0, 300, 31)));
  EXPECT_TRUE(none(range(0, 180, 5), {0, 90}));
}

} // namespace
} // namespace scatter::table
