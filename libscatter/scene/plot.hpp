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

/// A picture of colours with axes, one pixel of the drawing per colour.
struct ColourImage {
  std::string title{}, x_label{}, y_label{};
  double x_first = 0, x_last = 1; ///< at the left and right edge, increasing
  double y_first = 0, y_last = 1; ///< at the bottom and the top
  bool log_x = false;             ///< then 0 < x_first, and columns are evenly spaced in log x
  int columns = 0, rows = 0;
  std::vector<std::array<std::uint8_t, 3>> pixels{}; ///< sRGB, [row][column], row 0 at the bottom
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

/// draw() into a file that appears whole or not at all. Throws as draw() and table::PartFile do.
void write_plot(const std::filesystem::path& path, const Plot& plot);
void write_plot(const std::filesystem::path& path, const ColourImage& image);

} // namespace scatter::scene
