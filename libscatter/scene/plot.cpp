#include <scatter/optics/errors.hpp>
#include <scatter/scene/plot.hpp>
#include <scatter/table/atomic_file.hpp>

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <string_view>

extern char** environ;

namespace scatter::scene {
namespace {

/// Okabe & Ito, "Color Universal Design" (2008), darkest first on white.
constexpr std::array<const char*, 7> palette{"#0072B2", "#D55E00", "#009E73", "#CC79A7",
                                             "#000000", "#E69F00", "#56B4E9"};
constexpr const char* font = "DejaVu Sans";
constexpr int text_px = 15;     ///< height of a line of text
constexpr int character_px = 8; ///< width of a character, rather too much than too little

/// A file without a name: gone when it is closed, however the process ends.
struct TemporaryFile {
  TemporaryFile() : file(std::tmpfile(), &std::fclose) {
    if (!file)
      throw RunError(fmt::format("cannot make a temporary file for gnuplot: {}", std::strerror(errno)));
  }
  [[nodiscard]] int descriptor() const { return ::fileno(file.get()); }
  void write(std::string_view text) const {
    if (std::fwrite(text.data(), 1, text.size(), file.get()) != text.size() || std::fflush(file.get()) != 0)
      throw RunError(fmt::format("cannot write a temporary file for gnuplot: {}", std::strerror(errno)));
    std::rewind(file.get());
  }
  [[nodiscard]] std::string read() const {
    std::string text;
    std::array<char, 65536> buffer{};
    std::rewind(file.get());
    while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), file.get()))
      text.append(buffer.data(), count);
    return text;
  }
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file;
};

std::string one_line(std::string text) {
  for (char& c : text)
    if (c == '\n' || c == '\r' || c == '\t') c = ' ';
  const auto first = text.find_first_not_of(" ");
  if (first == std::string::npos) return "no message";
  text = text.substr(first);
  return text.size() > 300 ? text.substr(0, 300) + "..." : text;
}

std::string run_gnuplot(const std::string& script) {
  const TemporaryFile input, output, errors;
  input.write(script);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input.descriptor(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, output.descriptor(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, errors.descriptor(), STDERR_FILENO);
  // The user's own settings of gnuplot must not change our pictures.
  std::string program = "gnuplot", option = "--default-settings";
  char* arguments[] = {program.data(), option.data(), nullptr};
  pid_t child = 0;
  const int error = ::posix_spawnp(&child, program.c_str(), &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error == ENOENT)
    throw RunError("plots are drawn by gnuplot, which is not installed: apt-get install gnuplot-nox");
  if (error != 0) throw RunError(fmt::format("gnuplot does not start: {}", std::strerror(error)));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0)
    if (errno != EINTR) throw RunError(fmt::format("gnuplot is lost: {}", std::strerror(errno)));
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw RunError(fmt::format("gnuplot failed: {}", one_line(errors.read())));
  std::string picture = output.read();
  if (picture.empty()) throw RunError(fmt::format("gnuplot drew nothing: {}", one_line(errors.read())));
  return picture;
}

/// A text in gnuplot's single quotes, where only the quote itself is special.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'') out += '\'';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out += '\'';
}

