#include <scatter/optics/errors.hpp>
#include <scatter/scene/plot.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

namespace scatter::scene {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

Plot example() {
  Plot plot{
      .title = "it's 'quoted', under_score, <tag> & ^caret", .x_label = "angle (deg)", .y_label = "value"};
  plot.log_y = true;
  for (const double order : {1.0, 2.0}) {
    Curve curve{.label = order > 1 ? "second" : "first"};
    for (int i = 0; i <= 1000; ++i) {
      const double x = i * 0.18;
      curve.x.push_back(x);
      curve.y.push_back(std::exp(-order * x / 40) * (1.1 + std::sin(x)));
      curve.lower.push_back(0.9 * curve.y.back());
      curve.upper.push_back(1.1 * curve.y.back());
    }
    plot.curves.push_back(curve);
  }
  plot.strips.push_back(
      {.label = "red to blue", .first = 0, .last = 180, .pixels = {{255, 0, 0}, {0, 0, 255}}});
  return plot;
}

TEST(Plot, SvgHoldsEveryTextAndColour) {
  const std::string svg = draw(example(), PictureFormat::svg);
  EXPECT_THAT(svg, AllOf(HasSubstr("<svg"), HasSubstr("</svg>"), HasSubstr("viewBox=\"0 0 1000 640\"")));
  for (const char* text :
       {"it's 'quoted', under_score, &lt;tag> &amp; ^caret", "angle (deg)", "value", "first", "second",
        "red to blue"})
    EXPECT_THAT(svg, HasSubstr(text));
  EXPECT_THAT(svg, AllOf(HasSubstr("rgb(255,   0,   0)"), HasSubstr("rgb(  0,   0, 255)")));
}

TEST(Plot, PngHasTheSizeThatWasAsked) {
  Plot plot = example();
  plot.width = 700;
  plot.height = 500;
  const std::string png = draw(plot, PictureFormat::png);
  ASSERT_THAT(png, StartsWith("\x89PNG\r\n"));
  const auto number = [&](std::size_t at) {
    return static_cast<unsigned char>(png[at + 2]) * 256 + static_cast<unsigned char>(png[at + 3]);
  };
  EXPECT_EQ(number(16), 700);
  EXPECT_EQ(number(20), 500);
}

TEST(Plot, IsTheSameForTheSameInput) {
  EXPECT_EQ(draw(example(), PictureFormat::svg), draw(example(), PictureFormat::svg));
}

TEST(Plot, PointsAreMarkedOneByOneInAnyOrder) {
  Plot plot{.title = "", .x_label = "x", .y_label = "y"};
  Curve curve;
  curve.points = true;
  for (int i = 0; i < 60; ++i) {
    curve.x.push_back(i % 2); // many at one place of the axis
    curve.y.push_back(i);
  }
  plot.curves.push_back(curve);
  const auto marks = [](const std::string& svg, const std::string& symbol) {
    std::size_t count = 0;
    for (std::size_t at = svg.find(symbol); at != std::string::npos; at = svg.find(symbol, at + 1)) ++count;
    return count;
  };
  const std::string full = draw(plot, PictureFormat::svg);
  plot.curves[0].dashed = true;
  const std::string open = draw(plot, PictureFormat::svg);
  EXPECT_EQ(marks(full, "href='#gpPt6'"), 60u);
  // Gnuplot's definitions of symbols use one another: the same in every picture.
  EXPECT_EQ(marks(open, "href='#gpPt5'"), 60u + marks(full, "href='#gpPt5'"));
}

TEST(Plot, LongCurvesAreThinnedButKeepTheirPeaks) {
  Plot plot{.title = "", .x_label = "x", .y_label = "y"};
  Curve curve;
  for (int i = 0; i < 1000000; ++i) {
    curve.x.push_back(i);
    curve.y.push_back(i == 654321 ? 1.0 : 0.0);
  }
  plot.curves.push_back(curve);
  plot.y_range = {0, 2};
  const std::string svg = draw(plot, PictureFormat::svg);
  EXPECT_LT(svg.size(), 200000u);
  plot.curves[0].y[654321] = 0;
  EXPECT_NE(draw(plot, PictureFormat::svg), svg);
}

TEST(Plot, ValuesThatCannotBeDrawnLeaveAGap) {
  Plot plot = example();
  plot.curves.resize(1);
  plot.strips.clear();
  const std::string whole = draw(plot, PictureFormat::svg);
  plot.curves[0].y[500] = std::numeric_limits<double>::quiet_NaN();
  plot.curves[0].y[501] = -1;
  const std::string broken = draw(plot, PictureFormat::svg);
  EXPECT_NE(whole, broken);
  EXPECT_THAT(broken, Not(HasSubstr("nan")));
  for (double& y : plot.curves[0].y) y = 0;
  EXPECT_THAT(draw(plot, PictureFormat::svg), HasSubstr("angle (deg)"));
}

TEST(Plot, BothAxesMayBeLogarithmic) {
  Plot plot{.title = "log-log", .x_label = "seconds", .y_label = "error", .log_x = true, .log_y = true};
  plot.curves.push_back({.label = "marks", .x = {0.001, 0.1, 10}, .y = {30, 3, 0.3}, .points = true});
  const std::string svg = draw(plot, PictureFormat::svg);
  for (const char* tick : {">0.001<", ">0.1<", ">10<"}) EXPECT_THAT(svg, HasSubstr(tick));
  plot.x_range = {{0, 10}};
  EXPECT_THROW(static_cast<void>(draw(plot, PictureFormat::svg)), std::invalid_argument);
}

TEST(Plot, WrongRequestsAreRefused) {
  EXPECT_THROW(static_cast<void>(draw(Plot{}, PictureFormat::svg)), std::invalid_argument);
  Plot plot = example();
  plot.curves[0].y.pop_back();
  EXPECT_THROW(static_cast<void>(draw(plot, PictureFormat::svg)), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(picture_format("a.jpg")), InputError);
  EXPECT_THROW(write_plot("/no/such/folder/a.png", example()), InputError);
}

TEST(Plot, AFailingOrMissingGnuplotIsARunErrorAndLeavesNoFile) {
  std::string pattern = (std::filesystem::temp_directory_path() / "scatter-test-XXXXXX").string();
  ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
  const std::filesystem::path folder = pattern;
  const std::string path_before = ::getenv("PATH");
  const auto message = [&] {
    try {
      write_plot(folder / "a.svg", example());
    } catch (const RunError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  ::setenv("PATH", folder.c_str(), 1);
  EXPECT_THAT(message(), HasSubstr("not installed"));
  const auto pretend = [&](const char* script) {
    std::ofstream(folder / "gnuplot") << "#!/bin/sh\n" << script;
    std::filesystem::permissions(folder / "gnuplot", std::filesystem::perms::owner_all);
  };
  pretend("echo broken >&2\nexit 3\n");
  EXPECT_THAT(message(), AllOf(HasSubstr("gnuplot failed: broken"), Not(HasSubstr("\n"))));
  pretend("echo '<svg>'\n");
  EXPECT_THAT(message(), HasSubstr("cut off"));
  pretend("exit 0\n");
  EXPECT_THAT(message(), HasSubstr("drew nothing"));
  ::setenv("PATH", path_before.c_str(), 1);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.svg"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1); // the pretended gnuplot
  write_plot(folder / "a.svg", example());
  EXPECT_TRUE(std::filesystem::exists(folder / "a.svg"));
  std::filesystem::remove_all(folder);
}

TEST(PolarPlot, GoesAroundWithItsAnglesAndLabels) {
  PolarPlot plot;
  plot.title = "around";
  Curve curve;
  curve.label = "lobe";
  curve.colour = "#123456";
  for (int degrees = -180; degrees <= 180; degrees += 5) {
    curve.x.push_back(degrees);
    curve.y.push_back(degrees < 0 ? 0.25 : 1);
  }
  plot.curves = {curve};
  const std::string svg = draw(plot, PictureFormat::svg);
  for (const char* const words : {"around", "lobe", "-150°", "90°", "180°"})
    EXPECT_THAT(svg, testing::HasSubstr(words));
  EXPECT_EQ(svg, draw(plot, PictureFormat::svg));
  plot.curves[0].y[3] = -1;
  EXPECT_THROW((void)draw(plot, PictureFormat::svg), std::invalid_argument);
  plot.curves[0].y.assign(plot.curves[0].x.size(), 0.0);
  EXPECT_THROW((void)draw(plot, PictureFormat::svg), std::invalid_argument);
  plot.curves.clear();
  EXPECT_THROW((void)draw(plot, PictureFormat::svg), std::invalid_argument);
}

TEST(HalfDiscPlot, HoldsItsPanelsRingsAndRays) {
  HalfDiscPlot plot{.title = "lobes", .radius_label = "per steradian"};
  for (const double scale : {1.0, 300.0}) {
    Curve curve{.label = "round", .x = {-80, 0, 80}, .y = {0.5 * scale, 0.9 * scale, 0.5 * scale}};
    plot.panels.push_back({.label = scale > 1 ? "bright" : "dim", .curves = {curve}, .mark = -30});
  }
  const std::string svg = draw(plot, PictureFormat::svg);
  // Rings of 0.9 and of 270 at round values; the legend names a curve of both panels once.
  for (const char* text :
       {"lobes", "per steradian", "bright", "dim", ">0.2<", ">0.8<", ">100<", ">300<", "-60°"})
    EXPECT_THAT(svg, HasSubstr(text));
  EXPECT_EQ(svg.find("round"), svg.rfind("round"));
  EXPECT_EQ(svg, draw(plot, PictureFormat::svg));

  EXPECT_THROW(static_cast<void>(draw(HalfDiscPlot{}, PictureFormat::svg)), std::invalid_argument);
  HalfDiscPlot crowded = plot;
  crowded.panels.resize(40);
  EXPECT_THROW(static_cast<void>(draw(crowded, PictureFormat::svg)), std::invalid_argument);
  HalfDiscPlot uneven = plot;
  uneven.panels[0].curves[0].x.pop_back();
  EXPECT_THROW(static_cast<void>(draw(uneven, PictureFormat::svg)), std::invalid_argument);
  HalfDiscPlot dark = plot;
  for (auto& panel : dark.panels) panel.curves[0].y = {0, 0, 0};
  EXPECT_THROW(static_cast<void>(draw(dark, PictureFormat::svg)), std::invalid_argument);
}

TEST(ColourImage, IsDrawnPixelByPixelWithItsAxes) {
  ColourImage image{.title = "two colours", .x_label = "radius", .y_label = "angle"};
  image.x_first = 10;
  image.x_last = 1000;
  image.log_x = true;
  image.y_first = 120;
  image.y_last = 150;
  image.columns = 120;
  image.rows = 100;
  for (int j = 0; j < image.rows; ++j)
    for (int i = 0; i < image.columns; ++i)
      image.pixels.push_back(
          j < 50 ? std::array<std::uint8_t, 3>{255, 0, 0} : std::array<std::uint8_t, 3>{0, 0, 255});
  EXPECT_THAT(draw(image, PictureFormat::png), StartsWith("\x89PNG"));
  EXPECT_THAT(
      draw(image, PictureFormat::svg), AllOf(
                                           HasSubstr("two colours"), HasSubstr("radius"), HasSubstr("angle"),
                                           HasSubstr("1000"), HasSubstr("150")));
  image.pixels.pop_back();
  EXPECT_THROW((void)draw(image, PictureFormat::png), std::invalid_argument);
  image.pixels.push_back({0, 0, 0});
  image.x_first = 0;
  EXPECT_THROW((void)draw(image, PictureFormat::png), std::invalid_argument);
}

} // namespace
} // namespace scatter::scene
