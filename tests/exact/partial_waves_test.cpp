#include <scatter/exact/extended_partial_waves.hpp>
#include <scatter/exact/partial_waves.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace {

using namespace scatter::exact;
using std::numbers::pi;
using complex = std::complex<double>;

/// Coefficients of size 1 with phases that run like a sphere's, or at random, or that hardly change with n.
enum class Kind { rays, random, smooth };

struct Waves {
  PartialWaves rounded;
  ExtendedWaves exact;

  Waves(Kind kind, std::size_t count) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> turn(0, 2 * pi);
    for (std::size_t k = 1; k <= count; ++k) {
      const double n = static_cast<double>(k), size = static_cast<double>(count), edge = n / size;
      complex a = 1, b = 1;
      if (kind == Kind::rays) {
        const double phase = 4 * size * std::sqrt(std::max(0.0, 1.8 - edge * edge));
        a = std::polar(0.5, phase);
        b = std::polar(0.7, phase + 0.3);
      } else if (kind == Kind::random) {
        a = std::polar(1.0, turn(random));
        b = std::polar(1.0, turn(random));
      } else {
        a = {1 - edge * edge, 0.1};
        b = {1 - edge * edge, 0.2};
      }
      const double factor = (2 * n + 1) / (n * (n + 1)) / 2;
      const complex plus = factor * (a + b), minus = factor * (a - b);
      rounded.add(plus, minus);
      exact.waves.push_back({{plus.real(), 0}, {plus.imag(), 0}, {minus.real(), 0}, {minus.imag(), 0}});
    }
  }
};

/// Dense near the axis and where the form of the sum changes; mirrored or not.
std::vector<double> many_degrees() {
  std::vector<double> degrees;
  for (double angle = 1e-7; angle < 8; angle *= 1.7) degrees.insert(degrees.end(), {angle, 180 - angle});
  for (int i = 0; i <= 720; ++i) degrees.push_back(i / 4.0 + (i % 3 == 1 ? 1e-3 : 0));
  return degrees;
}

class VectorUnits : public testing::TestWithParam<std::size_t> {
protected:
  const VectorUnit& unit = vector_units()[GetParam()];
};

TEST_P(VectorUnits, AgreeWithThirtyDigits) {
  const auto angles = fold_angles(many_degrees(), AngleUnit::degree);
  for (const Kind kind : {Kind::rays, Kind::random, Kind::smooth})
    for (const std::size_t count : {1, 2, 3, 17, 64, 65, 1000, 6001}) {
      const Waves waves(kind, count);
      const ExtendedWaves* const exact_set[] = {&waves.exact};
      const auto sums = std::move(sum_partial_waves({&waves.rounded, 1}, angles, 1, unit)[0]);
      const auto exact = std::move(sum_partial_waves(exact_set, angles, 0)[0]);
      double worst = 0;
      for (std::size_t i = 0; i < angles.size(); ++i) {
        const double error = std::max(std::abs(sums.S1[i] - exact.S1[i]), std::abs(sums.S2[i] - exact.S2[i]));
        const double estimate = sum_rounding(count) * std::sqrt(sums.largest_partial[i]);
        ASSERT_LE(error, estimate) << unit.name << ", " << count << " terms, theta = " << angles[i].theta;
        worst = std::max(worst, error / estimate);
      }
      EXPECT_GT(worst, 1e-3) << "an estimate that says too much says nothing: " << unit.name << ", " << count;
      if (std::getenv("SCATTER_PRINT_ERRORS"))
        std::printf(
            "%s, kind %d, %zu terms: error up to %.3f of the estimate\n", unit.name, static_cast<int>(kind),
            count, worst);
    }
}

TEST_P(VectorUnits, AnglesAndSetsDoNotDisturbEachOther) {
  const auto angles = fold_angles(many_degrees(), AngleUnit::degree);
  // More sets than go side by side.
  std::vector<PartialWaves> sets;
  for (std::size_t i = 0; i < 11; ++i) sets.push_back(Waves(i % 2 ? Kind::rays : Kind::random, 300).rounded);
  const auto together = sum_partial_waves(sets, angles, 0, unit);
  for (const std::size_t set : {0, 1, 10}) {
    const auto alone = std::move(sum_partial_waves({&sets[set], 1}, angles, 1, unit)[0]);
    EXPECT_EQ(alone.S1, together[set].S1);
    EXPECT_EQ(alone.S2, together[set].S2);
    EXPECT_EQ(alone.largest_partial, together[set].largest_partial);
    for (std::size_t i = 0; i < angles.size(); i += 7) {
      const auto one = std::move(sum_partial_waves({&sets[set], 1}, {&angles[i], 1}, 1, unit)[0]);
      EXPECT_EQ(one.S1[0], alone.S1[i]) << angles[i].theta;
      EXPECT_EQ(one.S2[0], alone.S2[i]) << angles[i].theta;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Machine, VectorUnits, testing::Range(std::size_t{0}, vector_units().size()));

TEST(FoldAngles, EvenGridsAreSymmetric) {
  std::vector<double> degrees;
  for (int i = 0; i <= 1800; ++i) degrees.push_back(i / 10.0);
  std::shuffle(degrees.begin(), degrees.end(), std::mt19937(3));
  const auto angles = fold_angles(degrees, AngleUnit::degree);
  std::vector<const Angle*> sorted;
  for (const auto& angle : angles) sorted.push_back(&angle);
  std::sort(sorted.begin(), sorted.end(), [](auto* a, auto* b) { return a->theta < b->theta; });
  for (std::size_t i = 0; i <= 1800; ++i) {
    const Angle &angle = *sorted[i], &mirror = *sorted[1800 - i];
    EXPECT_EQ(angle.t, mirror.t);
    EXPECT_EQ(angle.t_rest, mirror.t_rest);
    EXPECT_EQ(angle.backward, i > 900);
    // Independent of the tables of sines.
    const long double folded = static_cast<long double>(std::min<std::size_t>(i, 1800 - i));
    const long double half = std::sin(folded * std::numbers::pi_v<long double> / 3600), t = 2 * half * half;
    const long double found = static_cast<long double>(angle.t) + static_cast<long double>(angle.t_rest);
    EXPECT_LE(std::abs(found - t), 1e-18L * t) << angle.theta;
    EXPECT_NEAR(angle.theta + angle.theta_rest, static_cast<double>(i) / 10, 1e-14);
  }
}

TEST(FoldAngles, OtherListsCountAsTheyAre) {
  // No even grid: 0.1 stands for its double, which is 5.55e-18 above.
  for (const std::vector<double>& degrees :
       {std::vector<double>{0.1, 0.3}, {0.1, 0.3, 0.7}, {0.1, 0.1, 0.1}, {0.1, 0.2, 0.30000001}})
    for (const auto& angle : fold_angles(degrees, AngleUnit::degree)) EXPECT_EQ(angle.theta_rest, 0);
  const auto even = fold_angles(std::vector<double>{0.3, 0.1, 0.2}, AngleUnit::degree);
  EXPECT_NEAR(even[1].theta_rest, -5.551115123125783e-18, 1e-20);
}

} // namespace
