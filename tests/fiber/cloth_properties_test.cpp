// Threads and fabrics by the properties that they should have, and by how far they miss those that the model
// lacks: energy, reciprocity, sampling, highlights. The figures printed here are those of
// papers/sadeghi-fibres.md.
#include <scatter/compute/device.hpp>
#include <scatter/fiber/cloth_program.hpp>
#include <scatter/fiber/fabric.hpp>
#include <scatter/fiber/legendre_rule.hpp>
#include <scatter/fiber/thread.hpp>
#include <scatter/fiber/weave.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace scatter;
using namespace scatter::fiber;

constexpr double degree = radians_per_degree;

glm::dvec3 direction(double theta_deg, double azimuth_deg) {
  const double t = theta_deg * degree, a = azimuth_deg * degree;
  return glm::normalize(glm::dvec3(std::sin(t) * std::cos(a), std::sin(t) * std::sin(a), std::cos(t)));
}

double sum_of(const Rgb& value) {
  return value[0] + value[1] + value[2];
}

struct NamedThread {
  std::string name;
  ThreadParameters parameters;
};

/// All distinct threads of the fabrics, and extremes.
std::vector<NamedThread> threads() {
  std::vector<NamedThread> list;
  for (const std::string& name : fabric_names()) {
    const Fabric fabric = load_fabric(name);
    for (std::size_t j = 0; j < fabric.weave.threads.size(); ++j) {
      const ThreadParameters& thread = fabric.weave.threads[j].thread;
      const bool known = std::ranges::any_of(list, [&](const NamedThread& other) {
        return other.parameters.eta == thread.eta && other.parameters.gamma_s == thread.gamma_s &&
               other.parameters.kd == thread.kd && other.parameters.albedo == thread.albedo;
      });
      if (!known) list.push_back({name + " " + std::to_string(j + 1), thread});
    }
  }
  list.push_back({"isotropic", {1.5, 1, 40 * degree, 40 * degree, {1, 0.5, 0}}});
  list.push_back({"narrow", {1.3, 0, 0.5 * degree, 1 * degree, {0.5, 0.5, 0.5}}});
  return list;
}

/// How improbable counts are as samples of the expected numbers: chi^2 of the bins, those that expect fewer
/// than ten thrown together, as deviations of a standard normal (Wilson and Hilferty).
double chi_square_deviations(const std::vector<double>& counts, const std::vector<double>& expected) {
  double chi2 = 0, few_counted = 0, few_expected = 0;
  int bins = 0;
  for (std::size_t k = 0; k < counts.size(); ++k) {
    if (expected[k] < 10) {
      few_counted += counts[k];
      few_expected += expected[k];
      continue;
    }
    chi2 += std::pow(counts[k] - expected[k], 2) / expected[k];
    ++bins;
  }
  if (few_expected >= 1) {
    chi2 += std::pow(few_counted - few_expected, 2) / few_expected;
    ++bins;
  } else {
    EXPECT_LT(few_counted, 12);
  }
  const double freedom = bins - 1, v = 2 / (9 * freedom);
  return (std::cbrt(chi2 / freedom) - (1 - v)) / std::sqrt(v);
}

template <std::size_t count>
std::array<double, count> numbers(std::mt19937_64& random) {
  std::array<double, count> u;
  for (double& x : u) x = std::generate_canonical<double, 53>(random);
  return u;
}

TEST(Thread, SamplesFollowTheirDensity) {
  const auto rule = legendre_rule(20);
  constexpr int thetas = 36, phis = 12, samples = 50000;
  for (const NamedThread& named : threads()) {
    const Thread thread(named.parameters);
    for (const double theta_i : {0.0, 40.0, -75.0}) {
      std::vector<double> counts(thetas * phis), expected(thetas * phis);
      double total = 0;
      for (int t = 0; t < thetas; ++t)
        for (int p = 0; p < phis; ++p) {
          const double low_t = -pi / 2 + pi * t / thetas, low_p = -pi + 2 * pi * p / phis;
          for (std::size_t i = 0; i < rule.x.size(); ++i)
            for (std::size_t j = 0; j < rule.x.size(); j += 1) {
              const double theta = low_t + pi / thetas * 0.5 * (1 + rule.x[i]);
              const double phi = low_p + 2 * pi / phis * 0.5 * (1 + rule.x[j]);
              expected[t * phis + p] += 0.25 * rule.weight[i] * rule.weight[j] * (pi / thetas) *
                                        (2 * pi / phis) * std::cos(theta) *
                                        thread.pdf({theta_i * degree, theta, phi});
            }
          total += expected[t * phis + p];
          expected[t * phis + p] *= samples;
        }
      EXPECT_NEAR(total, 1, 1e-6) << named.name << ' ' << theta_i;
      std::mt19937_64 random(7);
      for (int k = 0; k < samples; ++k) {
        const ScatteringSample picked = thread.sample(theta_i * degree, numbers<3>(random));
        const int t = std::clamp(static_cast<int>((picked.theta_o / pi + 0.5) * thetas), 0, thetas - 1);
        const int p = std::clamp(static_cast<int>((picked.phi / (2 * pi) + 0.5) * phis), 0, phis - 1);
        ++counts[t * phis + p];
      }
      EXPECT_LT(chi_square_deviations(counts, expected), 4) << named.name << ' ' << theta_i;
    }
  }
}

