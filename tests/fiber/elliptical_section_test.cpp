// Rays in an ellipse: the circle where it is one, energy, reciprocity, and integrals of the distribution.
#include <scatter/fiber/elliptical_section.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/errors.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace {

using namespace scatter::fiber;
constexpr double pi = std::numbers::pi;

TEST(EllipticalSection, IsTheCircleAtAxisRatioOne) {
  const EllipticalSection ellipse(1.55, 0.2, 1);
  const RaySection circle(1.55, 0.2);
  int lit = 0;
  for (const double theta_d : {0.0, 0.5, -1.0})
    for (const double phi_i : {0.0, 0.7, 2.9})
      for (int order = 0; order <= 4; ++order) {
        for (const double phi : {0.05, 0.2, 1.1, -1.1, 2.3, 3.0}) {
          const double expected = circle.distribution(order, theta_d, phi);
          EXPECT_NEAR(ellipse.distribution(order, theta_d, phi_i, phi), expected, 1e-9 * expected + 1e-14)
              << theta_d << " " << phi_i << " order " << order << " phi " << phi;
          lit += expected > 0 ? 1 : 0;
        }
        const OrderMoments found = ellipse.moments(order, theta_d, phi_i),
                           moments = circle.moments(order, theta_d);
        EXPECT_NEAR(found.energy, moments.energy, 1e-12);
        EXPECT_NEAR(found.forward, moments.forward, 1e-11);
        EXPECT_NEAR(found.forward_half, moments.forward_half, 1e-11);
        const auto caustics = ellipse.caustics(order, theta_d, phi_i),
                   expected = circle.caustics(order, theta_d);
        ASSERT_EQ(caustics.size(), 2 * expected.size());
        if (!expected.empty()) {
          EXPECT_NEAR(caustics[1], expected[0], 1e-9);
          EXPECT_NEAR(caustics[0], -expected[0], 1e-9);
        }
      }
  EXPECT_GT(lit, 80);
  EXPECT_NEAR(ellipse.residual_energy(3, 0.5, 0.7), circle.residual_energy(3, 0.5), 1e-11);
}

TEST(EllipticalSection, WhiteFurnaceIsOne) {
  for (const double axis_ratio : {0.95, 0.7, 0.4})
    for (const double phi_i : {0.4, pi / 2}) {
      const EllipticalSection section(1.55, 0, axis_ratio);
      double sum = 0;
      for (int order = 0; order < 3; ++order) sum += section.moments(order, 0.3, phi_i).energy;
      EXPECT_NEAR(sum + section.residual_energy(3, 0.3, phi_i), 1, 1e-10) << axis_ratio << " " << phi_i;
      // The orders after them, one by one, tend to the same.
      for (int order = 3; order < 5; ++order) sum += section.moments(order, 0.3, phi_i).energy;
      EXPECT_NEAR(sum + section.residual_energy(5, 0.3, phi_i), 1, 5e-9);
    }
  // With absorption the residual is a sum of its own.
  const EllipticalSection grey(1.55, 0.4, 0.7);
  double sum = 0;
  for (int order = 2; order < 6; ++order) sum += grey.moments(order, 0.3, 0.4).energy;
  EXPECT_NEAR(grey.residual_energy(2, 0.3, 0.4), sum + grey.residual_energy(6, 0.3, 0.4), 1e-9);
  EXPECT_GT(sum, 1e-3);
}

TEST(EllipticalSection, IsReciprocalOrderByOrder) {
  int lit = 0;
  for (const double axis_ratio : {0.9, 0.6}) {
    const EllipticalSection section(1.55, 0.3, axis_ratio);
    for (int order = 0; order <= 3; ++order)
      for (const double phi_i : {0.3, 1.2})
        for (const double phi_o : {0.5, 1.9, 2.8, -1.6, -2.9}) {
          const double there = section.width(phi_i) * section.distribution(order, 0.4, phi_i, phi_o - phi_i);
          const double back = section.width(phi_o) * section.distribution(order, 0.4, phi_o, phi_i - phi_o);
          EXPECT_NEAR(there, back, 1e-8 * back + 1e-13) << axis_ratio << " order " << order;
          lit += there > 0 ? 1 : 0;
        }
  }
  EXPECT_GT(lit, 40);
}

TEST(EllipticalSection, TurnsWithItsMirrorImages) {
  const EllipticalSection section(1.55, 0.1, 0.7);
  for (int order = 0; order <= 3; ++order)
    for (const double phi : {0.3, 2.6}) {
      const double N = section.distribution(order, 0.2, 0.5, phi);
      EXPECT_NEAR(section.distribution(order, 0.2, -0.5, -phi), N, 1e-9 * N + 1e-13);
      EXPECT_NEAR(section.distribution(order, 0.2, 0.5 + pi, phi), N, 1e-9 * N + 1e-13);
      EXPECT_NEAR(section.distribution(order, -0.2, 0.5, phi), N, 1e-9 * N + 1e-13);
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