/// Characters, not bytes, of a text in UTF-8.
int length(const std::string& text) {
  return static_cast<int>(std::count_if(
      text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

bool drawable(double y, bool log_y) {
  return std::isfinite(y) && (!log_y || y > 0);
}

/// Indices of the points to draw: in every bin of x the first, lowest, highest and last, and one point of
/// every gap.
std::vector<std::size_t> thin(const Curve& curve, bool log_y, double first, double last, int bins) {
  std::vector<std::size_t> kept;
  std::size_t i = 0;
  if (curve.points)
    for (; i < curve.x.size(); ++i)
      if (drawable(curve.y[i], log_y)) kept.push_back(i);
  while (i < curve.x.size()) {
    if (!drawable(curve.y[i], log_y)) {
      if (kept.empty() || kept.back() + 1 == i) kept.push_back(i);
      ++i;
      continue;
    }
    const double bin = std::floor((curve.x[i] - first) / (last - first) * bins);
    std::size_t low = i, high = i, end = i;
    while (end < curve.x.size() && drawable(curve.y[end], log_y) &&
           std::floor((curve.x[end] - first) / (last - first) * bins) == bin) {
      if (curve.y[end] < curve.y[low]) low = end;
      if (curve.y[end] > curve.y[high]) high = end;
      ++end;
    }
    std::array<std::size_t, 4> chosen{i, std::min(low, high), std::max(low, high), end - 1};
    for (const std::size_t k : chosen)
      if (kept.empty() || kept.back() < k || k == 0) {
        if (kept.empty() || kept.back() != k) kept.push_back(k);
      }
    i = end;
  }
  return kept;
}

/// A round step that gives between 5 and 12 ticks.
double tick_step(double span) {
  for (const double step : {30.0, 20.0, 15.0, 10.0, 5.0, 2.0, 1.0})
    if (span / step >= 5 && span / step <= 12.5) return step;
  const double decade = std::pow(10, std::floor(std::log10(span)));
  for (const double factor : {0.1, 0.2, 0.5, 1.0, 2.0})
    if (span / (factor * decade) <= 12.5) return factor * decade;
  return decade;
}

std::pair<double, double> extent(const Plot& plot, bool of_x) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Curve& curve : plot.curves)
    for (std::size_t i = 0; i < curve.x.size(); ++i) {
      if (plot.x_range && (curve.x[i] < plot.x_range->first || curve.x[i] > plot.x_range->second)) continue;
      if (!drawable(curve.y[i], plot.log_y) || !drawable(curve.x[i], plot.log_x)) continue;
      if (of_x) {
        low = std::min(low, curve.x[i]);
        high = std::max(high, curve.x[i]);
        continue;
      }
      // A band counts too, but one far wider than its curve must not squeeze all curves into a line.
      const double y = curve.y[i], reach = 2 * std::abs(y);
      low = std::min(
          {low, y, curve.lower.empty() ? y : std::max(curve.lower[i], plot.log_y ? y / 3 : y - reach)});
      high = std::max({high, y, curve.upper.empty() ? y : std::min(curve.upper[i], y + reach)});
    }
  if (!(low <= high)) return plot.log_y && !of_x ? std::pair(0.1, 1.0) : std::pair(0.0, 1.0);
  if (low == high) return plot.log_y && !of_x ? std::pair(low / 2, high * 2) : std::pair(low - 1, high + 1);
  return {low, high};
}

struct Script {
  std::string text;
  template <class... Args>
  void line(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(text), format, std::forward<Args>(args)...);
    text += '\n';
  }
};

void set_terminal(Script& s, PictureFormat format, int width, int height) {
  if (format == PictureFormat::png)
    s.line(
        "set terminal pngcairo enhanced size {},{} font '{},11' background '#ffffff'", width, height, font);
  else
    s.line(
        "set terminal svg enhanced standalone size {},{} dynamic font '{},14' background '#ffffff'", width,
        height, font);
  s.line("set encoding utf8");
}

std::string finished_picture(const std::string& script, PictureFormat format) {
  std::string picture = run_gnuplot(script);
  const std::string_view end =
      format == PictureFormat::png ? std::string_view("IEND\xAE\x42\x60\x82", 8) : "</svg>";
  const auto last = picture.find_last_not_of(format == PictureFormat::png ? "" : " \r\n\t");
  if (last == std::string::npos || !std::string_view(picture).substr(0, last + 1).ends_with(end))
    throw RunError("gnuplot failed: its picture is cut off");
  return picture;
}

void check(const Plot& plot) {
  if (plot.curves.empty()) throw std::invalid_argument("a plot needs at least one curve");
  if (plot.log_x && (!plot.strips.empty() || (plot.x_range && !(plot.x_range->first > 0))))
    throw std::invalid_argument("a logarithmic x axis has no strips and begins above zero");
  for (const Curve& curve : plot.curves) {
    const bool band = !curve.lower.empty() || !curve.upper.empty();
    if (curve.x.size() != curve.y.size() ||
        (band && (curve.lower.size() != curve.x.size() || curve.upper.size() != curve.x.size())))
      throw std::invalid_argument("the arrays of curve '" + curve.label + "' differ in length");
  }
}

} // namespace