TEST(Thread, WeightsAverageToTheAlbedo) {
  constexpr int samples = 40000;
  for (const NamedThread& named : threads())
    for (const double theta_i : {0.0, 60.0, 85.0}) {
      const Thread thread(named.parameters, SurfaceLobe::energy_true);
      std::mt19937_64 random(11);
      double sum = 0, squares = 0;
      for (int k = 0; k < samples; ++k) {
        const double weight = thread.sample(theta_i * degree, numbers<3>(random)).weight[1];
        sum += weight;
        squares += weight * weight;
      }
      const double mean = sum / samples, deviation = std::sqrt((squares / samples - mean * mean) / samples);
      EXPECT_NEAR(mean, thread.albedo(theta_i * degree)[1], 4.5 * deviation) << named.name << ' ' << theta_i;
      EXPECT_LT(deviation * std::sqrt(samples), 2.5 * mean) << named.name << ' ' << theta_i << ": noisy";
    }
}

TEST(Thread, IsReciprocalAndEven) {
  std::mt19937_64 random(3);
  for (const NamedThread& named : threads()) {
    const Thread thread(named.parameters);
    for (int k = 0; k < 200; ++k) {
      const auto u = numbers<3>(random);
      const Angles a{(u[0] - 0.5) * 3.1, (u[1] - 0.5) * 3.1, (u[2] - 0.5) * 6.28};
      const double value = sum_of(thread.eval(a));
      EXPECT_NEAR(sum_of(thread.eval({a.theta_o, a.theta_i, a.phi})), value, 1e-13 * value);
      EXPECT_NEAR(sum_of(thread.eval({-a.theta_i, -a.theta_o, -a.phi})), value, 1e-13 * value);
    }
  }
}

TEST(Thread, AlbedoIsTheIntegral) {
  // Against a plain sum in another variable: sin theta, dense enough for the widest kernels.
  for (const NamedThread& named : threads()) {
    if (named.name != "linen-plain 1" && named.name != "silk-crepe-de-chine 1" &&
        named.name != "polyester-satin-front 2")
      continue;
    const Thread thread(named.parameters);
    for (const double theta_i : {0.0, 50.0}) {
      double sum = 0;
      constexpr int steps = 1000, turns = 300;
      for (int i = 0; i < steps; ++i) {
        const double theta = std::asin(-1 + 2 * (i + 0.5) / steps);
        for (int j = 0; j < turns; ++j)
          sum += thread.eval({theta_i * degree, theta, -pi + 2 * pi * (j + 0.5) / turns})[0] *
                 std::cos(theta) * (2.0 / steps) * (2 * pi / turns);
      }
      EXPECT_NEAR(sum, thread.albedo(theta_i * degree)[0], 1e-4 * sum) << named.name << ' ' << theta_i;
    }
  }
}

