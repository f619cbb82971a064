#include "support.hpp"
#include <scatter/optics/errors.hpp>

/// Requests at the ends of what is allowed: finite numbers come out, or one line that says what would be
/// right.
namespace {

using namespace support;
using testing::HasSubstr;

struct HardCase {
  std::string name;
  drop::Shape shape;
};
const std::vector<HardCase> hard_cases{
    {"beard_chuang_3mm", drop::beard_chuang(3e-3)}, {"chuang_beard_3mm", drop::chuang_beard(3e-3)},
    {"axis_ratio_0_5", drop::spheroid(1e-3, 0.5)},  {"axis_ratio_2", drop::spheroid(1e-3, 2)},
    {"umbilic", drop::spheroid(1e-3, 1 / 1.31)},    {"dust", drop::sphere(1e-6)}};

class HardCases : public testing::TestWithParam<std::size_t> {};

TEST_P(HardCases, GiveFiniteNumbers) {
  const HardCase& hard = hard_cases[GetParam()];
  for (const double sun : {0.0, 40.0, 90.0})
    for (const int rays : {2, 3, 16, 61}) {
      Tracing tracing;
      tracing.shape = hard.shape;
      tracing.sun_elevation_deg = sun;
      tracing.rays = rays;
      tracing.orders = {0, 1, 2, 3, 4};
      for (const Search search : {Search::raster, Search::tree}) {
        tracing.search = search;
        Tracer tracer(tracing, device());
        Wanted wanted;
        wanted.matrix = wanted.amplitudes = true;
        if (search == Search::raster) {
          wanted.theta_deg = range(0, 180, 1);
          wanted.phi_deg = range(-180, 180, 10);
        } else {
          wanted.theta_deg = {0, 138, 180};
          wanted.phi_deg = {-180, 90};
          wanted.filter_sigma_deg = 0.5;
          wanted.sun_disc_deg = 0.5;
        }
        const FarField field = far_field(tracer, {500e-9, {1.334, rays == 16 ? 1e-7 : 0}}, wanted);
        const std::string where =
            hard.name + ", sun " + std::to_string(sun) + ", rays " + std::to_string(rays);
        for (const double value : field.phase_function)
          ASSERT_TRUE(std::isfinite(value) && value >= 0) << where;
        for (const double value : field.phase_matrix) ASSERT_TRUE(std::isfinite(value)) << where;
        for (const Amplitude& a : field.amplitude)
          ASSERT_TRUE(std::isfinite(std::norm(a.S1) + std::norm(a.S2) + std::norm(a.S3) + std::norm(a.S4)))
              << where;
        double energy = 0;
        for (const double value : field.order_energy) {
          ASSERT_TRUE(value >= 0 && value <= 1.3) << where << ": " << value;
          energy += value;
        }
        EXPECT_LT(energy, 1.3) << "a grid this coarse may overrate the shadow";
        EXPECT_TRUE(rays < 61 || energy < 1 + 1e-6) << where;
        EXPECT_GT(field.scattering_cross_section, 0) << where;
        EXPECT_LE(field.scattering_cross_section, field.extinction_cross_section * (1 + 1e-12)) << where;
      }
    }
}

TEST_P(HardCases, GiveFiniteNumbersByTheIntegral) {
  const HardCase& hard = hard_cases[GetParam()];
  for (const double sun : {0.0, 40.0, 90.0}) {
    Tracing tracing;
    tracing.shape = hard.shape;
    tracing.sun_elevation_deg = sun;
    tracing.rays = 60;
    tracing.orders = {0, 1, 2, 3};
    Tracer tracer(tracing, device());
    Wanted wanted;
    wanted.integral = wanted.matrix = wanted.amplitudes = true;
    wanted.theta_deg = {20, 120, 150};
    wanted.phi_deg = {0, 90};
    // Of size parameter 1000, which is quick; sizes of a few hundred may end with RunError on shapes like
    // these.
    const double wavelength = 2 * pi * hard.shape.radius_m / 1000;
    const FarField field = far_field(tracer, {wavelength, {1.334, sun == 40 ? 1e-6 : 0}}, wanted);
    const std::string where = hard.name + ", sun " + std::to_string(sun);
    for (const double value : field.phase_function) ASSERT_TRUE(std::isfinite(value) && value >= 0) << where;
    for (const double value : field.phase_matrix) ASSERT_TRUE(std::isfinite(value)) << where;
    for (const Amplitude& a : field.amplitude)
      ASSERT_TRUE(std::isfinite(std::norm(a.S1) + std::norm(a.S2) + std::norm(a.S3) + std::norm(a.S4)))
          << where;
  }
}
INSTANTIATE_TEST_SUITE_P(
    Drops, HardCases, testing::Range<std::size_t>(0, hard_cases.size()),
    [](const auto& one) { return hard_cases[one.param].name; });

TEST(HardRays, TheCentralRayAndThoseBesideItAreFinite) {
  std::vector<double> u, v;
  for (const double b : {0.0, 1e-300, 1e-30, 1e-16, 1e-12, 1e-9, 0.9999999999, 1 - 1e-15, 1.0})
    for (int a = 0; a < 8; ++a) {
      u.push_back(b * std::cos(45 * a * degree));
      v.push_back(b * std::sin(45 * a * degree));
    }
  for (const HardCase& hard : hard_cases)
    for (const double sun : {0.0, 40.0, 90.0})
      for (const auto& rays : tracer(hard.shape, sun).trace(red, u, v, 6))
        for (const TracedRay& ray : rays) {
          if (!ray.valid) continue;
          const auto& d = ray.direction;
          EXPECT_NEAR(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1, 1e-12) << hard.name;
          EXPECT_TRUE(std::isfinite(ray.path)) << hard.name;
          const Amplitude& j = ray.jones;
          EXPECT_LE(std::norm(j.S1) + std::norm(j.S2) + std::norm(j.S3) + std::norm(j.S4), 2 + 1e-9)
              << hard.name;
        }
  // Straight through the centre of a sphere and back.
  const auto through = tracer(drop::sphere(1e-3)).trace(red, std::vector{0.0}, std::vector{0.0}, 2).at(0);
  EXPECT_EQ(through[0].direction[2], -1);
  EXPECT_EQ(through[1].direction[2], 1);
  EXPECT_EQ(through[2].direction[2], -1);
}

std::string refusal(auto&& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(TracerRefuses, WhatItCannotTrace) {
  Tracing tracing;
  tracing.shape = drop::beard_chuang(1e-3);
  const auto with_rays = [&](int rays) {
    tracing.rays = rays;
    return refusal([&] { Tracer(tracing, device()); });
  };
  EXPECT_THAT(with_rays(1), HasSubstr("2 to 20000"));
  EXPECT_THAT(with_rays(-5), HasSubstr("--rays -5"));
  EXPECT_THAT(with_rays(20001), HasSubstr("--rays 20001"));
  tracing.rays = 50;
  tracing.orders = {};
  EXPECT_THAT(refusal([&] { Tracer(tracing, device()); }), HasSubstr("--orders"));
  tracing.orders = {0, 1};
  tracing.search = Search::raster;
  Wanted uneven;
  uneven.theta_deg = {10, 11, 13};
  uneven.phi_deg = {0, 10};
  EXPECT_THAT(refusal([&] { far_field(tracing, red, uneven); }), HasSubstr("--search raster"));
  tracing.search = Search::automatic;
  tracing.interference = false;
  uneven.amplitudes = true;
  EXPECT_THAT(refusal([&] { far_field(tracing, red, uneven); }), HasSubstr("--no-interference"));
}

} // namespace
