#include "support.hpp"
#include <scatter/exact/debye.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/wavefront/airy_edge.hpp>
#include <scatter/wavefront/shadow.hpp>

#include <cstdio>

/// Order 0 with forward diffraction, against the Debye series, against itself in other coordinates, and
/// against what is known of extinction.
namespace {

using namespace support;

/// Root mean square error over the rms of the truth itself.
struct Error {
  double S1 = 0, S2 = 0;
};
template <typename At>
Error relative_error(
    const exact::DebyeOrder& truth, const std::vector<double>& theta, double first, double last, At&& at) {
  double wrong[2] = {0, 0}, all[2] = {0, 0};
  for (std::size_t i = 0; i < theta.size(); ++i) {
    if (theta[i] < first || theta[i] >= last) continue;
    const Amplitude a = at(i);
    wrong[0] += std::norm(a.S1 - truth.S1[i]);
    all[0] += std::norm(truth.S1[i]);
    wrong[1] += std::norm(a.S2 - truth.S2[i]);
    all[1] += std::norm(truth.S2[i]);
  }
  return {std::sqrt(wrong[0] / all[0]), std::sqrt(wrong[1] / all[1])};
}

exact::DebyeOrder
order_0(double radius_m, const std::vector<double>& theta, std::complex<double> m = red.index) {
  const int orders[] = {0};
  return exact::debye_at_degrees(2 * pi * radius_m / red.wavelength_m, m, orders, theta).orders.at(0);
}

struct Sphere {
  double radius_m, bound;
};
void PrintTo(const Sphere& sphere, std::ostream* to) {
  *to << sphere.radius_m * 1e3 << " mm";
}
class ShadowOfSphere : public testing::TestWithParam<Sphere> {};

TEST_P(ShadowOfSphere, IsDebyesTerm) {
  const auto [radius_m, bound] = GetParam();
  const auto theta = range(0, 180, 0.05);
  const auto truth = order_0(radius_m, theta);
  const Shadow shadow(drop::sphere(radius_m), 0, red);
  // Local errors: in windows of 1 deg, each over what shines there.
  Worst S1, S2, brewster;
  for (double first = 0; first < 180; ++first) {
    const Error e =
        relative_error(truth, theta, first, first + 1, [&](std::size_t i) { return shadow.at(theta[i], 0); });
    const auto where = [&] { return std::to_string(first) + " deg"; };
    S1.see(e.S1, where);
    (first > 59 && first < 90 ? brewster : S2).see(e.S2, where);
  }
  std::printf(
      "%g mm: S1 within %.4f %% (%s), S2 %.4f %% (%s), about Brewster's angle %.4f %%\n", radius_m * 1e3,
      100 * S1.value, S1.where.c_str(), 100 * S2.value, S2.where.c_str(), 100 * brewster.value);
  expect_below(S1, bound, "S1");
  expect_below(S2, 4 * bound, "S2");
  // S2 all but vanishes there.
  expect_below(brewster, 20 * bound, "S2 about Brewster's angle");
}

INSTANTIATE_TEST_SUITE_P(
    Radii, ShadowOfSphere,
    testing::Values(
        Sphere{0.05e-3, 0.0006}, Sphere{0.1e-3, 0.0003}, Sphere{0.4e-3, 0.0001}, Sphere{1e-3, 0.0001}));

TEST(Shadow, HoldsForOtherIndices) {
  const auto theta = range(0, 180, 0.1);
  for (const std::complex<double> m : {std::complex(1.5), std::complex(1.2), std::complex(1.33, 0.05)}) {
    const auto truth = order_0(0.2e-3, theta, m);
    const Shadow shadow(drop::sphere(0.2e-3), 0, with_index(m));
    for (const auto& [first, last] : {std::pair{0, 30}, std::pair{30, 180}}) {
      const Error e =
          relative_error(truth, theta, first, last, [&](std::size_t i) { return shadow.at(theta[i], 0); });
      std::printf(
          "m = %g%+gi, %d..%d deg: %.4f %% %.4f %%\n", m.real(), m.imag(), first, last, 100 * e.S1,
          100 * e.S2);
      EXPECT_LT(e.S1, 0.001) << m;
      EXPECT_LT(e.S2, 0.002) << m;
    }
  }
}

TEST(Shadow, ComesOutOfTheTracer) {
  // The same through the tables, of a sphere traced as a general drop, order by order and in the sum.
  Tracing tracing;
  tracing.shape = drop::cosine_series(0.1e-3, std::vector<double>(8, 0.0));
  tracing.orders = {0};
  tracing.rays = 100;
  Wanted wanted;
  wanted.theta_deg = range(0, 180, 0.5);
  wanted.phi_deg = {0, 50, 180, 300};
  wanted.amplitudes = wanted.per_order = wanted.integral = true;
  const auto truth = order_0(0.1e-3, wanted.theta_deg);
  for (const double sun : {0.0, 40.0, 90.0}) {
    tracing.sun_elevation_deg = sun;
    const FarField field = far_field(tracing, red, wanted);
    for (std::size_t f = 0; f < 4; ++f)
      for (const auto* amplitude : {&field.amplitude, &field.order_amplitude}) {
        const Error e = relative_error(
            truth, wanted.theta_deg, 0, 181, [&](std::size_t i) { return (*amplitude)[i * 4 + f]; });
        EXPECT_LT(e.S1, 1e-4) << sun << " " << f;
        EXPECT_LT(e.S2, 1e-4) << sun << " " << f;
      }
    // Intensity over k^2 times the scattering cross section.
    const double k = 2 * pi / red.wavelength_m;
    EXPECT_NEAR(
        field.phase_function[0] * k * k * field.scattering_cross_section, std::norm(truth.S1[0]),
        1e-4 * std::norm(truth.S1[0]));
  }
}

/// A sphere whose polar curve starts off its centre, by `lift` radii towards theta = 0.
drop::Shape lifted_sphere(double radius_m, double lift) {
  constexpr int terms = 24, samples = 64;
  std::vector<double> c(terms, 0.0);
  for (int s = 0; s < samples; ++s) {
    const double t = pi * (s + 0.5) / samples;
    const double r = lift * std::cos(t) + std::sqrt(1 - lift * lift * std::sin(t) * std::sin(t));
    for (int n = 0; n < terms; ++n) c[n] += (n == 0 ? 1.0 : 2.0) / samples * r * std::cos(n * t);
  }
  c[0] -= 1;
  return drop::cosine_series(radius_m, c);
}

TEST(Shadow, OfAShiftedSphereIsShiftedInPhase) {
  // The outline is then neither about the light nor in a plane, and azimuths are not those of its normals.
  const double radius_m = 0.3e-3, lift = 0.15, sun = 30, ka = 2 * pi * radius_m / red.wavelength_m;
  const Shadow sphere(drop::sphere(radius_m), 0, red), shifted(lifted_sphere(radius_m, lift), sun, red);
  const double to[] = {lift * std::cos(sun * degree), 0, lift * std::sin(sun * degree)};
  Worst near, far;
  for (const double phi : {0.0, 37.0, 90.0, 143.0, 180.0, 290.0})
    for (const double theta : range(0, 178, 0.37)) {
      const double s = std::sin(theta * degree), c = std::cos(theta * degree);
      const double path = to[2] - (s * std::cos(phi * degree) * to[0] + c * to[2]);
      const std::complex<double> phase = std::polar(1.0, ka * path);
      Amplitude a = sphere.at(theta, 0);
      a.S1 *= phase;
      a.S2 *= phase;
      const double scale = std::max(std::abs(a.S1), std::abs(a.S2));
      (theta < 20 ? near : far).see(difference(a, shifted.at(theta, phi)) / scale, [&] {
        return std::to_string(theta) + " deg, phi " + std::to_string(phi);
      });
    }
  std::printf("shifted sphere: %.1e to 20 deg, %.1e beyond\n", near.value, far.value);
  expect_below(near, 1e-5, "edge");
  expect_below(far, 1e-5, "reflection");
}

TEST(Shadow, ExtinguishesByItsAreaAndItsEdge) {
  // Re S(0) of order 0 is k^2 / (2 pi) times the shadow, wider by 0.628 (k rho / 2)^(1/3) / k, rho the radius
  // of curvature along the light: Nussenzveig & Wiscombe (1980, Phys. Rev. Lett. 45, 1490) have 1.9924
  // x^(-2/3) for a sphere's efficiency. What comes next is of order 1/x.
  for (const double radius_m : {0.5e-3, 1.0e-3}) {
    Tracing tracing;
    tracing.shape = drop::beard_chuang(radius_m);
    tracing.sun_elevation_deg = 20;
    tracing.rays = 64;
    const double area = Tracer(tracing, device()).shadow_area(), ka = 2 * pi * radius_m / red.wavelength_m;
    const Amplitude forward = Shadow(tracing.shape, 20, red).at(0, 0);
    const double bare = ka * ka * area / (2 * pi);
    // A circle of that area stands for the outline.
    const double edge = 0.9962 * std::pow(ka, -2.0 / 3);
    const double S = 0.5 * (forward.S1 + forward.S2).real();
    std::printf(
        "%g mm: Re S(0) / (k^2 area / 2 pi) - 1 = %.5f, an edge has %.5f\n", radius_m * 1e3, S / bare - 1,
        edge);
    EXPECT_NEAR(S / bare - 1, edge, 0.1 * edge);
    EXPECT_LT(std::abs(forward.S3), 1e-3 * S);
  }
}

TEST(Shadow, IsReciprocal) {
  // Light and direction exchanged and turned round: in the vertical plane of a spheroid, which is its own
  // mirror image, the sun at h and light that leaves theta further down against the sun at h + theta and
  // light that leaves theta further up. Rims, outlines and curvatures are other ones.
  const drop::Shape shape = drop::spheroid(0.3e-3, 0.8);
  const double ka = 2 * pi * 0.3e-3 / red.wavelength_m;
  Worst worst;
  for (const double h : {0.0, 45.0})
    for (const double theta : range(1, 31, 5)) {
      const Amplitude there = Shadow(shape, h, red).at(theta, 0);
      const Amplitude back = Shadow(shape, h + theta, red).at(theta, 180);
      const double scale = std::max({std::abs(there.S1), std::abs(there.S2), 0.25 * ka});
      worst.see(difference(there, back) / scale, [&] {
        return std::to_string(theta) + " deg, sun " + std::to_string(h);
      });
    }
  std::printf("reciprocity: %.3f %% at %s\n", 100 * worst.value, worst.where.c_str());
  expect_below(worst, 0.02, "reciprocity");
}

TEST(Shadow, DoesNotDependOnWhereTwoPointsTakeOver) {
  // The contour leaves out how curvature changes along the ray, two points leave out 1 / (k a theta).
  struct Case {
    drop::Shape shape;
    double bound;
  };
  const Case cases[] = {
      {drop::beard_chuang(1e-3), 0.003},
      {drop::spheroid(0.2e-3, 0.95), 0.003},
      {drop::spheroid(0.2e-3, 0.8), 0.01}};
  for (const auto& [shape, bound] : cases) {
    const Shadow early(shape, 20, red), late(shape, 20, red, 80);
    const double ka = 2 * pi * shape.radius_m / red.wavelength_m;
    Worst worst;
    for (const double phi : {0.0, 45.0, 90.0, 150.0, 180.0})
      for (const double X : range(25, 160, 0.7)) {
        const double theta = X / ka / degree;
        const Amplitude a = early.at(theta, phi), b = late.at(theta, phi);
        // Over the envelope of the rings, or the reflected ray.
        const double scale = std::max(ka * ka * std::sqrt(2 / pi) * std::pow(X, -1.5), 0.5 * ka);
        worst.see(difference(a, b) / scale, [&] {
          return "k a theta = " + std::to_string(X) + " at phi " + std::to_string(phi);
        });
      }
    std::printf(
        "%s: contour against two points: %.3f %% at %s\n", shape.name.c_str(), 100 * worst.value,
        worst.where.c_str());
    expect_below(worst, bound, "contour against two points");
  }
}

TEST(Shadow, ReflectsLikePatches) {
  // Patches with many rays, away from grazing: geometric optics of the same surface by another route.
  Tracing tracing;
  tracing.shape = drop::beard_chuang(1e-3);
  tracing.sun_elevation_deg = 20;
  tracing.orders = {0};
  tracing.rays = 3000;
  Wanted wanted;
  wanted.theta_deg = range(60, 175, 5);
  wanted.phi_deg = {0, 40, 90, 130, 180};
  wanted.amplitudes = true;
  const FarField field = far_field(tracing, red, wanted);
  const Shadow shadow(tracing.shape, 20, red);
  Worst worst;
  for (std::size_t t = 0; t < wanted.theta_deg.size(); ++t)
    for (std::size_t f = 0; f < 5; ++f) {
      const Amplitude a = shadow.at(wanted.theta_deg[t], wanted.phi_deg[f]), b = field.amplitude[t * 5 + f];
      worst.see(difference(a, b) / std::max(std::abs(a.S1), std::abs(a.S2)), [&] {
        return std::to_string(wanted.theta_deg[t]) + " deg, phi " + std::to_string(wanted.phi_deg[f]);
      });
    }
  std::printf("patches: %.3f %% at %s\n", 100 * worst.value, worst.where.c_str());
  expect_below(worst, 0.01, "patches");
}

TEST(Shadow, RefusesWhatIsNoRaysBusiness) {
  EXPECT_THROW(Shadow(drop::sphere(1e-7), 0, red), InputError);
  EXPECT_THROW(Shadow(drop::sphere(2e-6), 0, red), InputError);
}

TEST(Airy, HasTheTabulatedValues) {
  // Abramowitz & Stegun, table 10.11.
  const double table[][5] = {
      {-1, 0.53556088, 0.10399739, -0.01016057, 0.59237563},
      {0, 0.35502805, 0.61492663, -0.25881940, 0.44828836},
      {1, 0.13529242, 1.20742359, -0.15914744, 0.93243593}};
  for (const auto& [tau, Ai, Bi, Ai_slope, Bi_slope] : table) {
    const Airy a = airy(tau);
    EXPECT_NEAR(a.Ai, Ai, 1e-8) << tau;
    EXPECT_NEAR(a.Bi, Bi, 1e-8) << tau;
    EXPECT_NEAR(a.Ai_slope, Ai_slope, 1e-8) << tau;
    EXPECT_NEAR(a.Bi_slope, Bi_slope, 1e-8) << tau;
  }
  // DLMF 9.2.7
  for (double tau = -30; tau <= 25; tau += 0.7) {
    const Airy a = airy(tau);
    EXPECT_NEAR((a.Ai * a.Bi_slope - a.Ai_slope * a.Bi) * pi, 1, 1e-11) << tau;
  }
}

TEST(Shadow, IsANumberForHardShapes) {
  const drop::Shape shapes[] = {drop::spheroid(0.5e-3, 0.2), drop::spheroid(0.5e-3, 5),
                                drop::chuang_beard(3e-3),    drop::beard_chuang(3e-3),
                                drop::sphere(2.1e-6),        drop::spheroid(5e-6, 0.3)};
  EXPECT_FALSE(shapes[2].is_convex()) << "one of them is to have a dent";
  for (const drop::Shape& shape : shapes)
    for (const std::complex<double> m : {std::complex(1.331), std::complex(0.75), std::complex(1.33, 2.0)})
      for (const double sun : {0.0, 50.0}) {
        const Shadow shadow(shape, sun, with_index(m));
        const double ka = 2 * pi * shape.radius_m / red.wavelength_m;
        for (const double phi : {0.0, 60.0, 180.0}) {
          const auto azimuth = shadow.azimuth(phi);
          for (const double theta : range(0, 180, 1)) {
            const Amplitude a = shadow.at(theta, azimuth);
            for (const auto& S : {a.S1, a.S2, a.S3, a.S4})
              ASSERT_LT(std::abs(S), 2 * ka * ka) << shape.name << m << sun << " " << theta << " " << phi;
          }
        }
      }
}

TEST(Shadow, DoesNotDependOnThreads) {
  Tracing tracing;
  tracing.shape = drop::beard_chuang(0.5e-3);
  tracing.sun_elevation_deg = 20;
  tracing.orders = {0};
  tracing.rays = 100;
  Wanted wanted;
  wanted.theta_deg = range(0, 20, 0.1);
  wanted.phi_deg = range(0, 350, 10);
  wanted.integral = true;
  const compute::Device one(1), two(2);
  const auto run = [&](const compute::Device& on) {
    Tracer made(tracing, on);
    return far_field(made, red, wanted);
  };
  EXPECT_EQ(run(one).phase_function, run(two).phase_function);
}

} // namespace
