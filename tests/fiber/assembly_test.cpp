// Assemblies: averages against brute force, ladder sums against the paths they stand for, dual scattering's
// parts.
#include "sampling.hpp"
#include <scatter/fiber/artist_hair.hpp>
#include <scatter/fiber/assembly.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <random>

namespace {

using namespace scatter::fiber;
using scatter::InputError;
using scatter::pi;

TEST(Assembly, AveragesAgreeWithBruteForce) {
  std::ifstream file(SCATTER_HAIR_TRUTH);
  const auto truth = nlohmann::json::parse(file).at("assembly");
  ASSERT_EQ(truth.size(), 48U);
  std::map<std::string, std::shared_ptr<const HairScattering>> made;
  for (const auto& row : truth) {
    HairParameters parameters;
    parameters.eta = row.at("eta");
    const double sigma_a = row.at("sigma_a");
    parameters.sigma_a = {sigma_a, sigma_a, sigma_a};
    parameters.shift = row.at("shift");
    parameters.width = row.at("width");
    parameters.residual = row.at("lobes") == 4;
    auto& hair = made[row.at("eta").dump() + row.at("sigma_a").dump() + row.at("lobes").dump()];
    if (!hair) hair = std::make_shared<const HairScattering>(parameters);
    const AssemblyAverages found = assembly_averages(*hair, row.at("theta_i"));
    const std::pair<const char*, double> values[] = {
        {"a_f", found.a_f[1]},         {"a_b", found.a_b[1]},         {"alpha_f", found.alpha_f[1]},
        {"alpha_b", found.alpha_b[1]}, {"beta_f", found.beta_f[1]},   {"beta_b", found.beta_b[1]},
        {"A_b", found.A_b[1]},         {"Delta_b", found.Delta_b[1]}, {"sigma_b", found.sigma_b[1]}};
    for (const auto& [name, value] : values) {
      const double expected = row.at(name);
      // 1e-9 of averages; the sums divide by (1 - a_f^2)^3.
      const double a_f = row.at("a_f");
      const bool sum = std::string(name).ends_with("_b") && std::isupper(name[0]);
      const double bound = sum ? 1e-9 / std::pow(1 - a_f * a_f, 4) : 1e-9;
      EXPECT_NEAR(value, expected, bound) << name << " of " << row.dump();
    }
  }
}

/// Explicit sums over the paths of light that turns back once, and three times, among strands in a row; every
/// passage multiplies by a_f and shifts by alpha_f, every turn by a_b and alpha_b.
struct Paths {
  double once = 0, thrice = 0, shift_once = 0, shift_thrice = 0, deviation = 0;
};
Paths walk(double a_f, double a_b, double alpha_f, double alpha_b, double beta_f, double beta_b) {
  Paths paths;
  const auto visit = [&](int passages, int turns, double& energy, double& shift) {
    const double weight = std::pow(a_f, passages) * std::pow(a_b, turns);
    energy += weight;
    shift += weight * (passages * alpha_f + turns * alpha_b);
    paths.deviation += weight * std::sqrt(passages * beta_f * beta_f + turns * beta_b * beta_b);
  };
  const int deep = static_cast<int>(std::log(1e-18) / std::log(a_f * a_f)) + 2;
  // Forward through i strands, back through as many.
  for (int i = 1; i <= deep; ++i) visit(2 * i, 1, paths.once, paths.shift_once);
  // Forward i, back i - 1 - j to strand j, forward again, and out over k > j strands.
  for (int i = 1; i <= deep; ++i)
    for (int j = 0; j < i; ++j)
      for (int k = j + 1; k <= deep; ++k) visit(2 * (i - j - 1 + k), 3, paths.thrice, paths.shift_thrice);
  return paths;
}

TEST(Assembly, LadderSumsAreSumsOverPaths) {
  const double alpha_f = 0.03, alpha_b = -0.08, beta_f = 0.07, beta_b = 0.15;
  for (const double a_f : {0.3, 0.6, 0.85})
    for (const double a_b : {1e-3, 0.05, 0.12}) {
      const Paths paths = walk(a_f, a_b, alpha_f, alpha_b, beta_f, beta_b);
      const LadderSums sums = ladder_sums(a_f, a_b, alpha_f, alpha_b, beta_f, beta_b);
      EXPECT_NEAR(sums.A_b, paths.once + paths.thrice, 1e-12 * sums.A_b) << a_f << " " << a_b;
      const LadderSums printed = ladder_sums(a_f, a_b, alpha_f, alpha_b, beta_f, beta_b, Variant::printed);
      const double exact = (paths.shift_once + paths.shift_thrice) / (paths.once + paths.thrice);
      // To first order in r = (energy of three turns) / (energy of one): what remains is of order r^2.
      const double r = paths.thrice / paths.once;
      const double change = paths.shift_thrice / paths.thrice - paths.shift_once / paths.once;
      EXPECT_NEAR(sums.Delta_b, exact, 1.01 * r * r * std::abs(change) + 1e-12) << a_f << " " << a_b;
      // The sign that is printed is not that of the path sum, to first order.
      if (a_b == 0.05) {
        EXPECT_GT(std::abs(printed.Delta_b - exact), 5 * std::abs(sums.Delta_b - exact));
      }
    }
}

TEST(Assembly, SpreadIsAnApproximationOfThePathSum) {
  // sigma_b has 1 + 0.7 a_f^2 in place of sums of square roots: here 4 to 15 % too much.
  const double beta_f = 0.09, beta_b = 0.16;
  for (const double a_f : {0.3, 0.6, 0.8})
    for (const double a_b : {0.05, 0.1}) {
      const Paths paths = walk(a_f, a_b, 0, 0, beta_f, beta_b);
      const double exact = paths.deviation / (paths.once + paths.thrice);
      const double found = ladder_sums(a_f, a_b, 0, 0, beta_f, beta_b).sigma_b;
      EXPECT_GT(found, 1.03 * exact);
      EXPECT_LT(found, 1.15 * exact);
    }
  // Dimensions: twice the widths is twice the spread. The printed denominator breaks that.
  const double one = ladder_sums(0.7, 0.2, 0, 0, 0.1, 0.2).sigma_b,
               two = ladder_sums(0.7, 0.2, 0, 0, 0.2, 0.4).sigma_b;
  EXPECT_NEAR(two, 2 * one, 1e-15);
  EXPECT_GT(
      std::abs(
          ladder_sums(0.7, 0.2, 0, 0, 0.2, 0.4, Variant::printed).sigma_b -
          2 * ladder_sums(0.7, 0.2, 0, 0, 0.1, 0.2, Variant::printed).sigma_b),
      1e-4);
}

TEST(Assembly, PrintedVariantIsToTheLetter) {
  const double a_f = 0.7, a_b = 0.2, alpha_f = 0.03, alpha_b = -0.05, beta_f = 0.08, beta_b = 0.14;
  const double x = a_f * a_f;
  const LadderSums printed = ladder_sums(a_f, a_b, alpha_f, alpha_b, beta_f, beta_b, Variant::printed);
  EXPECT_NEAR(printed.A_b, a_b * x / (1 - x) + a_b * a_b * a_b * x / ((1 - x) * (1 - x)), 1e-15);
  EXPECT_NEAR(
      printed.Delta_b,
      alpha_b * (1 - 2 * a_b * a_b / ((1 - x) * (1 - x))) +
          alpha_f * ((2 * (1 - x) * (1 - x) + 4 * x * a_b * a_b) / std::pow(1 - x, 3)),
      1e-15);
  const double root = std::sqrt(2 * beta_f * beta_f + beta_b * beta_b), a_b3 = a_b * a_b * a_b;
  EXPECT_NEAR(
      printed.sigma_b, (1 + 0.7 * x) * (a_b * root + a_b3 * root) / (a_b + a_b3 * (2 * beta_f + 3 * beta_b)),
      1e-15);
}

TEST(Assembly, NothingIsDividedByNothing) {
  for (const Variant variant : {Variant::corrected, Variant::printed})
    for (const double a_f : {0.0, 1.0, 3.0})
      for (const double a_b : {0.0, 0.5}) {
        const LadderSums sums = ladder_sums(a_f, a_b, 0.1, 0.1, 0.1, 0.1, variant);
        EXPECT_TRUE(std::isfinite(sums.A_b) && std::isfinite(sums.Delta_b) && std::isfinite(sums.sigma_b));
      }
  // Hair that absorbs all but its reflection, and white hair that the print makes gain energy.
  HairParameters parameters;
  parameters.sigma_a = {1e5, 0, 0};
  for (const Variant variant : {Variant::corrected, Variant::printed}) {
    parameters.variant = variant;
    const HairScattering hair(parameters);
    for (const double degrees : {-89.9, -45.0, 0.0, 89.999}) {
      const AssemblyAverages found = assembly_averages(hair, degrees * scatter::radians_per_degree, variant);
      for (const Rgb* part :
           {&found.a_f, &found.a_b, &found.alpha_f, &found.alpha_b, &found.beta_f, &found.beta_b, &found.A_b,
            &found.Delta_b, &found.sigma_b})
        for (const double value : *part) EXPECT_TRUE(std::isfinite(value)) << degrees;
      EXPECT_LE(found.a_f[1], 1 - 1e-4);
    }
    EXPECT_THROW((void)assembly_averages(hair, pi / 2), InputError);
    EXPECT_THROW((void)assembly_averages(hair, std::nan("")), InputError);
  }
}

TEST(Assembly, TableKeepsItsError) {
  const HairScattering hair{HairParameters{}};
  const AssemblyTable table(hair);
  EXPECT_LT(table.error_estimate(), 1e-6);
  double worst = 0;
  for (int i = 0; i < 37; ++i) {
    const double theta_i = (-79.3 + 158.6 * i / 36) * scatter::radians_per_degree;
    const AssemblyAverages found = table(theta_i), exact = assembly_averages(hair, theta_i);
    for (std::size_t c = 0; c < 3; ++c)
      for (const auto part :
           {&AssemblyAverages::a_f, &AssemblyAverages::a_b, &AssemblyAverages::alpha_f,
            &AssemblyAverages::alpha_b, &AssemblyAverages::beta_f, &AssemblyAverages::beta_b})
        worst = std::max(worst, std::abs((found.*part)[c] - (exact.*part)[c]));
  }
  EXPECT_LT(worst, table.error_estimate());
  EXPECT_GT(worst, 1e-3 * table.error_estimate());
  EXPECT_THROW(AssemblyTable(hair, Variant::corrected, 5), InputError);
  // Up to the axis and not beyond.
  EXPECT_EQ(table(pi / 2).a_f, table(1.5707).a_f);
  for (const double bad :
       {std::nan(""), std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(), 1.6,
        -1.6})
    EXPECT_THROW((void)table(bad), InputError) << bad;
}

/// R alone: a mirror around a fibre. The general averages need no lobes.
TEST(Assembly, AnyFibreHasAverages) {
  struct Mirror : FiberScattering {
    using FiberScattering::eval;
    [[nodiscard]] Rgb eval(const Angles& angles) const override {
      const double c = std::cos(std::clamp(angles.theta_d(), -largest_theta_d, largest_theta_d));
      const double value = LongitudinalKernel(0.05, 0.1, Norm::area_over_theta_o)(angles.theta_h()) *
                           std::cos(0.5 * angles.phi) / (4 * c * c);
      return {value, 0.5 * value, 0};
    }
    [[nodiscard]] double pdf(const Angles&) const override { return 0; }
    [[nodiscard]] ScatteringSample sample(double, const std::array<double, 3>&) const override { return {}; }
  };
  const AssemblyAverages found = assembly_averages(Mirror{}, 0.2);
  // Of cos(phi/2)/4: forward 1 - 2/pi, backward 2/pi.
  EXPECT_NEAR(found.a_f[0] / (found.a_f[0] + found.a_b[0]), 1 - 2 / pi, 1e-9);
  EXPECT_NEAR(found.a_f[1], 0.5 * found.a_f[0], 1e-12);
  EXPECT_EQ(found.a_f[2], 0);
  EXPECT_NEAR(found.alpha_f[0], 0.05, 5e-3); // cos^2 theta_o moves it a little
  EXPECT_NEAR(found.beta_f[0], 0.1, 5e-3);
  EXPECT_TRUE(std::isfinite(found.sigma_b[2]));
}

TEST(DualScattering, CountsStrandsBothWays) {
  const auto hair = std::make_shared<const HairScattering>(HairParameters{});
  const DualScattering dual(hair, hair);
  const double theta_i = 0.3;
  const AssemblyAverages averages = dual.table()(theta_i);
  const std::vector<double> strands(4, theta_i);
  const Shadow exact = dual.through(strands), estimated = dual.estimated(theta_i, 1, 4);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(exact.transmittance[c], std::pow(averages.a_f[c], 4), 1e-14);
    EXPECT_NEAR(exact.variance[c], 4 * averages.beta_f[c] * averages.beta_f[c], 1e-15);
    EXPECT_NEAR(estimated.transmittance[c], exact.transmittance[c], 1e-14);
    EXPECT_NEAR(estimated.variance[c], exact.variance[c], 1e-15);
    EXPECT_NEAR(dual.estimated(theta_i, 0.25, 10).transmittance[c], std::pow(averages.a_f[c], 2.5), 1e-14);
  }
  EXPECT_EQ(exact.direct, 0);
  EXPECT_EQ(dual.estimated(theta_i, 0.25, 10).direct, 0.75);
  EXPECT_EQ(dual.through({}).direct, 1);
  EXPECT_THROW((void)dual.estimated(0, 1.1, 4), InputError);
  EXPECT_THROW((void)dual.estimated(0, 0.5, -1), InputError);
  DualScatteringOptions options;
  options.d_f = 1.5;
  EXPECT_THROW(DualScattering(hair, hair, options), InputError);
}