TEST(Thread, EnergyTrueSurfaceReflectsWhatACylinderDoes) {
  // The share of the light that meets a smooth cylinder's surface and is reflected there, integral of
  // F(asin h) over the offset h; at normal incidence the kernel's tails change it by its width squared.
  const auto rule = legendre_rule(60);
  for (const double eta : {1.345, 1.46, 1.539}) {
    double reflected = 0;
    for (std::size_t i = 0; i < rule.x.size(); ++i) {
      const double phi = pi * 0.5 * (1 + rule.x[i]), c = std::cos(0.5 * phi);
      const double g = std::sqrt(eta * eta - 1 + c * c);
      const double s = (c - g) / (c + g), p = (eta * eta * c - g) / (eta * eta * c + g);
      // h = sin(phi / 2): dh = cos(phi / 2) / 2 d phi.
      reflected += rule.weight[i] * pi / 2 * 0.5 * c * 0.5 * (s * s + p * p);
    }
    const double narrow = 0.2 * degree;
    const ThreadParameters parameters{eta, 0, narrow, narrow, {0, 0, 0}};
    EXPECT_NEAR(Thread(parameters, SurfaceLobe::energy_true).albedo(0)[0], reflected, 1e-4 * reflected);
    EXPECT_NEAR(Thread(parameters).albedo(0)[0], 8 * reflected, 1e-3 * reflected);
  }
}

TEST(Thread, PrintedVolumeScattersSixTimesItsAlbedo) {
  // Without a surface (eta near 1) and at normal incidence the lobes integrate in closed form: isotropic
  // 4 pi (pi - 8/3) A, narrow 2 pi A.
  const double eta = 1 + 1e-9, narrow = 0.1 * degree;
  const double isotropic = Thread({eta, 1, narrow, narrow, {1, 0.5, 0}}).albedo(0)[0];
  EXPECT_NEAR(isotropic, 4 * pi * (pi - 8.0 / 3), 1e-4);
  EXPECT_NEAR(Thread({eta, 0, narrow, narrow, {1, 0.5, 0}}).albedo(0)[0], 2 * pi, 1e-3);
  EXPECT_NEAR(Thread({eta, 0, narrow, narrow, {1, 0.5, 0}}).albedo(0)[1], pi, 1e-3);
}

TEST(Thread, SurfaceAloneKeepsEnergyOnlyWhenEnergyTrue) {
  for (const NamedThread& named : threads()) {
    ThreadParameters surface = named.parameters;
    surface.albedo = {0, 0, 0};
    const Thread true_surface(surface, SurfaceLobe::energy_true), printed_surface(surface);
    double most_printed = 0;
    for (double theta = 0; theta < 60; theta += 5) {
      EXPECT_LT(true_surface.albedo(theta * degree)[0], 1) << named.name;
      most_printed = std::max(most_printed, printed_surface.albedo(theta * degree)[0]);
    }
    const Thread printed(named.parameters), energy_true(named.parameters, SurfaceLobe::energy_true);
    std::printf(
        "%-24s surface alone, up to 55 deg: printed %.2f; whole thread at 0 and 60 deg: printed %.2f %.2f, "
        "energy-true surface %.2f %.2f\n",
        named.name.c_str(), most_printed, printed.albedo(0)[0], printed.albedo(60 * degree)[0],
        energy_true.albedo(0)[0], energy_true.albedo(60 * degree)[0]);
  }
}

