#include <scatter/exact/extended_partial_waves.hpp>
#include <scatter/exact/mie.hpp>
#include <scatter/exact/sphere_coefficients.hpp>
#include <scatter/optics/errors.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <random>

namespace {

using scatter::exact::mie;
using scatter::exact::mie_at_degrees;
using scatter::exact::MieResult;
using std::numbers::pi;
using complex = std::complex<double>;
using testing::HasSubstr;

/// Spheres whose scattering was computed with 60 digits: see tests/data/make_mie_truth.py.
const nlohmann::json& truth() {
  static const nlohmann::json cases = nlohmann::json::parse(std::ifstream(SCATTER_TRUTH));
  return cases;
}

complex as_complex(const nlohmann::json& pair) {
  return {pair[0].get<double>(), pair[1].get<double>()};
}

class MieTruth : public testing::TestWithParam<std::size_t> {
protected:
  const nlohmann::json& exact = truth()[GetParam()];
  const std::vector<double> angles = exact["theta_deg"];
  const MieResult result = mie_at_degrees(exact["x"], as_complex(exact["m"]), angles);

  /// What the header promises of S.
  double amplitude_limit() const { return exact["x"] <= 5000 ? 1e-12 : 1e-11; }
};

TEST_P(MieTruth, Efficiencies) {
  const auto relative = [&](double value, const char* name) {
    const double expected = exact[name];
    return expected == 0 ? std::abs(value) : std::abs(value / expected - 1);
  };
  EXPECT_LE(relative(result.Qext, "Qext"), result.error_estimate);
  EXPECT_LE(relative(result.Qsca, "Qsca"), result.error_estimate);
  EXPECT_LE(relative(result.Qabs, "Qabs"), result.error_estimate);
  EXPECT_LE(relative(result.Qext, "Qext"), 1e-13);
  EXPECT_LE(relative(result.Qsca, "Qsca"), 1e-13);
  EXPECT_LE(relative(result.Qabs, "Qabs"), 1e-13);
  EXPECT_LE(relative(result.Qback, "Qback"), result.Qback_error_estimate);
  EXPECT_LE(relative(result.Qback, "Qback"), 2 * amplitude_limit());
  EXPECT_LE(result.Qback_error_estimate, 2 * amplitude_limit());
  EXPECT_LE(relative(result.g, "g"), 1e-13);
}

TEST_P(MieTruth, Amplitudes) {
  double worst = 0;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const complex S1 = as_complex(exact["S1"][i]), S2 = as_complex(exact["S2"][i]);
    const double scale = std::max(std::abs(S1), std::abs(S2));
    const double error = std::max(std::abs(result.S1[i] - S1), std::abs(result.S2[i] - S2)) / scale;
    EXPECT_LE(error, result.error_estimate) << "theta = " << angles[i];
    EXPECT_LE(error, amplitude_limit()) << "theta = " << angles[i];
    worst = std::max(worst, error);
    const double x = exact["x"], Qsca = exact["Qsca"];
    const double phase_function = (std::norm(S1) + std::norm(S2)) / (2 * pi * x * x * Qsca);
    EXPECT_NEAR(result.phase_function[i] / phase_function, 1, 4 * result.error_estimate);
  }
  EXPECT_LE(result.error_estimate, 100 * std::max(worst, 1e-16))
      << "an estimate that says too much says nothing";
  RecordProperty("worst_error", std::to_string(worst));
  if (testing::Test::HasFailure() || std::getenv("SCATTER_PRINT_ERRORS"))
    std::printf(
        "%-28s error %.1e, estimate %.1e\n", exact["name"].get<std::string>().c_str(), worst,
        result.error_estimate);
}