TEST(DualScattering, PartsAreTheFormulas) {
  const auto hair = std::make_shared<const HairScattering>(HairParameters{});
  const DualScattering dual(hair, hair);
  const Angles at{0.4, -0.2, 1.1};
  Shadow shadow = dual.estimated(at.theta_i, 0.4, 6);
  const auto parts = dual.eval(at, shadow);
  const AssemblyAverages averages = dual.table()(at.theta_i);
  const double cosine = std::cos(at.theta_i), theta_h = at.theta_h(), theta_d = at.theta_d();
  const double over = 1 / (std::cos(theta_d) * std::cos(theta_d));
  const RaySection sections[3] = {{1.55, 0.2}, {1.55, 0.3}, {1.55, 0.5}};
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(parts.single[c], 0.6 * hair->eval(at)[c] * cosine, 1e-14);
    const auto back = [&](double variance) {
      const double V = averages.sigma_b[c] * averages.sigma_b[c] + variance;
      return 2 * averages.A_b[c] * gaussian(V, theta_h - averages.Delta_b[c]) / pi * over;
    };
    EXPECT_NEAR(parts.back[c], 0.6 * 0.7 * back(0) * cosine, 1e-14);
    const double T = shadow.transmittance[c], variance = shadow.variance[c];
    double scattered =
        hair->kernel(3).spread(variance, theta_h) * hair->moments(3, c, theta_d).energy / (2 * pi);
    for (int p = 0; p < 3; ++p) {
      const double width = hair->kernel(p).width();
      // N^G by the section's own energy between pi/2 and pi.
      const double N = 2 / pi * sections[c].energy_between(p, theta_d, pi / 2, pi);
      scattered += 0.5 * gaussian(width * width + variance, theta_h - hair->kernel(p).shift()) * N;
    }
    EXPECT_NEAR(parts.forward[c], 0.4 * 0.7 * T * scattered * over * cosine, 1e-10);
    EXPECT_NEAR(parts.forward_back[c], 0.4 * 0.7 * T * pi * 0.7 * back(variance) * cosine, 1e-14);
    EXPECT_NEAR(
        parts.sum()[c], parts.single[c] + parts.back[c] + parts.forward[c] + parts.forward_back[c], 1e-16);
  }
  // As printed, lit hair darkens: d_f twice, and delta subtracted.
  DualScatteringOptions options;
  options.variant = Variant::printed;
  const DualScattering printed(hair, hair, options);
  shadow.direct = 1;
  EXPECT_LT(printed.eval(at, shadow).forward[0], 0);
  EXPECT_EQ(dual.eval(at, shadow).forward[0], 0);
}

