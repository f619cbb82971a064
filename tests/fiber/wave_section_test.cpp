// Waves as a cross-section: against the cylinder's own amplitudes and cross sections, against plain sums, and
// against rays, which waves tend to.
#include <scatter/exact/cylinder.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/fiber/wave_section.hpp>
#include <scatter/optics/errors.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace {

using namespace scatter::fiber;
constexpr double pi = std::numbers::pi;

double intensity(const scatter::exact::CylinderAmplitudes& T, std::size_t i) {
  return 0.5 * (std::norm(T.T1[i]) + std::norm(T.T2[i]) + std::norm(T.T3[i]) + std::norm(T.T4[i]));
}

TEST(WaveSection, IsTheCylinderWithoutAverage) {
  const double x = 55.5, sigma_a = 0.3, theta_d = -0.4, eta = 1.55;
  const WaveSection section(eta, sigma_a, x, 0);
  const std::vector<double> theta{0, 0.1234, 1, 2.5, pi, -1};
  const std::vector<int> orders{0, 1, 2};
  const auto wave = scatter::exact::cylinder(x, {eta, sigma_a / (2 * x)}, theta_d, theta, orders);
  for (int order = 0; order < 3; ++order)
    for (std::size_t i = 0; i < theta.size(); ++i) {
      const double expected = intensity(wave.orders[order].amplitudes, i) / (pi * x * std::cos(theta_d));
      EXPECT_NEAR(section.distribution(order, theta_d, pi - theta[i]), expected, 1e-12 * expected + 1e-15);
    }
  const WaveProfiles profiles = wave_profiles(eta, sigma_a, x, theta_d, orders);
  EXPECT_NEAR(profiles.whole.moments(0).energy * std::cos(theta_d), (wave.Qsca.I + wave.Qsca.II) / 2, 1e-13);
  EXPECT_LT(profiles.error_estimate, 1e-12);
  EXPECT_NEAR(section.residual(0, theta_d).energy, profiles.whole.moments(0).energy, 1e-13);
  EXPECT_NEAR(section.residual(3, theta_d).energy, profiles.rest.moments(0).energy, 1e-13);
}

TEST(WaveSection, AveragesAndMomentsAreIntegrals) {
  const double theta_d = 0.3, width = 0.1;
  const WaveSection plain(1.4, 0, 40, 0), averaged(1.4, 0, 40, width);
  constexpr int count = 2000;
  for (const int order : {0, 2}) {
    OrderMoments sum;
    double convolved = 0;
    const double at = 1.1;
    for (int i = 0; i < count; ++i) {
      const double phi = -pi + 2 * pi * (i + 0.5) / count, step = 2 * pi / count;
      const double smooth = averaged.distribution(order, theta_d, phi);
      sum.energy += smooth * step;
      sum.forward += smooth * step * std::abs(phi) / pi;
      sum.forward_half += std::abs(phi) > pi / 2 ? smooth * step : 0;
      for (const int turn : {-1, 0, 1}) {
        const double far = (phi + 2 * pi * turn - at) / width;
        convolved += plain.distribution(order, theta_d, phi) * std::exp(-far * far / 2) /
                     (width * std::sqrt(2 * pi)) * step;
      }
    }
    EXPECT_NEAR(averaged.distribution(order, theta_d, at), convolved, 1e-12 + 1e-10 * convolved);
    const OrderMoments moments = averaged.moments(order, theta_d);
    EXPECT_NEAR(moments.energy, sum.energy, 1e-12);
    EXPECT_NEAR(moments.forward, sum.forward, 1e-5 * sum.energy);
    EXPECT_NEAR(moments.forward_half, sum.forward_half, 1e-5 * sum.energy);
    EXPECT_NEAR(moments.energy, plain.moments(order, theta_d).energy, 1e-13);
    const WaveProfile profile = wave_profiles(1.4, 0, 40, theta_d, std::vector<int>{order}).orders[0];
    EXPECT_NEAR(profile.energy_between(-pi, pi, width), moments.energy, 1e-13);
    EXPECT_NEAR(2 * profile.energy_between(pi / 2, pi, width), moments.forward_half, 1e-13);
  }
}