TEST(Cloth, SamplesFollowTheirDensity) {
  const auto rule = legendre_rule(12);
  constexpr int thetas = 24, phis = 24, samples = 30000;
  for (const std::string& name : fabric_names()) {
    const Cloth cloth(load_fabric(name).weave, 4);
    const glm::dvec3 view = direction(35, 25);
    std::vector<double> counts(thetas * phis), expected(thetas * phis);
    double total = 0;
    for (int t = 0; t < thetas; ++t)
      for (int p = 0; p < phis; ++p) {
        double& bin = expected[t * phis + p];
        for (std::size_t i = 0; i < rule.x.size(); ++i)
          for (std::size_t j = 0; j < rule.x.size(); ++j) {
            const double theta = pi * (t + 0.5 * (1 + rule.x[i])) / thetas;
            const double phi = 2 * pi * (p + 0.5 * (1 + rule.x[j])) / phis;
            const glm::dvec3 w(
                std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
            bin += 0.25 * rule.weight[i] * rule.weight[j] * (pi / thetas) * (2 * pi / phis) *
                   std::sin(theta) * cloth.pdf(w, view);
          }
        total += bin;
        bin *= samples;
      }
    EXPECT_NEAR(total, 1, 3e-3) << name; // the density has no bound along threads
    std::mt19937_64 random(13);
    Rgb sum{};
    double squares = 0;
    for (int k = 0; k < samples; ++k) {
      const ClothSample picked = cloth.sample(view, numbers<4>(random));
      const double phi = std::atan2(picked.light.y, picked.light.x);
      const int t = std::clamp(
          static_cast<int>(std::acos(std::clamp(picked.light.z, -1.0, 1.0)) / pi * thetas), 0, thetas - 1);
      const int p =
          std::clamp(static_cast<int>((phi < 0 ? phi + 2 * pi : phi) / (2 * pi) * phis), 0, phis - 1);
      ++counts[t * phis + p];
      for (int c = 0; c < 3; ++c) sum[c] += picked.weight[c] / samples;
      squares += picked.weight[0] * picked.weight[0] / samples;
    }
    EXPECT_LT(chi_square_deviations(counts, expected), 4) << name;
    // The same samples estimate the albedo.
    const double deviation = std::sqrt((squares - sum[0] * sum[0]) / samples);
    EXPECT_NEAR(sum[0], cloth.albedo(view)[0], 4.5 * deviation + 1e-3 * sum[0]) << name;
  }
}

TEST(Cloth, EnergyOfTheFabrics) {
  // Printed with the figures of the notes. What must hold: radiance in uniform surroundings stays below that
  // of the surroundings with either lobe, for views within 80 deg of the normal.
  for (const std::string& name : fabric_names())
    for (const SurfaceLobe lobe : {SurfaceLobe::printed, SurfaceLobe::energy_true}) {
      const Cloth cloth(load_fabric(name).weave, 64, lobe);
      double seen = 0;
      Rgb leaving{};
      std::size_t at = 0;
      for (const double theta : {0.0, 60.0, 85.0}) {
        double most = 0;
        for (const double azimuth : {0.0, 45.0, 90.0}) {
          const Rgb albedo = cloth.albedo(direction(theta, azimuth), 64);
          const Rgb share = cloth.reflectance(direction(theta, azimuth), 64);
          seen = std::max(seen, *std::max_element(albedo.begin(), albedo.end()));
          most = std::max(most, *std::max_element(share.begin(), share.end()));
        }
        leaving[at++] = most;
      }
      std::printf(
          "%-24s %-12s in white surroundings at most %.2f; leaves of light at 0, 60, 85 deg at most %.2f "
          "%.2f "
          "%.2f\n",
          name.c_str(), surface_lobe_name(lobe), seen, leaving[0], leaving[1], leaving[2]);
      EXPECT_LT(seen, 1) << name;
      EXPECT_LT(leaving[0], 1) << name;
      EXPECT_GT(leaving[2], leaving[0]) << name;
    }
}

TEST(Cloth, QuadratureOfTheAlbedoConverges) {
  for (const std::string& name : fabric_names()) {
    const Cloth cloth(load_fabric(name).weave);
    const glm::dvec3 w = direction(40, 30);
    const double fine = cloth.albedo(w, 300)[0], leaving = cloth.reflectance(w, 300)[0];
    EXPECT_NEAR(cloth.albedo(w)[0], fine, 1e-3 * fine) << name;
    EXPECT_NEAR(cloth.reflectance(w)[0], leaving, 1e-3 * leaving) << name;
  }
}

TEST(Cloth, IsNotReciprocalAndHowFar) {
  // value / (n . light) is the cloth's BRDF.
  for (const std::string& name : fabric_names()) {
    const Cloth cloth(load_fabric(name).weave);
    std::mt19937_64 random(17);
    double sum = 0, worst = 0;
    constexpr int pairs = 2000;
    std::vector<glm::dvec3> lights, views;
    for (int k = 0; k < pairs; ++k) {
      const auto u = numbers<4>(random);
      lights.push_back(direction(80 * std::sqrt(u[0]), 360 * u[1]));
      views.push_back(direction(80 * std::sqrt(u[2]), 360 * u[3]));
    }
    std::vector<Rgb> there(pairs), back(pairs);
    cloth.eval(lights, views, there);
    cloth.eval(views, lights, back);
    for (int k = 0; k < pairs; ++k) {
      const double a = sum_of(there[k]) / lights[k].z, b = sum_of(back[k]) / views[k].z;
      if (!(a + b > 0)) continue;
      const double difference = 2 * std::abs(a - b) / (a + b);
      sum += difference / pairs;
      worst = std::max(worst, difference);
    }
    std::printf(
        "%-24s BRDF there and back, directions within 80 deg: differ by %.2f of their mean on average, at "
        "most "
        "%.2f\n",
        name.c_str(), sum, worst);
    EXPECT_GT(sum, 0.05) << name; // if this fails, the notes are out of date
    EXPECT_LE(worst, 2) << name;
  }
  // Light and view exchanged by the mirror plane of the weave: value itself must not change.
  const Cloth linen(load_fabric("linen-plain").weave);
  const double there = sum_of(linen.eval(direction(50, 20), direction(50, 160)));
  EXPECT_NEAR(sum_of(linen.eval(direction(50, 160), direction(50, 20))), there, 1e-13 * there);
}

TEST(Cloth, ManyAreOneByOne) {
  // Blocks that are not full, and directions in the cloth's plane or below.
  const Cloth cloth(load_fabric("silk-shot").weave);
  const ClothProgram program(cloth, compute::Device());
  std::mt19937_64 random(23);
  for (const std::size_t count : {0u, 1u, 15u, 16u, 17u, 100u}) {
    std::vector<glm::dvec3> lights, views;
    for (std::size_t k = 0; k < count; ++k) {
      const auto u = numbers<4>(random);
      lights.push_back(direction(95 * u[0], 360 * u[1]));
      views.push_back(direction(95 * u[2], 360 * u[3]));
    }
    std::vector<Rgb> on_device(count);
    program.eval(lights, views, on_device);
    for (const auto& unit : exact::vector_units()) {
      std::vector<Rgb> many(count), alone(1);
      cloth.eval(lights, views, many, unit);
      for (std::size_t k = 0; k < count; ++k) {
        const Rgb one = cloth.eval(lights[k], views[k]);
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(many[k][c], one[c], 1e-12 * one[c]) << unit.name;
          EXPECT_NEAR(on_device[k][c], one[c], 1e-12 * one[c]);
        }
        // The same bits wherever a pair stands.
        cloth.eval({&lights[k], 1}, {&views[k], 1}, alone, unit);
        EXPECT_EQ(alone[0], many[k]) << unit.name;
      }
    }
  }
  std::vector<Rgb> values(1);
  const std::vector<glm::dvec3> long_one{{0, 0, 1.1}}, up{{0, 0, 1}};
  EXPECT_THROW(cloth.eval(long_one, up, values), InputError);
  EXPECT_THROW(program.eval(long_one, up, values), InputError);
  EXPECT_THROW(static_cast<void>(cloth.eval(up[0], long_one[0])), InputError);
  const glm::dvec3 none(std::numeric_limits<double>::quiet_NaN(), 0, 1);
  EXPECT_THROW(static_cast<void>(cloth.eval(none, up[0])), InputError);
  EXPECT_THROW(cloth.eval(up, std::vector<glm::dvec3>{}, values), std::invalid_argument);
}