PictureFormat picture_format(const std::filesystem::path& path) {
  if (path.extension() == ".png") return PictureFormat::png;
  if (path.extension() == ".svg") return PictureFormat::svg;
  throw InputError(fmt::format("{}: a picture is written as .png or .svg", path.string()));
}

std::string draw(const Plot& plot, PictureFormat format) {
  check(plot);
  const auto [x_first, x_last] = plot.x_range ? *plot.x_range : extent(plot, true);
  auto [y_first, y_last] = plot.y_range ? *plot.y_range : extent(plot, false);
  if (!plot.y_range) { // a little air
    if (plot.log_y) {
      const double air = std::pow(y_last / y_first, 0.04);
      y_first /= air;
      y_last *= air;
    } else {
      const double air = 0.04 * (y_last - y_first);
      y_first -= air;
      y_last += air;
    }
  }

  // The layout in pixels from the top: title, strips, legend, curves, axis. Nothing overlaps, because
  // everything has its own rows.
  int labels = 0, widest = 0, strip_label = 0;
  for (const Curve& curve : plot.curves)
    if (!curve.label.empty()) {
      ++labels;
      widest = std::max(widest, length(curve.label));
    }
  for (const ColourStrip& strip : plot.strips) strip_label = std::max(strip_label, length(strip.label));
  const int left = std::max(96, plot.strips.empty() ? 0 : 16 + strip_label * character_px), right = 24;
  const int entry_px = widest * character_px + 56;
  const int columns = std::clamp((plot.width - left - right) / entry_px, 1, std::max(labels, 1));
  const int legend_rows = labels == 0 ? 0 : (labels + columns - 1) / columns;
  constexpr int strip_px = 26, gap_px = 5;
  int top = plot.title.empty() ? 16 : 44;
  const int strips_top = top;
  top += static_cast<int>(plot.strips.size()) * (strip_px + gap_px) + (plot.strips.empty() ? 0 : 6);
  const int legend_top = top;
  top += legend_rows * (text_px + 5) + (legend_rows > 0 ? 8 : 0);
  constexpr int bottom = 66;
  const auto across = [&](int px) { return static_cast<double>(px) / plot.width; };
  const auto up = [&](int px) { return 1 - static_cast<double>(px) / plot.height; };

  Script s;
  set_terminal(s, format, plot.width, plot.height);
  s.line("set datafile missing 'nan'");
  s.line("set multiplot");
  s.line("set lmargin at screen {}", across(left));
  s.line("set rmargin at screen {}", across(plot.width - right));
  s.line("set xrange [{}:{}]", x_first, x_last);

  for (std::size_t i = 0; i < plot.strips.size(); ++i) {
    const ColourStrip& strip = plot.strips[i];
    const int strip_top = strips_top + static_cast<int>(i) * (strip_px + gap_px);
    const double step =
        (strip.last - strip.first) / static_cast<double>(std::max<std::size_t>(strip.pixels.size(), 1));
    s.line("$strip{} << END", i);
    for (std::size_t k = 0; k < strip.pixels.size(); ++k) {
      const auto& [r, g, b] = strip.pixels[k];
      // Each box runs on under its neighbour: no hairlines of background where two edges meet within a pixel.
      const double from = strip.first + static_cast<double>(k) * step,
                   to = std::min(from + 2 * step, strip.last);
      s.line("{} {} {}", from, to, (r << 16) | (g << 8) | b);
    }
    s.line("END");
    s.line("set tmargin at screen {}", up(strip_top));
    s.line("set bmargin at screen {}", up(strip_top + strip_px));
    s.line("unset tics\nunset key\nset border 15 lc rgb '#444444' lw 0.6\nset yrange [0:1]");
    s.line(
        "set label 1 {} at screen {},{} right noenhanced tc rgb '#222222'", quoted(strip.label),
        across(left - 8), up(strip_top + strip_px / 2));
    s.line(
        "plot $strip{} using 1:(0):1:2:(0):(1):3 with boxxyerror fs solid 1 noborder lc rgb variable notitle",
        i);
    s.line("unset label 1");
  }

  for (std::size_t i = 0; i < plot.curves.size(); ++i) {
    const Curve& curve = plot.curves[i];
    s.line("$curve{} << END", i);
    for (const std::size_t k : thin(curve, plot.log_y, x_first, x_last, plot.width)) {
      if (!drawable(curve.y[k], plot.log_y)) {
        // An empty line breaks the curve; 'nan' alone would be bridged.
        s.line("");
        continue;
      }
      const double low = curve.lower.empty() ? curve.y[k] : curve.lower[k];
      const double high = curve.upper.empty() ? curve.y[k] : curve.upper[k];
      // Below a logarithmic axis there is no end; the axis' bottom does.
      s.line("{} {} {} {}", curve.x[k], curve.y[k], plot.log_y ? std::max(low, y_first) : low, high);
    }
    s.line("END");
  }
  s.line("set tmargin at screen {}", up(top));
  s.line("set bmargin at screen {}", up(plot.height - bottom));
  if (!plot.title.empty())
    s.line(
        "set label 2 {} at screen {},{} center noenhanced font '{},{}'", quoted(plot.title),
        across((left + plot.width - right) / 2), up(22), font, format == PictureFormat::png ? 13 : 17);
  s.line("set border 3 lc rgb '#444444' lw 1");
  s.line("set grid xtics ytics lc rgb '#dddddd' lw 0.7 lt 1");
  s.line(
      "set label 4 {} at screen {},{} center noenhanced", quoted(plot.x_label),
      across((left + plot.width - right) / 2), up(plot.height - 13));
  s.line(
      "set label 3 {} at screen {},{} center rotate noenhanced", quoted(plot.y_label), across(20),
      up((top + plot.height - bottom) / 2));
  s.line(
      "set xtics nomirror out {} offset 0,0.3 tc rgb '#222222'",
      plot.log_x ? 10 : tick_step(x_last - x_first));
  if (plot.log_x) s.line("set logscale x\nset format x '%g'");
  s.line("set ytics nomirror out tc rgb '#222222'");
  s.line("set mxtics");
  s.line("set yrange [{}:{}]", y_first, y_last);
  if (plot.log_y) {
    s.line("set logscale y");
    const double decades = std::log10(y_last / y_first);
    if (decades > 2) {
      // Every decade has a tick; where there are many, only some have a label.
      s.line("set format y '10^{{%T}}'");
      s.line("set ytics {}", decades > 12 ? 1000 : decades > 8 ? 100 : 10);
      s.line("set mytics 10");
    } else if (decades < 0.9) {
      s.line("set format y '%g'");
      // Too little for powers of ten: evenly spaced values, as on a linear axis.
      const double step = tick_step(y_last - y_first);
      std::string tics;
      for (double n = std::ceil(y_first / step); n * step <= y_last; ++n)
        tics += fmt::format("{}{:.12g}", tics.empty() ? "" : ",", n * step);
      s.line("set ytics ({})", tics);
    } else {
      s.line("set format y '%g'");
      std::string tics;
      for (int power = static_cast<int>(std::floor(std::log10(y_first))); power <= std::log10(y_last);
           ++power)
        for (const int digit : {1, 2, 5})
          tics += fmt::format("{}{}e{}", tics.empty() ? "" : ",", digit, power);
      s.line("set ytics ({})", tics);
    }
  } else {
    s.line("set ytics autofreq");
  }
  if (labels > 0)
    s.line(
        "set key at screen {},{} center top horizontal maxcols {} noenhanced reverse Left samplen 2.5 "
        "spacing 1.2 tc rgb "
        "'#222222'",
        across((left + plot.width - right) / 2), up(legend_top), columns);
  else
    s.line("unset key");
  std::string command;
  std::size_t next = 0;
  std::vector<std::string> colours;
  for (const Curve& curve : plot.curves)
    colours.push_back(curve.colour.empty() ? palette[next++ % palette.size()] : curve.colour);
  const auto append = [&](const std::string& part) { command += (command.empty() ? "plot " : ", ") + part; };
  for (std::size_t i = 0; i < plot.curves.size(); ++i)
    if (!plot.curves[i].lower.empty())
      append(fmt::format(
          "$curve{} using 1:3:4 with filledcurves fs transparent solid 0.25 noborder fc rgb '{}' notitle", i,
          colours[i]));
  for (std::size_t i = 0; i < plot.curves.size(); ++i) {
    const Curve& curve = plot.curves[i];
    const bool marks = curve.points || curve.x.size() == 1;
    append(fmt::format(
        "$curve{} using 1:2 with {} lc rgb '{}' lw {}{} {}", i,
        !marks                         ? "lines"
        : curve.points && curve.dashed ? "points pt 6"
                                       : "points pt 7",
        colours[i], curve.width, curve.dashed && !marks ? " dt 2" : "",
        curve.label.empty() ? "notitle" : "title " + quoted(curve.label)));
  }
  s.line("{}", command);
  s.line("unset multiplot");

  return finished_picture(s.text, format);
}

