// `scatter plot --lee`: the colours of the bows of spheres in sunlight, against radius and scattering angle.
//
// Every pixel is a mean: over radii, over the sun's disc, and over wavelengths with the weights of the
// observer. So a sphere's fast interference is wanted as a mean only, and the sampling is as coarse as the
// error allows. Columns of pixels take every second wavelength in turn, every wavelength other radii within
// the column (a golden-ratio sequence), and neighbours are mixed 1:2:1: a pixel shows the sizes of about two
// columns. The grid of angles under the sun's disc becomes finer with the size parameter only down to
// `finest_level`. --check measures what that costs.
#include "lee.hpp"

#include "option_readers.hpp"
#include <scatter/exact/mie.hpp>
#include <scatter/exact/sun_disc.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/refractive_index.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/scene/colour.hpp>
#include <scatter/scene/plot.hpp>
#include <scatter/table/atomic_file.hpp>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <exception>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace scatter::app {
namespace {

constexpr double golden = 0.6180339887498949;
/// 0.044 deg, a twelfth of the sun.
constexpr int finest_level = 6;

enum class Normalise { radius, chromaticity, common };

struct Lee {
  double first_radius_m = 0, last_radius_m = 0;
  double first_angle_deg = 0, last_angle_deg = 0;
  std::size_t columns = 0, rows = 0;
  double sun_disc_deg = 0;
  std::vector<double> wavelength_m;
  std::vector<std::complex<double>> index;
  Normalise normalise = Normalise::radius;
  int spheres = 1; ///< per wavelength and column
  int threads = 0;
};

/// "10um:1mm", "120:150deg": a unit at the end holds for a bare first number.
template <typename Reader>
std::pair<double, double> parse_span(const std::string& text, Reader&& reader, const char* example) {
  const auto colon = text.find(':');
  if (colon == std::string::npos || text.find(':', colon + 1) != std::string::npos)
    throw InputError(quote(text) + " is not first:last, such as " + example);
  std::string first = text.substr(0, colon);
  const std::string last = text.substr(colon + 1);
  if (!first.empty() && first.find_first_not_of("0123456789.") == std::string::npos) {
    const auto unit = last.find_first_not_of("0123456789.");
    if (unit != std::string::npos) first.append(last, unit);
  }
  const std::pair<double, double> span{reader(first), reader(last)};
  if (!(span.first < span.second))
    throw InputError(quote(text) + " ends before it starts; write first:last, such as " + example);
  return span;
}

Lee parse(const LeeTexts& texts) {
  Lee lee;
  std::tie(lee.first_radius_m, lee.last_radius_m) = read("--radii", texts.radii, [](const std::string& t) {
    return parse_span(
        t, [](const std::string& v) { return parse_length(v); }, "10um:1mm");
  });
  std::tie(lee.first_angle_deg, lee.last_angle_deg) =
      read("--angles", texts.angles, [](const std::string& t) {
        return parse_span(
            t, [](const std::string& v) { return parse_angle_deg(v); }, "120:150deg");
      });
  if (!(lee.first_angle_deg >= 0 && lee.last_angle_deg <= 180))
    throw InputError("--angles: " + quote(texts.angles) + " is not within 0deg..180deg");
  const auto cross = texts.size.find('x');
  if (cross == std::string::npos)
    throw InputError("--size: " + quote(texts.size) + " is not RADIIxANGLES, such as 400x600");
  lee.columns = static_cast<std::size_t>(whole_number("--size", texts.size.substr(0, cross), 100, 10000));
  lee.rows = static_cast<std::size_t>(whole_number("--size", texts.size.substr(cross + 1), 100, 10000));
  lee.sun_disc_deg = read("--sun-disc", texts.sun_disc, parse_angle_deg);
  if (!(lee.sun_disc_deg >= 0.01 && lee.sun_disc_deg <= 60))
    throw InputError(
        "--sun-disc: " + quote(texts.sun_disc) +
        " is outside 0.01deg..60deg; the sun's diameter seen from the Earth is 0.533deg");
  lee.wavelength_m = read("--sample-wavelengths", texts.wavelengths, parse_lengths);
  if (lee.wavelength_m.size() > 2000)
    throw InputError(
        fmt::format("--sample-wavelengths: {} are too many; use up to 2000", lee.wavelength_m.size()));
  const IndexSource source = read("--index", texts.index, parse_index_source);
  for (const double wavelength : lee.wavelength_m) {
    try {
      lee.index.push_back(refractive_index(source, wavelength));
    } catch (const InputError& error) {
      throw InputError(std::string("--sample-wavelengths: ") + error.what());
    }
    if (lee.index.back() == 1.0)
      throw InputError("--index: index 1 is no sphere: nothing is scattered; use an index other than 1");
    for (const double radius : {lee.first_radius_m, lee.last_radius_m}) {
      const double x = 2 * pi * radius / wavelength;
      if (!(x >= 1e-2 && x <= 1e5))
        throw InputError(fmt::format(
            "--radii: radius {:.6g} um has the size parameter {:.3g} at {:.6g} nm, outside 0.01..1e5",
            radius * 1e6, x, wavelength * 1e9));
    }
  }
  if (texts.normalise == "chromaticity")
    lee.normalise = Normalise::chromaticity;
  else if (texts.normalise == "common")
    lee.normalise = Normalise::common;
  else if (texts.normalise != "radius")
    throw InputError(
        "--normalise: " + quote(texts.normalise) + " is not known; use radius, chromaticity or common");
  lee.spheres = static_cast<int>(whole_number("--spheres", texts.spheres, 1, 1000));
  lee.threads = thread_count(texts.threads);
  return lee;
}

class Painter {
public:
  explicit Painter(const Lee& lee) : lee_(lee) {
    for (std::size_t j = 0; j < lee.rows; ++j)
      theta_deg_.push_back(
          lee.first_angle_deg + (lee.last_angle_deg - lee.first_angle_deg) * (static_cast<double>(j) + 0.5) /
                                    static_cast<double>(lee.rows));
    // 0, 1: every second wavelength; 2: all of them.
    for (std::size_t set = 0; set < 3; ++set) {
      const std::size_t step = set < 2 && lee.wavelength_m.size() >= 8 ? 2 : 1;
      std::vector<double> taken;
      Spectrum& spectrum = spectra_[set];
      for (std::size_t w = step == 2 ? set : 0; w < lee.wavelength_m.size(); w += step) {
        spectrum.wavelength.push_back(w);
        taken.push_back(lee.wavelength_m[w]);
      }
      const scene::SunlitColour colour(taken);
      std::vector<double> one(taken.size());
      for (std::size_t k = 0; k < one.size(); ++k) {
        one[k] = 1;
        spectrum.weight.push_back(colour(one));
        one[k] = 0;
      }
    }
  }

