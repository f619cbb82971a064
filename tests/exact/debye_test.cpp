#include <scatter/exact/debye.hpp>
#include <scatter/exact/mie.hpp>
#include <scatter/optics/errors.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

namespace {

using scatter::exact::debye;
using scatter::exact::debye_at_degrees;
using scatter::exact::DebyeResult;
using scatter::exact::DebyeTerm;
using scatter::exact::mie_at_degrees;
using std::numbers::pi;
using complex = std::complex<double>;
using testing::HasSubstr;

/// Spheres whose Debye terms were computed with 60 digits and more: see tests/data/make_debye_truth.py.
const nlohmann::json& truth() {
  static const nlohmann::json cases = nlohmann::json::parse(std::ifstream(SCATTER_DEBYE_TRUTH));
  return cases;
}

complex as_complex(const nlohmann::json& pair) {
  return {pair[0].get<double>(), pair[1].get<double>()};
}

double larger(complex a, complex b) {
  return std::max(std::abs(a), std::abs(b));
}

class DebyeTruth : public testing::TestWithParam<std::size_t> {
protected:
  const nlohmann::json& exact = truth()[GetParam()];
  const std::vector<double> angles = exact["theta_deg"];

  DebyeResult compute() const {
    std::vector<int> orders;
    for (const auto& order : exact["orders"]) orders.push_back(order["p"]);
    return debye_at_degrees(exact["x"], as_complex(exact["m"]), orders, angles);
  }

  /// The error of a term as its header defines it, largest over the angles.
  double error(const DebyeTerm& term, const nlohmann::json& expected) const {
    double worst = 0;
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const complex S1 = as_complex(expected["S1"][i]), S2 = as_complex(expected["S2"][i]);
      const double whole = larger(as_complex(exact["S1"][i]), as_complex(exact["S2"][i]));
      const double scale = std::max(larger(S1, S2), 1e-12 * whole);
      const double here = larger(term.S1[i] - S1, term.S2[i] - S2) / scale;
      EXPECT_TRUE(std::isfinite(here)) << angles[i];
      worst = std::max(worst, here);
    }
    return worst;
  }
};

TEST_P(DebyeTruth, EveryOrderAtEveryAngle) {
  const DebyeResult result = compute();
  ASSERT_EQ(result.orders.size(), exact["orders"].size());
  const auto check = [&](const char* name, int p, const DebyeTerm& term, const nlohmann::json& expected) {
    const double found = error(term, expected);
    EXPECT_LE(found, term.error_estimate) << name << p;
    EXPECT_LE(found, 1e-11) << name << p;
    EXPECT_LE(term.error_estimate, 1e-10) << name << p;
    EXPECT_LE(term.error_estimate, 3e3 * std::max(found, 1e-14)) << name << p << ": says too much";
  };
  for (std::size_t i = 0; i < result.orders.size(); ++i) {
    ASSERT_EQ(result.orders[i].p, exact["orders"][i]["p"].get<int>());
    check("order ", result.orders[i].p, result.orders[i], exact["orders"][i]);
  }
  check("remainder ", result.orders.back().p, result.remainder, exact["remainder"]);
  check("whole ", 0, result.whole, exact);
}

INSTANTIATE_TEST_SUITE_P(
    Cases, DebyeTruth, testing::Range(std::size_t{0}, truth().size()), [](const auto& test) {
      std::string name = truth()[test.param]["name"];
      std::erase_if(name, [](char c) { return c == ',' || c == '.'; });
      std::replace(name.begin(), name.end(), ' ', '_');
      return name;
    });

