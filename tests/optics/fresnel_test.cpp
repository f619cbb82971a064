#include <scatter/optics/errors.hpp>
#include <scatter/optics/fresnel.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <limits>
#include <vector>

namespace {

using namespace scatter;
using complex = std::complex<double>;
using long_complex = std::complex<long double>;

const std::vector<complex> real_indices{1.0003, 1.333, 1.5, 4.0, 0.75, 1 / 1.333, 0.2};
const std::vector<complex> all_indices{1.0003,   1.333,      4.0,           0.75,      {1.33, 1e-9},
                                       {10, 10}, {0.2, 3.0}, {1 + 1e-9, 0}, {1.5, 0.3}};

std::vector<double> cosines() {
  std::vector<double> c{1, 1 - 1e-12, 1e-3, 1e-6, 1e-12};
  for (double angle = 0.05; angle < 1.57; angle += 0.05) c.push_back(std::cos(angle));
  return c;
}

/// Bohren & Huffman 2.67-2.70 as printed, in long double.
struct Printed {
  long_complex r_s, r_p, t_s, t_p, cos_t;
};
Printed printed(complex index, double cosine) {
  const long_complex m = index;
  const long double c = cosine;
  const long double sine2 = (1 - c) * (1 + c);
  long_complex cos_t = std::sqrt(1.0L - sine2 / (m * m));
  if ((m * cos_t).real() + (m * cos_t).imag() < 0) cos_t = -cos_t;
  return {
      (c - m * cos_t) / (c + m * cos_t), (cos_t - m * c) / (cos_t + m * c), 2 * c / (c + m * cos_t),
      2 * c / (cos_t + m * c), cos_t};
}

void expect_near(
    complex actual, long_complex expected, double tolerance, const char* what, complex m, double c) {
  EXPECT_LE(std::abs(long_complex(actual) - expected), tolerance * std::abs(expected) + 1e-300L)
      << what << ": " << actual << " for " << complex(expected) << " at m = " << m << ", cos = " << c;
}

TEST(Fresnel, AgreesWithThePrintedFormsInLongDouble) {
  for (const complex m : all_indices)
    for (const double c : cosines()) {
      const auto [r_s, r_p, t_s, t_p, cos_t] = printed(m, c);
      // The printed differences cancel for m near 1: there long double itself keeps about 1e-19 / |m - 1|.
      const double tolerance = 2e-14 + 1e-18 / std::abs(m - 1.0);
      const auto f = fresnel(m, c);
      expect_near(f.r_perpendicular, r_s, tolerance, "r_s", m, c);
      expect_near(f.t_perpendicular, t_s, tolerance, "t_s", m, c);
      expect_near(f.t_parallel, t_p, tolerance, "t_p", m, c);
      expect_near(f.cos_transmitted, cos_t, tolerance, "cos_t", m, c);
      // r_p has a zero (Brewster's angle), where only the absolute error counts.
      EXPECT_LE(std::abs(long_complex(f.r_parallel) - r_p), tolerance * (std::abs(r_p) + std::abs(r_s)))
          << m << c;
    }
}

TEST(Fresnel, EnergyIsConserved) {
  for (const complex m : all_indices)
    for (const double c : cosines()) {
      const auto energy = fresnel_energy(m, c);
      EXPECT_NEAR(energy.reflectivity_perpendicular + energy.transmissivity_perpendicular, 1, 1e-14)
          << m << c;
      EXPECT_NEAR(energy.reflectivity_parallel + energy.transmissivity_parallel, 1, 1e-14) << m << c;
      EXPECT_GE(energy.transmissivity_perpendicular, 0);
      EXPECT_GE(energy.transmissivity_parallel, 0);
    }
}

TEST(Fresnel, TotalReflectionKeepsTheAmplitude) {
  for (const complex m : real_indices) {
    if (m.real() >= 1) continue;
    const double critical = std::sqrt((1 - m.real()) * (1 + m.real())); // cosine of the critical angle
    for (double share = 0.01; share < 1; share += 0.01) {
      const auto f = fresnel(m, share * critical);
      EXPECT_NEAR(std::abs(f.r_perpendicular), 1, 1e-14);
      EXPECT_NEAR(std::abs(f.r_parallel), 1, 1e-14);
      // It decays behind the interface: exp(i k m cos z) with a positive imaginary part.
      EXPECT_GT((m * f.cos_transmitted).imag(), 0);
      EXPECT_NEAR(fresnel_energy(m, share * critical).transmissivity_perpendicular, 0, 1e-15);
      // With exp(-i omega t) both phases lag: Bohren & Huffman's r_s = exp(-2 i delta), tan(delta) = |w| / c.
      const double delta = std::atan((m * f.cos_transmitted).imag() / (share * critical));
      EXPECT_NEAR(std::abs(f.r_perpendicular - std::polar(1.0, -2 * delta)), 0, 1e-13);
    }
    EXPECT_GT(fresnel_energy(m, std::min(1.0, 1.01 * critical)).transmissivity_perpendicular, 0.01);
  }
}

TEST(Fresnel, TotalReflectionSurvivesATraceOfAbsorption) {
  // From water with k = 1e-9 into air the relative index has k < 0; the evanescent wave must still decay.
  const complex water{1.333, 1e-9};
  const auto f = fresnel(1.0 / water, 0.3);
  EXPECT_NEAR(std::abs(f.r_perpendicular), 1, 1e-8);
  EXPECT_NEAR(std::abs(f.r_perpendicular - fresnel(1 / 1.333, 0.3).r_perpendicular), 0, 1e-8);
  const auto refracted = fresnel(1.0 / water, 0.9);
  EXPECT_NEAR(std::abs(refracted.r_perpendicular - fresnel(1 / 1.333, 0.9).r_perpendicular), 0, 1e-8);
}

TEST(Fresnel, BrewsterAngleReflectsNoParallel) {
  for (const complex m : real_indices) {
    const double c = 1 / std::hypot(1.0, m.real()); // tan(angle) = m
    const auto f = fresnel(m, c);
    EXPECT_LE(std::abs(f.r_parallel), 1e-15) << m;
    EXPECT_NEAR(fresnel_energy(m, c).transmissivity_parallel, 1, 1e-14) << m;
    EXPECT_NEAR(f.cos_transmitted.real(), std::sqrt((1 - c) * (1 + c)), 1e-14)
        << "refracted at a right angle";
  }
}

TEST(Fresnel, SnellHolds) {
  for (const complex m : all_indices)
    for (const double c : cosines()) {
      const complex cos_t = fresnel(m, c).cos_transmitted;
      const double sine2 = (1 - c) * (1 + c);
      EXPECT_NEAR(std::abs(m * m * (1.0 - cos_t * cos_t) - sine2), 0, 1e-14 * (1 + std::norm(m))) << m << c;
    }
}

TEST(Fresnel, NormalIncidence) {
  for (const complex m : all_indices) {
    const auto f = fresnel(m, 1);
    const complex r = (1.0 - m) / (1.0 + m);
    EXPECT_LE(std::abs(f.r_perpendicular - r), 1e-14 * std::abs(r));
    EXPECT_LE(std::abs(f.r_parallel - r), 1e-14 * std::abs(r));
    EXPECT_LE(std::abs(f.t_perpendicular - 2.0 / (1.0 + m)), 1e-14);
    EXPECT_LE(std::abs(f.t_parallel - 2.0 / (1.0 + m)), 1e-14);
  }
}

TEST(Fresnel, GrazingIncidenceReflectsEverything) {
  for (const complex m : all_indices) {
    const auto f = fresnel(m, 0);
    EXPECT_LE(std::abs(f.r_perpendicular + 1.0), 1e-14);
    EXPECT_LE(std::abs(f.r_parallel - 1.0), 1e-14);
    EXPECT_EQ(f.t_perpendicular, 0.0);
    EXPECT_EQ(f.t_parallel, 0.0);
    EXPECT_EQ(fresnel_energy(m, 0).transmissivity_parallel, 0);
  }
}

TEST(Fresnel, ReciprocityStokesRelations) {
  // The way back: r' = -r and t t' = 1 - r^2, for complex m and beyond total reflection alike.
  for (const complex m : all_indices)
    for (const double c : cosines()) {
      if (m.imag() >= m.real()) continue; // a metal is outside the declared domain of the way back
      const auto there = fresnel(m, c);
      const auto back = fresnel(1.0 / m, there.cos_transmitted);
      if (std::abs(c) < 1e-5)
        continue; // the way back meets 1 - r^2 -> 0 with the rounding of cos_transmitted
      const double tolerance = 1e-11;
      EXPECT_LE(std::abs(back.r_perpendicular + there.r_perpendicular), tolerance) << m << c;
      EXPECT_LE(std::abs(back.r_parallel + there.r_parallel), tolerance) << m << c;
      EXPECT_LE(
          std::abs(
              there.t_perpendicular * back.t_perpendicular -
              (1.0 - there.r_perpendicular * there.r_perpendicular)),
          tolerance)
          << m << c;
      EXPECT_LE(
          std::abs(there.t_parallel * back.t_parallel - (1.0 - there.r_parallel * there.r_parallel)),
          tolerance)
          << m << c;
    }
}

TEST(Fresnel, NoInterfaceDoesNothing) {
  for (const double c : {0.0, 1e-9, 0.5, 1.0}) {
    const auto f = fresnel(1, c);
    EXPECT_EQ(f.r_perpendicular, 0.0);
    EXPECT_EQ(f.r_parallel, 0.0);
    EXPECT_EQ(f.t_perpendicular, 1.0);
    EXPECT_EQ(f.t_parallel, 1.0);
    EXPECT_EQ(fresnel_energy(1, c).transmissivity_perpendicular, 1);
  }
}

TEST(Fresnel, WrongInputIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW((void)fresnel(0, 0.5), InputError);
  EXPECT_THROW((void)fresnel({nan, 0}, 0.5), InputError);
  EXPECT_THROW((void)fresnel(1.33, nan), InputError);
  EXPECT_THROW((void)fresnel(1.33, -0.1), InputError);
  EXPECT_THROW((void)fresnel_energy(1.33, 1.1), InputError);
}

} // namespace
