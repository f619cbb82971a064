#include <scatter/exact/extended_partial_waves.hpp>
#include <scatter/exact/partial_waves.hpp>
#include <scatter/optics/errors.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace {

using namespace scatter::exact;
using std::numbers::pi;
using complex = std::complex<double>;

/// Coefficients of size 1 with phases that run like a sphere's, or at random, or that hardly change with n; a
/// few resonant ones; or those of a tiny sphere, each much smaller than the one before.
enum class Kind { rays, random, smooth, resonant, tiny };

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
      } else if (kind == Kind::resonant) {
        a = b = 0;
        if (2 * k == count || 2 * k == count + 1) a = 1;
        if (k + 5 == count) b = {0.5, 0.5};
      } else if (kind == Kind::tiny) {
        a = {1e-9 * std::pow(1e-6, n), 1e-3 * std::pow(1e-6, n)};
        b = 1e-2 * a;
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

/// first, first + step, .. up to last, in thousandths of a thousandth of a degree, as a user's list of
/// decimals.
std::vector<double> decimals(long first, long last, long step) {
  std::vector<double> degrees;
  for (long place = first; place <= last; place += step) degrees.push_back(static_cast<double>(place) / 1e6);
  return degrees;
}

/// Even grids: the half circle with even and odd numbers of steps, parts of it, midpoints, a step that does
/// not divide the right angle, and lists out of order.
std::vector<std::vector<double>> grids() {
  std::vector<std::vector<double>> all = {
      decimals(0, 180'000'000, 500'000),           decimals(0, 180'000'000, 20'000'000),
      decimals(130'000'000, 150'000'000, 12'500),  decimals(50'000, 179'950'000, 100'000),
      decimals(0, 179'900'000, 700'000),           decimals(300'000, 900'000, 300'000),
      decimals(170'000'000, 180'000'000, 250'000), decimals(0, 180'000'000, 800'000)};
  all.push_back(all[3]);
  std::shuffle(all.back().begin(), all.back().end(), std::mt19937(5));
  return all;
}

TEST(SumByFourier, AgreesWithThirtyDigits) {
  for (const auto& degrees : grids()) {
    const auto angles = fold_angles(degrees, AngleUnit::degree);
    for (const Kind kind : {Kind::rays, Kind::random, Kind::smooth, Kind::resonant, Kind::tiny})
      for (const std::size_t count : {1, 2, 3, 17, 65, 1000, 3001}) {
        const Waves waves(kind, count);
        const ExtendedWaves* const exact_set[] = {&waves.exact};
        const auto sums = std::move(
            sum_partial_waves({&waves.rounded, 1}, angles, 1, vector_units()[0], SumMethod::fourier)[0]);
        const auto exact = std::move(sum_partial_waves(exact_set, angles, 0)[0]);
        double worst = 0;
        for (std::size_t i = 0; i < angles.size(); ++i) {
          const double error =
              std::max(std::abs(sums.S1[i] - exact.S1[i]), std::abs(sums.S2[i] - exact.S2[i]));
          ASSERT_LE(error, sums.rounding[i]) << "kind " << static_cast<int>(kind) << ", " << count
                                             << " terms, " << degrees.size() << " angles, " << degrees[i];
          if (error > 0) worst = std::max(worst, error / sums.rounding[i]);
        }
        // Of few angles, all may be exact by chance, or left to the direct sum.
        if (degrees.size() < 100) continue;
        EXPECT_GT(worst, 1e-2) << "an estimate that says too much says nothing: " << static_cast<int>(kind)
                               << ", " << count << ", " << degrees.size();
        if (std::getenv("SCATTER_PRINT_ERRORS"))
          std::printf(
              "%zu angles, kind %d, %zu terms: error up to %.3f of the estimate\n", degrees.size(),
              static_cast<int>(kind), count, worst);
      }
  }
}

TEST(SumByFourier, LargestSpheres) {
  // The whole of a fine grid is summed, some angles are looked at: simple parts of the circle, where the
  // forward peak leaks most, places next to the poles, and any.
  const std::size_t count = 50343;
  for (const long step : {12'500L, 100'000L, 1'000'000L}) {
    const auto degrees = decimals(0, 180'000'000, step);
    const auto angles = fold_angles(degrees, AngleUnit::degree);
    std::vector<std::size_t> looked_at;
    for (const double part : {0.1, 0.2, 0.25, 0.4, 0.5, 0.6, 0.8, 0.9})
      looked_at.push_back(static_cast<std::size_t>(part * static_cast<double>(angles.size() - 1) + 0.5));
    for (std::size_t i = 0; i < 8; ++i)
      looked_at.insert(looked_at.end(), {1 + 17 * i, angles.size() - 2 - 13 * i});
    std::mt19937 random(11);
    for (int i = 0; i < 40; ++i) looked_at.push_back(random() % angles.size());
    std::vector<Angle> some;
    for (const std::size_t i : looked_at) some.push_back(angles[i]);
    for (const Kind kind : {Kind::rays, Kind::random, Kind::smooth}) {
      const Waves waves(kind, count);
      const ExtendedWaves* const exact_set[] = {&waves.exact};
      const auto sums = std::move(
          sum_partial_waves({&waves.rounded, 1}, angles, 0, vector_units()[0], SumMethod::fourier)[0]);
      const auto exact = std::move(sum_partial_waves(exact_set, some, 0)[0]);
      double worst = 0, largest = 0;
      for (std::size_t i = 0; i < some.size(); ++i) {
        const std::size_t at = looked_at[i];
        const double error =
            std::max(std::abs(sums.S1[at] - exact.S1[i]), std::abs(sums.S2[at] - exact.S2[i]));
        EXPECT_LE(error, sums.rounding[at]) << static_cast<int>(kind) << ", theta = " << degrees[at];
        worst = std::max(worst, error / sums.rounding[at]);
        largest = std::max(largest, error / std::max(std::abs(exact.S1[i]), std::abs(exact.S2[i])));
      }
      EXPECT_GT(worst, 0.02) << static_cast<int>(kind);
      // Smooth coefficients leave next to nothing beside the forward peak: 1 of 1e8.
      EXPECT_LE(largest, kind == Kind::smooth ? 1e-8 : 2e-12) << static_cast<int>(kind);
      if (std::getenv("SCATTER_PRINT_ERRORS"))
        std::printf(
            "step %g deg, kind %d: error %.1e, up to %.3f of the estimate\n", static_cast<double>(step) / 1e6,
            static_cast<int>(kind), largest, worst);
    }
  }
}

TEST(SumByFourier, ThreadsOrderAndSetsChangeNothing) {
  const auto degrees = decimals(20'000'000, 180'000'000, 50'000);
  std::vector<PartialWaves> sets;
  for (std::size_t i = 0; i < 3; ++i) sets.push_back(Waves(i % 2 ? Kind::rays : Kind::random, 3000).rounded);
  const auto sum = [&](const std::vector<double>& list, int threads) {
    return sum_partial_waves(
        sets, fold_angles(list, AngleUnit::degree), threads, vector_units()[0], SumMethod::fourier);
  };
  const auto one = sum(degrees, 1), many = sum(degrees, 5);
  auto shuffled = degrees;
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(2));
  const auto mixed = sum(shuffled, 2);
  for (std::size_t set = 0; set < sets.size(); ++set) {
    EXPECT_EQ(one[set].S1, many[set].S1);
    EXPECT_EQ(one[set].S2, many[set].S2);
    EXPECT_EQ(one[set].rounding, many[set].rounding);
    EXPECT_EQ(one[set].largest_partial, many[set].largest_partial);
    for (std::size_t i = 0; i < shuffled.size(); ++i) {
      const auto at = static_cast<std::size_t>((shuffled[i] - 20) / 0.05 + 0.5);
      ASSERT_EQ(mixed[set].S1[i], one[set].S1[at]) << shuffled[i];
      ASSERT_EQ(mixed[set].S2[i], one[set].S2[at]) << shuffled[i];
    }
  }
  EXPECT_EQ(one[0].S1, one[2].S1);
}

TEST(SumByFourier, IsUsedWhereItSaves) {
  const Waves waves(Kind::rays, 4000);
  const auto sum = [&](std::span<const Angle> angles, SumMethod method) {
    return std::move(sum_partial_waves({&waves.rounded, 1}, angles, 0, vector_units()[0], method)[0].S1);
  };
  const auto whole = fold_angles(decimals(0, 180'000'000, 12'500), AngleUnit::degree);
  EXPECT_EQ(sum(whole, SumMethod::cheapest), sum(whole, SumMethod::fourier));
  EXPECT_NE(sum(whole, SumMethod::cheapest), sum(whole, SumMethod::direct));
  // A handful of angles out of a fine grid.
  const auto few = fold_angles(decimals(130'000'000, 130'100'000, 1'250), AngleUnit::degree);
  EXPECT_EQ(sum(few, SumMethod::cheapest), sum(few, SumMethod::direct));
  // No decimals.
  const auto radians = fold_angles(many_degrees(), AngleUnit::degree);
  EXPECT_EQ(sum(radians, SumMethod::cheapest), sum(radians, SumMethod::direct));
  EXPECT_THROW((void)sum(radians, SumMethod::fourier), scatter::InputError);
}

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
