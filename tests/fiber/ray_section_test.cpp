// Rays in a circular section: against a tracer in three dimensions with 40 digits (make_fiber_truth.py), and
// against what must hold whatever the numbers: energy, evenness, integrals of the distribution.
#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/errors.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <random>
#include <string>

namespace {

using namespace scatter::fiber;
constexpr double pi = std::numbers::pi, degree = pi / 180;

nlohmann::json truth() {
  std::ifstream file(SCATTER_FIBER_TRUTH);
  return nlohmann::json::parse(file);
}

TEST(RaySection, AgreesWithATracerOfFortyDigits) {
  const auto data = truth();
  int compared = 0, lit = 0;
  double worst = 0, worst_moment = 0;
  for (const auto& row : data.at("cases")) {
    const RaySection section(
        row.at("eta"), row.at("sigma_a"),
        row.at("tracked").get<bool>() ? Polarisation::tracked : Polarisation::mean);
    const int order = row.at("order");
    const double theta_d = row.at("theta_d");
    const std::string name =
        row.at("eta").dump() + " " + row.at("theta_d").dump() + " order " + std::to_string(order);
    const auto caustics = section.caustics(order, theta_d);
    ASSERT_EQ(caustics.size(), row.at("caustics").size()) << name;
    for (std::size_t k = 0; k < caustics.size(); ++k)
      EXPECT_NEAR(caustics[k], row.at("caustics")[k].get<double>(), 1e-15) << name;
    for (std::size_t i = 0; i < row.at("phi").size(); ++i) {
      const double phi = row.at("phi")[i], expected = row.at("N")[i];
      const double found = section.distribution(order, theta_d, phi);
      EXPECT_NEAR(found, expected, 1e-12 * expected) << name << " phi " << phi;
      if (expected > 0) worst = std::max(worst, std::abs(found / expected - 1));
      lit += expected > 0 ? 1 : 0;
      ++compared;
    }
    const OrderMoments moments = section.moments(order, theta_d);
    const auto& expected = row.at("moments");
    const double values[] = {moments.energy, moments.forward, moments.forward_half};
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(values[k], expected[k].get<double>(), 1e-12 * expected[0].get<double>())
          << name << " moment " << k;
      worst_moment =
          std::max(worst_moment, std::abs(values[k] - expected[k].get<double>()) / expected[0].get<double>());
    }
  }
  EXPECT_GT(compared, 300);
  EXPECT_GT(lit, 150);
  std::printf("worst: N %.2g, moments %.2g of the energy; %d values\n", worst, worst_moment, compared);
}

TEST(RaySection, WhiteFurnaceIsOne) {
  for (const Polarisation polarisation : {Polarisation::mean, Polarisation::tracked})
    for (const double eta : {1.0001, 1.01, 1.33, 1.55, 2.5, 10.0})
      for (const double theta_d :
           {0.0, 20 * degree, -46.87 * degree, 70 * degree, 89 * degree, 89.9999 * degree}) {
        const RaySection section(eta, 0, polarisation);
        double sum = 0;
        for (int order = 0; order < 3; ++order) {
          sum += section.moments(order, theta_d).energy;
          EXPECT_NEAR(sum + section.residual(order + 1, theta_d).energy, 1, 1e-12)
              << eta << " " << theta_d << " order " << order;
        }
        EXPECT_NEAR(section.residual(0, theta_d).energy, 1, 1e-12);
      }
}

TEST(RaySection, ResidualIsTheSumOfItsOrders) {
  for (const Polarisation polarisation : {Polarisation::mean, Polarisation::tracked})
    for (const double theta_d : {0.0, 0.6, -1.2}) {
      const RaySection section(1.55, 0.3, polarisation); // higher orders die out
      const OrderMoments residual = section.residual(2, theta_d);
      OrderMoments sum;
      for (int order = 2; order < 60; ++order) {
        const OrderMoments moments = section.moments(order, theta_d);
        sum.energy += moments.energy;
        sum.forward += moments.forward;
        sum.forward_half += moments.forward_half;
      }
      EXPECT_NEAR(residual.energy, sum.energy, 1e-14);
      EXPECT_NEAR(residual.forward, sum.forward, 1e-10);
      EXPECT_NEAR(residual.forward_half, sum.forward_half, 1e-10);
      EXPECT_GT(sum.energy, 1e-3);
    }
  // Without absorption orders fall off as p^-4; a thousand of them leave 1e-10.
  const RaySection clear(1.55, 0);
  OrderMoments sum;
  for (int order = 3; order <= 1000; ++order) {
    const OrderMoments moments = clear.moments(order, 0.3);
    sum.forward += moments.forward;
    sum.forward_half += moments.forward_half;
  }
  const OrderMoments residual = clear.residual(3, 0.3);
  EXPECT_NEAR(residual.forward, sum.forward, 1e-9);
  EXPECT_NEAR(residual.forward_half, sum.forward_half, 1e-9);
}

