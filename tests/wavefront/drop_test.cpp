#include "reference_tracer.hpp"
#include "support.hpp"

/// Rays through deformed drops against an independent tracer in long double (reference_tracer.hpp).
namespace {

using namespace support;

struct Case {
  std::string name;
  drop::Shape shape;
  double sun;
  double index;
};
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const double sun : {0.0, 20.0, 40.0, 90.0}) {
    const std::string at = "_sun_" + std::to_string(static_cast<int>(sun));
    all.push_back({"spheroid_0_90" + at, drop::spheroid(0.5e-3, 0.9), sun, 1.333});
    all.push_back({"spheroid_1_10" + at, drop::spheroid(0.5e-3, 1.1), sun, 1.333});
    all.push_back({"beard_chuang_1mm" + at, drop::beard_chuang(1e-3), sun, 1.331});
    all.push_back({"chuang_beard_1_5mm" + at, drop::chuang_beard(1.5e-3), sun, 1.343});
  }
  return all;
}

/// Incident points over the drop's disc, out to where some rays miss.
struct Points {
  std::vector<double> u, v;
};
Points in_the_symmetry_plane() {
  Points points;
  for (int i = -60; i <= 60; ++i) {
    points.u.push_back(i == 0 ? 1e-7 : i * 0.0171);
    points.v.push_back(0);
  }
  return points;
}
Points over_the_disc() {
  Points points;
  for (int i = 0; i < 160; ++i) {
    // A spiral of Fibonacci: even over the disc, no symmetry.
    const double r = 1.06 * std::sqrt((i + 0.5) / 160), angle = i * 2.399963229728653;
    points.u.push_back(r * std::cos(angle));
    points.v.push_back(r * std::sin(angle));
  }
  return points;
}

class RaysThroughDrops : public testing::TestWithParam<Case> {
protected:
  void compare(const Points& points, int last) {
    const Case& drop = GetParam();
    Tracer trace = tracer(drop.shape, drop.sun);
    const auto traced = trace.trace(with_index(drop.index), points.u, points.v, last);
    const reference::Surface surface(drop.shape, drop.sun);
    Worst direction, path, amplitude;
    int left = 0, total = 0;
    for (std::size_t k = 0; k < points.u.size(); ++k) {
      const auto expected = reference::trace(surface, drop.index, points.u[k], points.v[k], last);
      if (expected.empty()) {
        for (const TracedRay& ray : traced[k])
          EXPECT_FALSE(ray.valid) << "misses: u " << points.u[k] << ", v " << points.v[k];
        continue;
      }
      for (int p = 0; p <= last; ++p) {
        const auto where = [&] {
          return "order " + std::to_string(p) + ", u " + std::to_string(points.u[k]) + ", v " +
                 std::to_string(points.v[k]);
        };
        const TracedRay& ray = traced[k][p];
        ASSERT_EQ(ray.valid, expected[p].valid) << where();
        if (!ray.valid) {
          ++total;
          continue;
        }
        ++left;
        const auto& d = expected[p].direction;
        const double exact[] = {double(d.x), double(d.y), double(d.z)};
        double off = 0;
        for (int c = 0; c < 3; ++c) off = std::max(off, std::abs(ray.direction[c] - exact[c]));
        direction.see(off, where);
        path.see(std::abs(ray.path - double(expected[p].path)), where);
        const auto rounded = [](reference::complex z) {
          return std::complex<double>(double(z.real()), double(z.imag()));
        };
        const Amplitude jones{
            rounded(expected[p].S1), rounded(expected[p].S2), rounded(expected[p].S3),
            rounded(expected[p].S4)};
        // The scattering plane turns by the error of the direction over sin(theta).
        const double sine = std::max(std::hypot(exact[0], exact[1]), 1e-12);
        amplitude.see(difference(ray.jones, jones) / (1 + 0.01 / sine), where);
      }
    }
    expect_below(direction, 1e-11, "direction");
    expect_below(path, 1e-11, "path");
    expect_below(amplitude, 1e-11, "Jones matrix");
    EXPECT_GT(left, static_cast<int>(points.u.size()) * 2) << total << " reflected totally";
  }
};

TEST_P(RaysThroughDrops, InTheVerticalPlane) {
  compare(in_the_symmetry_plane(), 4);
}

TEST_P(RaysThroughDrops, OverTheWholeDisc) {
  compare(over_the_disc(), 3);
}

