// Rays in an ellipse: against a tracer in three dimensions with 50 digits (make_ellipse_truth.py), the circle
// where it is one, energy, reciprocity, and integrals of the distribution.
#include <scatter/fiber/elliptical_section.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/errors.hpp>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

namespace {

using namespace scatter::fiber;
constexpr double pi = std::numbers::pi;

TEST(EllipticalSection, AgreesWithATracerOfFiftyDigits) {
  std::ifstream file(SCATTER_ELLIPSE_TRUTH);
  const auto data = nlohmann::json::parse(file);
  // N is computed in long double: one rounding of each input moves it by this times its condition, which the
  // truth has; every surface rounds a few times.
  constexpr double rounding = static_cast<double>(std::numeric_limits<long double>::epsilon());
  int lit = 0, caustic = 0;
  double worst = 0, worst_plain = 0, worst_moment = 0;
  for (const auto& row : data.at("cases")) {
    const EllipticalSection section(row.at("eta"), row.at("sigma_a"), row.at("axis_ratio"));
    const double theta_d = row.at("theta_d"), phi_i = row.at("phi_i");
    const int order = row.at("order");
    const std::string name =
        row.at("axis_ratio").dump() + " " + row.at("theta_d").dump() + " order " + std::to_string(order);
    const auto caustics = section.caustics(order, theta_d, phi_i);
    ASSERT_EQ(caustics.size(), row.at("caustics").size()) << name;
    for (std::size_t k = 0; k < caustics.size(); ++k)
      EXPECT_NEAR(caustics[k], row.at("caustics")[k].get<double>(), 1e-14) << name;
    caustic += static_cast<int>(caustics.size());
    for (std::size_t i = 0; i < row.at("phi").size(); ++i) {
      const double phi = row.at("phi")[i], expected = row.at("N")[i], condition = row.at("condition")[i];
      const double error = std::abs(section.distribution(order, theta_d, phi_i, phi) - expected);
      EXPECT_LE(error, (1e-12 + 4 * (order + 1) * rounding * condition) * expected)
          << name << " phi " << phi << " condition " << condition;
      if (!(expected > 0)) continue;
      worst = std::max(worst, error / expected);
      if (condition < 1e5) worst_plain = std::max(worst_plain, error / expected);
      ++lit;
    }
    const OrderMoments moments = section.moments(order, theta_d, phi_i);
    const auto& expected = row.at("moments");
    const double values[] = {moments.energy, moments.forward, moments.forward_half};
    for (std::size_t k = 0; k < 3; ++k) {
      const double error = std::abs(values[k] - expected[k].get<double>()) / expected[0].get<double>();
      EXPECT_LE(error, 1e-12) << name << " moment " << k;
      worst_moment = std::max(worst_moment, error);
    }
  }
  EXPECT_GT(lit, 250);
  EXPECT_GT(caustic, 40);
  std::printf(
      "worst: N %.2g, of condition below 1e5 %.2g; moments %.2g of the energy; %d values, %d caustics\n",
      worst, worst_plain, worst_moment, lit, caustic);
}

TEST(EllipticalSection, IsTheCircleAtAxisRatioOne) {
  const EllipticalSection ellipse(1.55, 0.2, 1);
  const RaySection circle(1.55, 0.2);
  int lit = 0;
  for (const double theta_d : {0.0, 0.5, -1.0})
    for (const double phi_i : {0.0, 0.7, 2.9})
      for (int order = 0; order <= 4; ++order) {
        for (const double phi : {0.05, 0.2, 1.1, -1.1, 2.3, 3.0}) {
          const double expected = circle.distribution(order, theta_d, phi);
          EXPECT_NEAR(ellipse.distribution(order, theta_d, phi_i, phi), expected, 1e-12 * expected)
              << theta_d << " " << phi_i << " order " << order << " phi " << phi;
          lit += expected > 0 ? 1 : 0;
        }
        const OrderMoments found = ellipse.moments(order, theta_d, phi_i),
                           moments = circle.moments(order, theta_d);
        EXPECT_NEAR(found.energy, moments.energy, 1e-13);
        EXPECT_NEAR(found.forward, moments.forward, 1e-13);
        EXPECT_NEAR(found.forward_half, moments.forward_half, 1e-13);
        const auto caustics = ellipse.caustics(order, theta_d, phi_i),
                   expected = circle.caustics(order, theta_d);
        ASSERT_EQ(caustics.size(), 2 * expected.size());
        if (!expected.empty()) {
          EXPECT_NEAR(caustics[1], expected[0], 1e-14);
          EXPECT_NEAR(caustics[0], -expected[0], 1e-14);
        }
      }
  EXPECT_GT(lit, 80);
  EXPECT_NEAR(ellipse.residual_energy(3, 0.5, 0.7), circle.residual_energy(3, 0.5), 1e-11);
}

TEST(EllipticalSection, WhiteFurnaceIsOne) {
  double worst = 0;
  for (const double eta : {1.33, 1.55, 2.4})
    for (const double axis_ratio : {0.999, 0.7, 0.3, 0.1})
      for (const double theta_d : {0.3, -1.4})
        for (const double phi_i : {0.0, 0.4}) {
          const EllipticalSection section(eta, 0, axis_ratio);
          double sum = 0;
          for (int order = 0; order <= 8; ++order) {
            sum += section.moments(order, theta_d, phi_i).energy;
            const double error = std::abs(sum + section.residual_energy(order + 1, theta_d, phi_i) - 1);
            EXPECT_LE(error, 1e-12) << eta << " " << axis_ratio << " " << theta_d << " " << phi_i << " order "
                                    << order;
            worst = std::max(worst, error);
          }
        }
  std::printf("worst: %.2g\n", worst);
}

TEST(EllipticalSection, ResidualIsTheSumOfItsOrders) {
  double worst = 0;
  for (const double sigma_a : {0.01, 0.4})
    for (const double axis_ratio : {0.999, 0.7, 0.3}) {
      const EllipticalSection grey(1.55, sigma_a, axis_ratio);
      const double all = grey.residual_energy(2, 0.3, 0.4);
      double sum = 0;
      for (int order = 2; order <= 8; ++order) {
        sum += grey.moments(order, 0.3, 0.4).energy;
        const double error = std::abs(sum + grey.residual_energy(order + 1, 0.3, 0.4) - all);
        EXPECT_LE(error, 1e-10) << sigma_a << " " << axis_ratio << " order " << order;
        worst = std::max(worst, error);
      }
      EXPECT_GT(sum, 1e-3);
    }
  std::printf("worst: %.2g\n", worst);
}

TEST(EllipticalSection, IsReciprocalOrderByOrder) {
  int lit = 0;
  for (const double axis_ratio : {0.9, 0.6, 0.2}) {
    const EllipticalSection section(1.55, 0.3, axis_ratio);
    for (int order = 0; order <= 8; ++order)
      for (const double phi_i : {0.3, 1.2})
        for (const double phi_o : {0.5, 1.9, 2.8, -1.6, -2.9}) {
          const double there = section.width(phi_i) * section.distribution(order, 0.4, phi_i, phi_o - phi_i);
          const double back = section.width(phi_o) * section.distribution(order, 0.4, phi_o, phi_i - phi_o);
          EXPECT_NEAR(there, back, 1e-11 * back) << axis_ratio << " order " << order;
          lit += there > 0 ? 1 : 0;
        }
  }
  EXPECT_GT(lit, 150);
}

TEST(EllipticalSection, TurnsWithItsMirrorImages) {
  const EllipticalSection section(1.55, 0.1, 0.7);
  for (int order = 0; order <= 3; ++order)
    for (const double phi : {0.3, 2.6}) {
      const double N = section.distribution(order, 0.2, 0.5, phi);
      EXPECT_NEAR(section.distribution(order, 0.2, -0.5, -phi), N, 1e-12 * N);
      EXPECT_NEAR(section.distribution(order, 0.2, 0.5 + pi, phi), N, 1e-12 * N);
      EXPECT_NEAR(section.distribution(order, -0.2, 0.5, phi), N, 1e-12 * N);
    }
}

TEST(EllipticalSection, MomentsAreIntegralsOfTheDistribution) {
  const EllipticalSection section(1.55, 0.1, 0.95);
  const double theta_d = 0.2, phi_i = 0.6;
  for (const int order : {0, 1}) { // without caustics here midpoints do
    ASSERT_TRUE(section.caustics(order, theta_d, phi_i).empty());
    double energy = 0, forward = 0;
    constexpr int count = 600;
    for (int i = 0; i < count; ++i) {
      const double phi = -pi + 2 * pi * (i + 0.5) / count;
      const double N = section.distribution(order, theta_d, phi_i, phi) * 2 * pi / count;
      energy += N;
      forward += N * std::abs(phi) / pi;
    }
    const OrderMoments moments = section.moments(order, theta_d, phi_i);
    EXPECT_NEAR(energy, moments.energy, 2e-5) << order;
    EXPECT_NEAR(forward, moments.forward, 2e-5) << order;
  }
}

TEST(EllipticalSection, EvenTTMayHaveCaustics) {
  const EllipticalSection section(1.55, 0, 0.8);
  EXPECT_EQ(section.caustics(1, 0.2, 0.6).size(), 2U);
  EXPECT_TRUE(section.caustics(1, 0.2, 0).empty());
}

TEST(EllipticalSection, GlintsMoveWithTheSection) {
  // Eccentric hair shows its glints elsewhere: section 4.6.1 of the dissertation lets artists place them.
  const EllipticalSection section(1.55, 0.1, 0.85);
  const auto along = section.caustics(2, 0, 0), across = section.caustics(2, 0, pi / 2);
  ASSERT_FALSE(along.empty());
  ASSERT_FALSE(across.empty());
  EXPECT_GT(std::abs(along.back() - across.back()), 0.1);
  EXPECT_NEAR(along.back(), -along.front(), 1e-9);
}

TEST(EllipticalSection, RefusesWhatIsNoFiber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(EllipticalSection(1, 0, 1), scatter::InputError);
  EXPECT_THROW(EllipticalSection(1.5, -1, 1), scatter::InputError);
  for (const double ratio : {0.0, 0.05, 1.1, -1.0, nan})
    EXPECT_THROW(EllipticalSection(1.5, 0, ratio), scatter::InputError);
  const EllipticalSection section(1.5, 0, 0.8);
  EXPECT_THROW((void)section.distribution(0, pi / 2, 0, 0), scatter::InputError);
  EXPECT_THROW((void)section.distribution(0, 0, nan, 0), scatter::InputError);
  EXPECT_THROW((void)section.distribution(0, 0, 0, nan), scatter::InputError);
  EXPECT_THROW((void)section.moments(65, 0, 0), scatter::InputError);
  EXPECT_THROW((void)section.residual_energy(-1, 0, 0), scatter::InputError);
}

} // namespace