/// Integral of N over from..to with the variable s, phi = end -+ s^2, that takes the caustic's root away.
double
direct_integral(const RaySection& section, int order, double theta_d, double from, double to, bool forward) {
  std::vector<double> cuts{from, to};
  for (double c : section.caustics(order, theta_d))
    if (c > from && c < to) cuts.push_back(c);
  // where a piece of phi(h) ends at the rim, N has a kink
  const double eta_prime = bravais_index(section.eta(), theta_d);
  if (order > 0) {
    const double edge =
        std::abs(std::remainder(2 * order * std::asin(1 / eta_prime) - pi + order * pi, 2 * pi));
    if (edge > from && edge < to) cuts.push_back(edge);
  }
  std::sort(cuts.begin(), cuts.end());
  double sum = 0;
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
    const double a = cuts[i], b = cuts[i + 1], middle = (a + b) / 2;
    // Both halves from their end; midpoints in s over tanh-sinh like refinement: trapezoids with x = tanh.
    for (const auto& [end, sign] : {std::pair{a, 1.0}, {b, -1.0}}) {
      const double width = middle - a;
      constexpr int steps = 400;
      for (int k = -steps; k <= steps; ++k) {
        const double t = 3.3 * k / steps, u = pi / 2 * std::sinh(t);
        const double x = 1 / (1 + std::exp(2 * u)); // distance from the end as a share, without cancellation
        const double weight = 3.3 / steps * pi / 2 * std::cosh(t) / (2 * std::cosh(u) * std::cosh(u));
        const double phi = end + sign * width * x * x, jacobian = 2 * width * x;
        if (!(x > 1e-7)) continue; // rounding of phi; x^2 of the integrand's size there is nothing
        sum += weight * jacobian * section.distribution(order, theta_d, phi) * (forward ? phi / pi : 1);
      }
    }
  }
  return 2 * sum;
}

TEST(RaySection, MomentsAreTheIntegralsOfTheDistribution) {
  for (const double theta_d : {0.0, 0.5, 1.0})
    for (int order = 0; order <= 4; ++order) {
      const RaySection section(1.55, 0.1);
      const OrderMoments moments = section.moments(order, theta_d);
      EXPECT_NEAR(direct_integral(section, order, theta_d, 0, pi, false), moments.energy, 5e-9)
          << theta_d << " " << order;
      EXPECT_NEAR(direct_integral(section, order, theta_d, 0, pi, true), moments.forward, 5e-9)
          << theta_d << " " << order;
      EXPECT_NEAR(direct_integral(section, order, theta_d, pi / 2, pi, false), moments.forward_half, 5e-9)
          << theta_d << " " << order;
      EXPECT_NEAR(2 * section.energy_between(order, theta_d, pi / 2, pi), moments.forward_half, 1e-13);
      EXPECT_NEAR(section.energy_between(order, theta_d, -pi, pi), moments.energy, 1e-13);
      EXPECT_NEAR(
          2 * section.energy_between(order, theta_d, 0.2, 0.5),
          direct_integral(section, order, theta_d, 0.2, 0.5, false), 5e-9);
    }
}

/// A_p from its textbook form.
double attenuation(const RaySection& section, int order, double theta_d, double gamma) {
  const double eta = section.eta(), c = std::cos(theta_d) * std::cos(gamma),
               t = std::sqrt(1 - (1 - c * c) / (eta * eta));
  const double s = (c - eta * t) / (c + eta * t), p = (eta * c - t) / (eta * c + t), F = (s * s + p * p) / 2;
  if (order == 0) return F;
  const double index = bravais_index(eta, theta_d), h = std::sin(gamma) / index,
               inclined = std::sin(theta_d) / eta;
  const double path = 2 * std::sqrt(1 - h * h) / std::sqrt(1 - inclined * inclined);
  return (1 - F) * (1 - F) * std::pow(F, order - 1) * std::exp(-order * section.sigma_a() * path);
}