TEST_P(DebyeTruth, VisibleDigitsAreThoseThatShowBesideTheWhole) {
  std::vector<int> orders;
  for (const auto& order : exact["orders"]) orders.push_back(order["p"]);
  const auto result = debye_at_degrees(
      exact["x"], as_complex(exact["m"]), orders, angles, 0, scatter::exact::DebyeDigits::visible);
  ASSERT_EQ(result.orders.size(), orders.size());
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double whole = larger(as_complex(exact["S1"][i]), as_complex(exact["S2"][i]));
    for (std::size_t o = 0; o < orders.size(); ++o) {
      const auto& expected = exact["orders"][o];
      const complex S1 = as_complex(expected["S1"][i]), S2 = as_complex(expected["S2"][i]);
      const double error = larger(result.orders[o].S1[i] - S1, result.orders[o].S2[i] - S2);
      EXPECT_LE(error, 1e-7 * std::max(larger(S1, S2), whole)) << "p = " << orders[o] << ", " << angles[i];
    }
  }
}

const double sizes[] = {1e-6, 1e-3, 0.1, 1, pi, 10, 49.9386, 200, 3000};
const complex indices[] = {1.0001, 1.333, 1.5, 10, 0.75, {1.33, 1e-9}, {1.33, 1e-3}, {0.2, 3}, {10, 10}};
const std::vector<double> some_angles{0, 1e-3, 30, 89.9, 90, 90.1, 138, 179.99, 180};

TEST(Debye, WholeIsMie) {
  for (const double x : sizes)
    for (const complex m : indices) {
      const auto exact = mie_at_degrees(x, m, some_angles);
      const std::vector<int> orders{2};
      const auto result = debye_at_degrees(x, m, orders, some_angles);
      const double limit = exact.error_estimate + result.whole.error_estimate;
      EXPECT_LT(limit, 1e-11) << x << m;
      for (std::size_t i = 0; i < some_angles.size(); ++i) {
        const double scale = larger(exact.S1[i], exact.S2[i]);
        EXPECT_LE(std::abs(result.whole.S1[i] - exact.S1[i]), limit * scale) << x << m << some_angles[i];
        EXPECT_LE(std::abs(result.whole.S2[i] - exact.S2[i]), limit * scale) << x << m << some_angles[i];
      }
    }
}

TEST(Debye, WholeIsMieOfSixtyDigits) {
  // Up to x = 50,000 and on the peak of a resonance of width 1e-8 in x.
  for (const auto& exact : nlohmann::json::parse(std::ifstream(SCATTER_TRUTH))) {
    const std::vector<double> angles = exact["theta_deg"];
    const std::vector<int> orders{0};
    const auto whole = debye_at_degrees(exact["x"], as_complex(exact["m"]), orders, angles).whole;
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const complex S1 = as_complex(exact["S1"][i]), S2 = as_complex(exact["S2"][i]);
      const double scale = larger(S1, S2), found = larger(whole.S1[i] - S1, whole.S2[i] - S2) / scale;
      EXPECT_LE(found, 1e-11) << exact["name"] << angles[i];
      EXPECT_LE(found, whole.error_estimate) << exact["name"] << angles[i];
    }
  }
}

TEST(Debye, PartsAddUp) {
  for (const double x : sizes)
    for (const complex m : indices) {
      const std::vector<int> orders{0, 1, 2, 3, 4, 5};
      const auto result = debye_at_degrees(x, m, orders, some_angles);
      for (std::size_t i = 0; i < some_angles.size(); ++i) {
        complex S1 = 0, S2 = 0;
        // The parts may be larger than their sum, which then keeps their rounding.
        double scale = 1e-12 * larger(result.whole.S1[i], result.whole.S2[i]);
        double error = 0;
        const auto count = [&](const DebyeTerm& term) {
          const double size = larger(term.S1[i], term.S2[i]);
          error += term.error_estimate * std::max(size, scale) + 1e-15 * size;
        };
        for (const auto& order : result.orders) {
          S1 += order.S1[i];
          S2 += order.S2[i];
          count(order);
        }
        count(result.partial_sum);
        EXPECT_LE(std::abs(S1 - result.partial_sum.S1[i]), error) << x << m << some_angles[i];
        EXPECT_LE(std::abs(S2 - result.partial_sum.S2[i]), error) << x << m << some_angles[i];
        S1 = result.partial_sum.S1[i] + result.remainder.S1[i];
        S2 = result.partial_sum.S2[i] + result.remainder.S2[i];
        count(result.remainder);
        count(result.whole);
        EXPECT_LE(std::abs(S1 - result.whole.S1[i]), error) << x << m << some_angles[i];
        EXPECT_LE(std::abs(S2 - result.whole.S2[i]), error) << x << m << some_angles[i];
      }
    }
}