std::string draw(const PolarPlot& plot, PictureFormat format) {
  if (plot.curves.empty()) throw std::invalid_argument("a plot needs at least one curve");
  double largest = 0;
  for (const Curve& curve : plot.curves) {
    if (curve.x.size() != curve.y.size()) throw std::invalid_argument("a curve needs as many x as y");
    for (const double y : curve.y) {
      if (y < 0) throw std::invalid_argument("a polar plot has no place for negative values");
      if (std::isfinite(y)) largest = std::max(largest, y);
    }
  }
  if (!(largest > 0)) throw std::invalid_argument("nothing to draw: no value is positive");

  Script s;
  set_terminal(s, format, plot.width, plot.height);
  constexpr int top = 44, bottom = 24;
  int widest = 0;
  for (const Curve& curve : plot.curves) widest = std::max(widest, length(curve.label));
  const int columns = std::clamp((plot.width - 40) / (widest * character_px + 56), 1, 4);
  const int rows = (static_cast<int>(plot.curves.size()) + columns - 1) / columns;
  const int legend_px = rows * (text_px + 5) + 24;
  const int side = std::max(std::min(plot.width - 120, plot.height - top - legend_px - bottom), 100);
  const auto across = [&](int px) { return static_cast<double>(px) / plot.width; };
  const auto up = [&](int px) { return 1 - static_cast<double>(px) / plot.height; };
  const int left = (plot.width - side) / 2, first_row = top + legend_px;
  s.line("set lmargin at screen {}\nset rmargin at screen {}", across(left), across(left + side));
  s.line("set tmargin at screen {}\nset bmargin at screen {}", up(first_row), up(first_row + side));
  // Unit circle: values are scaled here, so that gnuplot need not know about roots.
  s.line("set xrange [-1.12:1.12]\nset yrange [-1.12:1.12]\nunset border\nunset tics");
  const double step = tick_step(largest);
  int rings = 0;
  for (double value = step; value <= largest * 1.0001; value += step) ++rings;
  const double scale = 1 / std::sqrt(largest);
  for (int k = 0; k < rings; ++k) {
    const double value = step * (k + 1), r = std::sqrt(value) * scale;
    s.line("set object {} circle at 0,0 size {} fs empty border lc rgb '#cccccc' lw 0.7 back", k + 1, r);
    // Labels on a spoke of their own, where rings are not too near.
    if (k == 0 || k + 1 == rings || rings <= 4 || k == rings / 2)
      s.line(
          "set label {} '{:g}' at {},{} center font '{},9' tc rgb '#777777' front", 100 + k, value,
          r * std::sin(1.31), r * std::cos(1.31), font);
  }
  s.line("set object 99 circle at 0,0 size 1 fs empty border lc rgb '#888888' lw 0.8 back");
  for (int degrees = 0; degrees < 360; degrees += 30) {
    const double a = degrees * 3.14159265358979323846 / 180;
    s.line(
        "set arrow {} from 0,0 to {},{} nohead lc rgb '#dddddd' lw 0.6 back", degrees / 30 + 1, std::sin(a),
        std::cos(a));
    s.line(
        "set label {} '{}°' at {},{} center tc rgb '#222222'", 200 + degrees,
        degrees <= 180 ? degrees : degrees - 360, 1.08 * std::sin(a), 1.08 * std::cos(a));
  }
  for (std::size_t i = 0; i < plot.curves.size(); ++i) {
    const Curve& curve = plot.curves[i];
    s.line("$curve{} << END", i);
    for (std::size_t k = 0; k < curve.x.size(); ++k) {
      if (!std::isfinite(curve.x[k]) || !std::isfinite(curve.y[k])) {
        s.line("");
        continue;
      }
      const double a = curve.x[k] * 3.14159265358979323846 / 180, r = std::sqrt(curve.y[k]) * scale;
      s.line("{:.6g} {:.6g}", r * std::sin(a), r * std::cos(a));
    }
    s.line("END");
  }
  if (!plot.title.empty())
    s.line(
        "set label 300 {} at screen 0.5,{} center noenhanced font '{},{}'", quoted(plot.title), up(22), font,
        format == PictureFormat::png ? 13 : 17);
  s.line(
      "set key at screen 0.5,{} center top horizontal maxcols {} noenhanced reverse Left samplen 2.5 spacing "
      "1.2 tc rgb "
      "'#222222'",
      up(top), columns);
  std::string command;
  std::size_t next = 0;
  for (std::size_t i = 0; i < plot.curves.size(); ++i) {
    const Curve& curve = plot.curves[i];
    command += fmt::format(
        "{}$curve{} using 1:2 with lines lc rgb '{}' lw {}{} {}", i == 0 ? "plot " : ", ", i,
        curve.colour.empty() ? palette[next++ % palette.size()] : curve.colour, curve.width,
        curve.dashed ? " dt 2" : "", curve.label.empty() ? "notitle" : "title " + quoted(curve.label));
  }
  s.line("{}", command);
  return finished_picture(s.text, format);
}

