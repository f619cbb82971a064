#include <scatter/optics/errors.hpp>
#include <scatter/optics/refractive_index.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/job.hpp>
#include <scatter/phase/truncation.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <numeric>

/// Choosing settings by tolerance, and the errors that tables claim.
namespace {

using namespace scatter;
using namespace scatter::phase;

std::vector<double> range(double first, double last, double step) {
  std::vector<double> values;
  for (int i = 0; first + i * step <= last + 1e-9; ++i) values.push_back(first + i * step);
  return values;
}

std::vector<int> upto(int last) {
  std::vector<int> orders(last + 1);
  std::iota(orders.begin(), orders.end(), 0);
  return orders;
}

/// A sphere that is traced as any drop.
Request sphere_as_drop(double radius_m, double first_deg, double last_deg) {
  Request request;
  request.shape = drop::cosine_series(radius_m, std::vector<double>(8, 0.0));
  request.wavelength_m = {650e-9};
  request.index = parse_index_source("1.331");
  request.theta_deg = range(first_deg, last_deg, 0.1);
  request.phi_deg = {0};
  request.sun_disc_deg = 0.533;
  request.method = Method::patches;
  return request;
}

Request raindrop() {
  Request request;
  request.shape = drop::beard_chuang(0.5e-3);
  request.sun_elevation_deg = 20;
  request.wavelength_m = {450e-9, 650e-9};
  request.theta_deg = range(120, 150, 0.25);
  request.phi_deg = range(0, 180, 10);
  return request;
}

struct Published {
  double radius_m;
  int last;
  double from_deg, to_deg, error;
};

TEST(Truncation, CostsWhatAnIndependentComputationFound) {
  // Coherent sums of exact orders against Lorenz-Mie, computed elsewhere (Python) for water and sunlight.
  for (const auto& [radius, last, from, to, error] :
       {Published{0.1e-3, 3, 137, 150, 0.048},
        {0.1e-3, 3, 130, 137, 0.147},
        {0.1e-3, 8, 137, 150, 0.010},
        {0.1e-3, 8, 130, 137, 0.035},
        {0.4e-3, 3, 137, 150, 0.027},
        {0.4e-3, 3, 130, 137, 0.137},
        {0.4e-3, 8, 137, 150, 0.0045},
        {0.4e-3, 8, 130, 137, 0.025}}) {
    // Windows of 2 deg must stay inside.
    const auto theta = range(from + 2, to - 2, 0.25);
    const Truncation truncation(2 * pi * radius / 650e-9, 1.331, theta, 8, 0);
    const double found = root_mean_square(truncation.error(upto(last)));
    std::printf("%g mm, p <= %d, %g..%g deg: %.2f %%\n", radius * 1e3, last, from, to, 100 * found);
    EXPECT_NEAR(found, error, 0.4 * error);
  }
}

TEST(Truncation, VanishesWithAllOrdersOfAnAbsorbingSphere) {
  const auto theta = range(20, 160, 5);
  const Truncation truncation(500, {1.33, 0.02}, theta, 6, 0); // rays are gone after one crossing
  EXPECT_LT(root_mean_square(truncation.error(upto(6))), 1e-6);
  EXPECT_GT(root_mean_square(truncation.error(std::vector<int>{1, 2})), 0.5);
}

struct Claim {
  double radius_m;
  Diffraction diffraction;
  int last;
  double from_deg, to_deg;
  int rays = 1000;
};

class ErrorEstimate : public testing::TestWithParam<Claim> {};

TEST_P(ErrorEstimate, IsBetweenHalfAndTenTimesTheTrueError) {
  const auto [radius, diffraction, last, from, to, rays] = GetParam();
  Request request = sphere_as_drop(radius, from, to);
  request.diffraction = diffraction;
  request.orders = upto(last);
  request.rays = rays;
  const auto found = phase::compute(request);
  request.shape = drop::sphere(radius);
  request.method = Method::mie;
  const auto truth = phase::compute(request);
  std::vector<double> errors;
  for (std::size_t t = 0; t < request.theta_deg.size(); ++t)
    errors.push_back(found.slabs[0].phase_function[t] / truth.slabs[0].phase_function[t] - 1);
  const double error = root_mean_square(errors), claimed = root_mean_square(found.slabs[0].error_estimate);
  std::printf(
      "%g mm, orders 0..%d, %g..%g deg: error %.2f %%, estimate %.2f %%\n", radius * 1e3, last, from, to,
      100 * error, 100 * claimed);
  EXPECT_GT(claimed, 0.5 * error);
  EXPECT_LT(claimed, 10 * error);
}

INSTANTIATE_TEST_SUITE_P(
    Spheres, ErrorEstimate,
    testing::Values(
        Claim{0.1e-3, Diffraction::integral, 8, 137, 150}, Claim{0.1e-3, Diffraction::integral, 3, 130, 137},
        Claim{0.1e-3, Diffraction::integral, 8, 100, 115}, Claim{0.4e-3, Diffraction::integral, 3, 137, 150},
        Claim{0.4e-3, Diffraction::integral, 8, 130, 137}, Claim{0.4e-3, Diffraction::integral, 12, 137, 150},
        Claim{0.1e-3, Diffraction::gaussian, 3, 137, 150}, Claim{0.4e-3, Diffraction::gaussian, 8, 130, 137},
        Claim{0.4e-3, Diffraction::none, 3, 40, 100},
        // Few rays do not matter where the integral is.
        Claim{0.4e-3, Diffraction::integral, 8, 137, 150, 50},
        // The sun's disc next to the forward peak; forward diffraction left out.
        Claim{0.1e-3, Diffraction::integral, 8, 0.6, 2}, Claim{0.1e-3, Diffraction::none, 3, 1, 5},
        // A filter as wide as that of order 8.
        Claim{0.1e-3, Diffraction::gaussian, 8, 130, 137},
        // Small drops: the cross section, and orders beyond use.
        Claim{0.03e-3, Diffraction::integral, 20, 30, 120}));

TEST(CrossSection, OfADropThatHardlyBendsLightIsInTheEstimate) {
  Request request = sphere_as_drop(0.2e-3, 130, 140);
  request.diffraction = Diffraction::integral;
  request.index = parse_index_source("1.005");
  const auto found = phase::compute(request);
  request.shape = drop::sphere(0.2e-3);
  request.method = Method::mie;
  const double off =
      found.slabs[0].scattering_cross_section / phase::compute(request).slabs[0].scattering_cross_section - 1;
  EXPECT_GT(off, 0.03);
  EXPECT_GT(root_mean_square(found.slabs[0].error_estimate), 0.9 * off);
}

TEST(Tolerance, SpendsMoreOnASmallerTolerance) {
  Request request = raindrop();
  double seconds = 0;
  for (const double tolerance : {0.5, 0.1, 0.03}) {
    request.tolerance = tolerance;
    const Plan made = plan(request);
    const Prediction expected = predict(made);
    EXPECT_LE(expected.error, tolerance);
    EXPECT_GE(expected.seconds, seconds);
    EXPECT_THAT(made.reasons, testing::HasSubstr("chosen"));
    seconds = expected.seconds;
  }
}

TEST(Tolerance, LeavesAloneWhatIsGiven) {
  Request request = raindrop();
  request.tolerance = 0.05;
  request.orders = {0, 1, 2, 3, 4, 5, 6, 7};
  request.open.orders = false;
  const Plan made = plan(request);
  EXPECT_EQ(made.request.orders, request.orders);
  EXPECT_EQ(made.request.diffraction, Diffraction::integral);
  request.diffraction = Diffraction::gaussian;
  request.open.diffraction = false;
  EXPECT_THROW((void)plan(request), InputError); // no filter is that good
}

TEST(Tolerance, SaysWhatIsPossibleWhenNothingReachesTheTolerance) {
  Request request = raindrop();
  request.tolerance = 1e-5;
  try {
    (void)plan(request);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(
        error.what(), testing::AllOf(testing::HasSubstr("--tolerance"), testing::HasSubstr("--orders")));
  }
}

TEST(Tolerance, HoldsForAllWavelengthsOfATable) {
  Request request = raindrop();
  request.phi_deg = {0};
  request.tolerance = 0.3;
  request.wavelength_m = {380e-9, 540e-9, 700e-9};
  for (const bool between : {false, true}) {
    if (between) request.wavelength_m = {380e-9, 450e-9, 540e-9, 620e-9, 700e-9};
    const Plan made = plan(request);
    const Prediction expected = predict(made);
    const double judging = made.errors->seconds();
    EXPECT_GT(judging, 0);
    table::MemorySink sink;
    const Outcome outcome = run(made, sink);
    EXPECT_LE(outcome.error, request.tolerance);
    if (between) {
      EXPECT_NEAR(outcome.error, expected.error, 0.2 * expected.error);
      EXPECT_GT(outcome.judging_seconds, judging);
    } else {
      EXPECT_NEAR(outcome.error, expected.error, 1e-9 * expected.error);
      EXPECT_EQ(outcome.judging_seconds, judging) << "errors are computed once";
    }
  }
}

TEST(EstimateOfATable, IsTriedAtEveryWavelength) {
  // On a sphere with Mie's ripple errors change from one wavelength to the next.
  Request request;
  request.shape = drop::sphere(0.05e-3);
  request.wavelength_m = {400e-9, 475e-9, 550e-9, 625e-9, 700e-9};
  request.method = Method::patches;
  request.diffraction = Diffraction::integral;
  request.orders = {0, 1, 2, 3};
  request.theta_deg = range(137, 150, 0.25);
  request.phi_deg = {0};
  request.sun_disc_deg = 0.533;
  const table::PhaseTable found = phase::compute(request);
  request.method = Method::mie;
  const table::PhaseTable truth = phase::compute(request);
  for (std::size_t w = 0; w < request.wavelength_m.size(); ++w) {
    std::vector<double> errors;
    for (std::size_t t = 0; t < request.theta_deg.size(); ++t)
      errors.push_back(found.slabs[w].phase_function[t] / truth.slabs[w].phase_function[t] - 1);
    const double ratio = root_mean_square(found.slabs[w].error_estimate) / root_mean_square(errors);
    EXPECT_GT(ratio, 0.8) << request.wavelength_m[w];
    EXPECT_LT(ratio, 1.25) << request.wavelength_m[w];
  }
}

TEST(SunDisc, AveragesTheForwardPeakOfASphere) {
  // Whose light does not depend on the azimuth; rays err by 0.8 % there by themselves.
  Request request = sphere_as_drop(0.1e-3, 0, 5);
  request.diffraction = Diffraction::integral;
  request.orders = upto(8);
  request.theta_deg = {0, 0.1, 0.25, 0.3, 0.5, 1, 2, 4, 10, 20};
  request.sun_disc_deg = 0.533;
  const auto found = phase::compute(request);
  request.matrix = true;
  const auto with_matrix = phase::compute(request);
  request.shape = drop::sphere(0.1e-3);
  request.method = Method::mie;
  const auto truth = phase::compute(request);
  for (std::size_t t = 0; t < request.theta_deg.size(); ++t) {
    EXPECT_NEAR(with_matrix.slabs[0].phase_function[t] / found.slabs[0].phase_function[t], 1, 1e-12);
    for (std::size_t e = 0; e < 16; ++e)
      EXPECT_NEAR(
          with_matrix.slabs[0].phase_matrix[16 * t + e], truth.slabs[0].phase_matrix[16 * t + e],
          0.015 * truth.slabs[0].phase_function[t])
          << request.theta_deg[t] << " deg, element " << e;
    EXPECT_NEAR(found.slabs[0].phase_function[t] / truth.slabs[0].phase_function[t], 1, 0.015)
        << request.theta_deg[t];
  }
}

TEST(Tolerance, NamesTheOptionThatBarsTheIntegral) {
  Request request = raindrop();
  request.shape = drop::beard_chuang(0.45e-3);
  request.wavelength_m = {650e-9};
  request.theta_deg = range(138, 142, 1);
  request.phi_deg = {0};
  request.tolerance = 0.1;
  const auto refusal = [&] {
    try {
      (void)plan(request);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(refusal(), "accepted");
  request.focal_lines = FocalLines::rule;
  EXPECT_THAT(refusal(), testing::HasSubstr("--focal-lines"));
  EXPECT_THAT(refusal(), testing::Not(testing::HasSubstr("180deg"))) << "no direction is near the poles";
  request.focal_lines = FocalLines::exact;
  request.interference = false;
  EXPECT_THAT(refusal(), testing::HasSubstr("--no-interference"));
}

TEST(Tolerance, SendsASphereToMie) {
  Request request = raindrop();
  request.shape = drop::sphere(0.5e-3);
  request.tolerance = 0.01;
  EXPECT_EQ(plan(request).method, Method::mie);
}

} // namespace
