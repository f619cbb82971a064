// Averages against direct quadrature with other rules and other points.
#include <scatter/exact/average.hpp>
#include <scatter/exact/mie.hpp>
#include <scatter/exact/sun_disc.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numeric>

namespace scatter::exact {
namespace {

constexpr double wavelength_m = 600e-9;
const std::complex<double> absorbing{1.33, 2e-3}; // too lossy for resonances that a test could miss

AverageRequest lognormal(double median_m, double sigma, double tolerance) {
  AverageRequest request;
  const double width = std::log(sigma);
  request.radii.density = [=](double r) {
    const double z = std::log(r / median_m) / width;
    return std::exp(-z * z / 2) / (r * width * std::sqrt(2 * pi));
  };
  request.radii.smallest_m = median_m * std::pow(sigma, -5.5);
  request.radii.largest_m = median_m * std::pow(sigma, 7);
  request.band = {wavelength_m, wavelength_m, {}};
  request.index = [](double) { return absorbing; };
  request.theta_deg = {0, 17, 60, 90, 138, 180};
  request.tolerance = tolerance;
  return request;
}

/// Sums of cross sections and of the four elements over spheres, by Simpson's rule in the radius itself.
struct Direct {
  double C_ext = 0, C_sca = 0, C_abs = 0, g = 0;
  std::vector<std::array<double, 4>> S;
  explicit Direct(std::size_t angles) : S(angles) {}
  void add(double radius, double wavelength, double weight, const std::vector<double>& theta_deg) {
    const double k = 2 * pi / wavelength;
    const MieResult mie = mie_at_degrees(k * radius, absorbing, theta_deg, 1);
    const double area = weight * pi * radius * radius;
    C_ext += area * mie.Qext;
    C_sca += area * mie.Qsca;
    C_abs += area * mie.Qabs;
    g += area * mie.Qsca * mie.g;
    for (std::size_t i = 0; i < S.size(); ++i) {
      const auto S1 = mie.S1[i], S2 = mie.S2[i];
      const std::complex<double> cross = S2 * std::conj(S1);
      S[i][0] += weight / (k * k) * (std::norm(S1) + std::norm(S2)) / 2;
      S[i][1] += weight / (k * k) * (std::norm(S2) - std::norm(S1)) / 2;
      S[i][2] += weight / (k * k) * cross.real();
      S[i][3] += weight / (k * k) * cross.imag();
    }
  }
};

void expect_within_estimate(const Average& average, const Direct& direct, double truth_error) {
  const double bulk = average.bulk_error + truth_error;
  EXPECT_NEAR(average.C_ext / direct.C_ext, 1, bulk);
  EXPECT_NEAR(average.C_sca / direct.C_sca, 1, bulk);
  EXPECT_NEAR(average.C_abs / direct.C_abs, 1, bulk);
  EXPECT_NEAR(average.g, direct.g / direct.C_sca, bulk);
  for (std::size_t i = 0; i < direct.S.size(); ++i) {
    const double S11 = direct.S[i][0] / direct.C_sca;
    const double room = (average.error_estimate[i] + truth_error) * S11;
    EXPECT_NEAR(average.S11[i], S11, room) << "angle " << i;
    EXPECT_NEAR(average.S12[i], direct.S[i][1] / direct.C_sca, room) << "angle " << i;
    EXPECT_NEAR(average.S33[i], direct.S[i][2] / direct.C_sca, room) << "angle " << i;
    EXPECT_NEAR(average.S34[i], direct.S[i][3] / direct.C_sca, room) << "angle " << i;
  }
}

double simpson(int i, int steps) {
  return i == 0 || i == steps ? 1.0 / 3 : i % 2 ? 4.0 / 3 : 2.0 / 3;
}

TEST(Average, OfALognormalIsTheDirectIntegral) {
  Direct direct(6);
  const AverageRequest fine = lognormal(2e-6, 1.3, 1e-3);
  constexpr int steps = 20000;
  const double low = fine.radii.smallest_m, high = fine.radii.largest_m;
  for (int i = 0; i <= steps; ++i) {
    const double r = low + (high - low) * i / steps;
    direct.add(
        r, wavelength_m, simpson(i, steps) * (high - low) / steps * fine.radii.density(r), fine.theta_deg);
  }
  for (const double tolerance : {0.3, 3e-2, 1e-3, 1e-5}) {
    const Average average = exact::average(lognormal(2e-6, 1.3, tolerance));
    EXPECT_TRUE(average.converged) << tolerance;
    EXPECT_LE(average.largest_error, tolerance);
    expect_within_estimate(average, direct, 2e-6);
  }
}

TEST(Average, OfABandIsTheDirectIntegral) {
  AverageRequest request;
  request.radii.radius_m = {4e-6, 7.3e-6};
  request.radii.number = {3, 1};
  request.band = {500e-9, 640e-9, [](double l) { return 1 + std::cos(2e7 * l); }};
  request.index = [](double) { return absorbing; };
  request.theta_deg = {0, 17, 60, 90, 138, 180};
  request.tolerance = 1e-4;
  const Average average = exact::average(request);
  EXPECT_TRUE(average.converged);
  Direct direct(6);
  constexpr int steps = 1000;
  double total = 0;
  for (int i = 0; i <= steps; ++i)
    total += simpson(i, steps) * request.band.weight(500e-9 + 140e-9 * i / steps);
  for (int i = 0; i <= steps; ++i) {
    const double l = 500e-9 + 140e-9 * i / steps;
    const double weight = simpson(i, steps) * request.band.weight(l) / total;
    direct.add(4e-6, l, 0.75 * weight, request.theta_deg);
    direct.add(7.3e-6, l, 0.25 * weight, request.theta_deg);
  }
  expect_within_estimate(average, direct, 1e-6);
  const double r2 = (3 * 16 + 7.3 * 7.3) / 4, r3 = (3 * 64 + std::pow(7.3, 3)) / 4;
  EXPECT_NEAR(average.effective_radius_m / (r3 / r2 * 1e-6), 1, average.bulk_error);
}

TEST(Average, OfSizesAndBandTogetherIsTheDoubleIntegral) {
  AverageRequest request = lognormal(2e-6, 1.25, 3e-3);
  request.band = {500e-9, 600e-9, {}};
  const Average average = exact::average(request);
  EXPECT_TRUE(average.converged);
  Direct direct(6);
  constexpr int radii = 600, bands = 40;
  const double low = request.radii.smallest_m, high = request.radii.largest_m;
  for (int i = 0; i <= radii; ++i)
    for (int j = 0; j <= bands; ++j) {
      const double r = low + (high - low) * i / radii;
      direct.add(
          r, 500e-9 + 100e-9 * j / bands,
          simpson(i, radii) * (high - low) / radii * request.radii.density(r) * simpson(j, bands) / bands,
          request.theta_deg);
    }
  expect_within_estimate(average, direct, 1e-5);
}

TEST(Average, OfANarrowDistributionIsTheSphere) {
  AverageRequest request = lognormal(10e-6, 1.000001, 1e-4);
  const Average average = exact::average(request);
  const MieResult sphere = mie_at_degrees(2 * pi * 10e-6 / wavelength_m, absorbing, request.theta_deg);
  EXPECT_NEAR(average.Q_ext / sphere.Qext, 1, 1e-5);
  EXPECT_NEAR(average.g, sphere.g, 1e-5);
  for (std::size_t i = 0; i < sphere.S1.size(); ++i)
    EXPECT_NEAR(average.S11[i] / sphere.phase_function[i], 1, 1e-4) << i;
}

TEST(Average, OfOneSphereAtOneWavelengthIsTheSphere) {
  AverageRequest request = lognormal(10e-6, 1.5, 1e-3);
  request.radii = {};
  request.radii.radius_m = {10e-6};
  request.radii.number = {7};
  const Average average = exact::average(request);
  const MieResult sphere = mie_at_degrees(2 * pi * 10e-6 / wavelength_m, absorbing, request.theta_deg);
  EXPECT_EQ(average.spheres, 1U);
  EXPECT_NEAR(average.Q_abs / sphere.Qabs, 1, 1e-14);
  EXPECT_EQ(average.effective_variance, 0);
  EXPECT_LT(average.largest_error, 1e-11);
  for (std::size_t i = 0; i < sphere.S1.size(); ++i)
    EXPECT_NEAR(average.S11[i] / sphere.phase_function[i], 1, 1e-13) << i;
}

TEST(Average, HasAPhaseFunctionWhoseIntegralIsOne) {
  AverageRequest request = lognormal(2e-6, 1.3, 1e-3);
  // Gauss-Chebyshev points in the angle; the integral of S11 sin(theta) is smooth and even about both ends.
  constexpr int count = 1000;
  request.theta_deg.clear();
  for (int i = 0; i < count; ++i) request.theta_deg.push_back(180 * (i + 0.5) / count);
  for (const double disc : {0.0, 2.0}) {
    request.sun_disc_deg = disc;
    const Average average = exact::average(request);
    double sum = 0, cosine = 0;
    for (int i = 0; i < count; ++i) {
      // Fejer's first rule: exact weights for cosines, so that the ends cost no accuracy.
      const double theta = pi * (i + 0.5) / count;
      double weight = 1;
      for (int k = 1; k <= count / 2; ++k) weight -= 2 * std::cos(2 * k * theta) / (4.0 * k * k - 1);
      weight *= 2.0 / count;
      sum += 2 * pi * weight * average.S11[static_cast<std::size_t>(i)];
      cosine += 2 * pi * weight * std::cos(theta) * average.S11[static_cast<std::size_t>(i)];
    }
    EXPECT_NEAR(sum, 1, 1e-7) << "disc " << disc;
    // Each sample's phase function has its own g: the sums agree whatever the quadrature over radii. A disc
    // of radius r multiplies the mean cosine by (1 + cos r) / 2.
    const double r = disc / 2 * radians_per_degree;
    EXPECT_NEAR(cosine, average.g * (1 + std::cos(r)) / 2, 1e-7) << "disc " << disc;
  }
}

TEST(Average, IsTheSameForAnyNumberOfThreads) {
  AverageRequest request = lognormal(2e-6, 1.3, 0.2);
  request.band = {500e-9, 520e-9, {}};
  request.sun_disc_deg = 3;
  request.threads = 1;
  const Average one = exact::average(request);
  for (const int threads : {2, 3, 200}) {
    request.threads = threads;
    const Average other = exact::average(request);
    EXPECT_EQ(one.S11, other.S11);
    EXPECT_EQ(one.S34, other.S34);
    EXPECT_EQ(one.error_estimate, other.error_estimate);
    EXPECT_EQ(one.C_ext, other.C_ext);
    EXPECT_EQ(one.spheres, other.spheres);
  }
}

TEST(Average, SaysWhenItStopsShort) {
  AverageRequest request = lognormal(20e-6, 1.5, 1e-6);
  request.most_spheres = 500;
  const Average average = exact::average(request);
  EXPECT_FALSE(average.converged);
  EXPECT_GT(average.largest_error, 1e-6);
  EXPECT_LE(average.spheres, 500U);
}

TEST(Average, SeesRippleInStepWithItsPoints) {
  // A narrow density about a size where 32 points of the radius fall in step with the forward-backward
  // ripple: whatever the step, the estimate must cover the error.
  for (const double median : {10e-6, 10.3e-6, 11.7e-6, 13.1e-6}) {
    AverageRequest request = lognormal(median, 1.08, 0.05);
    const Average coarse = exact::average(request);
    request.tolerance = 1e-4;
    const Average fine = exact::average(request);
    for (std::size_t i = 0; i < coarse.S11.size(); ++i)
      EXPECT_LE(std::abs(coarse.S11[i] / fine.S11[i] - 1), coarse.error_estimate[i] + fine.error_estimate[i])
          << median << " angle " << i;
  }
}

TEST(Average, RefusesWhatIsImpossible) {
  const auto broken = [](auto&& change) {
    AverageRequest request = lognormal(5e-6, 1.4, 1e-2);
    change(request);
    return request;
  };
  EXPECT_THROW((void)average(broken([](auto& r) { r.theta_deg = {181}; })), InputError);
  EXPECT_THROW((void)average(broken([](auto& r) { r.theta_deg = {}; })), InputError);
  EXPECT_THROW((void)average(broken([](auto& r) { r.tolerance = 0; })), InputError);
  EXPECT_THROW((void)average(broken([](auto& r) { r.sun_disc_deg = 70; })), InputError);
  EXPECT_THROW((void)average(broken([](auto& r) { r.band.last_m = 1e-9; })), InputError);
  EXPECT_THROW((void)average(broken([](auto& r) { r.radii.largest_m = 1; })), InputError);
  EXPECT_THROW((void)average(broken([](auto& r) { r.radii.radius_m = {1e-6}; })), InputError);
  EXPECT_THROW((void)average(broken([](auto& r) { r.index = [](double) { return 1.0; }; })), InputError);
}

/// f(theta) at the disc's grid, averaged.
template <typename Function>
std::vector<double>
disc_means(const std::vector<double>& theta_deg, double diameter_deg, int level, Function f) {
  const SunDisc disc(theta_deg, diameter_deg, level);
  std::vector<double> values, means;
  for (const double t : disc.grid_deg()) values.push_back(f(t * radians_per_degree));
  for (std::size_t i = 0; i < disc.size(); ++i) means.push_back(disc.mean(i, values));
  return means;
}

TEST(SunDisc, MultipliesLegendrePolynomialsByItsOwnTransform) {
  // Funk-Hecke: the mean of P_l over a disc of radius r is P_l times (P_{l-1}(c) - P_{l+1}(c)) / ((2l + 1)
  // (1 - c)), c = cos r. Everywhere, the poles and discs that reach over them included.
  const std::vector<double> theta{0,  0.1,   0.26, 0.2665, 0.27,   0.5,      1,     30,
                                  90, 137.9, 179,  179.5,  179.73, 179.7335, 179.9, 180};
  for (const double diameter : {0.533, 3.0, 40.0})
    for (const unsigned l : {0U, 1U, 2U, 17U, 300U}) {
      const double c = std::cos(diameter / 2 * radians_per_degree);
      const double factor =
          l == 0 ? 1 : (std::legendre(l - 1, c) - std::legendre(l + 1, c)) / ((2.0 * l + 1) * (1 - c));
      const auto P = [&](double t) { return std::legendre(l, std::clamp(std::cos(t), -1.0, 1.0)); };
      const auto means = disc_means(theta, diameter, SunDisc::level_for(std::max(l / 2.0, 20.0)) + 1, P);
      for (std::size_t i = 0; i < theta.size(); ++i)
        EXPECT_NEAR(means[i], factor * P(theta[i] * radians_per_degree), 2e-6)
            << "l " << l << " diameter " << diameter << " at " << theta[i];
    }
}

TEST(SunDisc, OfASphereIsTheDirectIntegralOverDirections) {
  // Directions on rings around the centre, of which the scattering angle follows by the cosine rule.
  const double x = 400, diameter = 0.533;
  const std::vector<double> theta{0, 0.2, 0.3, 42, 138.5, 179.9, 180};
  AverageRequest request;
  request.radii.radius_m = {x * wavelength_m / (2 * pi)};
  request.radii.number = {1};
  request.band = {wavelength_m, wavelength_m, {}};
  request.index = [](double) { return absorbing; };
  request.theta_deg = theta;
  request.sun_disc_deg = diameter;
  const Average average = exact::average(request);
  EXPECT_TRUE(average.converged);
  constexpr int rings = 60, turns = 240;
  for (std::size_t i = 0; i < theta.size(); ++i) {
    std::vector<double> directions;
    const double c = theta[i] * radians_per_degree;
    for (int ring = 0; ring < rings; ++ring)
      for (int turn = 0; turn < turns; ++turn) {
        // Rings of equal solid angle.
        const double r =
            2 * std::asin(std::sqrt((ring + 0.5) / rings) * std::sin(diameter / 4 * radians_per_degree));
        const double phi = 2 * pi * (turn + 0.5) / turns;
        const double cosine = std::cos(c) * std::cos(r) + std::sin(c) * std::sin(r) * std::cos(phi);
        directions.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)));
      }
    const MieResult mie = exact::mie(x, absorbing, directions);
    const double mean =
        std::accumulate(mie.phase_function.begin(), mie.phase_function.end(), 0.0) / (rings * turns);
    EXPECT_NEAR(average.S11[i] / mean, 1, average.error_estimate[i] + 3e-4) << theta[i];
    EXPECT_LT(average.error_estimate[i], 1e-4) << theta[i];
  }
}

TEST(SunDisc, EstimatesItsError) {
  // Against a grid eight times as fine.
  const double x = 900;
  std::vector<double> theta;
  for (int i = 0; i <= 90; ++i) theta.push_back(2 * i);
  const int level = SunDisc::level_for(x);
  const SunDisc disc(theta, 0.533, level, true), finer(theta, 0.533, level + 3);
  const auto f = mie_at_degrees(x, {1.33, 0}, disc.grid_deg()).phase_function;
  const auto g = mie_at_degrees(x, {1.33, 0}, finer.grid_deg()).phase_function;
  for (std::size_t i = 0; i < theta.size(); ++i) {
    const double truth = finer.mean(i, g), error = std::abs(disc.mean(i, f) - truth);
    EXPECT_LE(error, std::abs(disc.coarse_mean(i, f) - disc.mean(i, f)) / 32 + 1e-10 * truth) << theta[i];
    EXPECT_LE(error, 1e-4 * truth) << theta[i];
  }
}

} // namespace
} // namespace scatter::exact
