#include <scatter/fiber/frame.hpp>
#include <scatter/optics/errors.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace {

using namespace scatter::fiber;
constexpr double pi = std::numbers::pi;

TEST(FiberFrame, IsRightHandedAndOrthonormal) {
  const Frame frame = make_frame({3, 1, 0.5}, {0.2, -4, 1});
  for (const auto& v : {frame.tangent, frame.normal, frame.binormal}) EXPECT_NEAR(glm::length(v), 1, 1e-15);
  EXPECT_NEAR(glm::dot(frame.tangent, frame.normal), 0, 1e-15);
  EXPECT_NEAR(glm::length(glm::cross(frame.tangent, frame.normal) - frame.binormal), 0, 1e-15);
}

TEST(FiberFrame, AnglesFollowTheConventions) {
  const Frame frame = make_frame({1, 0, 0}, {0, 0, 1}); // binormal -y
  const double a = 0.3, b = 1.1;
  const glm::dvec3 w(std::sin(a), -std::cos(a) * std::sin(b), std::cos(a) * std::cos(b));
  EXPECT_NEAR(inclination(frame, w), a, 1e-15);
  EXPECT_NEAR(azimuth(frame, w), b, 1e-15);
  EXPECT_NEAR(longitudinal_angle(frame, w), std::atan2(std::sin(a), std::cos(a) * std::cos(b)), 1e-15);
  EXPECT_DOUBLE_EQ(angles(frame, w, w).phi, 0);
  EXPECT_DOUBLE_EQ(angles(frame, w, -w).phi, pi); // straight on, and pi rather than -pi
  EXPECT_DOUBLE_EQ(angles(frame, w, -w).theta_h(), 0);
  EXPECT_DOUBLE_EQ(angles(frame, w, -w).theta_d(), -a);
}

TEST(FiberFrame, WrapsToHalfOpenTurn) {
  EXPECT_DOUBLE_EQ(wrap_angle(-pi), pi);
  EXPECT_DOUBLE_EQ(wrap_angle(pi), pi);
  EXPECT_NEAR(wrap_angle(7), 7 - 2 * pi, 1e-15);
  EXPECT_DOUBLE_EQ(azimuth(Frame{}, {1, 0, 0}), 0);
  EXPECT_DOUBLE_EQ(longitudinal_angle(Frame{}, {0, 1, 0}), 0);
}

TEST(FiberFrame, RefusesWhatHasNoDirection) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW((void)make_frame({0, 0, 0}, {0, 0, 1}), scatter::InputError);
  EXPECT_THROW((void)make_frame({1, 0, 0}, {nan, 0, 1}), scatter::InputError);
  EXPECT_THROW((void)make_frame({1, 2, 3}, {-2, -4, -6}), scatter::InputError);
  EXPECT_NO_THROW((void)make_frame({1e-300, 0, 0}, {0, 1e300, 0}));
}

} // namespace
