#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// Pictures of curves, drawn by gnuplot.
namespace scatter::scene {

/// One curve. Points that are not finite, or not positive on a logarithmic axis, leave a gap.
struct Curve {
  std::string label{};          ///< in the legend; empty: not there
  std::vector<double> x{}, y{}; ///< the same number of each, x increasing
  std::vector<double> lower{};  ///< bottom of a shaded band around the curve, or empty
  std::vector<double> upper{};  ///< top of the band
  std::string colour{}; ///< "#rrggbb"; empty: the next of a palette that the colour-blind can tell apart
  double width = 1.5;   ///< of the line, in points
  bool dashed = false;
  /// A mark for every point instead of a line, open if `dashed`; x in any order.
  bool points = false;
};

/// A bar of colours above the curves, aligned with their x axis.
struct ColourStrip {
  std::string label{};                               ///< at its left, short
  double first = 0, last = 0;                        ///< x at its left and right edge
  std::vector<std::array<std::uint8_t, 3>> pixels{}; ///< sRGB, evenly spaced from first to last
};

struct Plot {
  std::string title{}, x_label{}, y_label{};
  bool log_x = false; ///< then strips have no place
  bool log_y = false;
  std::optional<std::pair<double, double>> x_range{}, y_range{}; ///< default: what the curves need
  std::vector<Curve> curves{};
  std::vector<ColourStrip> strips{};
  int width = 1000, height = 640; ///< pixels
};

/// Curves around a point: x is an angle in degrees, clockwise from the top, y a value >= 0 whose square root
/// is the distance from the middle, so that weak lobes show beside strong ones. Bands, strips and points are
/// not drawn.
struct PolarPlot {
  std::string title{};
  std::vector<Curve> curves{};
  int width = 800, height = 800; ///< pixels
};

/// A picture of colours with axes, one pixel of the drawing per colour.
struct ColourImage {
  std::string title{}, x_label{}, y_label{};
  double x_first = 0, x_last = 1; ///< at the left and right edge, increasing
  double y_first = 0, y_last = 1; ///< at the bottom and the top
  bool log_x = false;             ///< then 0 < x_first, and columns are evenly spaced in log x
  int columns = 0, rows = 0;
  std::vector<std::array<std::uint8_t, 3>> pixels{}; ///< sRGB, [row][column], row 0 at the bottom
};

/// Curves around a centre in the upper half of a disc, such as light that leaves a surface; several side by
/// side, each on a scale of its own.
struct HalfDiscPlot {
  struct Panel {
    std::string label{};          ///< below the disc
    std::vector<Curve> curves{};  ///< x: angle [deg], 0 straight up, positive to the right; y: radius, >= 0
    std::optional<double> mark{}; ///< a ray at this angle, where light comes from
  };
  std::string title{}, radius_label{}; ///< radius_label: what the rings are
  std::vector<Panel> panels{};
  int width = 1000; ///< pixels; the height follows
};

enum class PictureFormat { png, svg };

/// By extension, .png or .svg; throws InputError that lists them.
[[nodiscard]] PictureFormat picture_format(const std::filesystem::path& path);

/// The bytes of the picture; SVG stands alone and may be put into an HTML page as it is.
/// Long curves are thinned to the resolution of the picture, so that the extremes within every pixel stay.
/// Throws std::invalid_argument for curves of unequal lengths or no curve at all, RunError when gnuplot is
/// not installed or fails.
[[nodiscard]] std::string draw(const Plot& plot, PictureFormat format);

/// Throws std::invalid_argument for another number of pixels than columns x rows, or an axis without extent.
[[nodiscard]] std::string draw(const ColourImage& image, PictureFormat format);

/// The rings are at round values of the radius. Throws std::invalid_argument for curves of
/// unequal lengths, no panel, panels without room, or nothing that is positive.
[[nodiscard]] std::string draw(const HalfDiscPlot& plot, PictureFormat format);

/// Throws as draw(Plot) does, also for values that are negative or curves of which nothing is positive.
[[nodiscard]] std::string draw(const PolarPlot& plot, PictureFormat format);

/// draw() into a file that appears whole or not at all. Throws as draw() and table::PartFile do.
void write_plot(const std::filesystem::path& path, const Plot& plot);
void write_plot(const std::filesystem::path& path, const ColourImage& image);
void write_plot(const std::filesystem::path& path, const HalfDiscPlot& plot);
void write_plot(const std::filesystem::path& path, const PolarPlot& plot);

} // namespace scatter::scene