TEST(DualScattering, AdjustmentsDoWhatTheySay) {
  const auto hair = std::make_shared<const HairScattering>(HairParameters{});
  const DualScattering plain(hair, hair);
  DualScatteringOptions options;
  options.adjustments.back_colour = {0.5, 1, 1};
  options.adjustments.back_intensity = 2;
  options.adjustments.forward_colour = {1, 1, 0};
  options.adjustments.forward_intensity = 3;
  const DualScattering adjusted(hair, hair, options);
  const Angles at{0.1, 0.2, 0.5};
  const Shadow shadow = plain.estimated(0.1, 0.5, 4);
  const auto before = plain.eval(at, shadow), after = adjusted.eval(at, shadow);
  EXPECT_DOUBLE_EQ(after.back[0], before.back[0]);
  EXPECT_DOUBLE_EQ(after.back[1], 2 * before.back[1]);
  EXPECT_DOUBLE_EQ(after.forward[0], 3 * before.forward[0]);
  EXPECT_EQ(after.forward[2], 0);
  EXPECT_EQ(after.single, before.single);
  options = {};
  options.adjustments.back_shift = 0.1;
  const DualScattering shifted(hair, hair, options);
  // g(theta_h - Delta_b + alpha): the same value where theta_h is smaller by alpha, but for cos^2 theta_d.
  const double c0 = std::cos(0.05), c1 = std::cos(0.05 - 0.1);
  EXPECT_NEAR(
      shifted.back({0.1, 0.0, 0}, {})[0] * c1 * c1, plain.back({0.1, 0.2, 0}, {})[0] * c0 * c0, 1e-12);
  options = {};
  options.back_energy = BackEnergy::conserved;
  EXPECT_DOUBLE_EQ(DualScattering(hair, hair, options).back(at, {})[1], 0.25 * plain.back(at, {})[1]);
  options = {};
  options.adjustments.back_variance = -100; // never below a floor: finite
  EXPECT_TRUE(std::isfinite(DualScattering(hair, hair, options).back({0.1, 0.2, 0}, {})[0]));
}

