#include <scatter/exact/cylinder.hpp>
#include <scatter/optics/errors.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <numbers>
#include <random>

namespace {

using scatter::exact::cylinder;
using scatter::exact::cylinder_at_degrees;
using scatter::exact::CylinderAmplitudes;
using scatter::exact::CylinderResult;
using std::numbers::pi;
using complex = std::complex<double>;
using testing::HasSubstr;

/// Cylinders solved from Maxwell's boundary conditions in high precision: see
/// tests/data/make_cylinder_truth.py.
const nlohmann::json& truth() {
  static const nlohmann::json cases = nlohmann::json::parse(std::ifstream(SCATTER_CYLINDER_TRUTH));
  return cases;
}

complex as_complex(const nlohmann::json& pair) {
  return {pair[0].get<double>(), pair[1].get<double>()};
}

double largest(const CylinderAmplitudes& amplitudes, std::size_t i) {
  return std::max({std::abs(amplitudes.T1[i]), std::abs(amplitudes.T2[i]), std::abs(amplitudes.T3[i])});
}

/// The T's of a truth's object.
CylinderAmplitudes true_amplitudes(const nlohmann::json& exact) {
  CylinderAmplitudes result;
  for (const auto& [name, list] :
       {std::pair{"T1", &result.T1}, {"T2", &result.T2}, {"T3", &result.T3}, {"T4", &result.T4}})
    for (const auto& pair : exact[name]) list->push_back(as_complex(pair));
  return result;
}

double difference(const CylinderAmplitudes& a, const CylinderAmplitudes& b, std::size_t i) {
  return std::max(
      {std::abs(a.T1[i] - b.T1[i]), std::abs(a.T2[i] - b.T2[i]), std::abs(a.T3[i] - b.T3[i]),
       std::abs(a.T4[i] - b.T4[i])});
}

class CylinderTruth : public testing::TestWithParam<std::size_t> {
protected:
  const nlohmann::json& exact = truth()[GetParam()];
  const std::vector<double> angles = exact["theta_deg"];
  const std::vector<int> orders = [this] {
    std::vector<int> list;
    if (exact.contains("orders"))
      for (const auto& order : exact["orders"]) list.push_back(order["p"]);
    return list;
  }();
  const CylinderResult result =
      cylinder_at_degrees(exact["x"], as_complex(exact["m"]), exact["tilt_deg"], angles, orders);

  /// Of T, resonances as everything; an index next to 1 is the documented exception. Case `exact` holds what
  /// the header promises.
  double amplitude_limit() const { return std::abs(as_complex(exact["m"]) - 1.0) < 1e-3 ? 1e-11 : 1e-13; }

  void SetUp() override { ASSERT_EQ(angles.size(), result.amplitudes.T1.size()); }
};

TEST_P(CylinderTruth, Efficiencies) {
  double worst = 0;
  const auto compare = [&](const scatter::exact::ByCase& values, const char* name) {
    for (const auto& [value, which] : {std::pair{values.I, "I"}, {values.II, "II"}}) {
      const double expected = exact[name][which];
      const double error = expected == 0 ? std::abs(value) : std::abs(value / expected - 1);
      EXPECT_LE(error, 1e-14) << name << ' ' << which;
      EXPECT_LE(error, result.error_estimate) << name << ' ' << which;
      worst = std::max(worst, error);
    }
  };
  compare(result.Qext, "Qext");
  compare(result.Qsca, "Qsca");
  compare(result.Qabs, "Qabs");
}

TEST_P(CylinderTruth, Amplitudes) {
  const CylinderAmplitudes expected = true_amplitudes(exact);
  double worst = 0;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double error = difference(result.amplitudes, expected, i) / largest(expected, i);
    EXPECT_LE(error, result.error_estimate) << "theta = " << angles[i];
    EXPECT_LE(error, amplitude_limit()) << "theta = " << angles[i];
    worst = std::max(worst, error);
  }
  EXPECT_LE(result.error_estimate, 100 * std::max(worst, 1e-16))
      << "an estimate that says too much says nothing";
  if (testing::Test::HasFailure() || std::getenv("SCATTER_PRINT_ERRORS"))
    std::printf(
        "%-36s error %.1e, estimate %.1e\n", exact["name"].get<std::string>().c_str(), worst,
        result.error_estimate);
}