TEST(Debye, RemainderShrinksExceptOnResonances) {
  // A drop loses light with every reflection, but for what its narrow resonances keep: b_68's lasts for 1e8.
  const std::vector<double> angles{60};
  const auto left = [&](double x, complex m, int last) {
    return std::abs(debye_at_degrees(x, m, std::vector<int>{last}, angles).remainder.S1[0]);
  };
  EXPECT_LT(left(1000.3, 1.333, 100), 0.02 * left(1000.3, 1.333, 3));
  EXPECT_LT(left(1000, {1.333, 1e-4}, 1000), 1e-50);
  const double peak = 49.93863417718588;
  EXPECT_NEAR(left(peak, 1.5, 1000) / left(peak, 1.5, 300), 1, 0.02);
}

TEST(Debye, AbsorptionTakesFromEachChord) {
  // Forward, p = 1 crosses the diameter once: exp(-2 k x) of the amplitude's square.
  const double x = 2000, k = 1e-4;
  const std::vector<double> forward{0};
  const std::vector<int> orders{1};
  const auto clear = debye(x, 1.333, orders, forward), grey = debye(x, {1.333, k}, orders, forward);
  EXPECT_NEAR(std::abs(grey.orders[0].S1[0] / clear.orders[0].S1[0]), std::exp(-2 * k * x), 1e-3);
}

TEST(Debye, GeometricOpticsOfTheAxialRays) {
  // Backward only the axial rays for n = 3: p = 0 by a mirror of focal length a/2, |S| = x r / 2; p = 2 by
  // the back face behind a refracting front (paraxial), |S| = x/2 r (1 - r^2) n / |n - 2|. Corrections are
  // O(1/x).
  const double x = 5000, n = 3;
  const std::vector<double> backward{180};
  const std::vector<int> orders{0, 2};
  const auto result = debye_at_degrees(x, n, orders, backward);
  const double r = (n - 1) / (n + 1);
  EXPECT_NEAR(std::abs(result.orders[0].S1[0]) / (x / 2 * r), 1, 1e-3);
  EXPECT_NEAR(std::abs(result.orders[1].S1[0]) / (x / 2 * r * (1 - r * r) * n / (n - 2)), 1, 1e-2);
}

TEST(Debye, BubblesReflectTotallyInOrderZeroAndRemainder) {
  // Ray optics of external reflection, perpendicular: S1 = -i x/2 r exp(-2 i x cos(incidence)), with
  // Fresnel's r of modulus 1 where sin(incidence) > m. What the other orders leave at these angles is
  // creeping waves of some per cent.
  const double x = 5000, m = 0.75;
  const std::vector<double> degrees{40, 60, 100, 120};
  const std::vector<int> orders{0, 6};
  const auto result = debye_at_degrees(x, m, orders, degrees);
  for (std::size_t i = 0; i < degrees.size(); ++i) {
    const double cosine = std::sin(degrees[i] * pi / 360), sine = std::cos(degrees[i] * pi / 360);
    const complex inside = std::sqrt(complex(m * m - sine * sine, 0)); // i |.| beyond the critical angle
    const complex r = (cosine - inside) / (cosine + inside);
    const complex rays = complex(0, -x / 2) * r * std::polar(1.0, -2 * x * cosine);
    const complex first = result.orders[0].S1[i], rest = result.remainder.S1[i];
    EXPECT_NEAR(std::abs(first / rays), 1, 0.01) << degrees[i];
    EXPECT_LE(std::abs((first + rest) / rays - 1.0), 0.06) << degrees[i];
    if (sine > m) {
      EXPECT_GT(std::abs(first / rays - 1.0), 0.2) << degrees[i] << ": the remainder is needed";
    } else {
      EXPECT_LE(std::abs(first / rays - 1.0), 2e-3) << degrees[i];
    }
  }
}