TEST(DualScattering, BackEnergyIsThatOfTheLadderSums) {
  // Integral of f_back cos theta_o d omega over the half circle of azimuths, narrow enough that cosines
  // are 1.
  HairParameters parameters;
  parameters.shift = 0;
  parameters.width = 0.01;
  const auto hair = std::make_shared<const HairScattering>(parameters);
  DualScatteringOptions options;
  options.nodes = 31;
  const DualScattering zinke(hair, hair, options);
  options.back_energy = BackEnergy::conserved;
  const DualScattering conserved(hair, hair, options);
  Rgb one{}, other{};
  constexpr int steps = 4000;
  for (int i = 0; i < steps; ++i) {
    const double theta_o = pi * ((i + 0.5) / steps - 0.5),
                 area = pi / steps * pi * std::cos(theta_o) * std::cos(theta_o);
    const Rgb a = zinke.back({0, theta_o, 0}, {}), b = conserved.back({0, theta_o, 0}, {});
    for (std::size_t c = 0; c < 3; ++c) {
      one[c] += a[c] * area;
      other[c] += b[c] * area;
    }
  }
  const AssemblyAverages averages = conserved.table()(0);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(other[c], averages.A_b[c], 0.005 * averages.A_b[c]);
    EXPECT_NEAR(one[c], 4 * averages.A_b[c], 0.02 * averages.A_b[c]);
  }
}