  [[nodiscard]] double radius(double column) const {
    return lee_.first_radius_m *
           std::pow(lee_.last_radius_m / lee_.first_radius_m, column / static_cast<double>(lee_.columns));
  }
  [[nodiscard]] const std::vector<double>& theta_deg() const { return theta_deg_; }

  /// Light of one column, per angle: mean of the phase function over its radii, seen.
  [[nodiscard]] std::vector<scene::LinearRgb> column(std::size_t i) {
    // Small spheres cost little, and fewer ripples average within a pixel: they get more company.
    const double x = 2 * pi * radius(static_cast<double>(i) + 0.5) / lee_.wavelength_m.front();
    const int spheres = lee_.spheres * std::clamp(static_cast<int>(std::lround(800 / x)), 1, 6);
    std::vector<scene::LinearRgb> seen(lee_.rows);
    add(seen, static_cast<double>(i), spectra_[i % 2], spheres, finest_level);
    return seen;
  }
  /// What column i should be after its neighbours have been mixed in: all wavelengths, many radii, every
  /// angle resolved.
  [[nodiscard]] std::vector<scene::LinearRgb> fine_column(std::size_t i) {
    std::vector<scene::LinearRgb> seen(lee_.rows);
    const double middle = static_cast<double>(i);
    const int spheres = 4 * lee_.spheres;
    for (const double at : {middle - 1, middle, middle, middle + 1}) add(seen, at, spectra_[2], spheres, 16);
    for (auto& light : seen) light = {light.r / 4, light.g / 4, light.b / 4};
    return seen;
  }

private:
  struct Spectrum {
    std::vector<std::size_t> wavelength;  ///< places in the request's list
    std::vector<scene::LinearRgb> weight; ///< of each
  };

