#pragma once

#include <scatter/fiber/fiber_scattering.hpp>
#include <scatter/optics/units.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

/// Ties sample() to pdf() and eval(), for any fibre's scattering function.
namespace scatter::test {

/// Pearson's chi-square of samples against the integral of pdf over cells of theta_o and phi. Cells with an
/// expectation below 10 are pooled. The bound is seven standard deviations above the mean: a wrong pdf of a
/// few percent fails, chance does not.
inline void
expect_samples_follow_pdf(const fiber::FiberScattering& fiber, double theta_i, int samples = 200'000) {
  constexpr int rows = 24, columns = 36, fine = 10;
  std::vector<double> counted(rows * columns), expected(rows * columns);
  std::mt19937_64 generator(20'11);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int i = 0; i < samples; ++i) {
    const double a = uniform(generator), b = uniform(generator), c = uniform(generator);
    const fiber::ScatteringSample sample = fiber.sample(theta_i, {a, b, c});
    ASSERT_TRUE(std::abs(sample.theta_o) <= pi / 2) << sample.theta_o;
    ASSERT_TRUE(std::abs(sample.phi) <= pi) << sample.phi;
    ASSERT_TRUE(std::isfinite(sample.pdf) && sample.pdf > 0) << sample.pdf;
    ASSERT_DOUBLE_EQ(sample.pdf, fiber.pdf({theta_i, sample.theta_o, sample.phi}));
    for (const double weight : sample.weight) ASSERT_TRUE(std::isfinite(weight) && weight >= 0) << weight;
    const int row = std::min(rows - 1, static_cast<int>((sample.theta_o / pi + 0.5) * rows));
    const int column = std::min(columns - 1, static_cast<int>((sample.phi / (2 * pi) + 0.5) * columns));
    ++counted[row * columns + column];
  }
  double whole = 0;
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      double sum = 0;
      for (int i = 0; i < fine; ++i)
        for (int j = 0; j < fine; ++j) {
          const double theta_o = pi * ((row + (i + 0.5) / fine) / rows - 0.5);
          const double phi = 2 * pi * ((column + (j + 0.5) / fine) / columns - 0.5);
          sum += fiber.pdf({theta_i, theta_o, phi}) * std::cos(theta_o);
        }
      const double area = pi / rows * 2 * pi / columns / (fine * fine);
      expected[row * columns + column] = samples * sum * area;
      whole += sum * area;
    }
  EXPECT_NEAR(whole, 1, 2e-2) << "the pdf over all directions"; // caustics make the midpoint rule coarse
  double chi_square = 0, pooled_counted = 0, pooled_expected = 0;
  int cells = 0;
  const auto add = [&](double found, double wanted) {
    // The midpoint rule's own error at caustics, 2 %, is allowed for beside the counts'.
    chi_square += (found - wanted) * (found - wanted) / (wanted + 4e-4 * wanted * wanted);
    ++cells;
  };
  for (int cell = 0; cell < rows * columns; ++cell) {
    if (expected[cell] >= 10) {
      add(counted[cell], expected[cell]);
    } else {
      pooled_counted += counted[cell];
      pooled_expected += expected[cell];
    }
  }
  if (pooled_expected > 1) add(pooled_counted, pooled_expected);
  EXPECT_GT(cells, 20);
  EXPECT_LT(chi_square, cells + 7 * std::sqrt(2.0 * cells)) << cells << " cells, theta_i = " << theta_i;
}

/// The mean of the weights is the albedo: sample, pdf and eval fit together and reach all of the energy.
inline void expect_weights_average_to_albedo(
    const fiber::FiberScattering& fiber, double theta_i, double relative, int samples = 200'000) {
  std::mt19937_64 generator(4);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::array<double, 3> sum{}, square{};
  for (int i = 0; i < samples; ++i) {
    const double a = uniform(generator), b = uniform(generator), c = uniform(generator);
    const auto weight = fiber.sample(theta_i, {a, b, c}).weight;
    for (int k = 0; k < 3; ++k) {
      sum[k] += weight[k];
      square[k] += weight[k] * weight[k];
    }
  }
  const auto albedo = fiber.albedo(theta_i);
  for (int k = 0; k < 3; ++k) {
    const double mean = sum[k] / samples;
    const double deviation = std::sqrt((square[k] / samples - mean * mean) / samples);
    EXPECT_NEAR(mean, albedo[k], 5 * deviation + 1e-12) << "colour " << k << ", theta_i = " << theta_i;
    EXPECT_LT(deviation, relative * albedo[k]) << "the weights scatter too much to say anything";
  }
}

} // namespace scatter::test
