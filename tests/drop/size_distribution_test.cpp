#include <scatter/drop/size_distribution.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>

namespace scatter::drop {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// Integral of r^power density by the midpoint rule in ln r.
double integral(const SizeDistribution& sizes, double power, double low_m, double high_m) {
  constexpr int steps = 200000;
  const double width = std::log(high_m / low_m) / steps;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double r = low_m * std::exp((i + 0.5) * width);
    sum += std::pow(r, power + 1) * sizes.density(r);
  }
  return sum * width;
}

TEST(SizeDistribution, MomentsAreIntegralsOfTheDensity) {
  for (const auto& sizes :
       {SizeDistribution::lognormal(10e-6, 1.5), SizeDistribution::gamma(2.5, 3e3),
        SizeDistribution::gamma_effective(10e-6, 0.12), SizeDistribution::marshall_palmer(5)})
    for (const double power : {0.0, 1.0, 2.0, 3.0, 6.0})
      EXPECT_NEAR(integral(sizes, power, 1e-16, 1) / sizes.moment(power), 1, 1e-9)
          << sizes.name() << " power " << power;
}

TEST(SizeDistribution, MarshallPalmerHasItsClosedForms) {
  const auto sizes = SizeDistribution::marshall_palmer(25);
  const double lambda = 4.1 * std::exp(-0.21 * std::log(25.0)); // mm^-1
  EXPECT_NEAR(lambda, 2.0856, 1e-4);
  EXPECT_NEAR(sizes.number_per_m3(), 8000 / lambda, 1e-9);
  EXPECT_NEAR(sizes.moment(1), 0.5e-3 / lambda, 1e-16);                 // mean diameter 1/lambda
  EXPECT_NEAR(sizes.effective_radius_m(), 1.5e-3 / lambda, 1e-15);      // 3 / (2 lambda)
  EXPECT_NEAR(sizes.effective_variance(), 1.0 / 3, 1e-12);              // 1 / (mu + 3)
  EXPECT_NEAR(sizes.moment(3), 6.0 / 8e9 / std::pow(lambda, 3), 1e-21); // 3! / (2 lambda)^3
}

TEST(SizeDistribution, EffectiveRadiusAndVarianceComeBack) {
  const auto sizes = SizeDistribution::gamma_effective(12e-6, 0.08);
  EXPECT_NEAR(sizes.effective_radius_m() / 12e-6, 1, 1e-12);
  EXPECT_NEAR(sizes.effective_variance() / 0.08, 1, 1e-11);
  const auto lognormal = SizeDistribution::lognormal(10e-6, 1.4);
  const double s2 = std::pow(std::log(1.4), 2);
  EXPECT_NEAR(lognormal.effective_radius_m() / (10e-6 * std::exp(2.5 * s2)), 1, 1e-12);
  EXPECT_NEAR(lognormal.effective_variance(), std::expm1(s2), 1e-12);
}

TEST(SizeDistribution, ACutKeepsTheShapeAndCountsAnew) {
  auto sizes = SizeDistribution::marshall_palmer(5);
  const auto whole = sizes;
  sizes.cut(0.1e-3, 1e-3);
  EXPECT_EQ(sizes.density(0.09e-3), 0);
  EXPECT_EQ(sizes.density(1.01e-3), 0);
  EXPECT_NEAR(
      sizes.density(0.2e-3) / sizes.density(0.7e-3), whole.density(0.2e-3) / whole.density(0.7e-3), 1e-9);
  for (const double power : {0.0, 2.0, 3.0})
    EXPECT_NEAR(integral(sizes, power, 0.1e-3, 1e-3) / sizes.moment(power), 1, 1e-8) << power;
  const double two_lambda = 2 * 4.1e3 * std::pow(5, -0.21);
  const double kept = std::exp(-two_lambda * 0.1e-3) - std::exp(-two_lambda * 1e-3);
  EXPECT_NEAR(sizes.number_per_m3() / (whole.number_per_m3() * kept), 1, 1e-9);
}

TEST(SizeDistribution, OutsideItsRangeNothingIsLeft) {
  for (const auto& sizes :
       {SizeDistribution::lognormal(10e-6, 1.5), SizeDistribution::gamma(2.5, 3e3),
        SizeDistribution::marshall_palmer(5)}) {
    const auto [low, high] = sizes.range(1e-6);
    EXPECT_LT(1 - integral(sizes, 2, low, high) / sizes.moment(2), 1e-5) << sizes.name();
    EXPECT_LT(1 - integral(sizes, 4, low, high) / sizes.moment(4), 1e-5) << sizes.name();
    EXPECT_GT(1 - integral(sizes, 4, low, high) / sizes.moment(4), 1e-9) << "no wider than asked for";
  }
}

TEST(SizeDistribution, IsReadAsItIsNamed) {
  for (const char* text :
       {"lognormal:median=1e-05m,sigma=1.3", "gamma:mu=2,lambda=3000/m",
        "marshall-palmer:rate=5mm/h,N0=8000"})
    EXPECT_EQ(parse_size_distribution(text).name(), text);
  EXPECT_EQ(parse_size_distribution("gamma:mu=2,lambda=3/mm").name(), "gamma:mu=2,lambda=3000/m");
  EXPECT_NEAR(
      parse_size_distribution("gamma:effective-radius=10um,effective-variance=0.1").effective_radius_m(),
      10e-6, 1e-17);
  const auto cut = parse_size_distribution("marshall-palmer:rate=5mm/h,from=0.1mm,to=2mm");
  EXPECT_TRUE(cut.is_cut());
  EXPECT_EQ(cut.density(2.1e-3), 0);
}

class SizeList : public testing::Test {
protected:
  SizeDistribution read(const std::string& text) {
    std::ofstream(path_) << text;
    return read_size_list(path_);
  }
  ~SizeList() override { std::filesystem::remove(path_); }
  std::filesystem::path path_ =
      std::filesystem::temp_directory_path() /
      ("scatter_sizes_" + std::to_string(::testing::UnitTest::GetInstance()->random_seed()) + ".csv");
};

TEST_F(SizeList, HoldsUnitsPerValueOrInTheHeader) {
  const auto units = read("# a shower\n10um,1\r\n\n 0.02mm , 3\n");
  EXPECT_THAT(units.radius_m(), ElementsAre(1e-5, 2e-5));
  EXPECT_THAT(units.number(), ElementsAre(1, 3));
  EXPECT_NEAR(units.moment(1), 1.75e-5, 1e-19);
  const auto header = read("radius_um,number\n10,1\n20,3\n");
  EXPECT_NEAR(header.moment(1), 1.75e-5, 1e-19);
}

TEST_F(SizeList, SaysWhereItIsWrong) {
  const auto message = [&](const std::string& text) -> std::string {
    try {
      (void)read(text);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message("10um,1\n20,1\n"), HasSubstr(":2:1: \"20\" has no unit"));
  EXPECT_THAT(message("10um,1\n20um,-1\n"), HasSubstr(":2:6: \"-1\" is negative"));
  EXPECT_THAT(message("10um;1\n"), HasSubstr(":1:1: "));
  EXPECT_THAT(message("radius_mile,number\n"), HasSubstr("no known unit"));
  EXPECT_THAT(message("# nothing\n"), HasSubstr("holds no drops"));
  EXPECT_THAT(message("10um,0\n"), HasSubstr("all its numbers are 0"));
}

} // namespace
} // namespace scatter::drop