  void
  add(std::vector<scene::LinearRgb>& seen, double column, const Spectrum& spectrum, int spheres, int finest) {
    // Each call goes on where the last column's sequence of radii would be.
    double turn = 0.5 + golden * 7 * column;
    for (std::size_t k = 0; k < spectrum.wavelength.size(); ++k) {
      const std::size_t w = spectrum.wavelength[k];
      const scene::LinearRgb weight = spectrum.weight[k];
      if (weight.r == 0 && weight.g == 0 && weight.b == 0) continue;
      for (int s = 0; s < spheres; ++s, turn += golden) {
        const double r = radius(column + turn - std::floor(turn));
        const double x = 2 * pi * r / lee_.wavelength_m[w];
        const exact::SunDisc& disc = disc_for(std::min(exact::SunDisc::level_for(x), finest));
        const exact::MieResult mie = exact::mie_at_degrees(x, lee_.index[w], disc.grid_deg(), 1);
        for (std::size_t j = 0; j < lee_.rows; ++j) {
          const double light = disc.mean(j, mie.phase_function) / spheres;
          seen[j].r += weight.r * light;
          seen[j].g += weight.g * light;
          seen[j].b += weight.b * light;
        }
      }
    }
  }
  const exact::SunDisc& disc_for(int level) {
    const std::scoped_lock lock(mutex_);
    const auto found = discs_.find(level);
    if (found != discs_.end()) return found->second;
    return discs_.try_emplace(level, theta_deg_, lee_.sun_disc_deg, level).first->second;
  }

  const Lee& lee_;
  std::vector<double> theta_deg_;
  std::array<Spectrum, 3> spectra_;
  std::map<int, exact::SunDisc> discs_;
  std::mutex mutex_;
};

/// Jobs 0 .. count - 1 on all threads; each writes its own results.
template <typename Job>
void in_parallel(std::size_t count, int threads, Job&& job) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex mutex;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < count; i = next++) job(i);
    } catch (...) {
      next = count;
      const std::scoped_lock lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  const std::size_t wanted =
      threads > 0 ? static_cast<std::size_t>(threads) : std::max(1U, std::thread::hardware_concurrency());
  std::vector<std::thread> others;
  try {
    for (std::size_t i = 1; i < std::min(wanted, count); ++i) others.emplace_back(work);
  } catch (const std::system_error&) {
    // No more threads to be had: those that run, and this one, do the work.
  }
  work();
  for (auto& thread : others) thread.join();
  if (failure) std::rethrow_exception(failure);
}

/// The luminance that is shown as white: the brightest of the bows (120 .. 150 deg) where they are drawn.
double brightest(const std::vector<scene::LinearRgb>& column, const std::vector<double>& theta_deg) {
  double bows = 0, all = 0;
  for (std::size_t j = 0; j < column.size(); ++j) {
    const double luminance = scene::tristimulus(column[j]).Y;
    all = std::max(all, luminance);
    if (theta_deg[j] >= 120 && theta_deg[j] <= 150) bows = std::max(bows, luminance);
  }
  return bows > 0 ? bows : all;
}

/// Every column with its neighbours, 1:2:1; the outermost ones have the same neighbour twice.
std::vector<std::vector<scene::LinearRgb>> mixed(const std::vector<std::vector<scene::LinearRgb>>& columns) {
  auto result = columns;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto &left = columns[i == 0 ? 1 : i - 1], &here = columns[i],
               &right = columns[i + 1 == columns.size() ? i - 1 : i + 1];
    for (std::size_t j = 0; j < here.size(); ++j)
      result[i][j] = {
          (left[j].r + 2 * here[j].r + right[j].r) / 4, (left[j].g + 2 * here[j].g + right[j].g) / 4,
          (left[j].b + 2 * here[j].b + right[j].b) / 4};
  }
  return result;
}

} // namespace

