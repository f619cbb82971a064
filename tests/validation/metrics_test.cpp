// The yardsticks themselves: what compare() and average_disc() say of curves whose answers are known.
#include <gtest/gtest.h>
#include <validation/metrics.hpp>

#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace scatter::validation {
namespace {

constexpr double pi = 3.14159265358979323846;

TEST(RippleGrid, ResolvesTheRippleAndKeepsRegionBordersOnTheGrid) {
  for (const double x : {100.0, 965.0, 16534.7}) {
    const ThetaGrid grid = ripple_grid(x, 0.0125);
    EXPECT_LE(grid.step_deg, 0.0125);
    EXPECT_LE(grid.step_deg, 180 / x / 4);
    EXPECT_EQ(grid.theta_deg.front(), 0);
    EXPECT_EQ(grid.theta_deg.back(), 180);
    for (const Region& region : regions())
      for (const double border : {region.from_deg, region.to_deg})
        EXPECT_EQ(grid.theta_deg[static_cast<std::size_t>(std::llround(border / grid.step_deg))], border);
  }
}

TEST(AverageDisc, LeavesConstantsAndStraightLinesAlone) {
  std::vector<double> constant(400, 3.0), straight(400);
  std::iota(straight.begin(), straight.end(), 1.0);
  const auto mean_constant = average_disc(constant, 0.01, 0.5),
             mean_straight = average_disc(straight, 0.01, 0.5);
  for (std::size_t i = 0; i < 400; ++i) EXPECT_NEAR(mean_constant[i], 3, 1e-13);
  for (std::size_t i = 30; i < 370; ++i) EXPECT_NEAR(mean_straight[i], straight[i], 1e-11);
}

TEST(AverageDisc, AveragesASineByTheBesselFunctionOfTheDisc) {
  // The mean of cos(k t) over a disc of radius R is 2 J1(kR)/(kR).
  const double step = 0.002, diameter = 0.5, k = 20;
  std::vector<double> wave;
  for (int i = 0; i <= 5000; ++i) wave.push_back(std::cos(k * (i - 2500) * step));
  const double z = k * diameter / 2;
  EXPECT_NEAR(average_disc(wave, step, diameter)[2500], 2 * std::cyl_bessel_j(1, z) / z, 1e-4);
}

TEST(AverageDisc, SpreadsALineOverTheChordsOfADisc) {
  const double step = 0.001, diameter = 0.4;
  std::vector<double> line(2001, 0.0);
  line[1000] = 1;
  const auto spread = average_disc(line, step, diameter);
  EXPECT_NEAR(std::accumulate(spread.begin(), spread.end(), 0.0), 1, 1e-12);
  // Height of a unit area's semicircle-shaped profile: 2 / (pi R).
  EXPECT_NEAR(spread[1000] / step, 2 / (pi * 0.2), 1e-4);
  EXPECT_NEAR(spread[1100] / step, 2 / (pi * 0.2) * std::sqrt(0.75), 1e-4);
  EXPECT_EQ(spread[1202], 0);
}

TEST(Compare, FindsTheErrorsThatWerePutIn) {
  const ThetaGrid grid = ripple_grid(10, 0.5);
  const std::size_t count = grid.theta_deg.size();
  Curve truth{std::vector<double>(count, 2.0), std::vector<double>(count, -1.0)}; // half polarised
  Curve computed = truth;
  for (std::size_t i = 0; i < count; ++i) {
    computed.s11[i] = 2 * (i % 2 == 0 ? 1.3 : 0.9); // +30 %, -10 %
    computed.s12[i] = -0.6 * computed.s11[i];       // 0.6 instead of 0.5
  }
  const Errors errors = compare(computed, truth, grid, {30, 39.5});
  EXPECT_EQ(errors.angles, 20U);
  EXPECT_NEAR(errors.bias, 0.1, 1e-14);
  EXPECT_NEAR(errors.rms, std::sqrt(0.05), 1e-14);
  EXPECT_NEAR(errors.largest, 0.3, 1e-14);
  EXPECT_NEAR(errors.rms_over_mean, std::sqrt(0.05), 1e-14);
  EXPECT_NEAR(errors.polarisation_rms, 0.1, 1e-14);
  EXPECT_NEAR(errors.polarisation_largest, 0.1, 1e-14);
  const Errors none = compare(truth, truth, grid, {0, 180});
  EXPECT_EQ(none.rms, 0);
  EXPECT_EQ(none.polarisation_rms, 0);
}

TEST(Compare, RefusesWhatHasNoAnswer) {
  const ThetaGrid grid = ripple_grid(10, 0.5);
  const Curve zero{
      std::vector<double>(grid.theta_deg.size(), 0.0), std::vector<double>(grid.theta_deg.size(), 0.0)};
  EXPECT_THROW((void)compare(zero, zero, grid, {0, 180}), std::invalid_argument);
  EXPECT_THROW((void)compare(Curve{}, zero, grid, {0, 180}), std::invalid_argument);
  EXPECT_THROW((void)compare(zero, zero, grid, {30.1, 30.2}), std::invalid_argument);
  EXPECT_THROW((void)root_mean_square({}), std::invalid_argument);
}

} // namespace
} // namespace scatter::validation
