#include "support.hpp"

/// A sphere through the general kernel against the closed form: in the plane of the ray's azimuth every chord
/// turns the ray by pi - 2r.
namespace {

using namespace support;
using real = long double;
constexpr real pi_l = std::numbers::pi_v<real>;

struct ClosedForm {
  std::array<real, 3> direction;
  real path;
  int axis_crossings;
  bool near_axis; ///< the ray leaves so close to the axis that rounding decides how often it crossed it
  real S1, S2;
  real sin_theta;
};

/// The impact parameter is that of the doubles u and v: near the rim the rounding of b would be magnified.
ClosedForm closed_form(double u, double v, double index, int p) {
  const real n = index, b2 = real(u) * u + real(v) * v, b = std::sqrt(b2);
  const real cos_i = std::sqrt(1 - b2), sin_r = b / n, cos_r = std::sqrt(1 - sin_r * sin_r);
  const real i = std::asin(b), r = std::asin(sin_r);
  const real deflection = (p - 1) * pi_l + 2 * i - 2 * p * r; // towards the axis
  ClosedForm ray;
  const real towards = -std::sin(deflection);
  ray.direction = {towards * u / b, towards * v / b, std::cos(deflection)};
  ray.sin_theta = std::abs(towards);
  ray.path = -2 * cos_i + 2 * p * n * cos_r;
  // The ray's place, seen from the centre, turns from pi - i (angle from +z) to -deflection.
  ray.axis_crossings = 0;
  if (p > 0)
    for (int m = -2 * p - 2; m <= 0; ++m)
      if (-deflection < m * pi_l && m * pi_l < pi_l - i) ++ray.axis_crossings;
  ray.near_axis = std::abs(std::sin(deflection)) < 1e-9L;
  const real rs = (cos_i - n * cos_r) / (cos_i + n * cos_r), rp = (n * cos_i - cos_r) / (n * cos_i + cos_r);
  const auto product = [&](real f) {
    real t = p == 0 ? f : 1 - f * f;
    for (int k = 1; k < p; ++k) t *= -f;
    return t;
  };
  ray.S1 = product(rs);
  ray.S2 = product(rp);
  return ray;
}

struct Rays {
  std::vector<double> u, v;
};
Rays fan() {
  Rays rays;
  for (const double b :
       {1e-6, 1e-4, 0.01, 0.1, 0.25, 0.5, 0.7, 0.8, 0.86, 0.9, 0.95, 0.98, 0.99, 0.999, 0.9999, 0.99999,
        0.999999})
    for (int a = 0; a < 48; ++a) {
      // Multiples of 15 deg and others; the axes themselves among them.
      const double azimuth = (a < 24 ? 15.0 * a : 7.3 * a + 1) * degree;
      rays.u.push_back(b * std::cos(azimuth));
      rays.v.push_back(b * std::sin(azimuth));
    }
  return rays;
}

const std::vector<drop::Shape> spheres{
    drop::sphere(0.5e-3), drop::cosine_series(0.5e-3, {0.0}),
    drop::cosine_series(0.5e-3, std::vector<double>(8, 0.0)), drop::spheroid(0.5e-3, 1.0)};
const std::vector<std::string> names{
    "sphere", "series_of_one", "series_of_eight", "spheroid_of_axis_ratio_1"};

class SphereByGeneralKernel : public testing::TestWithParam<std::size_t> {};

TEST_P(SphereByGeneralKernel, AgreesWithTheClosedForm) {
  constexpr int last = 5;
  const Rays rays = fan();
  for (const double n : {1.331, 1.5, 1.05}) {
    Tracer trace = tracer(spheres[GetParam()], 27);
    const auto traced = trace.trace(with_index(n), rays.u, rays.v, last);
    Worst direction, path, diagonal, off_diagonal, crossings;
    for (std::size_t k = 0; k < rays.u.size(); ++k)
      for (int p = 0; p <= last; ++p) {
        const ClosedForm expected = closed_form(rays.u[k], rays.v[k], n, p);
        const TracedRay& ray = traced[k][p];
        const auto where = [&] {
          return "n " + std::to_string(n) + ", order " + std::to_string(p) + ", u " +
                 std::to_string(rays.u[k]) + ", v " + std::to_string(rays.v[k]);
        };
        ASSERT_TRUE(ray.valid) << where();
        for (int c = 0; c < 3; ++c)
          direction.see(double(std::abs(ray.direction[c] - expected.direction[c])), where);
        path.see(double(std::abs(ray.path - expected.path)), where);
        // The scattering plane of a ray near 0 or 180 deg is known to its rounding over sin(theta) only.
        const double plane = std::min(1.0, 4e-16 / double(expected.sin_theta));
        diagonal.see(
            double(std::max(
                std::abs(std::complex<real>(ray.jones.S1) - expected.S1),
                std::abs(std::complex<real>(ray.jones.S2) - expected.S2))),
            where);
        off_diagonal.see(
            std::max(std::abs(ray.jones.S3), std::abs(ray.jones.S4)) / (1 + plane / 1e-12), where);
        if (!expected.near_axis) crossings.see(std::abs(ray.axis_crossings - expected.axis_crossings), where);
      }
    expect_below(direction, 3e-14, "direction");
    expect_below(path, 3e-14, "path");
    expect_below(diagonal, 3e-14, "S1, S2");
    expect_below(off_diagonal, 3e-14, "S3, S4");
    expect_below(crossings, 0.5, "axis crossings");
  }
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, SphereByGeneralKernel, testing::Range<std::size_t>(0, spheres.size()),
    [](const auto& one) { return names[one.param]; });

TEST(SphereByGeneralKernel, TheSunsElevationChangesNothing) {
  const Rays rays = fan();
  const drop::Shape shape = drop::cosine_series(0.5e-3, std::vector<double>(8, 0.0));
  const auto level = tracer(shape, 0).trace(red, rays.u, rays.v, 3);
  for (const double sun : {20.0, 45.0, 90.0}) {
    const auto raised = tracer(shape, sun).trace(red, rays.u, rays.v, 3);
    Worst worst;
    for (std::size_t k = 0; k < rays.u.size(); ++k)
      for (int p = 0; p <= 3; ++p) {
        const auto where = [&] { return "order " + std::to_string(p) + ", ray " + std::to_string(k); };
        for (int c = 0; c < 3; ++c)
          worst.see(std::abs(level[k][p].direction[c] - raised[k][p].direction[c]), where);
        worst.see(std::abs(level[k][p].path - raised[k][p].path), where);
        worst.see(std::abs(level[k][p].jones.S1 - raised[k][p].jones.S1), where);
      }
    expect_below(worst, 1e-12, "sun " + std::to_string(sun));
  }
}

TEST(SphereByGeneralKernel, RaysBeyondTheRimMiss) {
  std::vector<double> u, v;
  for (const double b : {1 + 1e-12, 1.0001, 1.1, 1.4, 5.0})
    for (int a = 0; a < 12; ++a) {
      u.push_back(b * std::cos(30.0 * a * degree));
      v.push_back(b * std::sin(30.0 * a * degree));
    }
  for (const auto& ray : tracer(drop::sphere(0.5e-3)).trace(red, u, v, 3))
    for (const TracedRay& order : ray) EXPECT_FALSE(order.valid);
}

TEST(Absorption, DecaysAlongTheChordsOfASphere) {
  // exp(-2 pi k / lambda) per length, p chords of 2 cos r; the coefficients themselves move by k only.
  const Rays rays = fan();
  const double radius = 0.5e-3, k = 1e-6;
  Tracer trace = tracer(drop::sphere(radius));
  const Light clear = with_index(1.331), absorbing = with_index({1.331, k});
  const auto without = trace.trace(clear, rays.u, rays.v, 5),
             with = trace.trace(absorbing, rays.u, rays.v, 5);
  Worst worst;
  double strongest = 1;
  for (std::size_t i = 0; i < rays.u.size(); ++i)
    for (int p = 0; p <= 5; ++p) {
      const double b = std::hypot(rays.u[i], rays.v[i]), cos_r = std::sqrt(1 - b * b / (1.331 * 1.331));
      const double decay = std::exp(-2 * pi * radius / 650e-9 * k * p * 2 * cos_r);
      strongest = std::min(strongest, decay);
      const auto where = [&] { return "order " + std::to_string(p) + ", b " + std::to_string(b); };
      worst.see(std::abs(with[i][p].jones.S1 - decay * without[i][p].jones.S1), where);
      worst.see(std::abs(with[i][p].jones.S2 - decay * without[i][p].jones.S2), where);
      worst.see(std::abs(with[i][p].path - without[i][p].path), where);
    }
  expect_below(worst, 5 * k, "amplitude");
  EXPECT_LT(strongest, 0.96) << "the decay is far above the tolerance";
}

TEST(Absorption, FadesIntoTheTransparentDrop) {
  const Rays rays = fan();
  for (const drop::Shape& shape : {drop::sphere(0.5e-3), drop::beard_chuang(1e-3)}) {
    Tracer trace = tracer(shape, 20);
    const auto real_index = trace.trace(with_index(1.33), rays.u, rays.v, 4);
    const auto complex_index = trace.trace(with_index({1.33, 1e-9}), rays.u, rays.v, 4);
    Worst worst;
    for (std::size_t i = 0; i < rays.u.size(); ++i)
      for (int p = 0; p <= 4; ++p) {
        const auto where = [&] {
          return shape.name + ", order " + std::to_string(p) + ", u " + std::to_string(rays.u[i]) + ", v " +
                 std::to_string(rays.v[i]);
        };
        ASSERT_EQ(real_index[i][p].valid, complex_index[i][p].valid) << where();
        if (real_index[i][p].valid)
          worst.see(difference(real_index[i][p].jones, complex_index[i][p].jones), where);
      }
    // 2 pi a k / lambda = 1e-5 per radius of path for the larger drop; at most 4 chords of about 2.
    expect_below(worst, 2 * pi * shape.radius_m / 650e-9 * 1e-9 * 10, "amplitude");
  }
}

} // namespace
