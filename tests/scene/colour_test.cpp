#include <scatter/optics/errors.hpp>
#include <scatter/scene/colour.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace scatter::scene {
namespace {

double flat(double) {
  return 1;
}

std::vector<double> nanometres(double first, double last, double step) {
  std::vector<double> all;
  for (int i = 0; first + i * step < last + step / 2; ++i) all.push_back((first + i * step) * 1e-9);
  return all;
}

Xyz sum(const std::vector<Xyz>& weights, const std::vector<double>& spectrum) {
  Xyz total;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    total.X += weights[i].X * spectrum[i];
    total.Y += weights[i].Y * spectrum[i];
    total.Z += weights[i].Z * spectrum[i];
  }
  return total;
}

TEST(Observer, SeesAllWavelengthsAlikeAsWhite) {
  // CIE 15: the sums of the three functions at 5 nm over 380 .. 780 nm are 21.371 each.
  Xyz total;
  for (const double wavelength : nanometres(380, 780, 5)) {
    const Xyz c = colour_matching(wavelength);
    total = {total.X + c.X, total.Y + c.Y, total.Z + c.Z};
  }
  EXPECT_NEAR(total.X, 21.3714, 3e-4);
  EXPECT_NEAR(total.Y, 21.3714, 3e-4);
  EXPECT_NEAR(total.Z, 21.3714, 3e-4);
}

TEST(Observer, IsMostSensitiveAt555Nanometres) {
  EXPECT_EQ(colour_matching(555e-9).Y, 1);
  for (const double wavelength : nanometres(360, 830, 1)) EXPECT_LE(colour_matching(wavelength).Y, 1);
  EXPECT_EQ(colour_matching(359e-9).Y, 0);
  EXPECT_EQ(colour_matching(831e-9).X, 0);
}

TEST(Observer, GivesDaylightItsChromaticity) {
  // Standard illuminant D65, CIE 15 table T.1, 380 .. 780 nm every 10 nm.
  const std::vector<double> d65{
      49.9755, 54.6482, 82.7549, 91.4860, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861, 115.923,
      108.811, 109.354, 107.802, 104.790, 107.689, 104.405, 104.046, 100.000, 96.3342, 95.7880, 88.6856,
      90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268, 80.2146, 82.2778, 78.2842, 69.7213, 71.6091,
      74.3490, 61.6040, 69.8856, 75.0870, 63.5927, 46.4182, 66.8054, 63.3828};
  const Xyz white = sum(tristimulus_weights(nanometres(380, 780, 10), flat), d65);
  EXPECT_NEAR(white.X / (white.X + white.Y + white.Z), 0.3127, 2e-4);
  EXPECT_NEAR(white.Y / (white.X + white.Y + white.Z), 0.3290, 2e-4);
}

TEST(Weights, DoNotDependOnTheOrderOfWavelengthsNorOnTheSampling) {
  const auto fine = nanometres(380, 700, 1), coarse = nanometres(380, 700, 20);
  const auto line = [](const std::vector<double>& at) {
    std::vector<double> s;
    for (const double wavelength : at) s.push_back(2 + wavelength * 1e6); // linear: the same light either way
    return s;
  };
  const Xyz a = sum(tristimulus_weights(fine, sunlight), line(fine));
  const Xyz b = sum(tristimulus_weights(coarse, sunlight), line(coarse));
  EXPECT_NEAR(a.X / b.X, 1, 5e-6);
  EXPECT_NEAR(a.Y / b.Y, 1, 5e-6);
  EXPECT_NEAR(a.Z / b.Z, 1, 5e-6);
  std::vector<double> reversed(fine.rbegin(), fine.rend());
  const Xyz c = sum(tristimulus_weights(reversed, sunlight), line(reversed));
  EXPECT_NEAR(a.X / c.X, 1, 1e-12);
}

TEST(Sunlight, IsThatOfABlackBodyAt5772Kelvin) {
  EXPECT_EQ(sunlight(560e-9), 1);
  // Wien: the maximum is at 2897.771955 um K / T = 502.0 nm.
  double brightest = 0;
  for (double nm = 400; nm < 700; nm += 0.1)
    if (sunlight(nm * 1e-9) > sunlight(brightest * 1e-9 + 1e-12)) brightest = nm;
  EXPECT_NEAR(brightest, 2897771.955 / 5772, 0.11);
  // On the Planckian locus near 5772 K, between D55 and D65: x = 0.3260, y = 0.3354 at 5800 K (McCamy: CCT
  // within 30 K).
  const auto visible = nanometres(360, 830, 5);
  const Xyz sun = sum(tristimulus_weights(visible, sunlight), std::vector<double>(visible.size(), 1.0));
  const double x = sun.X / (sun.X + sun.Y + sun.Z), y = sun.Y / (sun.X + sun.Y + sun.Z);
  const double n = (x - 0.3320) / (0.1858 - y);
  EXPECT_NEAR(449 * n * n * n + 3525 * n * n + 6823.3 * n + 5520.33, 5772, 30);
}