TEST(Cloth, NeighboursDoNotChangeAValue) {
  // Linen's, shot silk's and some of crepe's lobes are wide, and 1 to 2: they take the short form of the
  // loop, but not along a thread, where a direction beside others takes the long one. Satin never takes the
  // short form.
  for (const char* const name :
       {"linen-plain", "silk-shot", "silk-crepe-de-chine", "polyester-satin-front"}) {
    const Cloth cloth(load_fabric(name).weave);
    std::vector<glm::dvec3> lights, views;
    std::mt19937_64 random(29);
    for (int k = 0; k < 96; ++k) {
      const auto u = numbers<4>(random);
      lights.push_back(direction(90 * u[0], 360 * u[1]));
      views.push_back(direction(90 * u[2], 360 * u[3]));
    }
    // In the planes of both families, up to a tangent of the curves and beyond, and nearly so.
    int k = 0;
    for (const double azimuth : {0.0, 90.0, 180.0, 270.0, 0.004})
      for (const double theta : {20.0, 64.9, 65.2, 85.0, 89.0, 89.999}) {
        (k % 2 == 0 ? lights : views)[static_cast<std::size_t>(3 * k)] = direction(theta, azimuth);
        ++k;
      }
    for (const auto& unit : exact::vector_units()) {
      std::vector<Rgb> many(lights.size()), alone(1);
      cloth.eval(lights, views, many, unit);
      for (std::size_t i = 0; i < lights.size(); ++i) {
        const Rgb one = cloth.eval(lights[i], views[i]);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(many[i][c], one[c], 1e-12 * one[c]) << name << ' ' << i;
        cloth.eval({&lights[i], 1}, {&views[i], 1}, alone, unit);
        EXPECT_EQ(alone[0], many[i]) << name << ' ' << i << ' ' << unit.name;
      }
    }
  }
}