/// Dual scattering under one shadow, as a fibre: for the tests that every fibre passes.
struct Shaded : FiberScattering {
  Shaded(DualScattering of, Shadow under) : dual(std::move(of)), shadow(under) {}
  using FiberScattering::eval;
  [[nodiscard]] Rgb eval(const Angles& angles) const override {
    Rgb sum = dual.eval(angles, shadow).sum();
    for (double& value : sum) value /= std::cos(angles.theta_i);
    return sum;
  }
  [[nodiscard]] double pdf(const Angles& angles) const override { return dual.pdf(angles, shadow); }
  [[nodiscard]] ScatteringSample sample(double theta_i, const std::array<double, 3>& u) const override {
    return dual.sample(theta_i, shadow, u);
  }
  [[nodiscard]] std::vector<LobeEnergy> lobe_energies(double theta_i) const override {
    return {{0, 0, dual.albedo(theta_i, shadow).sum(), {}}};
  }
  DualScattering dual;
  Shadow shadow;
};

/// Light hair, dark hair and hair with an artist's controls, whose single and multiple scattering differ.
std::vector<DualScattering> shadings() {
  DualScatteringOptions options;
  options.nodes = 61;
  HairParameters light, dark;
  light.sigma_a = {0.02, 0.06, 0.2};
  dark.sigma_a = {0.6, 1.2, 3};
  dark.residual = false;
  std::vector<DualScattering> found;
  const auto blond = std::make_shared<const HairScattering>(light);
  found.emplace_back(blond, blond, options);
  options.back_energy = BackEnergy::conserved;
  const auto black = std::make_shared<const HairScattering>(dark);
  found.emplace_back(black, black, options);
  ArtistHairShading artist;
  artist.multiple = ArtistHairParameters{};
  artist.multiple->secondary.width = 0.4;
  artist.dual = options;
  artist.dual.adjustments.back_colour = {1, 0.3, 0};
  artist.dual.adjustments.back_shift = 0.15;
  artist.dual.adjustments.forward_intensity = 2;
  found.push_back(dual_scattering(artist));
  return found;
}