TEST(WaveSection, TendsToRaysWhosePolarisationIsTracked) {
  const double eta = 1.55, sigma_a = 0.2, width = 0.05;
  const RaySection rays(eta, sigma_a, Polarisation::tracked), mean(eta, sigma_a);
  for (const double theta_d : {0.0, 0.6}) {
    const WaveSection waves(eta, sigma_a, 5000, width);
    const auto error = [&](const RaySection& section, int order, double phi) {
      return waves.distribution(order, theta_d, phi) / section.averaged(order, theta_d, phi, width) - 1;
    };
    for (const double phi : {0.0, 0.5, 1.5}) EXPECT_NEAR(error(rays, 0, phi), 0, 1e-4);
    for (const double phi : {2.2, 3.0}) EXPECT_NEAR(error(rays, 1, phi), 0, 1e-3);
    EXPECT_NEAR(error(rays, 2, 0), 0, 1e-3);
    EXPECT_NEAR(waves.moments(2, theta_d).energy / rays.moments(2, theta_d).energy, 1, 3e-3);
    EXPECT_NEAR(waves.moments(3, theta_d).energy / rays.moments(3, theta_d).energy, 1, 2e-2);
    // The shadow diffracts as much as falls on the fibre.
    EXPECT_NEAR(waves.moments(0, theta_d).energy - rays.moments(0, theta_d).energy, 1, 1e-2);
    // Mean reflectivities are another thing: waves tell the two apart.
    EXPECT_GT(std::abs(error(mean, 2, 0)), 0.05);
  }
}

TEST(WaveSection, DiffractionIsThatOfAStrip) {
  const WaveSection section(1.55, 0, 300, 0);
  double sum = 0;
  constexpr int count = 20000;
  for (int i = 0; i < count; ++i)
    sum += section.diffraction(0.3, 2 * pi * (i + 0.5) / count) * 2 * pi / count;
  EXPECT_NEAR(sum, 1, 2e-3);
  // Straight on next to nothing else goes: |T| there is xi, of the shadow.
  EXPECT_NEAR(section.diffraction(0.3, pi) / section.distribution(0, 0.3, pi), 1, 0.05);
}

TEST(WaveSection, RefusesWhatItCannotCompute) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(WaveSection(1, 0, 10, 0), scatter::InputError);
  EXPECT_THROW(WaveSection(nan, 0, 10, 0), scatter::InputError);
  EXPECT_THROW(WaveSection(1.5, -1, 10, 0), scatter::InputError);
  EXPECT_THROW(WaveSection(1.5, 0, 1e6, 0), scatter::InputError);
  EXPECT_THROW(WaveSection(1.5, 0, 0, 0), scatter::InputError);
  EXPECT_THROW(WaveSection(1.5, 0, 10, -0.1), scatter::InputError);
  EXPECT_THROW(WaveSection(1.5, 0, 10, nan), scatter::InputError);
  const WaveSection section(1.5, 0, 10, 0.1);
  for (const double theta_d : {pi / 2, -1.6}) {
    EXPECT_THROW((void)section.distribution(0, theta_d, 0), scatter::InputError);
    EXPECT_THROW((void)section.residual(3, theta_d), scatter::InputError);
    EXPECT_THROW((void)section.diffraction(theta_d, 0), scatter::InputError);
  }
  EXPECT_THROW((void)wave_profiles(1.5, 0, 10, 1.5706, {}), scatter::InputError);
  EXPECT_THROW((void)section.moments(1001, 0), scatter::InputError);
  EXPECT_THROW((void)section.diffraction(0, nan), scatter::InputError);
  EXPECT_THROW((void)section.distribution(-1, 0, 0), scatter::InputError);
  EXPECT_THROW((void)section.distribution(0, 0, nan), scatter::InputError);
  EXPECT_THROW((void)section.moments(0, nan), scatter::InputError);
  EXPECT_TRUE(section.caustics(2, 0).empty());
}

TEST(WaveSection, HoldsItsValuesBeyondTheLargestTilt) {
  const WaveSection section(1.5, 0, 10, 0.1);
  const double last = 89.9 / 180 * pi;
  for (const double theta_d : {1.5706, -1.5706, std::nextafter(pi / 2, 0.0)}) {
    EXPECT_EQ(section.distribution(1, theta_d, 2), section.distribution(1, last, 2));
    EXPECT_EQ(section.moments(0, theta_d).energy, section.moments(0, last).energy);
    EXPECT_EQ(section.residual(3, theta_d).forward, section.residual(3, last).forward);
  }
}

} // namespace