void add_lee_options(CLI::App& verb, LeeTexts& texts) {
  verb.add_flag("--lee", texts.wanted, "Lee diagram: colour of spheres' bows against radius and angle")
      ->group("Lee diagram");
  const auto add = [&](const char* name, std::string& text, const char* type,
                       const std::string& description) {
    verb.add_option(name, text, description + " [" + text + "]")->type_name(type)->group("Lee diagram");
  };
  add("--radii", texts.radii, "FIRST:LAST", "Radii, on a logarithmic axis");
  add("--angles", texts.angles, "FIRST:LAST", "Scattering angles");
  add("--size", texts.size, "RADIIxANGLES", "Pixels within the axes");
  add("--sun-disc", texts.sun_disc, "ANGLE", "Diameter of the sun");
  add("--sample-wavelengths", texts.wavelengths, "LENGTHS", "Wavelengths to compute");
  add("--index", texts.index, "INDEX", "Refractive index, as in scatter mie");
  add("--normalise", texts.normalise, "HOW",
      "White is the brightest bow of each radius (radius) or of all (common); or all pixels are equally "
      "bright (chromaticity)");
  add("--spheres", texts.spheres, "N", "Spheres per wavelength and column of pixels");
  verb.add_flag(
          "--check", texts.check,
          "Compute eight columns again, far finer, and print how much they differ (takes minutes)")
      ->group("Lee diagram");
  add("--threads", texts.threads, "N", "Threads to use, 0 for all cores; results do not depend on it");
}

void run_lee(const LeeTexts& texts, double exposure, const std::string& output) {
  static_cast<void>(scene::picture_format(output));
  const Lee lee = parse(texts);
  if (!std::isfinite(exposure) || std::abs(exposure) > 50)
    throw InputError(fmt::format("--exposure {}: give stops between -50 and 50", exposure));
  {
    // A folder that is not there is told at once.
    const table::PartFile probe(output);
  }
  Painter painter(lee);
  const auto start = std::chrono::steady_clock::now();
  std::vector<std::vector<scene::LinearRgb>> columns(lee.columns);
  // Large spheres first: no thread is left with the longest job at the end.
  in_parallel(lee.columns, lee.threads, [&](std::size_t job) {
    const std::size_t i = lee.columns - 1 - job;
    columns[i] = painter.column(i);
  });
  columns = mixed(columns);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  spdlog::info(
      "{} radii x {} angles x {} wavelengths, {:.3g} s", lee.columns, lee.rows, lee.wavelength_m.size(),
      seconds);
  if (texts.check) {
    constexpr std::size_t checks = 8;
    std::vector<std::string> lines(checks);
    in_parallel(checks, lee.threads, [&](std::size_t c) {
      const std::size_t i = (2 * c + 1) * lee.columns / (2 * checks);
      const auto fine = painter.fine_column(i);
      const double white = brightest(fine, painter.theta_deg());
      double squares = 0, worst = 0;
      for (std::size_t j = 0; j < lee.rows; ++j) {
        const double error = (scene::tristimulus(columns[i][j]).Y - scene::tristimulus(fine[j]).Y) / white;
        squares += error * error / static_cast<double>(lee.rows);
        worst = std::max(worst, std::abs(error));
      }
      lines[c] = fmt::format(
          "radius {:.3g} um: luminance differs from a fine computation by {:.2g} % (rms), {:.2g} % (most) of "
          "white",
          painter.radius(static_cast<double>(i) + 0.5) * 1e6, 100 * std::sqrt(squares), 100 * worst);
    });
    for (const std::string& line : lines) fmt::print("{}\n", line);
  }

  double common = 0;
  for (const auto& column : columns) common = std::max(common, brightest(column, painter.theta_deg()));
  scene::ColourImage image;
  image.title = fmt::format("Sunlight scattered by spheres, sun {:.4g}° wide", lee.sun_disc_deg);
  image.x_label = "radius (µm)";
  image.y_label = "scattering angle (°)";
  image.x_first = lee.first_radius_m * 1e6;
  image.x_last = lee.last_radius_m * 1e6;
  image.log_x = true;
  image.y_first = lee.first_angle_deg;
  image.y_last = lee.last_angle_deg;
  image.columns = static_cast<int>(lee.columns);
  image.rows = static_cast<int>(lee.rows);
  image.pixels.resize(lee.columns * lee.rows);
  for (std::size_t i = 0; i < lee.columns; ++i) {
    const double white =
        lee.normalise == Normalise::common ? common : brightest(columns[i], painter.theta_deg());
    for (std::size_t j = 0; j < lee.rows; ++j) {
      const scene::LinearRgb& light = columns[i][j];
      // Half of white leaves room for the colours.
      const double divisor =
          lee.normalise == Normalise::chromaticity ? 2 * scene::tristimulus(light).Y : white;
      const double scale = divisor > 0 ? std::exp2(exposure) / divisor : 0;
      image.pixels[j * lee.columns + i] =
          scene::srgb_bytes({light.r * scale, light.g * scale, light.b * scale});
    }
  }
  scene::write_plot(output, image);
}

} // namespace scatter::app
