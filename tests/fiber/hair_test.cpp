// Hair by rays: values against 40 digits, energy, reciprocity, sampling, colours, and what is refused.
#include "sampling.hpp"
#include <scatter/fiber/absorption.hpp>
#include <scatter/fiber/hair.hpp>
#include <scatter/fiber/hair_program.hpp>
#include <scatter/fiber/quadrature.hpp>
#include <scatter/fiber/wave_section.hpp>
#include <scatter/optics/errors.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <fstream>
#include <limits>
#include <vector>

namespace {

using namespace scatter::fiber;
using scatter::InputError;
using scatter::pi;
using testing::HasSubstr;

nlohmann::json truth() {
  std::ifstream file(SCATTER_HAIR_TRUTH);
  return nlohmann::json::parse(file);
}

HairParameters without_residual() {
  HairParameters parameters;
  parameters.residual = false;
  return parameters;
}

TEST(Hair, ValuesAgreeWithFortyDigits) {
  int compared = 0;
  const nlohmann::json rows = truth().at("values");
  for (const auto& row : rows) {
    HairParameters parameters;
    parameters.eta = row.at("eta");
    parameters.sigma_a = row.at("sigma_a");
    parameters.shift = row.at("shift");
    parameters.width = row.at("width");
    parameters.residual = false;
    const HairScattering hair(parameters);
    parameters.variant = Variant::printed;
    const HairScattering printed(parameters);
    for (std::size_t i = 0; i < row.at("at").size(); ++i) {
      const std::array<double, 3> at = row.at("at")[i];
      const Rgb expected = row.at("f")[i];
      const Rgb found = hair.eval({at[0], at[1], at[2]}), twice = printed.eval({at[0], at[1], at[2]});
      for (std::size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(found[c], expected[c], 1e-12 * expected[c]) << "at " << row.at("at")[i];
        EXPECT_NEAR(twice[c], 2 * expected[c], 2e-12 * expected[c]) << "the 1/2 that the print lacks";
        ++compared;
      }
    }
  }
  EXPECT_EQ(compared, 30);
}

TEST(Hair, ResidualLobeTakesWhatTheThreeLeave) {
  HairParameters parameters;
  parameters.sigma_a = {0, 0, 0};
  const HairScattering hair(parameters);
  for (const double theta_d : {0.0, 0.3, -0.9, 1.3, 1.55}) {
    double energy = 0;
    for (std::size_t lobe = 0; lobe < 4; ++lobe) energy += hair.moments(lobe, 1, theta_d).energy;
    EXPECT_NEAR(energy, 1, 1e-11) << theta_d;
  }
  // With absorption: as the section sums it up.
  const HairScattering dark{HairParameters{}};
  const RaySection section(1.55, 0.3);
  for (const double theta_d : {0.0, 0.7, 1.4}) {
    EXPECT_NEAR(dark.moments(3, 1, theta_d).energy, section.residual(3, theta_d).energy, 1e-12) << theta_d;
    EXPECT_NEAR(dark.azimuthal(3, 1, theta_d, 0.4) * 2 * pi, dark.moments(3, 1, theta_d).energy, 1e-15);
  }
}

TEST(Hair, FurnaceLosesOnlyWhatTheConesGeometryTakes) {
  // Without absorption all energy leaves up to the factor cos^2 theta_o / cos^2 theta_d, which is 1 on the
  // cone of reflection, and the tails beyond +-90 deg: narrow lobes lose nothing.
  HairParameters parameters;
  parameters.sigma_a = {0, 0, 0};
  parameters.shift = 0;
  parameters.width = 0.001;
  for (const double theta_i : {-1.2, -0.4, 0.0, 0.8})
    for (const double albedo : HairScattering(parameters).albedo(theta_i)) EXPECT_NEAR(albedo, 1, 3e-5);
  // To second order in the widths, at right angles: E[cos^2 theta_o / cos^2 (theta_o / 2)] = 1 - 3/4
  // E[theta_o^2], theta_o of deviation 2 width, and each lobe's own energy changes with theta_d = theta_o
  // / 2.
  parameters.width = 0.01;
  const HairScattering hair(parameters);
  double loss = 0;
  for (std::size_t lobe = 0; lobe < 4; ++lobe) {
    const double variance = 4 * hair.kernel(lobe).width() * hair.kernel(lobe).width();
    const double energy = hair.moments(lobe, 0, 0).energy, step = 0.01;
    const double second = 2 * (hair.moments(lobe, 0, step).energy - energy) / (step * step);
    loss += variance * (0.75 * energy - 0.125 * second);
  }
  EXPECT_NEAR(1 - hair.albedo(0)[0], loss, 0.01 * loss);
  // Standard hair without absorption: tilted cuticles and 1 / cos^2 theta_d lose and gain some, most where
  // light grazes.
  const HairScattering standard([] {
    HairParameters white;
    white.sigma_a = {0, 0, 0};
    return white;
  }());
  for (int degrees = -89; degrees <= 89; ++degrees) {
    const double albedo = standard.albedo(degrees * scatter::radians_per_degree)[0];
    EXPECT_GT(albedo, 0.7) << degrees;
    EXPECT_LT(albedo, std::abs(degrees) <= 80 ? 1.06 : 1.6) << degrees;
  }
}

TEST(Hair, EnergiesAreTheIntegralOfTheFunction) {
  // The general quadrature over eval() knows nothing of moments; caustics limit it.
  const HairScattering hair{HairParameters{}};
  struct Plain : FiberScattering {
    const HairScattering& of;
    explicit Plain(const HairScattering& hair) : of(hair) {}
    using FiberScattering::eval;
    [[nodiscard]] Rgb eval(const Angles& angles) const override {
      // Without TRT, whose caustics would need quadrature of their own.
      const double c = std::cos(angles.theta_d());
      Rgb sum{};
      for (const std::size_t lobe : {0U, 1U, 3U})
        for (std::size_t k = 0; k < 3; ++k)
          sum[k] += of.kernel(lobe)(angles.theta_h()) * of.azimuthal(lobe, k, angles.theta_d(), angles.phi) /
                    (c * c);
      return sum;
    }
    [[nodiscard]] double pdf(const Angles&) const override { return 0; }
    [[nodiscard]] ScatteringSample sample(double, const std::array<double, 3>&) const override { return {}; }
  } const plain(hair);
  const double theta_i = 0.35;
  const auto lobes = hair.lobe_energies(theta_i);
  const LobeEnergy found = plain.lobe_energies(theta_i).at(0);
  ASSERT_EQ(lobes.size(), 4U);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(found.forward[c], lobes[0].forward[c] + lobes[1].forward[c] + lobes[3].forward[c], 2e-6);
    EXPECT_NEAR(found.backward[c], lobes[0].backward[c] + lobes[1].backward[c] + lobes[3].backward[c], 2e-6);
  }
}