TEST(DualScattering, SamplesFollowTheirDensity) {
  for (const DualScattering& dual : shadings())
    for (const auto& [theta_i, opacity, strands] :
         {std::array{0.0, 0.0, 0.0}, {0.5, 0.3, 2.0}, {-1.2, 0.5, 6.0}, {0.9, 1.0, 40.0}}) {
      SCOPED_TRACE(testing::Message() << strands << " strands, opacity " << opacity);
      const Shadow shadow = dual.estimated(theta_i, opacity, strands);
      scatter::test::expect_samples_follow_pdf(Shaded(dual, shadow), theta_i, 30'000);
    }
}

TEST(DualScattering, WeightsAverageToTheAlbedo) {
  for (const DualScattering& dual : shadings())
    for (const double theta_i : {0.0, -0.7, 1.3})
      for (const double opacity : {0.0, 0.5, 1.0}) {
        const Shadow shadow = dual.estimated(theta_i, opacity, 5);
        scatter::test::expect_weights_average_to_albedo(Shaded(dual, shadow), theta_i, 0.03, 10'000);
      }
}

/// The trapezoid rule over the sphere, which knows nothing of lobes, on eval() itself.
TEST(DualScattering, AlbedoIsTheIntegralOfEval) {
  for (const DualScattering& dual : shadings())
    for (const double theta_i : {0.4, -1.4}) {
      Shadow shadow = dual.estimated(theta_i, 0.4, 5);
      const auto found = dual.albedo(theta_i, shadow);
      Rgb back{}, forward{}, forward_back{};
      constexpr int steps = 4000;
      for (int i = 1; i < steps; ++i) {
        const double theta_o = pi * (1.0 * i / steps - 0.5);
        const auto parts = dual.eval({theta_i, theta_o, 0.3}, shadow);
        const double area = pi / steps * 2 * pi * std::cos(theta_o) * std::cos(theta_o) / std::cos(theta_i);
        for (std::size_t c = 0; c < 3; ++c) {
          back[c] += parts.back[c] * area;
          forward[c] += parts.forward[c] * area;
          forward_back[c] += parts.forward_back[c] * area;
        }
      }
      const Rgb all = found.sum();
      const double whole = all[0] + all[1] + all[2];
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(found.back[c], back[c], 1e-9 * whole);
        EXPECT_NEAR(found.forward[c], forward[c], 1e-9 * whole);
        EXPECT_NEAR(found.forward_back[c], forward_back[c], 1e-9 * whole);
      }
      // Nothing of multiple scattering is left with no strands before, and none of the single with many.
      shadow = dual.through({});
      EXPECT_EQ(dual.albedo(theta_i, shadow).forward[0], 0);
      shadow.direct = 0;
      EXPECT_EQ(dual.albedo(theta_i, shadow).single[0], 0);
    }
}

TEST(DualScattering, WeightsAreBounded) {
  double steep = 0, grazing = 0;
  for (const DualScattering& dual : shadings())
    for (const double theta_i : {-1.57, -1.0, 0.0, 0.6, 1.5})
      for (const double opacity : {0.0, 0.7, 1.0}) {
        const Shadow shadow = dual.estimated(theta_i, opacity, 12);
        const Rgb albedo = dual.albedo(theta_i, shadow).sum();
        double& largest = std::abs(theta_i) > pi / 3 ? grazing : steep;
        for (int i = 0; i < 2000; ++i) {
          // Weyl's sequence fills the corners too.
          const auto part = [i](double step) { return std::fmod(0.5 + i * step, 1); };
          const ScatteringSample sample =
              dual.sample(theta_i, shadow, {part(0.8191725134), part(0.6710436067), part(0.5497004779)});
          for (const double weight : sample.weight) {
            ASSERT_TRUE(std::isfinite(weight) && weight >= 0);
            largest = std::max(largest, weight / (albedo[0] + albedo[1] + albedo[2]));
          }
        }
      }
  EXPECT_LT(steep, 4);
  EXPECT_LT(grazing, 20);
}

/// The peaks of TT and TRT lie at theta_d = 90 deg, where nothing passes, and their flanks are bright.
TEST(DualScattering, WeightsOfScatteredLightAreBoundedWhenGrazing) {
  HairParameters light;
  light.sigma_a = {0.02, 0.06, 0.2};
  DualScatteringOptions options;
  options.nodes = 61;
  options.d_b = 0;
  Shadow shadow;
  shadow.direct = 0;
  for (const HairParameters& parameters : {HairParameters{}, light})
    for (const bool residual : {false, true}) {
      HairParameters used = parameters;
      used.residual = residual;
      const auto hair = std::make_shared<const HairScattering>(used);
      const DualScattering dual(hair, hair, options);
      for (const double theta_i : {-1.57, -1.5, 1.57}) {
        const Rgb albedo = dual.albedo(theta_i, shadow).sum();
        // In every direction, however rarely it is drawn; phi does not matter.
        double largest = 0;
        for (int i = 0; i < 2000; ++i) {
          const Angles at{theta_i, pi * ((i + 0.5) / 2000 - 0.5), 0};
          const double over = std::cos(at.theta_o) / (std::cos(theta_i) * dual.pdf(at, shadow));
          for (const double value : dual.eval(at, shadow).sum())
            largest = std::max(largest, value * over / (albedo[0] + albedo[1] + albedo[2]));
        }
        // 0.72 at most is measured; by the energies of the peaks alone it is 264.
        EXPECT_LT(largest, 1) << theta_i << (residual ? " with" : " without") << " the residual";
      }
    }
}

/// Light that is spread over far more than all directions of theta_h all but misses the fibre: directions are
/// then those of what is left.
TEST(DualScattering, WideShadowsAreDrawnByWhatArrives) {
  const auto hair = std::make_shared<const HairScattering>(HairParameters{});
  DualScatteringOptions options;
  options.nodes = 61;
  const DualScattering dual(hair, hair, options);
  Shadow lit, shadow;
  lit.direct = shadow.direct = 0.5;
  lit.transmittance = {};
  for (const double variance : {1e8, 1e300}) {
    shadow.variance = {variance, variance, variance};
    for (const double theta_o : {-1.2, -0.3, 0.0, 0.9}) {
      const Angles at{0.3, theta_o, 0.7};
      // The Gaussian of 1e8 rad^2 has 1e-4 of its area over the directions there are.
      EXPECT_NEAR(dual.pdf(at, shadow), dual.pdf(at, lit), 0.01 * dual.pdf(at, lit)) << variance;
    }
  }
  // A shadow of 400 rad^2 has half the height of one of 100, to 2 %, and neither has a shape.
  options.d_b = 0;
  const DualScattering forward(hair, hair, options);
  const auto share = [&](double variance) {
    shadow.variance = {variance, variance, variance};
    // Where the single scattering sends nothing: what is drawn there comes from the wide parts alone.
    const Angles at{0.3, 1.5, 0.7};
    const double all = forward.pdf(at, shadow), single = hair->pdf(at);
    const double flat = 1 / (2 * pi * pi * std::cos(1.5)); // density of a wide part
    return (all - single) / (flat - all);                  // over the share of `single`
  };
  EXPECT_NEAR(share(400) / share(100), 0.5, 0.01);
}

TEST(DualScattering, SamplesAreFiniteAtTheEdges) {
  const double last = 1 - 0x1p-53;
  for (const DualScattering& dual : shadings())
    for (const double theta_i : {-pi / 2, -1.5707, 0.0, pi / 2, 2.0})
      for (const double strands : {0.0, 3.0, 1e6})
        for (const double opacity : {0.0, 1e-9, 1.0}) {
          const Shadow shadow = dual.estimated(std::clamp(theta_i, -1.5, 1.5), opacity, strands);
          for (const double a : {0.0, 0.5, last})
            for (const double b : {0.0, 0.5, last}) {
              const ScatteringSample sample = dual.sample(theta_i, shadow, {a, b, a});
              EXPECT_TRUE(std::abs(sample.theta_o) <= pi / 2 && std::abs(sample.phi) <= pi);
              EXPECT_TRUE(std::isfinite(sample.pdf) && sample.pdf >= 0);
              for (const double weight : sample.weight)
                EXPECT_TRUE(std::isfinite(weight) && weight >= 0) << theta_i << " " << strands;
            }
        }
  // Of a black fibre nothing leaves, yet directions are drawn.
  HairParameters parameters;
  const auto hair = std::make_shared<const HairScattering>(parameters);
  DualScatteringOptions options;
  options.nodes = 12;
  options.d_f = options.d_b = 0;
  const DualScattering nothing(hair, hair, options);
  Shadow shadow;
  shadow.direct = 0;
  const ScatteringSample sample = nothing.sample(0.2, shadow, {0.2, 0.3, 0.4});
  EXPECT_GT(sample.pdf, 0);
  EXPECT_EQ(sample.weight, Rgb{});
  EXPECT_EQ(nothing.albedo(0.2, shadow).sum(), Rgb{});
}

TEST(DualScattering, PrintedVariantIsSampledToo) {
  HairParameters parameters;
  parameters.variant = Variant::printed;
  const auto hair = std::make_shared<const HairScattering>(parameters);
  DualScatteringOptions options;
  options.variant = Variant::printed;
  options.nodes = 61;
  const DualScattering dual(hair, hair, options);
  // Forward scattering is negative where light is direct: so are weights, whose mean is the albedo still.
  const Shaded lit(dual, dual.estimated(0.3, 0.2, 3));
  EXPECT_LT(lit.dual.albedo(0.3, lit.shadow).forward[0], 0);
  std::mt19937_64 generator(9);
  std::uniform_real_distribution<double> uniform(0, 1);
  Rgb sum{}, square{};
  constexpr int samples = 30'000;
  for (int i = 0; i < samples; ++i) {
    const double a = uniform(generator), b = uniform(generator), c = uniform(generator);
    const Rgb weight = lit.sample(0.3, {a, b, c}).weight;
    for (std::size_t k = 0; k < 3; ++k) {
      sum[k] += weight[k] / samples;
      square[k] += weight[k] * weight[k] / samples;
    }
  }
  const Rgb albedo = lit.albedo(0.3);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(sum[k], albedo[k], 5 * std::sqrt((square[k] - sum[k] * sum[k]) / samples));
}

TEST(DualScattering, RefusesWhatItCannotShade) {
  const auto hair = std::make_shared<const HairScattering>(HairParameters{});
  DualScatteringOptions options;
  options.nodes = 12;
  const DualScattering dual(hair, hair, options);
  const std::array<double, 3> u{0.1, 0.2, 0.3};
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, inf, -0.1}) {
    for (const auto spoil : {0, 1, 2}) {
      Shadow shadow;
      (spoil == 0 ? shadow.direct : spoil == 1 ? shadow.transmittance[1] : shadow.variance[2]) = bad;
      EXPECT_THROW((void)dual.eval({}, shadow), InputError);
      EXPECT_THROW((void)dual.pdf({}, shadow), InputError);
      EXPECT_THROW((void)dual.sample(0, shadow, u), InputError);
      EXPECT_THROW((void)dual.albedo(0, shadow), InputError);
    }
    EXPECT_THROW((void)dual.back({}, {0, bad, 0}), InputError);
  }
  try {
    Shadow shadow;
    shadow.direct = 1.5;
    (void)dual.pdf({}, shadow);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "shadow.direct: 1.5 is not between 0 and 1");
  }
  EXPECT_THROW((void)dual.pdf({nan, 0, 0}, {}), InputError);
  EXPECT_THROW((void)dual.sample(nan, {}, u), InputError);
  EXPECT_THROW((void)dual.albedo(nan, {}), InputError);
  EXPECT_THROW((void)dual.albedo(pi / 2, {}), InputError);
  EXPECT_THROW(DualScattering(nullptr, hair, options), InputError);
  EXPECT_THROW(DualScattering(hair, nullptr, options), InputError);
  options.adjustments.back_shift = nan;
  EXPECT_THROW(DualScattering(hair, hair, options), InputError);
  for (const double bad : {nan, inf, 1.6}) {
    EXPECT_THROW((void)dual.estimated(bad, 0.5, 4), InputError);
    EXPECT_THROW((void)dual.through(std::array{0.1, bad}), InputError);
  }
  const auto refusal = [](const auto& call) -> std::string {
    try {
      call();
    } catch (const InputError& error) {
      return error.what();
    }
    return "nothing refused";
  };
  EXPECT_EQ(
      refusal([&] {
        (void)dual.through(std::array{0.1, nan});
      }),
      "theta_i[1]: nan deg is not between -90 deg and 90 deg");
  EXPECT_EQ(
      refusal([&] { (void)dual.estimated(2 * pi, 0.5, 4); }),
      "theta_i: 360 deg is not between -90 deg and 90 deg");
  EXPECT_EQ(
      refusal([&] { (void)dual.estimated(0, 0.5, inf); }),
      "strands_of_full_shadow: inf is not finite and 0 or more");
  EXPECT_EQ(refusal([&] { (void)dual.back({}, {0, inf, 0}); }), "variance: inf is not finite and 0 or more");
  for (const double bad : {nan, inf, -0.1}) {
    const auto artist = std::make_shared<const ArtistHair>(ArtistHairParameters{});
    for (const std::shared_ptr<const LobedScattering>& fibre :
         {std::shared_ptr<const LobedScattering>(hair), std::shared_ptr<const LobedScattering>(artist),
          std::shared_ptr<const LobedScattering>(std::make_shared<const NormalisedScattering>(artist))}) {
      EXPECT_THROW((void)fibre->scattered_lobes(0.1, {0, bad, 0}), InputError);
      EXPECT_THROW((void)fibre->eval_scattered({0.1, 0.2, 0}, {0, 0, bad}), InputError);
    }
  }
}