const std::vector<Case> all_cases = cases();
INSTANTIATE_TEST_SUITE_P(Drops, RaysThroughDrops, testing::ValuesIn(all_cases), [](const auto& one) {
  return one.param.name;
});
void PrintTo(const Case& drop, std::ostream* out) {
  *out << drop.name;
}

/// From a reflected ray alone: the point that it came from follows from its path, and has to lie on the polar
/// curve; the mirror's normal, halfway between, has to be the curve's.
TEST(ReflectedRays, ComeFromTheSurfaceAndItsNormal) {
  for (const Case& drop : all_cases) {
    const Points points = over_the_disc();
    Tracer trace = tracer(drop.shape, drop.sun);
    const auto traced = trace.trace(with_index(drop.index), points.u, points.v, 0);
    const double h = drop.sun * degree;
    Worst surface, normal;
    for (std::size_t k = 0; k < points.u.size(); ++k) {
      const TracedRay& ray = traced[k][0];
      if (!ray.valid) continue;
      const auto& d = ray.direction;
      const double u = points.u[k], v = points.v[k], z = (ray.path + u * d[0] + v * d[1]) / (1 - d[2]);
      const double down = u * std::cos(h) + z * std::sin(h);
      const double across_x = u - down * std::cos(h), across_z = z - down * std::sin(h);
      const double rho = std::sqrt(across_x * across_x + v * v + across_z * across_z);
      const double theta = std::atan2(rho, down);
      const auto where = [&] { return drop.name + ", u " + std::to_string(u) + ", v " + std::to_string(v); };
      // 1 - d_z is small where the ray grazes, and divides the path's rounding.
      if (1 - d[2] < 1e-3) continue;
      surface.see(std::abs(std::hypot(rho, down) - drop.shape.radius(theta)), where);
      // The curve's tangent (d rho, d down) and the normal's part in the meridian are at right angles.
      const double length = std::sqrt(2 * (1 - d[2]));
      const double n[] = {d[0] / length, d[1] / length, (d[2] - 1) / length};
      const double n_down = n[0] * std::cos(h) + n[2] * std::sin(h);
      const double n_rho = (across_x * n[0] + v * n[1] + across_z * n[2]) / rho;
      const double r = drop.shape.radius(theta), slope = drop.shape.slope(theta);
      const double t_down = slope * std::cos(theta) - r * std::sin(theta);
      const double t_rho = slope * std::sin(theta) + r * std::cos(theta);
      normal.see(std::abs(n_down * t_down + n_rho * t_rho) / std::hypot(t_down, t_rho), where);
    }
    expect_below(surface, 1e-12, "point");
    expect_below(normal, 1e-12, "normal");
  }
}

/// Light that goes in comes out: the orders of one ray add up to it, but for what stays inside by total
/// reflection.
TEST(EnergyOfARay, AddsUpOverTheOrders) {
  constexpr int last = 40;
  for (const auto& [shape, sun] : std::vector<std::pair<drop::Shape, double>>{
           {drop::sphere(0.5e-3), 0}, {drop::beard_chuang(0.5e-3), 20}, {drop::spheroid(0.5e-3, 0.95), 40}}) {
    Points points = over_the_disc();
    const auto traced = tracer(shape, sun).trace(with_index(1.333), points.u, points.v, last);
    Worst too_much, missing;
    for (std::size_t k = 0; k < points.u.size(); ++k) {
      if (!traced[k][0].valid) continue;
      double sum = 0;
      bool escapes = true;
      for (const TracedRay& ray : traced[k]) {
        escapes &= ray.valid;
        const Amplitude& j = ray.jones;
        if (ray.valid) sum += (std::norm(j.S1) + std::norm(j.S2) + std::norm(j.S3) + std::norm(j.S4)) / 2;
      }
      const auto where = [&] {
        return shape.name + ", u " + std::to_string(points.u[k]) + ", v " + std::to_string(points.v[k]);
      };
      too_much.see(std::max(sum - 1, 0.0), where);
      if (escapes && std::hypot(points.u[k], points.v[k]) < 0.9) missing.see(1 - sum, where);
    }
    expect_below(too_much, 1e-12, "energy gained");
    // Within 0.9 the inner reflectivity stays below 0.5, so that 0.5^40 is left.
    expect_below(missing, 1e-11, "energy lost");
  }
}

} // namespace
