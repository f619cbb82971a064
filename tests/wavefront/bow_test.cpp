#include "reference_tracer.hpp"
#include "support.hpp"

/// Where the geometric bows stand.
namespace {

using namespace support;

/// The bow's top [deg]: the scattering angle of the bow of order p at phi = 0. Rays of the primary come in
/// above the centre and leave below it, those of the secondary the other way round.
double top_of_bow(const drop::Shape& shape, double sun, double n, int p) {
  Tracer trace = tracer(shape, sun);
  std::vector<double> found;
  for (const auto& [theta, phi] : trace.bow_curve(with_index(n), p))
    if (phi < 1e-6 || shape.is_sphere() || sun == 90) found.push_back(theta);
  EXPECT_EQ(found.size(), 1U) << shape.name << ", sun " << sun << ", order " << p;
  return found.empty() ? NAN : found.front();
}

/// The same from the independent tracer: the stationary deflection in the vertical plane, by golden sections.
double reference_top(const drop::Shape& shape, double sun, double n, int p) {
  const reference::Surface surface(shape, sun);
  const double side = p % 2 == 0 ? -1 : 1;
  // The primary's theta is smallest there, the secondary's largest.
  const double sign = p == 2 ? 1 : -1;
  const auto theta = [&](double b) -> double {
    const auto rays = reference::trace(surface, n, side * b, 0, p);
    if (rays.empty() || !rays.at(p).valid) return sign * 1e3; // beside the drop, or reflected totally
    const auto& d = rays.at(p).direction;
    return double(std::atan2(d.x, d.z)) / degree; // positive: downward, phi = 0
  };
  double best = 0.5, lowest = 1e9;
  for (double b = 0.7; b < 0.985; b += 0.01)
    if (const double value = sign * theta(b); value < lowest) {
      lowest = value;
      best = b;
    }
  constexpr double golden = 0.6180339887498949;
  double low = best - 0.01, high = best + 0.01;
  for (int i = 0; i < 40; ++i) {
    const double a = high - golden * (high - low), b = low + golden * (high - low);
    (sign * theta(a) < sign * theta(b) ? high : low) = sign * theta(a) < sign * theta(b) ? b : a;
  }
  return theta((low + high) / 2);
}

TEST(BowOfTheSphere, StandsWhereDescartesPutIt) {
  // cos^2 i = (n^2 - 1) / (p^2 - 1), theta from Snell's law.
  for (const double n : {1.331, 1.343, 1.5})
    for (const int p : {2, 3, 4}) {
      const double i = std::acos(std::sqrt((n * n - 1) / (p * p - 1))), r = std::asin(std::sin(i) / n);
      const double deviation = (p - 1) * pi + 2 * i - 2 * p * r;
      const double theta = std::abs(std::remainder(deviation, 2 * pi)) / degree;
      EXPECT_NEAR(top_of_bow(drop::sphere(0.5e-3), 30, n, p), theta, 1e-4) << "n " << n << ", order " << p;
    }
  EXPECT_NEAR(top_of_bow(drop::sphere(0.5e-3), 0, 1.333, 2), 137.9219, 1e-4);
  EXPECT_NEAR(top_of_bow(drop::sphere(0.5e-3), 0, 1.333, 3), 129.1092, 1e-4);
}

TEST(BowOfDrops, AgreesWithTheStationaryRayOfTheReference) {
  for (const auto& [shape, sun] : std::vector<std::pair<drop::Shape, double>>{
           {drop::spheroid(0.5e-3, 0.95), 0},
           {drop::spheroid(0.5e-3, 0.95), 40},
           {drop::beard_chuang(0.5e-3), 20},
           {drop::chuang_beard(0.75e-3), 10}})
    for (const int p : {2, 3})
      EXPECT_NEAR(top_of_bow(shape, sun, 1.333, p), reference_top(shape, sun, 1.333, p), 1e-4)
          << shape.name << ", sun " << sun << ", order " << p;
}

TEST(BowOfTheSpheroid, ShiftsAsMoebiusFoundForSmallDeformations) {
  // Moebius 1910: 4.599 e cos(42.08 deg - 2 h) rad for the primary, an amplitude of 0.256 e for the
  // secondary.
  const double ratio = 0.999, e = (1 - ratio) / (1 + ratio);
  for (const double sun : {0.0, 20.0, 60.0}) {
    const auto shift = [&](int p) {
      return (top_of_bow(drop::spheroid(0.5e-3, ratio), sun, 1.333, p) -
              top_of_bow(drop::sphere(0.5e-3), sun, 1.333, p)) *
             degree;
    };
    EXPECT_NEAR(shift(2), 4.599 * e * std::cos((42.08 - 2 * sun) * degree), 0.02 * 4.599 * e)
        << "sun " << sun;
    EXPECT_LT(std::abs(shift(3)), 0.256 * e * 1.25) << "sun " << sun;
  }
}

TEST(BowOfTheSpheroid, ShiftsByThePublishedAnglesForFiniteDeformations) {
  const auto shift = [](double ratio, double sun) {
    return top_of_bow(drop::spheroid(0.5e-3, ratio), sun, 1.333, 2) - 137.9219;
  };
  EXPECT_NEAR(shift(0.95, 0), 5.46, 0.05);
  EXPECT_NEAR(shift(0.95, 20), 6.92, 0.05);
  EXPECT_NEAR(shift(0.95, 40), 4.95, 0.05);
  EXPECT_NEAR(shift(0.99, 0), 0.999, 0.005);
  EXPECT_NEAR(shift(0.99, 20), 1.331, 0.005);
  EXPECT_NEAR(shift(0.99, 40), 1.031, 0.005);
}

struct PublishedBow {
  drop::Shape shape;
  double sun, primary, secondary; ///< the secondary's deviation is unwrapped
};

TEST(BowOfRainDrops, StandsAtThePublishedAngles) {
  for (const PublishedBow& bow : std::vector<PublishedBow>{
           {drop::chuang_beard(0.5e-3), 0, 138.943, 233.763},
           {drop::chuang_beard(0.5e-3), 20, 140.175, 231.699},
           {drop::chuang_beard(0.75e-3), 0, 140.516, 239.560},
           {drop::chuang_beard(0.75e-3), 20, 143.967, 232.667},
           {drop::beard_chuang(1e-3), 0, 142.803, 246.417},
           {drop::beard_chuang(1e-3), 20, 149.705, 232.684}}) {
    EXPECT_NEAR(top_of_bow(bow.shape, bow.sun, 1.333, 2), bow.primary, 0.05)
        << bow.shape.name << " sun " << bow.sun;
    EXPECT_NEAR(top_of_bow(bow.shape, bow.sun, 1.333, 3), 360 - bow.secondary, 0.05)
        << bow.shape.name << " sun " << bow.sun;
  }
}

TEST(CosineSeries, TheZerothCoefficientIsSizeAndChangesNothing) {
  // (1 + c0) + c2 cos 2 theta is (1 + c2 / (1 + c0) cos 2 theta) in another unit of length.
  for (const double c0 : {-0.3, 0.5}) {
    const double sun = 20;
    const drop::Shape with = drop::cosine_series(0.5e-3, {c0, 0, -0.02 * (1 + c0)});
    const drop::Shape without = drop::cosine_series(0.5e-3, {0, 0, -0.02});
    for (const int p : {2, 3})
      EXPECT_NEAR(top_of_bow(with, sun, 1.333, p), top_of_bow(without, sun, 1.333, p), 1e-9);
    EXPECT_NEAR(top_of_bow(drop::cosine_series(0.5e-3, {c0, 0, 0}), sun, 1.333, 2), 137.9219, 1e-4);
  }
}

TEST(CosineSeries, TheFirstCoefficientIsATranslationAndChangesNothing) {
  // To first order: what is left goes with its square, while c_2 of the same size moves the bow a thousand
  // times more.
  for (const double sun : {0.0, 50.0}) {
    const double sphere = top_of_bow(drop::sphere(0.5e-3), sun, 1.333, 2);
    const auto moved = [&](std::vector<double> c) {
      return std::abs(top_of_bow(drop::cosine_series(0.5e-3, c), sun, 1.333, 2) - sphere);
    };
    EXPECT_LT(moved({0, 1e-3}), 4e-4) << "sun " << sun;
    EXPECT_GT(moved({0, 0, 1e-3}), 0.02) << "sun " << sun;
  }
}

/// A sphere beside the origin as a cosine series: all of the general kernel works, and the answer is the
/// sphere's.
TEST(CosineSeries, OfADisplacedSphereScattersLikeTheSphere) {
  constexpr double shift = 0.05, sun = 25;
  constexpr int terms = 11, samples = 400;
  std::vector<double> c(terms);
  for (int n = 0; n < terms; ++n) {
    long double sum = 0;
    for (int k = 0; k < samples; ++k) {
      const long double theta = std::numbers::pi_v<long double> * (k + 0.5L) / samples,
                        s = shift * std::sin(theta);
      sum += (shift * std::cos(theta) + std::sqrt(1 - s * s) - (n == 0)) * std::cos(n * theta);
    }
    c[n] = double(sum * (n == 0 ? 1 : 2) / samples);
  }
  const drop::Shape displaced = drop::cosine_series(0.5e-3, c), sphere = drop::sphere(0.5e-3);
  ASSERT_FALSE(displaced.is_sphere());
  for (const int p : {2, 3})
    EXPECT_NEAR(top_of_bow(displaced, sun, 1.333, p), top_of_bow(sphere, sun, 1.333, p), 1e-5);

  std::vector<double> u, v, u_sphere;
  for (const double b : {0.001, 0.2, 0.5, 0.8, 0.9, 0.95, 0.99})
    for (int a = 0; a < 24; ++a) {
      u_sphere.push_back(b * std::cos(15 * a * degree));
      v.push_back(b * std::sin(15 * a * degree));
      u.push_back(u_sphere.back() + shift * std::cos(sun * degree));
    }
  const auto expected = tracer(sphere, sun).trace(red, u_sphere, v, 3);
  const auto traced = tracer(displaced, sun).trace(red, u, v, 3);
  Worst direction, path, amplitude;
  for (std::size_t k = 0; k < u.size(); ++k)
    for (int p = 0; p <= 3; ++p) {
      const auto where = [&] { return "order " + std::to_string(p) + ", ray " + std::to_string(k); };
      ASSERT_TRUE(traced[k][p].valid) << where();
      const auto &d = expected[k][p].direction, &e = traced[k][p].direction;
      for (int i = 0; i < 3; ++i) direction.see(std::abs(d[i] - e[i]), where);
      // The planes of reference pass through the origin, which lies beside the centre.
      const double down = d[0] * std::cos(sun * degree) + d[2] * std::sin(sun * degree);
      const double moved = expected[k][p].path + shift * (std::sin(sun * degree) - down);
      path.see(std::abs(traced[k][p].path - moved), where);
      if (std::hypot(d[0], d[1]) > 0.01)
        amplitude.see(difference(expected[k][p].jones, traced[k][p].jones), where);
    }
  expect_below(direction, 1e-11, "direction");
  expect_below(path, 1e-11, "path");
  expect_below(amplitude, 1e-11, "Jones matrix");
}

} // namespace