std::string draw(const ColourImage& image, PictureFormat format) {
  if (image.columns < 1 || image.rows < 1 ||
      image.pixels.size() != static_cast<std::size_t>(image.columns) * static_cast<std::size_t>(image.rows))
    throw std::invalid_argument("an image needs columns x rows pixels");
  if (!(image.x_last > image.x_first && image.y_last > image.y_first) ||
      (image.log_x && !(image.x_first > 0)))
    throw std::invalid_argument("an axis of an image has no extent");
  constexpr int left = 78, right = 26, bottom = 62;
  const int top = image.title.empty() ? 16 : 44;
  const int width = left + image.columns + right, height = top + image.rows + bottom;
  const auto across = [&](int px) { return static_cast<double>(px) / width; };
  const auto up = [&](int px) { return 1 - static_cast<double>(px) / height; };

  // The axis is linear for gnuplot, whose images do not bend: a logarithmic one is made of its labels.
  const auto place = [&](double x) { return image.log_x ? std::log10(x) : x; };
  const double x_first = place(image.x_first), x_last = place(image.x_last);
  Script s;
  set_terminal(s, format, width, height);
  s.line("set lmargin at screen {}", across(left));
  s.line("set rmargin at screen {}", across(left + image.columns));
  s.line("set tmargin at screen {}", up(top));
  s.line("set bmargin at screen {}", up(top + image.rows));
  s.line("set xrange [{}:{}]\nset yrange [{}:{}]", x_first, x_last, image.y_first, image.y_last);
  s.line("$image << END");
  const double column = (x_last - x_first) / image.columns, row = (image.y_last - image.y_first) / image.rows;
  for (int j = 0; j < image.rows; ++j)
    for (int i = 0; i < image.columns; ++i) {
      const auto& [r, g, b] = image.pixels
                                  [static_cast<std::size_t>(j) * static_cast<std::size_t>(image.columns) +
                                   static_cast<std::size_t>(i)];
      s.line(
          "{:.10g} {:.10g} {} {} {}", x_first + (i + 0.5) * column, image.y_first + (j + 0.5) * row, r, g, b);
    }
  s.line("END");
  if (!image.title.empty())
    s.line(
        "set label 2 {} at screen {},{} center noenhanced font '{},{}'", quoted(image.title),
        across(width / 2), up(22), font, format == PictureFormat::png ? 12 : 16);
  s.line(
      "set label 4 {} at screen {},{} center noenhanced", quoted(image.x_label),
      across(left + image.columns / 2), up(height - 13));
  s.line(
      "set label 3 {} at screen {},{} center rotate noenhanced", quoted(image.y_label), across(18),
      up(top + image.rows / 2));
  s.line("set border 15 lc rgb '#444444' lw 1\nunset key");
  s.line("set tics nomirror out front tc rgb '#222222'");
  if (image.log_x) {
    std::string tics;
    const auto add = [&](double x, bool labelled) {
      if (x < image.x_first * (1 - 1e-9) || x > image.x_last * (1 + 1e-9)) return;
      tics += fmt::format(
          "{}'{}' {} {}", tics.empty() ? "" : ",", labelled ? fmt::format("{:.6g}", x) : "", place(x),
          labelled ? 0 : 1);
    };
    // 1, 2, 5 have labels; over less than half a decade all digits have.
    const bool all = x_last - x_first < 0.5;
    for (int power = static_cast<int>(std::floor(x_first)); power <= std::ceil(x_last); ++power)
      for (int digit = 1; digit <= 9; ++digit)
        add(digit * std::pow(10, power), all || digit == 1 || digit == 2 || digit == 5);
    s.line("set xtics ({}) offset 0,0.3", tics);
  } else {
    s.line("set xtics {} offset 0,0.3", tick_step(x_last - x_first));
  }
  s.line("set ytics {}", tick_step(image.y_last - image.y_first));
  s.line("set mytics");
  s.line("plot $image using 1:2:3:4:5 with rgbimage notitle");
  return finished_picture(s.text, format);
}