TEST(Cloth, HorizonIsDark) {
  for (const std::string& name : fabric_names()) {
    const Cloth cloth(load_fabric(name).weave);
    for (const glm::dvec3& w :
         {glm::dvec3(1, 0, 0), glm::dvec3(0, -1, 0), direction(120, 30), glm::dvec3(0, 0, -1)}) {
      EXPECT_EQ(cloth.eval(w, direction(30, 30)), Rgb({0, 0, 0}));
      EXPECT_EQ(cloth.eval(direction(30, 30), w), Rgb({0, 0, 0}));
    }
  }
  // Only what is seen counts: a fabric of no area sends no light, rather than 0 / 0.
  Weave bare = load_fabric("linen-plain").weave;
  for (WeaveThread& thread : bare.threads) thread.coverage = 0;
  EXPECT_EQ(Cloth(bare).eval(direction(10, 0), direction(20, 0)), Rgb({0, 0, 0}));
}

TEST(Cloth, AnyNumberOfThreads) {
  // A thread cut in two of half its area each is the same cloth; so is one that is turned by half a turn
  // when its curve is its own mirror image.
  const Fabric fabric = load_fabric("silk-crepe-de-chine");
  Weave three = fabric.weave;
  three.threads.push_back(three.threads[0]);
  three.threads[0].coverage /= 2;
  three.threads[2].coverage /= 2;
  three.threads[2].direction = pi;
  const Cloth one(fabric.weave), other(three);
  for (const double azimuth : {0.0, 33.0, 90.0, 200.0}) {
    const double value = sum_of(one.eval(direction(25, azimuth), direction(50, 130)));
    EXPECT_NEAR(sum_of(other.eval(direction(25, azimuth), direction(50, 130))), value, 1e-12 * value);
  }
  Weave turned = fabric.weave; // both threads turned by 30 deg: the same as the light and eye turned back
  for (WeaveThread& thread : turned.threads) thread.direction += 30 * degree;
  const double value = sum_of(one.eval(direction(25, 10), direction(50, 130)));
  EXPECT_NEAR(sum_of(Cloth(turned).eval(direction(25, 40), direction(50, 160))), value, 1e-12 * value);
}

/// The fabric with its families hiding each other.
Cloth crowned(const std::string& name, int samples = 64) {
  return Cloth(load_fabric(name).weave, samples, SurfaceLobe::printed, FamilyMasking::crowns);
}

TEST(Cloth, CrownsHideAsTheirCurveSays) {
  // Linen's offsets are even over -a..a: in the plane of the other family, <max(w . n', 0)> is an elementary
  // integral, and what is hidden begins where a section turns away, 90 deg - a from the normal.
  const Cloth linen = crowned("linen-plain", 20000);
  const double a = 25 * degree;
  for (const double psi : {10.0, 60.0, 64.9, 70.0, 80.0, 89.0})
    for (const double azimuth : {90.0, -90.0}) { // along thread 2, whose crowns hide thread 1
      const double t = psi * degree,
                   facing = t + a > pi / 2 ? (1 - std::sin(t - a)) / (2 * a) : std::sin(a) / a * std::cos(t);
      const double expected = std::sin(a) / a * std::cos(t) / facing;
      EXPECT_NEAR(linen.unmasked(0, direction(psi, azimuth)), expected, 1e-6) << psi;
      EXPECT_NEAR(linen.unmasked(1, direction(psi, azimuth)), 1, 1e-12) << psi; // thread 1 lies across
    }
  EXPECT_LT(linen.unmasked(0, direction(85, 90)), 0.6);
  // Parts that face w, less what is hidden of them, look as large as the cloth: a curve with few sections.
  Weave weave = load_fabric("linen-plain").weave;
  weave.threads[1].curve = {{-0.8, -0.8, 0.8, 0.8}, {1, 0, 1}};
  const Cloth steep(weave, 64, SurfaceLobe::printed, FamilyMasking::crowns);
  const glm::dvec3 w = direction(70, 90);
  EXPECT_NEAR(
      steep.unmasked(0, w) * std::sin(0.8 + 20 * degree) / 2, std::cos(0.8) * std::cos(70 * degree), 1e-12);
}