TEST(RaySection, AveragesAreConvolutions) {
  const RaySection section(1.55, 0.2);
  const double theta_d = 0.3, width = 0.05;
  for (const int order : {0, 1, 2, 3})
    for (const double phi : {0.0, 0.3, 1.5, pi}) {
      double sum = 0; // windows of energy, each finite at caustics
      constexpr int pieces = 4000;
      for (int k = 0; k < pieces; ++k) {
        const double a = -pi + 2 * pi * k / pieces, b = std::min(-pi + 2 * pi * (k + 1) / pieces, pi);
        if (std::abs(std::remainder((a + b) / 2 - phi, 2 * pi)) > 9 * width) continue;
        const double x = std::remainder((a + b) / 2 - phi, 2 * pi) / width;
        sum +=
            section.energy_between(order, theta_d, a, b) * std::exp(-x * x / 2) / (width * std::sqrt(2 * pi));
      }
      EXPECT_NEAR(section.averaged(order, theta_d, phi, width), sum, 3e-4 * sum + 1e-9)
          << order << " " << phi;
    }
  // Terms of the Fourier series: those of the rays, less what a Gaussian takes. Trapezoids are exact on one
  // side, fine enough on the other.
  const double eta_prime = bravais_index(1.55, theta_d);
  for (const int order : {0, 1, 2, 3})
    for (const int k : {0, 3, 17}) {
      double term = 0, expected = 0;
      for (int i = 0; i < 720; ++i) {
        const double phi = 2 * pi * i / 720;
        term += section.averaged(order, theta_d, phi, width) * std::cos(k * phi) * 2 * pi / 720;
      }
      constexpr int rays = 200000;
      for (int i = 0; i < rays; ++i) {
        const double gamma = pi / 2 * (i + 0.5) / rays, h = std::sin(gamma);
        const double phi = 2 * order * std::asin(h / eta_prime) - 2 * gamma + order * pi;
        expected +=
            attenuation(section, order, theta_d, gamma) * std::cos(gamma) * std::cos(k * phi) * pi / 2 / rays;
      }
      expected *= std::exp(-0.5 * k * k * width * width);
      EXPECT_NEAR(term, expected, 1e-10 * section.moments(order, theta_d).energy) << order << " " << k;
    }
  // so wide that nothing but energy is left
  EXPECT_NEAR(section.averaged(2, theta_d, 1, 10), section.moments(2, theta_d).energy / (2 * pi), 1e-12);
}

TEST(RaySection, IsEvenAndPeriodic) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-3, 3);
  for (int i = 0; i < 300; ++i) {
    const RaySection section(1.05 + std::abs(any(random)) / 3, std::abs(any(random)) / 10);
    const double phi = any(random), theta_d = any(random) / 2;
    for (int order = 0; order < 6; ++order) {
      const double N = section.distribution(order, theta_d, phi);
      ASSERT_TRUE(N >= 0 && std::isfinite(N));
      EXPECT_EQ(section.distribution(order, theta_d, -phi), N);
      EXPECT_EQ(section.distribution(order, -theta_d, phi), N);
    }
  }
}

TEST(RaySection, EventsComeBackToTheirAzimuth) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> any(-1, 1);
  std::size_t rays = 0;
  for (int i = 0; i < 500; ++i) {
    const RaySection section(1.5 + 0.45 * any(random), 0);
    const double theta_d = 1.5 * any(random), phi = pi * any(random);
    const double eta_prime = bravais_index(section.eta(), theta_d);
    for (int p = 0; p < 9; ++p)
      for (const RayEvent& event : section.events(p, theta_d, phi)) {
        const double back =
            2 * p * std::asin(event.offset / eta_prime) - 2 * std::asin(event.offset) + p * pi;
        // near the rim asin loses half the digits
        EXPECT_NEAR(std::remainder(back - phi, 2 * pi), 0, 1e-13 + 1e-15 / (event.cos_incidence + 1e-9)) << p;
        ++rays;
      }
  }
  EXPECT_GT(rays, 4000U);
}

