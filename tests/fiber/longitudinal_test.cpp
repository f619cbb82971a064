// Longitudinal kernels: their norms, their spread, and the normal distribution that samples them.
#include <scatter/fiber/longitudinal.hpp>
#include <scatter/fiber/quadrature.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace {

using namespace scatter::fiber;
using scatter::pi;

double integral(const auto& f, double a, double b) {
  using Sum = std::array<double, 1>;
  double sum = 0;
  for (int i = 0; i < 64; ++i)
    sum += integrate<Sum>(
        [&](double x) { return Sum{f(x)}; }, a + (b - a) * i / 64, a + (b - a) * (i + 1) / 64, 1e-15)[0];
  return sum;
}

TEST(Longitudinal, NormsAreWhatTheyAreCalled) {
  for (const double width : {0.02, 0.13, 0.2}) {
    const double theta_i = 0.1, shift = -0.05;
    const auto over_theta_o = [&](Norm norm) {
      const LongitudinalKernel kernel(shift, width, norm);
      return integral(
          [&](double theta_o) { return kernel(0.5 * (theta_i + theta_o)); }, -0.2 - 20 * width,
          -0.2 + 20 * width);
    };
    const auto over_theta_h = [&](Norm norm) {
      return integral(LongitudinalKernel(shift, width, norm), shift - 10 * width, shift + 10 * width);
    };
    EXPECT_NEAR(over_theta_o(Norm::area_over_theta_o), 1, 1e-13);
    EXPECT_NEAR(over_theta_h(Norm::area_over_theta_o), 0.5, 1e-13);
    EXPECT_NEAR(over_theta_h(Norm::area_over_theta_h), 1, 1e-13);
    EXPECT_EQ(LongitudinalKernel(shift, width, Norm::unit_height)(shift), 1);
  }
}

TEST(Longitudinal, SpreadKeepsTheAreaAndAddsTheVariance) {
  for (const Norm norm : {Norm::area_over_theta_o, Norm::area_over_theta_h, Norm::unit_height}) {
    const LongitudinalKernel kernel(0.07, 0.1, norm);
    const double variance = 0.04;
    const double area = integral(kernel, -2, 2.14);
    EXPECT_NEAR(integral([&](double x) { return kernel.spread(variance, x); }, -3, 3.14), area, 1e-13);
    const double second =
        integral([&](double x) { return kernel.spread(variance, x) * (x - 0.07) * (x - 0.07); }, -3, 3.14);
    EXPECT_NEAR(second / area, 0.01 + variance, 1e-12);
  }
}

TEST(Longitudinal, DegenerateWidthsAreRefused) {
  for (const double width : {0.0, -0.1, pi / 2, 2.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(check_width("width", width), scatter::InputError) << width;
    EXPECT_THROW(LongitudinalKernel(0, width, Norm::unit_height), scatter::InputError) << width;
  }
  EXPECT_THROW(LongitudinalKernel(std::nan(""), 0.1, Norm::unit_height), scatter::InputError);
  EXPECT_NO_THROW(LongitudinalKernel(0.1, 1e-6, Norm::unit_height));
}

TEST(Longitudinal, SamplesFollowTheDensityToTheFarTails) {
  // mean, deviation: cut in the middle, to one side, and far out on both sides.
  for (const auto& [mean, deviation] :
       {std::pair{0.1, 0.2}, {1.5, 0.3}, {2.1, 0.05}, {-2.3, 0.04}, {0.0, 5.0}, {9.0, 0.3}}) {
    const TruncatedNormal normal(mean, deviation, -pi / 2, pi / 2);
    // The distribution's inverse, integrated back.
    for (const double u : {0.01, 0.3, 0.5, 0.9, 0.999}) {
      const double x = normal.sample(u);
      ASSERT_GE(x, -pi / 2);
      ASSERT_LE(x, pi / 2);
      const double below = integral([&](double y) { return normal.density(y); }, -pi / 2, x);
      EXPECT_NEAR(below, u, 1e-9) << mean << " " << deviation;
    }
    EXPECT_EQ(normal.density(1.6), 0);
    EXPECT_EQ(normal.density(-1.6), 0);
  }
  // Nothing to be had within the cut: uniform, not NaN.
  const TruncatedNormal nowhere(100, 0.1, 0, 2);
  EXPECT_EQ(nowhere.density(1), 0.5);
  EXPECT_EQ(nowhere.sample(0.25), 0.5);
}

} // namespace