/// A fibre that counts how often it is asked.
struct Counting : HairScattering {
  using HairScattering::HairScattering;
  [[nodiscard]] std::vector<LobeEnergy> lobe_energies(double theta_i) const override {
    ++asked;
    return HairScattering::lobe_energies(theta_i);
  }
  mutable int asked = 0;
};

TEST(DualScattering, OptionsAreRefusedBeforeTablesAreMade) {
  const auto hair = std::make_shared<const Counting>(HairParameters{});
  for (int spoil = 0; spoil < 6; ++spoil) {
    DualScatteringOptions options;
    MultipleAdjustments& adjust = options.adjustments;
    if (spoil == 0) options.d_f = 2;
    if (spoil == 1) options.d_b = std::nan("");
    if (spoil == 2) adjust.back_colour[1] = std::numeric_limits<double>::infinity();
    if (spoil == 3) adjust.forward_intensity = std::nan("");
    if (spoil == 4) adjust.back_variance = -std::numeric_limits<double>::infinity();
    if (spoil == 5) adjust.forward_colour[2] = adjust.forward_intensity = 1e200; // their product
    EXPECT_THROW(DualScattering(hair, hair, options), InputError) << spoil;
  }
  EXPECT_EQ(hair->asked, 0);
}

TEST(DualScattering, RefusesMoreLightThanANumberHolds) {
  const auto hair = std::make_shared<const HairScattering>(HairParameters{});
  DualScatteringOptions options;
  options.nodes = 12;
  options.adjustments.back_intensity = options.adjustments.forward_intensity = 1e200;
  const DualScattering bright(hair, hair, options);
  Shadow shadow;
  shadow.direct = 0.5;
  const std::array<double, 3> u{0.9, 0.2, 0.3};
  // As bright as it is, it is sampled; with 1e200 as much light again it is not.
  for (const double weight : bright.sample(0.2, shadow, u).weight) EXPECT_TRUE(std::isfinite(weight));
  EXPECT_TRUE(std::isfinite(bright.pdf({0.2, 0.1, 0}, shadow)));
  EXPECT_TRUE(std::isfinite(bright.albedo(0.2, shadow).sum()[0]));
  shadow.transmittance = {1, 1e200, 1};
  EXPECT_THROW((void)bright.eval({0.2, -0.2, 0.1}, shadow), InputError);
  EXPECT_THROW((void)bright.pdf({0.2, -0.2, 0.1}, shadow), InputError);
  EXPECT_THROW((void)bright.sample(0.2, shadow, u), InputError);
  EXPECT_THROW((void)bright.albedo(0.2, shadow), InputError);
}

} // namespace