TEST(Hair, IsReciprocalAndEvenInAzimuth) {
  const HairScattering hair{HairParameters{}};
  for (const Angles& at : {Angles{0.3, -0.5, 0.2}, {1.1, 0.2, 2.9}, {-0.9, 1.3, -1.4}}) {
    const Rgb one = hair.eval(at), other = hair.eval({at.theta_o, at.theta_i, -at.phi});
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(one[c], other[c], 1e-12 * one[c]);
  }
}

TEST(Hair, BatchesAgreeWithEval) {
  // With the residual lobe and without, colours that differ, all directions; lengths that fill no vector.
  for (const bool residual : {true, false}) {
    HairParameters parameters;
    parameters.sigma_a = {0, 0.3, 4};
    parameters.residual = residual;
    const HairScattering hair(parameters);
    const RaySection section(1.55, 0.3);
    std::mt19937_64 generator(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    constexpr std::size_t count = 1003;
    std::vector<double> theta_i(count), theta_o(count), phi(count), value(3 * count);
    for (std::size_t k = 0; k < count; ++k) {
      theta_i[k] = std::asin(uniform(generator));
      theta_o[k] = std::asin(uniform(generator));
      phi[k] = 3 * pi * uniform(generator); // beyond one turn, too
    }
    phi[0] = 0;
    phi[1] = pi;
    theta_i[2] = theta_o[2] = pi / 2;
    theta_i[3] = 5; // clamped
    std::vector<std::vector<double>> values;
    for (const auto& unit : scatter::exact::vector_units()) {
      hair.eval(theta_i, theta_o, phi, value, unit);
      values.push_back(value);
      // The same bits wherever a direction stands.
      for (std::size_t first : {1U, 7U, 300U}) {
        std::vector<double> some(3 * (count - first));
        hair.eval(
            std::span(theta_i).subspan(first), std::span(theta_o).subspan(first),
            std::span(phi).subspan(first), some, unit);
        for (std::size_t c = 0; c < 3; ++c)
          for (std::size_t k = first; k < count; ++k)
            ASSERT_EQ(some[c * (count - first) + k - first], value[c * count + k]) << unit.name << ' ' << k;
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      const Angles at{theta_i[k], theta_o[k], phi[k]};
      const Rgb expected = hair.eval(at);
      // Beside caustics and rims the distance to them decides.
      const double theta_d = bounded(at).theta_d(), around = std::abs(wrap_angle(phi[k]));
      const double eta_prime = bravais_index(1.55, std::min(std::abs(theta_d), largest_theta_d));
      double distance = std::min(
          std::abs(around - std::abs(wrap_angle(4 * std::asin(1 / eta_prime) - pi))),
          std::abs(around - 2 * std::asin(1 / eta_prime)));
      for (const double caustic : section.caustics(2, std::min(std::abs(theta_d), largest_theta_d)))
        distance = std::min(distance, std::abs(around - caustic));
      const double bound = std::max(1e-12, 1e-15 / std::max(distance, 1e-12));
      for (std::size_t c = 0; c < 3; ++c)
        for (const std::vector<double>& found : values)
          EXPECT_NEAR(found[c * count + k], expected[c], bound * expected[c] + 1e-290)
              << k << ": " << theta_i[k] << " " << theta_o[k] << " " << phi[k];
    }
  }
  const HairScattering hair{HairParameters{}};
  std::vector<double> one(1), two(2), three(3);
  EXPECT_THROW(hair.eval(one, two, one, three), InputError);
  EXPECT_THROW(hair.eval(one, one, one, two), InputError);
  one[0] = std::nan("");
  EXPECT_THROW(hair.eval(one, one, one, three), InputError);
}

TEST(Hair, DeviceAgreesWithBatches) {
  std::mt19937_64 generator(6);
  std::uniform_real_distribution<double> uniform(-1, 1);
  constexpr std::size_t count = 2003; // fills no vector
  std::vector<double> theta_i(count), theta_o(count), phi(count), here(3 * count), there(3 * count);
  for (std::size_t k = 0; k < count; ++k) {
    theta_i[k] = std::asin(uniform(generator));
    theta_o[k] = std::asin(uniform(generator));
    phi[k] = 3 * pi * uniform(generator);
  }
  for (const bool residual : {true, false}) {
    HairParameters parameters;
    parameters.sigma_a = {0, 0.3, 4};
    parameters.residual = residual;
    const HairScattering hair(parameters);
    const HairProgram program(hair, scatter::compute::Device());
    hair.eval(theta_i, theta_o, phi, here);
    program.eval(theta_i, theta_o, phi, there);
    const RaySection section(1.55, 0.3);
    for (std::size_t k = 0; k < count; ++k) {
      // Beside a caustic or a rim both are as good as rounding lets them be.
      const double theta_d = std::min(std::abs(theta_o[k] - theta_i[k]) / 2, largest_theta_d);
      const double around = std::abs(wrap_angle(phi[k])), eta_prime = bravais_index(1.55, theta_d);
      double distance = std::min(
          std::abs(around - std::abs(wrap_angle(4 * std::asin(1 / eta_prime) - pi))),
          std::abs(around - 2 * std::asin(1 / eta_prime)));
      for (const double caustic : section.caustics(2, theta_d))
        distance = std::min(distance, std::abs(around - caustic));
      const double bound = std::max(1e-12, 1e-15 / std::max(distance, 1e-12));
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_NEAR(there[c * count + k], here[c * count + k], bound * here[c * count + k] + 1e-290)
            << k << ": " << theta_i[k] << " " << theta_o[k] << " " << phi[k];
    }
    EXPECT_THROW(program.eval(theta_i, theta_o, phi, {there.data(), 3}), InputError);
  }
  const auto section = std::make_shared<const RaySection>(1.55, 0.1);
  HairParameters parameters;
  parameters.residual = false;
  EXPECT_THROW(
      HairProgram(HairScattering(parameters, {section, section, section}), scatter::compute::Device()),
      InputError);
}

TEST(Hair, SamplesFollowThePdf) {
  for (const double theta_i : {-0.3, 0.9, 1.5}) {
    const HairScattering hair{HairParameters{}};
    scatter::test::expect_samples_follow_pdf(hair, theta_i, 30'000);
    scatter::test::expect_weights_average_to_albedo(hair, theta_i, 0.015, 20'000);
  }
  scatter::test::expect_samples_follow_pdf(HairScattering(without_residual()), 0.2, 30'000);
  scatter::test::expect_weights_average_to_albedo(HairScattering(without_residual()), 0.2, 0.015, 20'000);
}

TEST(FiberScattering, LobesAreChosenByTheirShares) {
  const double before_one = std::nextafter(1.0, 0.0);
  for (const std::vector<double>& shares :
       {std::vector<double>{0.1, 0.2, 0.3, 0.4},
        {0.5, 0, 0.5, 0},
        {0, 0, 1},
        {1, 0, 0},
        {1.0 / 3, 1.0 / 3, 1.0 / 3, 0}}) {
    std::vector<int> counts(shares.size());
    constexpr int count = 12000;
    for (int i = 0; i < count; ++i) ++counts[chosen(shares, (i + 0.5) / count)];
    for (std::size_t k = 0; k < shares.size(); ++k) EXPECT_NEAR(counts[k], shares[k] * count, 1) << k;
    for (const double u : {0.0, before_one, 1.0}) EXPECT_GT(shares[chosen(shares, u)], 0) << u;
  }
}

TEST(Hair, OtherSectionsAreSampledToo) {
  // Two colours of one section, and a third: any CrossSection will do.
  const auto clear = std::make_shared<const RaySection>(1.55, 0.0);
  const auto dark = std::make_shared<const RaySection>(1.55, 0.8);
  HairParameters parameters;
  const HairScattering hair(parameters, {clear, clear, dark});
  EXPECT_EQ(hair.eval({0.2, -0.1, 2.5})[0], hair.eval({0.2, -0.1, 2.5})[1]);
  EXPECT_GT(hair.eval({0.2, -0.1, 2.5})[0], hair.eval({0.2, -0.1, 2.5})[2]);
  scatter::test::expect_samples_follow_pdf(hair, 0.2, 30'000);
  scatter::test::expect_weights_average_to_albedo(hair, 0.2, 0.015, 20'000);
  EXPECT_NEAR(hair.moments(3, 2, 0.1).energy, dark->residual(3, 0.1).energy, 1e-11);
}

TEST(Hair, SectionsMayBeWaves) {
  // Thin fibres, widely averaged: cheap, and their R differs from colour to colour.
  const auto thin = std::make_shared<const WaveSection>(1.55, 0.1, 2.0, 0.5);
  const auto thicker = std::make_shared<const WaveSection>(1.55, 0.1, 3.0, 0.5);
  const HairScattering hair(HairParameters{}, {thin, thin, thicker}, 1e-6);
  const Angles at{0.3, -0.2, 2.5};
  const Rgb found = hair.eval(at);
  for (const std::size_t c : {std::size_t{0}, std::size_t{2}}) {
    const WaveSection& section = c == 0 ? *thin : *thicker;
    double expected = 0;
    for (std::size_t lobe = 0; lobe < 4; ++lobe) {
      const int order = static_cast<int>(lobe);
      const double N = lobe < 3 ? section.distribution(order, at.theta_d(), at.phi)
                                : section.residual(3, at.theta_d()).energy / (2 * pi);
      expected += hair.kernel(lobe)(at.theta_h()) * N / std::pow(std::cos(at.theta_d()), 2);
      const OrderMoments own =
          lobe < 3 ? section.moments(order, at.theta_d()) : section.residual(3, at.theta_d());
      EXPECT_NEAR(hair.moments(lobe, c, at.theta_d()).energy, own.energy, 1e-5) << lobe;
    }
    EXPECT_NEAR(found[c], expected, 1e-5 * expected);
  }
  EXPECT_EQ(found[0], found[1]);
  EXPECT_NE(found[0], found[2]);
  // A lobe's energies against the section's own, by the trapezoidal rule over theta_o.
  const auto lobes = hair.lobe_energies(at.theta_i);
  constexpr int steps = 300;
  for (std::size_t lobe = 0; lobe < 3; ++lobe) {
    double forward = 0, energy = 0;
    for (int i = 1; i < steps; ++i) {
      const double theta_o = pi * (static_cast<double>(i) / steps - 0.5);
      const double theta_d = 0.5 * (theta_o - at.theta_i), ratio = std::cos(theta_o) / std::cos(theta_d);
      const double weight = hair.kernel(lobe)(0.5 * (theta_o + at.theta_i)) * ratio * ratio * pi / steps;
      const OrderMoments own = thicker->moments(static_cast<int>(lobe), theta_d);
      forward += weight * own.forward;
      energy += weight * own.energy;
    }
    EXPECT_GT(energy, 0);
    EXPECT_NEAR(lobes[lobe].forward[2], forward, 1e-5) << lobe;
    EXPECT_NEAR(lobes[lobe].forward[2] + lobes[lobe].backward[2], energy, 1e-5) << lobe;
  }
  // Grazing, where the section holds its values.
  for (const double value : hair.eval({1.5707, -1.5707, 2}))
    EXPECT_TRUE(std::isfinite(value) && value >= 0) << value;
  scatter::test::expect_weights_average_to_albedo(hair, 0.3, 0.2, 1'000);
}

TEST(Hair, SectionsAndToleranceAreChecked) {
  const auto clear = std::make_shared<const RaySection>(1.55, 0.0);
  for (const double tolerance : {0.0, -1e-6, 0.1, std::nan("")})
    EXPECT_THROW(HairScattering(HairParameters{}, {clear, clear, clear}, tolerance), InputError);
  EXPECT_THROW(HairScattering(HairParameters{}, {clear, nullptr, clear}), InputError);
}

TEST(Hair, StaysFiniteAtEveryEdge) {
  const HairScattering hair{HairParameters{}};
  const double caustic = RaySection(1.55, 0.2).caustics(2, 0).at(0);
  for (const double theta_i : {-pi / 2, -1.5707, 0.0, 1.0, pi / 2, 7.0})
    for (const double theta_o : {-pi / 2, -1.5707, 0.0, pi / 2})
      for (const double phi : {0.0, caustic, pi, -pi, 100.0}) {
        for (const double value : hair.eval({theta_i, theta_o, phi}))
          EXPECT_TRUE(std::isfinite(value) && value >= 0) << theta_i << " " << theta_o << " " << phi;
        const double pdf = hair.pdf({theta_i, theta_o, phi});
        EXPECT_TRUE(std::isfinite(pdf) && pdf >= 0) << theta_i << " " << theta_o << " " << phi;
      }
  EXPECT_THROW((void)hair.eval({std::nan(""), 0, 0}), InputError);
  EXPECT_THROW((void)hair.eval(Frame{}, {0, 0, 0}, {0, 0, 1}), InputError);
  EXPECT_EQ(hair.eval(Frame{}, {0.3, 0.1, 2}, {0, 1, 1}), hair.eval(Frame{}, {0.6, 0.2, 4}, {0, 10, 10}));
}

TEST(Hair, WrongParametersAreNamed) {
  const HairScattering hair{HairParameters{}};
  for (const double theta_i : {pi / 2, -pi / 2, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW((void)hair.lobe_energies(theta_i), InputError);
  const auto message = [](auto change) -> std::string {
    HairParameters parameters;
    change(parameters);
    try {
      HairScattering{parameters};
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(message([](auto& p) { p.eta = 1; }), HasSubstr("eta: 1"));
  EXPECT_THAT(message([](auto& p) { p.eta = std::nan(""); }), HasSubstr("eta: nan"));
  EXPECT_THAT(message([](auto& p) { p.sigma_a[1] = -0.1; }), HasSubstr("sigma_a: -0.1"));
  EXPECT_THAT(message([](auto& p) { p.width = 0; }), HasSubstr("width: 0 deg"));
  EXPECT_THAT(message([](auto& p) { p.width = pi / 2; }), HasSubstr("width: 90 deg"));
  EXPECT_THAT(message([](auto& p) { p.shift = 2; }), HasSubstr("shift: "));
}

TEST(Absorption, MelaninAndColours) {
  const Rgb brown = absorption_from_melanin(1.3, 0);
  EXPECT_DOUBLE_EQ(brown[0], 1.3 * 0.419);
  EXPECT_DOUBLE_EQ(absorption_from_melanin(0.2, 2)[2], 0.2 * 1.37 + 2 * 1.05);
  // Roughness 0: (ln C / 5.969)^2.
  EXPECT_NEAR(absorption_from_colour({0.5, 0.1, 0.9})[1], std::pow(std::log(0.1) / 5.969, 2), 1e-16);
  EXPECT_NEAR(
      absorption_from_colour({0.5, 0.1, 0.9}, 0.3)[0],
      std::pow(
          std::log(0.5) / (5.969 - 0.0645 + 2.532 * 0.09 - 10.73 * 0.027 + 5.574 * 0.0081 + 0.245 * 0.00243),
          2),
      1e-15);
  EXPECT_THROW((void)absorption_from_melanin(-1, 0), InputError);
  EXPECT_THROW((void)absorption_from_colour({0, 0.5, 0.5}), InputError);
  EXPECT_THROW((void)absorption_from_colour({0.5, 0.5, 1}), InputError);
}

TEST(Absorption, SingleScatteringRoundTrips) {
  const Rgb wanted{0.9, 0.5, 0.2};
  const Rgb sigma_a = absorption_from_single_scattering(wanted);
  for (std::size_t c = 0; c < 3; ++c) {
    const RaySection section(1.55, sigma_a[c]);
    double energy = section.residual(3, 0).energy;
    for (int order = 0; order < 3; ++order) energy += section.moments(order, 0).energy;
    EXPECT_NEAR(energy, wanted[c], 1e-9);
  }
  EXPECT_EQ(absorption_from_single_scattering({1, 1, 1})[0], 0);
  EXPECT_THROW((void)absorption_from_single_scattering({0.01, 0.5, 0.5}), InputError);
}

} // namespace