TEST(Cloth, FamiliesHideOnlyEachOther) {
  for (const std::string& name : fabric_names()) {
    const Cloth plain(load_fabric(name).weave), masked = crowned(name);
    const auto up = direction(0, 0);
    EXPECT_NEAR(sum_of(masked.eval(up, up)), sum_of(plain.eval(up, up)), 1e-12) << name;
    EXPECT_DOUBLE_EQ(masked.open(up), plain.open(up)) << name;
    for (std::size_t j = 0; j < masked.strands().size(); ++j)
      for (const double theta : {20.0, 70.0, 88.0})
        for (const double azimuth : {0.0, 30.0, 100.0, 260.0}) {
          const double share = masked.unmasked(j, direction(theta, azimuth));
          EXPECT_TRUE(share > 0 && share <= 1) << name << ' ' << theta;
        }
    // Toward the eye no more than without: white surroundings.
    for (const double theta : {5.0, 60.0, 85.0}) {
      const auto view = direction(theta, 40);
      const Rgb radiance = masked.albedo(view, 32);
      for (const double value : radiance) EXPECT_LE(value + masked.open(view), 1) << name << ' ' << theta;
    }
  }
  // One family without a gap, given as two threads that run to and fro, hides nothing.
  Weave weave = load_fabric("linen-plain").weave;
  weave.threads[1].direction = pi;
  for (WeaveThread& thread : weave.threads) thread.coverage = 0.5;
  const Cloth plain(weave), masked(weave, 64, SurfaceLobe::printed, FamilyMasking::crowns);
  const auto light = direction(80, 10), view = direction(75, 200);
  EXPECT_EQ(masked.eval(light, view), plain.eval(light, view));
  // Light along the crowns of linen is kept from the other threads, and not from their own.
  const Cloth linen(load_fabric("linen-plain").weave), hidden = crowned("linen-plain");
  const auto low = direction(85, 90), high = direction(10, 90);
  EXPECT_LT(sum_of(hidden.eval(low, high)), 0.99 * sum_of(linen.eval(low, high)));
  // Many pairs take the same way, samples their weights from it; devices refuse.
  const std::vector<glm::dvec3> lights{low, high, light}, views{high, low, view};
  std::vector<Rgb> values(3);
  hidden.eval(lights, views, values);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(values[k], hidden.eval(lights[k], views[k]));
  const ClothSample sample = hidden.sample(view, {0.3, 0.4, 0.9, 0.2});
  ASSERT_GT(sample.pdf, 0);
  EXPECT_NEAR(sum_of(sample.weight) * sample.pdf, sum_of(hidden.eval(sample.light, view)), 1e-12);
  EXPECT_THROW(ClothProgram(hidden, compute::Device()), InputError);
}

TEST(Cloth, LightThroughTheGap) {
  for (const std::string& name : fabric_names()) {
    const Fabric fabric = load_fabric(name);
    double covered = 0;
    for (const WeaveThread& thread : fabric.weave.threads) covered += thread.coverage;
    const Cloth cloth(fabric.weave);
    for (const double theta : {0.0, 50.0, 89.0}) {
      const double open = cloth.open(direction(theta, 70));
      if (covered > 1 - 1e-9)
        EXPECT_NEAR(open, 0, 1e-9) << name;
      else
        EXPECT_TRUE(open > 0 && open < 1) << name << ' ' << theta;
    }
    EXPECT_EQ(cloth.open({0, 0, -1}), 0) << name;
  }
  // Linen from above: <cos psi> = sin a / a of two thirds, and a third.
  const Cloth linen(load_fabric("linen-plain").weave, 20000);
  const double a = 25 * degree, threads = 0.66 * std::sin(a) / a;
  EXPECT_NEAR(linen.open({0, 0, 1}), 0.34 / (threads + 0.34), 1e-9);
  // Flat threads along x seen from across keep their width while the gap closes.
  const Weave flat{{{load_fabric("linen-plain").weave.threads[0].thread, 0.6, 0, {{0, 0}, {1}}}}};
  const Cloth grid(flat);
  for (const double theta : {0.0, 40.0, 80.0}) {
    const double cosine = std::cos(theta * degree);
    EXPECT_NEAR(grid.open(direction(theta, 90)), 0.4 * cosine / (0.6 + 0.4 * cosine), 1e-12);
    EXPECT_NEAR(grid.open(direction(theta, 0)), 0.4, 1e-12);
  }
  EXPECT_THROW((void)linen.open({0, 0, 2}), InputError);
}

