// The fast evaluation against the slow one that is held to 40 digits.
#include <scatter/fiber/ray_section.hpp>
#include <scatter/fiber/ray_section_kernel.hpp>
#include <scatter/optics/errors.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>
#include <vector>

namespace {

using namespace scatter::fiber;
using scatter::exact::vector_units;
using scatter::exact::VectorUnit;
constexpr double pi = std::numbers::pi;

struct Directions {
  std::vector<double> theta_d, phi, cosine, S, C;
  void add(double theta, double azimuth) {
    theta_d.push_back(theta);
    phi.push_back(azimuth);
    cosine.push_back(std::cos(theta));
    S.push_back(std::sin(azimuth / 2));
    C.push_back(std::cos(azimuth / 2));
  }
  [[nodiscard]] RayLobeDirections view() const { return {cosine, S, C}; }
};

Directions any_directions(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  Directions made;
  for (std::size_t i = 0; i < count; ++i) // half of them where TRT is
    made.add(1.57 * unit(random), (i % 2 == 0 ? pi : 0.6) * unit(random));
  return made;
}

/// From the nearest azimuth where N_p bends without bound or goes out.
double distance(const RaySection& section, int order, double theta_d, double phi) {
  double nearest = 1;
  for (const double caustic : section.caustics(order, theta_d))
    nearest = std::min(nearest, std::abs(phi - caustic));
  const double index = bravais_index(section.eta(), theta_d);
  if (order > 0)
    nearest = std::min(
        nearest,
        std::abs(std::abs(std::remainder(2 * order * std::asin(1 / index) - pi + order * pi, 2 * pi)) - phi));
  return nearest;
}

TEST(RayLobes, AreThoseOfRaySection) {
  const Directions directions = any_directions(12000, 5);
  const std::vector<double> sigma_a{0, 0.2, 3};
  for (const double eta : {1.05, 1.345, 1.55, 1.9999, 2.3}) {
    std::vector<std::vector<double>> found;
    for (const VectorUnit& unit : vector_units()) {
      found.emplace_back(3 * sigma_a.size() * directions.phi.size());
      ray_lobes(eta, sigma_a, directions.view(), found.back(), unit);
    }
    std::size_t lit[3] = {};
    for (std::size_t colour = 0; colour < sigma_a.size(); ++colour) {
      const RaySection section(eta, sigma_a[colour]);
      for (std::size_t order = 0; order < 3; ++order)
        for (std::size_t i = 0; i < directions.phi.size(); ++i) {
          const double theta_d = directions.theta_d[i], phi = directions.phi[i];
          const double expected = section.distribution(static_cast<int>(order), theta_d, phi);
          const double away = distance(section, static_cast<int>(order), theta_d, phi);
          for (std::size_t u = 0; u < found.size(); ++u)
            ASSERT_NEAR(
                found[u][(order * sigma_a.size() + colour) * directions.phi.size() + i], expected,
                1e-12 * expected * std::max(1.0, 5e-3 / away) + 1e-22)
                << vector_units()[u].name << ' ' << eta << " order " << order << " theta_d " << theta_d
                << " phi " << phi;
          lit[order] += expected > 0 ? 1 : 0;
        }
    }
    EXPECT_GT(lit[1], 5000U);
    EXPECT_GT(lit[2], 5000U);
  }
}

TEST(RayLobes, DoNotDependOnTheirCompany) {
  const Directions directions = any_directions(1000, 9);
  const std::vector<double> sigma_a{0.2};
  for (const VectorUnit& unit : vector_units()) {
    std::vector<double> all(3000);
    ray_lobes(1.55, sigma_a, directions.view(), all, unit);
    for (std::size_t i = 0; i < 1000; ++i) {
      // Alone, and as the last one behind others.
      const std::size_t first = i - i % 39;
      for (const std::size_t from : {i, first}) {
        const std::size_t count = i + 1 - from;
        std::vector<double> some(3 * count);
        ray_lobes(
            1.55, sigma_a,
            {{&directions.cosine[from], count}, {&directions.S[from], count}, {&directions.C[from], count}},
            some, unit);
        for (std::size_t order = 0; order < 3; ++order)
          ASSERT_EQ(some[(order + 1) * count - 1], all[order * 1000 + i]) << unit.name << ' ' << i;
      }
    }
  }
}

TEST(RayLobes, AreFiniteAtTheEnds) {
  Directions directions;
  for (const double theta_d : {0.0, 1.0, std::nextafter(pi / 2, 0.0)})
    for (const double phi : {0.0, 1e-300, 1e-9, pi}) directions.add(theta_d, phi);
  const RaySection section(1.55, 0);
  directions.add(0, section.caustics(2, 0)[0]);
  const std::vector<double> sigma_a{0, 1e9};
  std::vector<double> N(6 * directions.phi.size());
  for (const VectorUnit& unit : vector_units())
    for (const double eta : {1 + 1e-15, 1 + 1e-9, 1.55, 2.0, 10.0}) {
      ray_lobes(eta, sigma_a, directions.view(), N, unit);
      for (const double value : N) EXPECT_TRUE(value >= 0 && std::isfinite(value)) << unit.name << ' ' << eta;
    }
  EXPECT_THROW(ray_lobes(1.55, sigma_a, directions.view(), {N.data(), 5}), std::invalid_argument);
}

TEST(ResidualEnergy, IsThatOfRaySection) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(0, 1);
  for (const double eta : {1.05, 1.55, 2.5})
    for (const double sigma_a : {0.0, 1e-3, 0.2, 3.0}) {
      const RaySection section(eta, sigma_a);
      const ResidualEnergy fitted(eta, sigma_a, 3);
      std::vector<double> cosine, at_once(101);
      for (int i = 0; i < 101; ++i)
        cosine.push_back(i % 2 == 0 ? 1 - unit(random) : std::pow(10, -6 * unit(random)));
      for (const VectorUnit& vectors : vector_units()) {
        fitted.evaluate(cosine, at_once, vectors);
        for (std::size_t i = 0; i < cosine.size(); ++i)
          EXPECT_NEAR(at_once[i], fitted(cosine[i]), 1e-14) << vectors.name;
      }
      for (std::size_t i = 0; i < cosine.size(); ++i) {
        const double expected = section.residual_energy(3, std::acos(cosine[i]));
        EXPECT_NEAR(fitted(cosine[i]), expected, 1e-12) << eta << " " << sigma_a << " " << cosine[i];
        EXPECT_NEAR(at_once[i], expected, 1e-12);
      }
    }
  EXPECT_THROW(ResidualEnergy(1.55, 0.2, 0), scatter::InputError);
  EXPECT_THROW(ResidualEnergy(0.9, 0.2, 3), scatter::InputError);
}

} // namespace