TEST(Rgb, MatrixIsThatOfTheStandard) {
  // IEC 61966-2-1 prints four decimals.
  const LinearRgb x = linear_rgb({1, 0, 0}), y = linear_rgb({0, 1, 0}), z = linear_rgb({0, 0, 1});
  const double printed[3][3] = {
      {3.2406, -1.5372, -0.4986}, {-0.9689, 1.8758, 0.0415}, {0.0557, -0.2040, 1.0570}};
  const LinearRgb columns[3] = {x, y, z};
  for (int j = 0; j < 3; ++j) {
    EXPECT_NEAR(columns[j].r, printed[0][j], 5e-4);
    EXPECT_NEAR(columns[j].g, printed[1][j], 5e-4);
    EXPECT_NEAR(columns[j].b, printed[2][j], 5e-4);
  }
  const LinearRgb white = linear_rgb(d65_white());
  EXPECT_NEAR(white.r, 1, 1e-14);
  EXPECT_NEAR(white.g, 1, 1e-14);
  EXPECT_NEAR(white.b, 1, 1e-14);
  const Xyz there = tristimulus(linear_rgb({0.3, 0.4, 0.2}));
  EXPECT_NEAR(there.X, 0.3, 1e-14);
  EXPECT_NEAR(there.Z, 0.2, 1e-14);
}

TEST(Rgb, TransferCurveIsContinuousAndEndsAtOne) {
  EXPECT_EQ(srgb_encode(0), 0);
  EXPECT_NEAR(srgb_encode(1), 1, 1e-15);
  EXPECT_NEAR(srgb_encode(0.0031308), srgb_encode(0.00313081), 1e-6);
  EXPECT_NEAR(srgb_encode(0.2140411), 0.5, 1e-6); // IEC 61966-2-1: half of the code is 21.4 % of the light
}

TEST(Adaptation, TakesOneWhiteToTheOtherAndBack) {
  const Xyz a{1.09850, 1, 0.35585}, b = d65_white();
  const Xyz there = adapt(a, a, b), back = adapt(adapt({0.2, 0.3, 0.1}, a, b), b, a);
  EXPECT_NEAR(there.X, b.X, 1e-14);
  EXPECT_NEAR(there.Z, b.Z, 1e-14);
  EXPECT_NEAR(back.X, 0.2, 1e-14);
  EXPECT_NEAR(back.Y, 0.3, 1e-14);
}

TEST(Gamut, KeepsLuminanceAndWhatTheDisplayCanShow) {
  for (const double wavelength : nanometres(400, 680, 5)) {
    Xyz pure = colour_matching(wavelength);
    const double scale = 0.05 / pure.Y; // dim enough that nothing is brighter than white
    if (pure.Y < 0.01) continue;
    pure = {pure.X * scale, pure.Y * scale, pure.Z * scale};
    const LinearRgb inside = into_gamut(linear_rgb(pure));
    EXPECT_GE(std::min({inside.r, inside.g, inside.b}), 0);
    EXPECT_NEAR(tristimulus(inside).Y, 0.05, inside.r < 1 && inside.g < 1 && inside.b < 1 ? 1e-12 : 0.02);
  }
  const LinearRgb same = into_gamut({0.2, 0.9, 0.4});
  EXPECT_EQ(same.r, 0.2);
  EXPECT_EQ(same.g, 0.9);
  EXPECT_EQ(same.b, 0.4);
  EXPECT_EQ(into_gamut({3, 0.5, 0.2}).r, 1);
  EXPECT_EQ(srgb_bytes({0, 0.2158605, 7}), (std::array<std::uint8_t, 3>{0, 128, 255}));
}

TEST(SunlitColour, OfAGreyScattererIsWhiteAndOfAPureOneItsHue) {
  const auto wavelengths = nanometres(380, 700, 10);
  const SunlitColour colour(wavelengths);
  const LinearRgb white = colour(std::vector<double>(wavelengths.size(), 1.0));
  EXPECT_NEAR(white.r, 1, 1e-12);
  EXPECT_NEAR(white.g, 1, 1e-12);
  EXPECT_NEAR(white.b, 1, 1e-12);
  const auto only = [&](double nm) {
    std::vector<double> s(wavelengths.size(), 0.0);
    s[static_cast<std::size_t>((nm - 380) / 10)] = 1;
    return colour(s);
  };
  const LinearRgb blue = only(450), green = only(540), red = only(640);
  EXPECT_TRUE(blue.b > blue.r && blue.b > blue.g);
  EXPECT_TRUE(green.g > green.r && green.g > green.b);
  EXPECT_TRUE(red.r > red.g && red.r > red.b);
  // A single wavelength shows itself.
  const std::vector<double> sodium{589.3e-9};
  const LinearRgb yellow = SunlitColour(sodium)(std::vector<double>{1.0});
  EXPECT_TRUE(yellow.r > 0.8 && yellow.g > 0.4 && yellow.b < 0.05);
  EXPECT_THROW(SunlitColour(std::vector<double>{900e-9, 1e-6}), InputError);
  EXPECT_THROW(static_cast<void>(colour(sodium)), std::invalid_argument);
}

} // namespace
} // namespace scatter::scene