/// Angles where |S1|^2 of one order has its maxima, from the first above `from` on, by a parabola through
/// three points.
std::vector<double> peaks(double x, int p, double from, double to, double step) {
  std::vector<double> angles;
  for (double angle = from; angle <= to; angle += step) angles.push_back(angle);
  const std::vector<int> orders{p};
  const auto result = debye_at_degrees(x, 1.333, orders, angles);
  std::vector<double> found;
  for (std::size_t i = 1; i + 1 < angles.size(); ++i) {
    const auto intensity = [&](std::size_t k) { return std::norm(result.orders[0].S1[k]); };
    const double before = intensity(i - 1), here = intensity(i), after = intensity(i + 1);
    if (here > before && here >= after)
      found.push_back(angles[i] + step / 2 * (before - after) / (before - 2 * here + after));
  }
  return found;
}

TEST(Debye, BowsAndTheirSupernumeraries) {
  // Perpendicular, n = 1.333: independent computation of the Debye terms' maxima.
  struct Bow {
    double x;
    int p;
    double from, to;
    std::vector<double> maxima;
  };
  const Bow bows[] = {
      {1000, 2, 136, 143, {138.899, 141.049, 142.546}},
      {1000, 3, 122.5, 131, {123.607, 127.493}},
      {5000, 2, 137, 139.7, {138.2595, 138.999, 139.518}},
      {5000, 3, 126.8, 130, {127.191, 128.520}},
  };
  for (const auto& bow : bows) {
    const auto found = peaks(bow.x, bow.p, bow.from, bow.to, 0.005);
    ASSERT_EQ(found.size(), bow.maxima.size()) << bow.x << ' ' << bow.p << testing::PrintToString(found);
    for (std::size_t i = 0; i < found.size(); ++i)
      EXPECT_NEAR(found[i], bow.maxima[i], 6e-4) << bow.x << ' ' << bow.p;
  }
}

TEST(Debye, ThreadsOrderAndCompanyChangeNothing) {
  std::vector<double> theta;
  for (int i = 0; i <= 300; ++i) theta.push_back(pi * i / 300);
  const complex m{1.333, 1e-8};
  const std::vector<int> orders{0, 1, 2, 3, 4, 5, 6, 7, 8, 9};
  const auto one = debye(700, m, orders, theta, 1), many = debye(700, m, orders, theta, 7);
  for (std::size_t k = 0; k < orders.size(); ++k) {
    EXPECT_EQ(one.orders[k].S1, many.orders[k].S1);
    EXPECT_EQ(one.orders[k].S2, many.orders[k].S2);
    EXPECT_EQ(one.orders[k].error_estimate, many.orders[k].error_estimate);
  }
  EXPECT_EQ(one.remainder.S1, many.remainder.S1);
  EXPECT_EQ(one.partial_sum.S2, many.partial_sum.S2);
  std::vector<std::size_t> order(theta.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(1));
  std::vector<double> shuffled;
  for (const auto i : order) shuffled.push_back(theta[i]);
  const auto mixed = debye(700, m, std::vector<int>{9, 2, 2, 0}, shuffled);
  ASSERT_EQ(mixed.orders.size(), 3U);
  for (std::size_t i = 0; i < order.size(); ++i)
    for (const auto& term : mixed.orders) {
      ASSERT_EQ(term.S1[i], one.orders[static_cast<std::size_t>(term.p)].S1[order[i]]) << term.p;
      ASSERT_EQ(term.S2[i], one.orders[static_cast<std::size_t>(term.p)].S2[order[i]]) << term.p;
    }
}