TEST(TangentCurve, SamplesAreEquallySpaced) {
  const std::vector<double> line = sample_curve({{-0.4, 0.4}, {3}}, 4);
  const double expected[] = {-0.3, -0.1, 0.1, 0.3};
  for (int k = 0; k < 4; ++k) EXPECT_NEAR(line[k], expected[k], 1e-15);
  // A jump: halves on both sides; the point that falls on it belongs to what follows.
  EXPECT_EQ(sample_curve({{0.1, 0.1, 0.5, 0.5}, {1, 0, 1}}, 2), (std::vector<double>{0.1, 0.5}));
  EXPECT_EQ(sample_curve({{0.1, 0.1, 0.5, 0.5}, {1, 0, 1}}, 3), (std::vector<double>{0.1, 0.5, 0.5}));
  // Zero lengths at the ends, and unequal parts.
  EXPECT_EQ(sample_curve({{0.9, 0.2, 0.2, 0.9}, {0, 1, 0}}, 3), (std::vector<double>{0.2, 0.2, 0.2}));
  EXPECT_EQ(sample_curve({{0.1, 0.1, 0.5, 0.5}, {3, 0, 1}}, 4), (std::vector<double>{0.1, 0.1, 0.1, 0.5}));
  EXPECT_THROW(static_cast<void>(sample_curve({{0.1, 0.2}, {1}}, 0)), InputError);
  EXPECT_THROW(static_cast<void>(sample_curve({{0.1, 0.2}, {1, 2}}, 4)), InputError);
  EXPECT_THROW(static_cast<void>(sample_curve({{0.1, 0.2}, {-1}}, 4)), InputError);
}

/// Angles [deg] of the maxima in the plane of x and z that stand out from the valleys beside them by
/// `prominence` of the largest.
std::vector<double> highlights(const Cloth& cloth, double light_deg, double prominence) {
  std::vector<double> angle, value;
  for (double a = -89; a <= 89; a += 0.125) {
    angle.push_back(a);
    value.push_back(sum_of(cloth.eval(direction(light_deg, 0), direction(a, 0))));
  }
  const double largest = *std::max_element(value.begin(), value.end());
  std::vector<double> found;
  for (std::size_t k = 1; k + 1 < value.size(); ++k) {
    if (!(value[k] > value[k - 1] && value[k] >= value[k + 1])) continue;
    double valley = 0; // the higher one of the lowest points before something as high, on both sides
    for (const int step : {-1, 1}) {
      double lowest = value[k];
      for (auto m = static_cast<std::ptrdiff_t>(k); m >= 0 && m < std::ssize(value) && value[m] <= value[k];
           m += step)
        lowest = std::min(lowest, value[m]);
      valley = std::max(valley, lowest);
    }
    if (value[k] - valley >= prominence * largest) found.push_back(angle[k]);
  }
  return found;
}

TEST(Cloth, HighlightsStandWhereFlatSectionsMirror) {
  // a_r = -a_i - 2 offset for every flat section of thread 1.
  struct Case {
    const char* fabric;
    std::vector<double> offsets;
    double tolerance; ///< steep mirrors are pushed by the cosines, overlapping ones toward each other
  };
  for (const Case& expected :
       {Case{"polyester-satin-front", {32, 0, -32}, 1.5}, Case{"polyester-satin-back", {30, 5, -5, -30}, 2.5},
        Case{"silk-crepe-de-chine", {35, -35}, 2.5}, Case{"imaginary-asymmetric", {10, -30}, 1}})
    for (const double light : {0.0, 5.0, 10.0}) {
      const Cloth cloth(load_fabric(expected.fabric).weave, 256);
      const std::vector<double> found = highlights(cloth, light, 0.02);
      ASSERT_EQ(found.size(), expected.offsets.size())
          << expected.fabric << ' ' << light << ' ' << testing::PrintToString(found);
      for (std::size_t k = 0; k < found.size(); ++k)
        EXPECT_NEAR(found[k], -light - 2 * expected.offsets[k], expected.tolerance)
            << expected.fabric << ' ' << light;
    }
}

TEST(Fabric, AllOfThemLoad) {
  EXPECT_GE(fabric_names().size(), 8u);
  for (const std::string& name : fabric_names()) {
    const Fabric fabric = load_fabric(name);
    EXPECT_EQ(fabric.name, name);
    EXPECT_FALSE(fabric.source.empty()) << name;
    EXPECT_EQ(fabric.weave.threads.size(), 2u) << name;
    EXPECT_NEAR(fabric.weave.threads[1].direction, pi / 2, 1e-15) << name;
  }
}

} // namespace