TEST_P(CylinderTruth, DebyeTerms) {
  ASSERT_EQ(result.orders.size(), orders.size());
  for (std::size_t k = 0; k < orders.size(); ++k) {
    const auto& order = result.orders[k];
    EXPECT_EQ(order.p, orders[k]);
    const CylinderAmplitudes expected = true_amplitudes(exact["orders"][k]);
    double worst = 0, peak = 0;
    for (std::size_t i = 0; i < angles.size(); ++i) {
      worst = std::max(worst, difference(order.amplitudes, expected, i));
      peak = std::max(peak, largest(expected, i));
    }
    EXPECT_LE(worst / peak, order.error_estimate) << "p = " << order.p;
    // An opaque cylinder lets 1e-100 through.
    const double limit = exact["name"] == "opaque" ? 1e-12 : amplitude_limit();
    EXPECT_LE(worst / peak, limit) << "p = " << order.p;
    EXPECT_LE(order.error_estimate, 100 * limit) << "p = " << order.p;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Cases, CylinderTruth, testing::Range(std::size_t{0}, truth().size()), [](const auto& test) {
      std::string name = truth()[test.param]["name"];
      std::erase_if(name, [](char c) { return c == ',' || c == '.'; });
      std::replace(name.begin(), name.end(), ' ', '_');
      return name;
    });

TEST(Cylinder, ExampleOfBohrenAndHuffman) {
  // Appendix C: radius 0.525, wavelength 0.6328, m = 1.55, normal incidence; printed to five digits.
  const auto result = cylinder(2 * pi * 0.525 / 0.6328, 1.55, 0, {});
  EXPECT_NEAR(result.Qsca.I, 2.0972, 5e-5);
  EXPECT_NEAR(result.Qsca.II, 1.9278, 5e-5);
}

const double sizes[] = {1e-6, 1e-3, 0.1, 1, pi, 10, 49.9386, 200, 3000};
const complex indices[] = {1.0001, 1.333, 1.55, 10, 0.75, {1.55, 1e-9}, {1.55, 1e-3}, {0.2, 3}, {10, 10}};
const double tilts[] = {0, 1e-3, 30, 48, 60, 85, -85};

TEST(Cylinder, OpticalTheorem) {
  const std::vector<double> forward{0};
  for (const double x : sizes)
    for (const complex m : indices)
      for (const double tilt : tilts) {
        const auto result = cylinder_at_degrees(x, m, tilt, forward);
        EXPECT_NEAR(2 / x * result.amplitudes.T1[0].real() / result.Qext.I, 1, 1e-12) << x << m << tilt;
        EXPECT_NEAR(2 / x * result.amplitudes.T2[0].real() / result.Qext.II, 1, 1e-12) << x << m << tilt;
        EXPECT_EQ(result.amplitudes.T3[0], 0.0) << x << m << tilt;
      }
}

TEST(Cylinder, EnergyIsConserved) {
  // The scattered intensity integrates to Qsca: the mean over equidistant angles is exact for its Fourier
  // sums.
  for (const double x : {1e-6, 0.1, 1.0, 10.0, 49.9386, 200.0})
    for (const complex m : indices)
      for (const double tilt : tilts) {
        const int count = 2 * static_cast<int>(x + 9 * std::cbrt(x) + 20);
        std::vector<double> theta;
        for (int i = 0; i < count; ++i) theta.push_back(2 * pi * i / count);
        const auto result = cylinder(x, m, tilt * (pi / 180), theta);
        double I = 0, II = 0;
        for (std::size_t i = 0; i < theta.size(); ++i) {
          I += std::norm(result.amplitudes.T1[i]) + std::norm(result.amplitudes.T3[i]);
          II += std::norm(result.amplitudes.T2[i]) + std::norm(result.amplitudes.T4[i]);
        }
        EXPECT_NEAR(2 / x * I / count / result.Qsca.I, 1, 1e-12) << x << m << tilt;
        EXPECT_NEAR(2 / x * II / count / result.Qsca.II, 1, 1e-12) << x << m << tilt;
        EXPECT_NEAR(result.Qext.I, result.Qsca.I + result.Qabs.I, 1e-15 * result.Qext.I) << x << m << tilt;
        EXPECT_NEAR(result.Qext.II, result.Qsca.II + result.Qabs.II, 1e-15 * result.Qext.II)
            << x << m << tilt;
        if (m.imag() == 0) {
          EXPECT_EQ(result.Qabs.I, 0) << x << m << tilt;
          EXPECT_EQ(result.Qabs.II, 0) << x << m << tilt;
        } else {
          EXPECT_GT(result.Qabs.I, 0) << x << m << tilt;
          EXPECT_GT(result.Qabs.II, 0) << x << m << tilt;
        }
      }
}

TEST(Cylinder, Symmetries) {
  const std::vector<double> theta{0, 17.3, 90, 179.9, 180}, mirrored{0, -17.3, 270, 180.1, -180};
  const std::vector<int> orders{0, 1, 2};
  for (const double tilt : {0.0, 40.0}) {
    const auto one = cylinder_at_degrees(37, {1.55, 1e-3}, tilt, theta, orders);
    const auto other_side = cylinder_at_degrees(37, {1.55, 1e-3}, tilt, mirrored, orders);
    const auto other_tilt = cylinder_at_degrees(37, {1.55, 1e-3}, -tilt, theta, orders);
    EXPECT_EQ(one.Qext.I, other_tilt.Qext.I);
    EXPECT_EQ(one.Qsca.II, other_tilt.Qsca.II);
    const auto compare = [&](const CylinderAmplitudes& a, const CylinderAmplitudes& mirror,
                             const CylinderAmplitudes& tilted) {
      EXPECT_EQ(a.T1, tilted.T1);
      EXPECT_EQ(a.T2, tilted.T2);
      for (std::size_t i = 0; i < theta.size(); ++i) {
        // 180.1 and 179.9 are no exact mirror images as doubles.
        const double scale = 1e-13 * largest(a, i);
        EXPECT_LE(std::abs(a.T1[i] - mirror.T1[i]), scale);
        EXPECT_LE(std::abs(a.T2[i] - mirror.T2[i]), scale);
        EXPECT_LE(std::abs(a.T3[i] + mirror.T3[i]), scale);
        EXPECT_EQ(a.T3[i], -tilted.T3[i]);
        EXPECT_EQ(a.T3[i], -a.T4[i]);
        if (tilt == 0) {
          EXPECT_EQ(a.T3[i], 0.0);
        }
      }
    };
    compare(one.amplitudes, other_side.amplitudes, other_tilt.amplitudes);
    for (std::size_t k = 0; k < orders.size(); ++k)
      compare(one.orders[k].amplitudes, other_side.orders[k].amplitudes, other_tilt.orders[k].amplitudes);
    if (tilt != 0) {
      EXPECT_GT(std::abs(one.amplitudes.T3[1]), 0.1);
    }
  }
}

TEST(Cylinder, ThreadsChangeNothing) {
  std::vector<double> theta;
  for (int i = 0; i <= 2000; ++i) theta.push_back(-180 + 0.18 * i);
  const std::vector<int> orders{1};
  const auto one = cylinder_at_degrees(700, {1.5, 1e-6}, 20, theta, orders, 1),
             many = cylinder_at_degrees(700, {1.5, 1e-6}, 20, theta, orders, 5);
  EXPECT_EQ(one.amplitudes.T1, many.amplitudes.T1);
  EXPECT_EQ(one.amplitudes.T3, many.amplitudes.T3);
  EXPECT_EQ(one.orders[0].amplitudes.T2, many.orders[0].amplitudes.T2);
  EXPECT_EQ(one.error_estimate, many.error_estimate);
}

TEST(Cylinder, NothingHappensAtTheCriticalTilt) {
  // sin(30 deg) = m: inside, the wave's argument passes from real through 0 to imaginary; the whole is
  // smooth.
  const std::vector<double> theta{0, 50, 180};
  const double step = 1e-7;
  const auto below = cylinder_at_degrees(10, 0.5, 30 - step, theta),
             at = cylinder_at_degrees(10, 0.5, 30, theta),
             above = cylinder_at_degrees(10, 0.5, 30 + step, theta);
  EXPECT_LE(at.error_estimate, 1e-13);
  for (std::size_t i = 0; i < theta.size(); ++i) {
    // Changes are first order in the step, their differences second.
    const complex slope = above.amplitudes.T1[i] - at.amplitudes.T1[i],
                  slope_below = at.amplitudes.T1[i] - below.amplitudes.T1[i];
    EXPECT_LE(std::abs(slope), 1e-5);
    EXPECT_LE(std::abs(slope - slope_below), 1e-11);
    EXPECT_GT(std::abs(slope), 1e-12);
  }
}

TEST(Cylinder, ThinCylindersAreDipoles) {
  // x -> 0: b_0I = -i pi x^2 (m^2 - 1) cos^2 tilt / 4 along the axis, 2 a_1II = -i pi x^2 (m^2 - 1) / (m^2 +
  // 1) / 2 across it (Bohren & Huffman, 8.4.5); the next terms are x^2 log x smaller.
  const std::vector<double> theta{0, 0.3, 1, 2, 3};
  for (const double x : {1e-6, 1e-4})
    for (const complex m : {complex{1.333, 0}, {1.5, 0.1}, {1.0001, 0}, {0.75, 0}}) {
      const auto result = cylinder(x, m, 0, theta);
      const complex along = complex(0, -1) * pi * x * x / 4.0 * (m * m - 1.0);
      const complex across = complex(0, -1) * pi * x * x / 2.0 * (m * m - 1.0) / (m * m + 1.0);
      for (std::size_t i = 0; i < theta.size(); ++i) {
        EXPECT_LE(std::abs(result.amplitudes.T1[i] / along - 1.0), 100 * x * x) << x << m;
        EXPECT_LE(
            std::abs(result.amplitudes.T2[i] - across * std::cos(theta[i])), 100 * x * x * std::abs(across))
            << x << m;
      }
      EXPECT_NEAR(result.Qsca.I / (pi * pi * x * x * x / 8 * std::norm(m * m - 1.0)), 1, 100 * x * x)
          << x << m;
    }
}

TEST(Cylinder, WeakAbsorptionIsProportionalToK) {
  for (const double x : {0.01, 1.0, 100.0, 3000.0})
    for (const double tilt : {0.0, 40.0, 85.0}) {
      const auto strong = cylinder_at_degrees(x, {1.55, 1e-12}, tilt, {}),
                 weak = cylinder_at_degrees(x, {1.55, 1e-18}, tilt, {});
      EXPECT_NEAR(strong.Qabs.I / weak.Qabs.I, 1e6, 1e6 * 1e-6) << x << ' ' << tilt;
      EXPECT_NEAR(strong.Qabs.II / weak.Qabs.II, 1e6, 1e6 * 1e-6) << x << ' ' << tilt;
    }
}

TEST(Cylinder, LargeOnesTakeOutTwiceTheirShadow) {
  // The edges add to 2 cos(tilt) a share that falls as (x cos tilt)^(-2/3).
  for (const double tilt : {0.0, 60.0, 85.0}) {
    const double shadow = std::cos(tilt * pi / 180);
    double excess[2];
    for (const int i : {0, 1}) {
      const double x = i == 0 ? 2000 : 16000;
      const auto result = cylinder_at_degrees(x, {1.5, 0.1}, tilt, {});
      excess[i] = (result.Qext.I + result.Qext.II) / 2 / (2 * shadow) - 1;
      EXPECT_GT(excess[i], 0) << x << ' ' << tilt;
      EXPECT_LT(excess[i], std::pow(x * shadow, -2.0 / 3)) << x << ' ' << tilt;
    }
    EXPECT_NEAR(excess[0] / excess[1], 4, 0.4) << tilt;
  }
}

TEST(Cylinder, DebyeTermsAddUpToTheWhole) {
  // Absorption and transmission end the series: with enough terms nothing remains. The remainder is what the
  // listed terms leave, to rounding.
  const std::vector<double> theta{0, 12, 80, 137, 180};
  struct Body {
    double x;
    complex m;
    double tilt;
  };
  for (const Body body :
       {Body{5, {1.55, 0.01}, 0},
        {5, {1.55, 0.01}, 35},
        {60, {1.55, 5e-3}, 0},
        {60, {1.55, 5e-3}, 60},
        {60, {0.75, 1e-2}, 20},
        {3000, {1.55, 1e-4}, 80}}) {
    std::vector<int> orders(61);
    for (int p = 0; p <= 60; ++p) orders[static_cast<std::size_t>(p)] = p;
    const auto result = cylinder_at_degrees(body.x, body.m, body.tilt, theta, orders);
    for (std::size_t i = 0; i < theta.size(); ++i) {
      const double scale = largest(result.amplitudes, i);
      complex sum[3] = {result.remainder.T1[i], result.remainder.T2[i], result.remainder.T3[i]};
      double terms = 0;
      for (const auto& order : result.orders) {
        sum[0] += order.amplitudes.T1[i];
        sum[1] += order.amplitudes.T2[i];
        sum[2] += order.amplitudes.T3[i];
        terms += largest(order.amplitudes, i);
      }
      EXPECT_LE(std::abs(sum[0] - result.amplitudes.T1[i]), 1e-13 * (scale + terms))
          << body.x << ' ' << theta[i];
      EXPECT_LE(std::abs(sum[1] - result.amplitudes.T2[i]), 1e-13 * (scale + terms))
          << body.x << ' ' << theta[i];
      EXPECT_LE(std::abs(sum[2] - result.amplitudes.T3[i]), 1e-13 * (scale + terms))
          << body.x << ' ' << theta[i];
      // Beyond total reflection the terms of a bubble die only slowly.
      if (body.m.real() > 1) {
        EXPECT_LE(largest(result.remainder, i), 1e-3 * scale) << body.x << ' ' << theta[i];
      }
    }
  }
}

TEST(Cylinder, OrderOfAnglesChangesNothing) {
  std::vector<double> theta;
  for (int i = 0; i <= 1000; ++i) theta.push_back(2 * pi * i / 1000);
  const std::vector<int> orders{1};
  const auto all = cylinder(800, {1.55, 1e-8}, 0.5, theta, orders);
  std::vector<std::size_t> order(theta.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  std::vector<double> shuffled;
  for (const auto i : order) shuffled.push_back(theta[i]);
  const auto mixed = cylinder(800, {1.55, 1e-8}, 0.5, shuffled, orders);
  for (std::size_t i = 0; i < order.size(); ++i) {
    ASSERT_EQ(mixed.amplitudes.T1[i], all.amplitudes.T1[order[i]]);
    ASSERT_EQ(mixed.amplitudes.T3[i], all.amplitudes.T3[order[i]]);
    ASSERT_EQ(mixed.orders[0].amplitudes.T2[i], all.orders[0].amplitudes.T2[order[i]]);
  }
  for (std::size_t i = 0; i < theta.size(); i += 137) {
    const auto alone = cylinder(800, {1.55, 1e-8}, 0.5, {&theta[i], 1});
    EXPECT_EQ(alone.amplitudes.T1[0], all.amplitudes.T1[i]) << "an angle on its own";
  }
}

TEST(Cylinder, DegreesAndRadiansAgree) {
  std::vector<double> degrees, radians;
  for (double angle = -360; angle <= 360; angle += 0.7) {
    degrees.push_back(angle);
    radians.push_back(angle * (pi / 180));
  }
  const double x = 500;
  const auto by_degrees = cylinder_at_degrees(x, 1.55, 20, degrees),
             by_radians = cylinder(x, 1.55, 20 * (pi / 180), radians);
  for (std::size_t i = 0; i < degrees.size(); ++i)
    // An angle in radians is off by up to 9e-16, which turns each partial wave by up to x times that.
    EXPECT_LE(
        difference(by_degrees.amplitudes, by_radians.amplitudes, i),
        1e-10 * largest(by_degrees.amplitudes, i))
        << degrees[i];
  EXPECT_NEAR(by_radians.tilt_deg, 20, 1e-14);
}

TEST(Cylinder, NothingBlowsUpAnywhereInTheDomain) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform;
  const std::vector<double> theta{0, 60, 123, 180};
  const std::vector<int> orders{0, 1, 4};
  for (int i = 0; i < 400; ++i) {
    const double x = std::pow(10, -6 + 9.5 * uniform(random));
    const double n = std::pow(10, -1 + 2 * uniform(random));
    const double k = uniform(random) < 0.4 ? 0 : std::pow(10, -12 + 13 * uniform(random));
    const double tilt = 89.9 * (2 * uniform(random) - 1);
    const auto result = cylinder_at_degrees(x, {n, k}, tilt, theta, orders);
    for (const auto& Q : {result.Qext, result.Qsca})
      EXPECT_TRUE(Q.I > 0 && Q.II > 0 && std::isfinite(Q.I) && std::isfinite(Q.II))
          << x << ' ' << n << ' ' << k << ' ' << tilt;
    EXPECT_TRUE(result.Qabs.I >= 0 && result.Qabs.II >= 0) << x << ' ' << n << ' ' << k << ' ' << tilt;
    EXPECT_TRUE(std::isfinite(result.error_estimate));
    for (std::size_t j = 0; j < theta.size(); ++j) {
      EXPECT_TRUE(std::isfinite(std::abs(result.amplitudes.T1[j]) + largest(result.amplitudes, j)));
      EXPECT_TRUE(std::isfinite(std::abs(result.remainder.T1[j]) + largest(result.remainder, j)));
      for (const auto& order : result.orders)
        EXPECT_TRUE(std::isfinite(std::abs(order.amplitudes.T2[j]) + largest(order.amplitudes, j)))
            << x << ' ' << n << ' ' << k << ' ' << tilt << " p = " << order.p;
    }
  }
}

TEST(Cylinder, WrongInputIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN(),
               infinity = std::numeric_limits<double>::infinity();
  for (const double x : {0.0, -1.0, 0.9e-6, 1.1e5, nan, infinity})
    EXPECT_THROW((void)cylinder(x, 1.55, 0, {}), scatter::InputError) << x;
  for (const complex m :
       {complex{1, 0}, {0, 1}, {-1.33, 0}, {1.33, -1e-9}, {nan, 0}, {1.33, nan}, {infinity, 0}})
    EXPECT_THROW((void)cylinder(1, m, 0, {}), scatter::InputError) << m;
  EXPECT_THROW((void)cylinder(1e5, 200, 0, {}), scatter::InputError);
  for (const double tilt : {90.0, -90.0, 89.95, nan})
    EXPECT_THROW((void)cylinder_at_degrees(1, 1.55, tilt, {}), scatter::InputError) << tilt;
  EXPECT_THROW((void)cylinder(1, 1.55, pi / 2, {}), scatter::InputError);
  for (const double angle : {-360.1, 361.0, nan}) {
    const std::vector<double> theta{0, angle};
    EXPECT_THROW((void)cylinder_at_degrees(1, 1.55, 0, theta), scatter::InputError) << angle;
  }
  for (const int p : {-1, 1001}) {
    const std::vector<int> orders{0, p};
    EXPECT_THROW((void)cylinder_at_degrees(1, 1.55, 0, {}, orders), scatter::InputError) << p;
  }
  try {
    (void)cylinder_at_degrees(1, 1.55, 90, {});
    FAIL();
  } catch (const scatter::InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("-89.9..89.9 deg"));
  }
}

} // namespace