std::string draw(const HalfDiscPlot& plot, PictureFormat format) {
  double largest = 0;
  if (plot.panels.empty()) throw std::invalid_argument("a plot of half discs needs one at least");
  std::vector<std::pair<std::string, std::string>> legend; // label, colour
  for (const HalfDiscPlot::Panel& panel : plot.panels) {
    std::size_t next = 0;
    for (const Curve& curve : panel.curves) {
      if (curve.x.size() != curve.y.size())
        throw std::invalid_argument("the arrays of curve '" + curve.label + "' differ in length");
      const std::string colour = curve.colour.empty() ? palette[next++ % palette.size()] : curve.colour;
      if (!curve.label.empty() &&
          std::ranges::none_of(legend, [&](const auto& entry) { return entry.first == curve.label; }))
        legend.emplace_back(curve.label, colour);
      for (const double y : curve.y)
        if (std::isfinite(y)) largest = std::max(largest, y);
    }
  }
  if (!(largest > 0)) throw std::invalid_argument("a plot of half discs needs something that is positive");
  // A few rings at round values.
  const auto ring_step = [](double most) {
    const double decade = std::pow(10, std::floor(std::log10(most)));
    for (const double factor : {0.2, 0.25, 0.5, 1.0})
      if (most / (factor * decade) <= 5) return factor * decade;
    return 2 * decade;
  };

  // Everything is laid out in pixels, from the bottom left.
  const auto count = static_cast<int>(plot.panels.size());
  constexpr int side = 34, between = 40;
  const int bottom = plot.radius_label.empty() ? 34 : 58;
  const int radius = (plot.width - 2 * side - (count - 1) * between) / (2 * count);
  if (radius < 40) throw std::invalid_argument("the half discs have no room");
  const int top = (plot.title.empty() ? 8 : 40) + (legend.empty() ? 0 : text_px + 10) + 26;
  constexpr int below = 26; // under the centre: labels of the scale
  const int height = top + radius + below + bottom;
  Script s;
  set_terminal(s, format, plot.width, height);
  s.line(
      "set lmargin at screen 0\nset rmargin at screen 1\nset tmargin at screen 1\nset bmargin at screen 0");
  s.line("set xrange [0:{}]\nset yrange [0:{}]\nunset border\nunset tics\nunset key", plot.width, height);
  int labels = 0;
  const auto label = [&](const std::string& text, double x, double y, const char* where, int size) {
    s.line(
        "set label {} {} at {},{} {} noenhanced font '{},{}' tc rgb '#222222'", ++labels, quoted(text), x, y,
        where, font, format == PictureFormat::png ? size : size + 3);
  };
  std::string command;
  int blocks = 0;
  const auto line = [&](const std::vector<std::pair<double, double>>& points, const std::string& style) {
    s.line("$line{} << END", blocks);
    for (const auto& [x, y] : points) s.line("{:.3f} {:.3f}", x, y);
    s.line("END");
    command +=
        fmt::format("{}$line{} using 1:2 with lines {} notitle", blocks == 0 ? "plot " : ", ", blocks, style);
    ++blocks;
  };
  if (!plot.title.empty()) label(plot.title, plot.width / 2.0, height - 22, "center", 13);
  double legend_x = 0;
  for (const auto& [text, colour] : legend) legend_x += length(text) * character_px + 56;
  legend_x = 0.5 * (plot.width - legend_x);
  const double legend_y = height - (plot.title.empty() ? 8 : 40) - text_px / 2.0 - 2;
  for (const auto& [text, colour] : legend) {
    line({{legend_x, legend_y}, {legend_x + 26, legend_y}}, fmt::format("lc rgb '{}' lw 2", colour));
    label(text, legend_x + 34, legend_y, "left", 11);
    legend_x += length(text) * character_px + 56;
  }
  const double degree = std::numbers::pi / 180;
  for (int panel = 0; panel < count; ++panel) {
    const HalfDiscPlot::Panel& of = plot.panels[static_cast<std::size_t>(panel)];
    const double x = side + radius + panel * (2.0 * radius + between), y = bottom + below;
    const auto at = [&](double angle_deg, double r) {
      return std::pair(x + r * std::sin(angle_deg * degree), y + r * std::cos(angle_deg * degree));
    };
    double most = 0;
    for (const Curve& curve : of.curves)
      for (const double value : curve.y)
        if (std::isfinite(value)) most = std::max(most, value);
    if (!(most > 0)) most = largest; // nothing here: the scale of the others
    const double ring = ring_step(most), scale = std::max(std::ceil(most / ring - 1e-9), 1.0) * ring;
    for (double value = ring; value <= scale * (1 + 1e-9); value += ring) {
      std::vector<std::pair<double, double>> arc;
      for (int a = -90; a <= 90; a += 2) arc.push_back(at(a, radius * value / scale));
      line(arc, "lc rgb '#dddddd' lw 0.7");
      label(fmt::format("{:.4g}", value), x + radius * value / scale, y - 12, "center", 8);
    }
    for (int a = -90; a <= 90; a += 30) {
      line(
          {at(a, 0), at(a, radius)}, std::abs(a) == 90 ? "lc rgb '#444444' lw 1" : "lc rgb '#dddddd' lw 0.7");
      const auto [lx, ly] = at(a, radius + 14);
      // At the horizon there is no room beside the disc, and the scale says what is there.
      if (std::abs(a) != 90) label(fmt::format("{}°", a), lx, ly, "center", 9);
    }
    if (of.mark) line({at(*of.mark, 0), at(*of.mark, radius)}, "lc rgb '#E69F00' lw 2");
    std::size_t next = 0;
    for (const Curve& curve : of.curves) {
      const std::string colour = curve.colour.empty() ? palette[next++ % palette.size()] : curve.colour;
      std::vector<std::pair<double, double>> points;
      for (std::size_t k = 0; k < curve.x.size(); ++k)
        if (std::isfinite(curve.y[k]))
          points.push_back(at(curve.x[k], radius * std::max(curve.y[k], 0.0) / scale));
      if (!points.empty())
        line(points, fmt::format("lc rgb '{}' lw {}{}", colour, curve.width, curve.dashed ? " dt 2" : ""));
    }
    label(of.label, x, bottom - 16, "center", 11);
  }
  if (!plot.radius_label.empty()) label(plot.radius_label, plot.width / 2.0, 16, "center", 9);
  s.line("{}", command);
  return finished_picture(s.text, format);
}

namespace {

template <typename Picture>
void write(const std::filesystem::path& path, const Picture& picture) {
  const PictureFormat format = picture_format(path);
  table::PartFile file(path);
  table::FileWriter out(file.descriptor(), path.string());
  out.write(draw(picture, format));
  out.flush();
  file.commit();
}

} // namespace

void write_plot(const std::filesystem::path& path, const Plot& plot) {
  write(path, plot);
}

void write_plot(const std::filesystem::path& path, const ColourImage& image) {
  write(path, image);
}

void write_plot(const std::filesystem::path& path, const HalfDiscPlot& plot) {
  write(path, plot);
}

void write_plot(const std::filesystem::path& path, const PolarPlot& plot) {
  write(path, plot);
}

} // namespace scatter::scene