TEST(Debye, EvenGridsAgreeWithSingleAngles) {
  // The grid's sums are made by FFT; the steps are doubles as they are.
  const double x = 2000;
  std::vector<double> grid, others{1e-7};
  for (int i = 0; i <= 5760; ++i) grid.push_back(i / 32.0);
  for (int i = 7; i < 5760; i += 97) others.push_back(grid[static_cast<std::size_t>(i)]);
  const std::vector<int> orders{0, 1, 2, 3, 30}, company{0, 2};
  for (const complex m : {complex{1.333, 0}, {1.5, 1e-4}}) {
    const auto whole = debye_at_degrees(x, m, orders, grid), few = debye_at_degrees(x, m, orders, others),
               two = debye_at_degrees(x, m, company, grid);
    const auto compare = [&](const DebyeTerm& term, const DebyeTerm& single, const char* name) {
      EXPECT_LE(term.error_estimate, 1e-10) << name;
      for (std::size_t i = 1; i < others.size(); ++i) {
        const std::size_t at = 7 + 97 * (i - 1);
        const double scale = std::max(
            larger(term.S1[at], term.S2[at]), 1e-12 * larger(whole.whole.S1[at], whole.whole.S2[at]));
        const double error = larger(term.S1[at] - single.S1[i], term.S2[at] - single.S2[i]) / scale;
        EXPECT_LE(error, term.error_estimate + single.error_estimate) << name << ' ' << grid[at];
      }
    };
    compare(whole.whole, few.whole, "whole");
    EXPECT_NE(whole.whole.S1[7 + 97 * 20], few.whole.S1[21]) << "the grid was not summed by FFT";
    compare(whole.partial_sum, few.partial_sum, "partial sum");
    compare(whole.remainder, few.remainder, "remainder");
    for (std::size_t k = 0; k < orders.size(); ++k) compare(whole.orders[k], few.orders[k], "order");
    EXPECT_EQ(two.orders[1].S1, whole.orders[2].S1) << "company";
    EXPECT_EQ(two.orders[1].S2, whole.orders[2].S2) << "company";
  }
}

TEST(Debye, EveryCornerOfTheDomainIsFinite) {
  const std::vector<double> angles{0, 1e-3, 77, 180};
  const std::vector<int> orders{0, 1, 2, 1000};
  for (const double x : {1e-6, 1e-3, 1.0, 300.0})
    for (const complex m :
         {complex{1e-6, 0}, {1e-6, 1e-6}, {1e-6, 1e4}, {1e4, 0}, {1e4, 1e4}, {std::nextafter(1, 2), 0}}) {
      const auto result = debye_at_degrees(x, m, orders, angles);
      const auto check = [&](const DebyeTerm& term) {
        EXPECT_TRUE(std::isfinite(term.error_estimate)) << x << m;
        for (std::size_t i = 0; i < angles.size(); ++i)
          EXPECT_TRUE(std::isfinite(larger(term.S1[i], term.S2[i]))) << x << m << angles[i];
      };
      for (const auto& order : result.orders) check(order);
      check(result.partial_sum);
      check(result.remainder);
      check(result.whole);
    }
}

TEST(Debye, WrongInputIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<int> orders{0};
  for (const double x : {0.0, -1.0, 0.9e-6, 5.1e5, nan})
    EXPECT_THROW((void)debye(x, 1.33, orders, {}), scatter::InputError) << x;
  for (const complex m : {complex{1, 0}, {0, 1}, {1.33, -1e-9}, {nan, 0}, {1e-7, 0}})
    EXPECT_THROW((void)debye(1, m, orders, {}), scatter::InputError) << m;
  const std::vector<double> beyond{180.0001};
  EXPECT_THROW((void)debye_at_degrees(1, 1.33, orders, beyond), scatter::InputError);
  EXPECT_THROW((void)debye(1, 1.33, {}, {}), scatter::InputError);
  for (const int p : {-1, 1001}) {
    try {
      (void)debye(1, 1.33, std::vector<int>{0, p}, {});
      FAIL() << p;
    } catch (const scatter::InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("0..1000"));
    }
  }
}

} // namespace