TEST(RaySection, StaysFiniteAtTheEnds) {
  for (const double theta_d :
       {89.9999999 * degree, std::nextafter(pi / 2, 0.0), -std::nextafter(pi / 2, 0.0)})
    for (const double sigma_a : {0.0, 1.0, 1e9}) {
      const RaySection section(1.55, sigma_a);
      for (int order = 0; order < 4; ++order) {
        const OrderMoments moments = section.moments(order, theta_d);
        EXPECT_TRUE(moments.energy >= 0 && moments.energy <= 1) << theta_d;
        for (const double phi : {0.0, 1.0, 3.0, pi}) {
          const double N = section.distribution(order, theta_d, phi);
          EXPECT_TRUE(N >= 0 && std::isfinite(N)) << theta_d << " " << order << " " << phi;
        }
      }
      EXPECT_GT(section.moments(0, theta_d).energy, 0.99); // a mirror at last
      EXPECT_TRUE(section.residual(3, theta_d).energy >= 0);
    }
  // On the caustic to the last bit N may be infinite, but not lack a sign.
  const RaySection section(1.55, 0.2);
  const double caustic = section.caustics(2, 0)[0];
  EXPECT_GT(section.distribution(2, 0, caustic), 1e5);
}

TEST(RaySection, ErrorEstimateCoversARoundingOfTheAzimuth) {
  const RaySection section(1.55, 0.2);
  EXPECT_EQ(section.error_estimate(2, 0.3, 0.1), 1e-12);
  const double caustic = section.caustics(2, 0.3).at(0);
  EXPECT_NEAR(section.error_estimate(2, 0.3, 2 * pi - caustic + 1e-5), 1e-10, 1e-14);
  EXPECT_EQ(section.error_estimate(2, 0.3, caustic), 1);
  for (double distance = 1e-9; distance < 0.1; distance *= 7) {
    const double phi = caustic - distance, next = std::nextafter(phi, 0.0);
    const double here = section.distribution(2, 0.3, phi), beside = section.distribution(2, 0.3, next);
    EXPECT_NEAR(here, beside, section.error_estimate(2, 0.3, phi) * here) << distance;
  }
  EXPECT_THROW((void)section.error_estimate(2, 0.3, std::nan("")), scatter::InputError);
  EXPECT_THROW((void)section.error_estimate(-1, 0.3, 0), scatter::InputError);
}

TEST(RaySection, CausticOfTRTEndsWhereBravaisIndexIsTwo) {
  const RaySection section(1.55, 0);
  EXPECT_EQ(section.caustics(2, 46.86 * degree).size(), 1U);
  EXPECT_TRUE(section.caustics(2, 46.88 * degree).empty());
  EXPECT_TRUE(section.caustics(1, 0).empty());
  EXPECT_TRUE(section.caustics(0, 0).empty());
  const double eta = 1.55, h = std::sqrt((4 - eta * eta) / 3);
  EXPECT_NEAR(section.caustics(2, 0)[0], 4 * std::asin(h / eta) - 2 * std::asin(h), 1e-15);
}

TEST(RaySection, RefusesWhatIsNoFiber) {
  const double nan = std::numeric_limits<double>::quiet_NaN(),
               infinity = std::numeric_limits<double>::infinity();
  for (const double eta : {1.0, 0.9, -1.5, nan, infinity})
    EXPECT_THROW(RaySection(eta, 0), scatter::InputError);
  for (const double sigma_a : {-1e-9, nan, infinity})
    EXPECT_THROW(RaySection(1.5, sigma_a), scatter::InputError);
  const RaySection section(1.5, 0);
  for (const double theta_d : {pi / 2, -pi / 2, 2.0, nan}) {
    EXPECT_THROW((void)section.distribution(0, theta_d, 0), scatter::InputError);
    EXPECT_THROW((void)section.moments(0, theta_d), scatter::InputError);
    EXPECT_THROW((void)section.residual(0, theta_d), scatter::InputError);
    EXPECT_THROW((void)section.caustics(0, theta_d), scatter::InputError);
  }
  EXPECT_THROW((void)section.distribution(-1, 0, 0), scatter::InputError);
  EXPECT_THROW((void)section.distribution(1001, 0, 0), scatter::InputError);
  EXPECT_THROW((void)section.distribution(2, 0, nan), scatter::InputError);
  EXPECT_THROW((void)section.energy_between(2, 0, 1, 0), scatter::InputError);
  EXPECT_THROW((void)section.averaged(2, 0, 1, 0), scatter::InputError);
}

} // namespace