TEST_P(MieTruth, AmplitudesOnEvenGrids) {
  // The same angles out of a grid that is summed by FFT where spheres are large: all but 0.001 and 179.999.
  std::vector<double> grid;
  for (int i = 0; i <= 14400; ++i) grid.push_back(i / 80.0);
  std::vector<double> finer;
  for (int i = 0; i <= 9000; ++i) finer.push_back(i / 50.0);
  for (const auto& list : {grid, finer}) {
    const auto whole = mie_at_degrees(exact["x"], as_complex(exact["m"]), list);
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const auto found = std::lower_bound(list.begin(), list.end(), angles[i]);
      if (found == list.end() || *found != angles[i]) continue;
      const auto at = static_cast<std::size_t>(found - list.begin());
      const complex S1 = as_complex(exact["S1"][i]), S2 = as_complex(exact["S2"][i]);
      const double scale = std::max(std::abs(S1), std::abs(S2));
      const double error = std::max(std::abs(whole.S1[at] - S1), std::abs(whole.S2[at] - S2)) / scale;
      EXPECT_LE(error, whole.error_estimate) << "theta = " << angles[i];
      EXPECT_LE(error, amplitude_limit()) << "theta = " << angles[i];
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Cases, MieTruth, testing::Range(std::size_t{0}, truth().size()), [](const auto& test) {
      std::string name = truth()[test.param]["name"];
      std::erase_if(name, [](char c) { return c == ',' || c == '.'; });
      std::replace(name.begin(), name.end(), ' ', '_');
      return name;
    });

double larger(complex a, complex b) {
  return std::max(std::abs(a), std::abs(b));
}

TEST(Mie, EvenGridsCountAsDecimals) {
  // Truth at decimals that no double is equal to; then 32 digits at all angles of the grid, as the estimate
  // is the largest of all.
  std::vector<double> grid;
  for (int i = 0; i <= 1800; ++i) grid.push_back(i / 10.0);
  const auto angles = scatter::exact::fold_angles(grid, scatter::exact::AngleUnit::degree);
  const nlohmann::json truth = nlohmann::json::parse(std::ifstream(SCATTER_DECIMAL_TRUTH));
  ASSERT_GE(truth.size(), 10);
  for (const auto& exact : truth) {
    const double x = exact["x"], limit = x <= 5000 ? 1e-12 : 1e-11;
    const complex m = as_complex(exact["m"]);
    const auto whole = mie_at_degrees(x, m, grid);
    for (std::size_t i = 0; i < exact["theta_deg"].size(); ++i) {
      const auto decimal = exact["theta_deg"][i].get<std::string>();
      const auto at = static_cast<std::size_t>(10 * std::stod(decimal) + 0.5);
      ASSERT_EQ(grid[at], std::stod(decimal));
      const complex S1 = as_complex(exact["S1"][i]), S2 = as_complex(exact["S2"][i]);
      const double error = larger(whole.S1[at] - S1, whole.S2[at] - S2) / larger(S1, S2);
      EXPECT_LE(error, whole.error_estimate) << exact["name"] << ", theta = " << decimal;
      EXPECT_LE(error, limit) << exact["name"] << ", theta = " << decimal;
    }
    scatter::exact::ExtendedWaves waves;
    (void)scatter::exact::sphere_coefficients(x, m, &waves);
    const scatter::exact::ExtendedWaves* const set = &waves;
    const auto fine = std::move(scatter::exact::sum_partial_waves({&set, 1}, angles, 0)[0]);
    double worst = 0;
    for (std::size_t i = 0; i < grid.size(); ++i)
      worst = std::max(
          worst, larger(whole.S1[i] - fine.S1[i], whole.S2[i] - fine.S2[i]) / larger(fine.S1[i], fine.S2[i]));
    EXPECT_LE(worst, whole.error_estimate) << exact["name"];
    EXPECT_LE(worst, limit) << exact["name"];
    EXPECT_LE(whole.error_estimate, 100 * std::max(worst, 1e-16)) << exact["name"];
    if (std::getenv("SCATTER_PRINT_ERRORS"))
      std::printf(
          "%-28s on a grid: error %.1e, estimate %.1e\n", exact["name"].get<std::string>().c_str(), worst,
          whole.error_estimate);
  }
}

TEST(Mie, TinySpheresKeepTheRealPart) {
  // Re S(0) is x^3 times smaller than Im S(0); the optical theorem needs its digits.
  for (const auto& exact : truth()) {
    const double x = exact["x"];
    if (x > 0.1) continue;
    const std::vector<double> forward{0};
    const auto result = mie(x, as_complex(exact["m"]), forward);
    EXPECT_NEAR(result.S1[0].real() / exact["S1"][0][0].get<double>(), 1, 1e-13) << x;
    EXPECT_NEAR(result.S1[0].imag() / exact["S1"][0][1].get<double>(), 1, 1e-13) << x;
  }
}

const double sizes[] = {1e-6, 1e-3, 0.1, 1, pi, 10, 49.9386, 200, 3000, 20000};
const complex indices[] = {1.0001, 1.333, 1.5, 10, 0.75, {1.33, 1e-9}, {1.33, 1e-3}, {0.2, 3}, {10, 10}};

TEST(Mie, OpticalTheorem) {
  const std::vector<double> forward{0};
  for (const double x : sizes)
    for (const complex m : indices) {
      const auto result = mie(x, m, forward);
      EXPECT_NEAR(4 / (x * x) * result.S1[0].real() / result.Qext, 1, 1e-12) << x << m;
      EXPECT_LE(std::abs(result.S1[0] - result.S2[0]), 1e-13 * std::abs(result.S1[0])) << x << m;
    }
}

TEST(Mie, BackwardAmplitudesAreOpposite) {
  const std::vector<double> backward{180};
  for (const double x : sizes)
    for (const complex m : indices) {
      const auto result = mie_at_degrees(x, m, backward);
      const double scale = std::abs(result.S1[0]);
      EXPECT_LE(std::abs(result.S1[0] + result.S2[0]), result.error_estimate * scale) << x << m;
      // Qback is summed apart, in higher precision.
      EXPECT_NEAR(4 * scale * scale / (x * x) / result.Qback, 1, 4 * result.error_estimate) << x << m;
    }
}

TEST(Mie, QbackHasAnEstimateOfItsOwn) {
  // Against 32 digits; no angle is asked for.
  double nearest = 0;
  for (const double x : sizes)
    for (const complex m : indices) {
      const auto result = mie(x, m, {});
      scatter::exact::ExtendedWaves waves;
      const double fine = scatter::exact::sphere_coefficients(x, m, &waves).Qback;
      const double error = std::abs(result.Qback / fine - 1);
      EXPECT_LE(error, result.Qback_error_estimate) << x << m;
      EXPECT_LE(result.Qback_error_estimate, x <= 5000 ? 2e-12 : 2e-11) << x << m;
      nearest = std::max(nearest, error / result.Qback_error_estimate);
    }
  // One number may be right by chance; all of them are not.
  EXPECT_GE(nearest, 0.01) << "an estimate that says too much says nothing";
}

TEST(Mie, MuellerElementsAreBohrenAndHuffmans) {
  // 4.77 as it stands there.
  const complex i{0, 1};
  for (const auto& [S1, S2] :
       {std::pair{complex{3, -2}, complex{-1, 0.5}},
        {{0, 0}, {0, 4}},
        {{1e-3, 1}, {1, 1e3}},
        {{2, 1}, {2, 1}}}) {
    const auto [S11, S12, S33, S34] = scatter::exact::mueller_elements(S1, S2);
    const double whole = std::norm(S1) + std::norm(S2);
    EXPECT_NEAR(S11, whole / 2, 1e-15 * whole);
    EXPECT_NEAR(S12, (std::norm(S2) - std::norm(S1)) / 2, 1e-15 * whole);
    EXPECT_NEAR(S33, (std::conj(S2) * S1 + S2 * std::conj(S1)).real() / 2, 1e-15 * whole);
    EXPECT_NEAR(S34, (i / 2.0 * (S1 * std::conj(S2) - S2 * std::conj(S1))).real(), 1e-15 * whole);
  }
}

/// Nodes and weights of Gauss-Legendre in mu = cos(theta), by Newton's iteration.
void gauss_legendre(int count, std::vector<double>& theta, std::vector<double>& weight) {
  for (int i = 0; i < count; ++i) {
    double angle = pi * (i + 0.75) / (count + 0.5), slope = 0;
    for (int step = 0; step < 8; ++step) {
      const double mu = std::cos(angle);
      double p = 1, before = 0;
      for (int n = 1; n <= count; ++n) {
        const double next = ((2 * n - 1) * mu * p - (n - 1) * before) / n;
        before = p;
        p = next;
      }
      slope = count * (before - mu * p) / std::sin(angle); // -dP/d theta
      angle += p / slope;
    }
    theta.push_back(angle);
    weight.push_back(2 / (slope * slope));
  }
}

TEST(Mie, EnergyIsConserved) {
  // The phase function integrates to 1 and its mean cosine is g: the angular sums against the sums of
  // coefficients.
  for (const double x : {1e-6, 0.1, 1.0, 10.0, 49.9386, 200.0})
    for (const complex m : indices) {
      std::vector<double> theta, weight;
      gauss_legendre(
          static_cast<int>(x + 9 * std::cbrt(x) + 20), theta, weight); // exact for the squared polynomial
      const auto result = mie(x, m, theta);
      double integral = 0, mean_cosine = 0;
      for (std::size_t i = 0; i < theta.size(); ++i) {
        integral += 2 * pi * weight[i] * result.phase_function[i];
        mean_cosine += 2 * pi * weight[i] * result.phase_function[i] * std::cos(theta[i]);
      }
      EXPECT_NEAR(integral, 1, 2e-11) << x << m;
      EXPECT_NEAR(mean_cosine, result.g, 2e-11) << x << m;
      EXPECT_NEAR(result.Qext, result.Qsca + result.Qabs, 1e-15 * result.Qext) << x << m;
      if (m.imag() == 0) {
        EXPECT_EQ(result.Qabs, 0) << x << m;
      } else {
        EXPECT_GT(result.Qabs, 0) << x << m;
      }
    }
}

TEST(Mie, RayleighLimit) {
  // x -> 0: S1 = -i x^3 (m^2 - 1)/(m^2 + 2), S2 = S1 cos(theta); the next term is x^2 smaller.
  const std::vector<double> theta{0, 0.3, 1, pi / 2, 2, 3};
  for (const double x : {1e-6, 1e-4})
    for (const complex m : {complex{1.333, 0}, {1.5, 0.1}, {1.0001, 0}, {0.75, 0}}) {
      const auto result = mie(x, m, theta);
      const complex polarisability = (m * m - 1.0) / (m * m + 2.0);
      const complex dipole = complex(0, -1) * x * x * x * polarisability;
      for (std::size_t i = 0; i < theta.size(); ++i) {
        EXPECT_LE(std::abs(result.S1[i] / dipole - 1.0), 10 * x * x) << x << m;
        EXPECT_LE(std::abs(result.S2[i] - dipole * std::cos(theta[i])), 10 * x * x * std::abs(dipole))
            << x << m;
        const double mu = std::cos(theta[i]);
        EXPECT_NEAR(result.phase_function[i], 3 / (16 * pi) * (1 + mu * mu), 10 * x * x) << x << m;
      }
      EXPECT_NEAR(result.Qsca / (8.0 / 3 * std::pow(x, 4) * std::norm(polarisability)), 1, 10 * x * x)
          << x << m;
      if (m.imag() > 0) {
        EXPECT_NEAR(result.Qabs / (4 * x * polarisability.imag()), 1, 10 * x * x) << x << m;
      }
    }
}

TEST(Mie, WeakAbsorptionIsProportionalToK) {
  // Qabs is not a difference of two big numbers: it stays proportional to k far below their rounding.
  for (const double x : {0.01, 1.0, 100.0, 10000.0}) {
    const double strong = mie(x, {1.33, 1e-12}, {}).Qabs, weak = mie(x, {1.33, 1e-18}, {}).Qabs;
    EXPECT_NEAR(strong / weak, 1e6, 1e6 * 1e-6) << x;
  }
}

TEST(Mie, ExtinctionParadox) {
  // Large spheres take out twice their shadow; the edge adds 1.9924 x^(-2/3) (Nussenzveig & Wiscombe 1980),
  // the rest is ripple of opaque spheres' next order.
  for (const double x : {2000.0, 20000.0, 50000.0}) {
    const double excess = mie(x, {1.33, 0.05}, {}).Qext - 2;
    EXPECT_NEAR(excess * std::pow(x, 2.0 / 3) / 1.9924, 1, 0.05) << x;
  }
}

TEST(Mie, ThreadsAndOrderChangeNothing) {
  std::vector<double> theta;
  for (int i = 0; i <= 1000; ++i) theta.push_back(pi * i / 1000);
  for (const double x : {5.0, 1500.0}) {
    const complex m{1.333, 1e-8};
    const auto one = mie(x, m, theta, 1), many = mie(x, m, theta, 7);
    EXPECT_EQ(one.S1, many.S1);
    EXPECT_EQ(one.S2, many.S2);
    EXPECT_EQ(one.phase_function, many.phase_function);
    EXPECT_EQ(one.error_estimate, many.error_estimate);
    std::vector<std::size_t> order(theta.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::shuffle(order.begin(), order.end(), std::mt19937(1));
    std::vector<double> shuffled;
    for (const auto i : order) shuffled.push_back(theta[i]);
    const auto mixed = mie(x, m, shuffled, 3);
    for (std::size_t i = 0; i < order.size(); ++i) {
      ASSERT_EQ(mixed.S1[i], one.S1[order[i]]);
      ASSERT_EQ(mixed.S2[i], one.S2[order[i]]);
    }
    for (std::size_t i = 0; i < theta.size(); i += 137) {
      const auto alone = mie(x, m, {&theta[i], 1});
      EXPECT_EQ(alone.S1[0], one.S1[i]) << "an angle on its own";
      EXPECT_EQ(alone.S2[0], one.S2[i]);
    }
  }
}

TEST(Mie, EvenGridsAgreeWithSingleAngles) {
  // Steps that are doubles as they are, so that an angle means the same in a grid and in any other list.
  std::vector<double> grid, others;
  for (int i = 0; i <= 11520; ++i) grid.push_back(i / 64.0);
  std::mt19937 random(17);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int sphere = 0; sphere < 40; ++sphere) {
    const double x = std::pow(10.0, 1 + 3.699 * (sphere < 3 ? 1 : uniform(random)));
    const double k = sphere % 3 == 0 ? 0 : std::pow(10.0, -9 + 8 * uniform(random));
    const complex m{sphere % 5 == 4 ? 0.7 + 0.2 * uniform(random) : 1.1 + uniform(random), k};
    const auto whole = mie_at_degrees(x, m, grid);
    std::vector<std::size_t> places;
    others = {1e-7}; // makes the list uneven
    for (int i = 0; i < 100; ++i) {
      places.push_back(random() % grid.size());
      others.push_back(grid[places.back()]);
    }
    const auto single = mie_at_degrees(x, m, others);
    for (std::size_t i = 0; i < places.size(); ++i) {
      const complex S1 = whole.S1[places[i]], S2 = whole.S2[places[i]];
      const double scale = std::max(std::abs(S1), std::abs(S2));
      const double error = std::max(std::abs(S1 - single.S1[i + 1]), std::abs(S2 - single.S2[i + 1])) / scale;
      EXPECT_LE(error, whole.error_estimate + single.error_estimate) << x << m << grid[places[i]];
      EXPECT_LE(error, x <= 5000 ? 2e-12 : 1e-11) << x << m << grid[places[i]];
    }
  }
}

TEST(Mie, DegreesAndRadiansAgree) {
  std::vector<double> degrees, radians;
  for (double angle = 0; angle <= 180; angle += 0.7) {
    degrees.push_back(angle);
    radians.push_back(angle * (pi / 180));
  }
  const double x = 1000;
  const auto by_degrees = mie_at_degrees(x, 1.333, degrees), by_radians = mie(x, 1.333, radians);
  for (std::size_t i = 0; i < degrees.size(); ++i) {
    // An angle in radians is off by up to 5e-16, which turns each partial wave by up to x times that.
    const double scale = std::max(std::abs(by_degrees.S1[i]), std::abs(by_degrees.S2[i]));
    EXPECT_LE(std::abs(by_degrees.S1[i] - by_radians.S1[i]), 1e-10 * scale) << degrees[i];
  }
}

TEST(Mie, AnglesAreContinuousAcrossTheFold) {
  // 90 deg and its neighbours take different branches (mirrored or not): the amplitude's slope is at most x.
  const double x = 300, step = 1e-9;
  const std::vector<double> theta{pi / 2, pi / 2 + step};
  const auto result = mie(x, 1.333, theta);
  EXPECT_LE(std::abs(result.S1[0] - result.S1[1]), 2 * x * step * x);
}

TEST(Mie, WrongInputIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN(),
               infinity = std::numeric_limits<double>::infinity();
  for (const double x : {0.0, -1.0, 0.9e-6, 5.1e5, nan, infinity})
    EXPECT_THROW((void)mie(x, 1.33, {}), scatter::InputError) << x;
  for (const complex m :
       {complex{1, 0}, {0, 1}, {-1.33, 0}, {1.33, -1e-9}, {nan, 0}, {1.33, nan}, {infinity, 0}})
    EXPECT_THROW((void)mie(1, m, {}), scatter::InputError) << m;
  EXPECT_THROW((void)mie(1e5, 2000, {}), scatter::InputError);
  EXPECT_THROW((void)mie(1, 9e-7, {}), scatter::InputError);
  for (const double angle : {-1e-9, 3.15, nan}) {
    const std::vector<double> theta{0, angle};
    EXPECT_THROW((void)mie(1, 1.33, theta), scatter::InputError) << angle;
  }
  const std::vector<double> beyond{180.0001};
  try {
    (void)mie_at_degrees(1, 1.33, beyond);
    FAIL();
  } catch (const scatter::InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("0..180 deg"));
  }
}

} // namespace
