#include "azimuthal_plot.hpp"
#include "cloth_plot.hpp"
#include "lee.hpp"
#include "verbs.hpp"
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/scene/colour.hpp>
#include <scatter/scene/plot.hpp>
#include <scatter/table/summary.hpp>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace scatter::app {
namespace {

struct Texts {
  std::string file, output;
  std::optional<std::string> phi, wavelengths, from, to;
  double exposure = 0;
  int width = 1000, height = 640;
  bool no_strip = false;
};

/// The table along one azimuth: everything that a picture shows.
struct Column {
  std::vector<double> theta_deg;
  std::vector<table::Slab> slabs; ///< per wavelength, F = 1, cut to the angles that are drawn
};

/// The value of the list nearest to `wanted`; refuses one that is further away than the list's own steps.
std::size_t
nearest(const std::vector<double>& values, double wanted, const char* option, const std::string& text) {
  const auto distance = [&](std::size_t i) { return std::abs(values[i] - wanted); };
  std::size_t best = 0;
  double step = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    if (distance(i) < distance(best)) best = i;
    step = std::max(step, std::abs(values[i] - values[i - 1]));
  }
  const double scale = std::max(std::abs(values.front()), std::abs(values.back()));
  if (distance(best) > step / 2 + 1e-6 * scale) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const bool length = std::string(option) == "--wavelength";
    throw InputError(fmt::format(
        "{} {}: the table has {:.6g} .. {:.6g} {}", option, text, *low * (length ? 1e9 : 1),
        *high * (length ? 1e9 : 1), length ? "nm" : "deg"));
  }
  return best;
}

/// Up to five wavelengths, or those nearest to blue, green and red.
std::vector<std::size_t> default_wavelengths(const std::vector<double>& wavelength_m) {
  std::vector<std::size_t> chosen;
  if (wavelength_m.size() <= 5) {
    for (std::size_t w = 0; w < wavelength_m.size(); ++w) chosen.push_back(w);
    return chosen;
  }
  const auto [low, high] = std::minmax_element(wavelength_m.begin(), wavelength_m.end());
  const bool visible = *low <= 460e-9 && *high >= 640e-9;
  for (const double wanted :
       visible ? std::array{450e-9, 550e-9, 650e-9} : std::array{*low, (*low + *high) / 2, *high}) {
    std::size_t best = 0;
    for (std::size_t w = 1; w < wavelength_m.size(); ++w)
      if (std::abs(wavelength_m[w] - wanted) < std::abs(wavelength_m[best] - wanted)) best = w;
    if (std::find(chosen.begin(), chosen.end(), best) == chosen.end()) chosen.push_back(best);
  }
  return chosen;
}

Column load(table::Source& source, std::size_t phi, const Texts& texts) {
  const table::TableHeader& head = source.header();
  const double from = texts.from ? parse_angle_deg(*texts.from) : head.theta_deg.front();
  const double to = texts.to ? parse_angle_deg(*texts.to) : head.theta_deg.back();
  std::size_t first = 0, last = head.theta_deg.size();
  while (first < last && head.theta_deg[first] < from - 1e-9) ++first;
  while (last > first && head.theta_deg[last - 1] > to + 1e-9) --last;
  if (last - first < 2)
    throw InputError(fmt::format(
        "{}: {} of its scattering angles ({:.6g} .. {:.6g} deg) lie between {:.6g} and {:.6g} deg; a curve "
        "needs two",
        texts.file, last - first, head.theta_deg.front(), head.theta_deg.back(), from, to));
  Column column;
  const auto cut = [&](std::vector<double>& values, std::size_t inner) {
    if (values.empty()) return;
    values.erase(values.begin() + static_cast<std::ptrdiff_t>(last * inner), values.end());
    values.erase(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(first * inner));
  };
  column.theta_deg = head.theta_deg;
  cut(column.theta_deg, 1);
  for (std::size_t w = 0; w < head.wavelength_m.size(); ++w) {
    table::Slab slab = source.read(w, {.matrix = true, .amplitudes = false, .phi = phi});
    cut(slab.phase_function, 1);
    cut(slab.error_estimate, 1);
    cut(slab.phase_matrix, 16);
    cut(slab.stokes, 3);
    column.slabs.push_back(std::move(slab));
  }
  return column;
}

enum class Polarisation { perpendicular, parallel, unpolarised };

/// Scattered sunlight of one polarisation, in units where unpolarised is the sum of both.
double intensity(const table::Slab& slab, std::size_t t, Polarisation polarisation) {
  const double I = slab.phase_function[t];
  if (polarisation == Polarisation::unpolarised) return I;
  // Bohren & Huffman: Q = I_parallel - I_perpendicular to the scattering plane.
  const double Q = slab.stokes.empty() ? slab.phase_matrix[16 * t + 4] : slab.stokes[3 * t];
  return std::max(polarisation == Polarisation::parallel ? (I + Q) / 2 : (I - Q) / 2, 0.0);
}

/// The luminance that is shown as white: the brightest angle of the bows (120 .. 150 deg) where they are
/// drawn, so that neither the forward peak nor the glory leave them black; else the brightest angle of all.
double white_level(const Column& column, const std::vector<double>& luminance) {
  double bows = 0, all = 0;
  for (std::size_t t = 0; t < luminance.size(); ++t) {
    all = std::max(all, luminance[t]);
    if (column.theta_deg[t] >= 120 && column.theta_deg[t] <= 150) bows = std::max(bows, luminance[t]);
  }
  return bows > 0 ? bows : all;
}

std::vector<scene::ColourStrip>
colour_strips(const Column& column, const std::vector<double>& wavelength_m, const Texts& texts) {
  const scene::SunlitColour colour(wavelength_m);
  const std::size_t rows = column.theta_deg.size();
  const auto light = [&](Polarisation polarisation) {
    std::vector<scene::LinearRgb> seen(rows);
    std::vector<double> scattered(wavelength_m.size());
    for (std::size_t t = 0; t < rows; ++t) {
      // Cross sections: the phase function alone hides how much of each wavelength is scattered.
      for (std::size_t w = 0; w < wavelength_m.size(); ++w)
        scattered[w] = intensity(column.slabs[w], t, polarisation) *
                       std::max(column.slabs[w].scattering_cross_section, 0.0);
      seen[t] = colour(scattered);
    }
    return seen;
  };
  const auto unpolarised = light(Polarisation::unpolarised);
  std::vector<double> luminance;
  for (const auto& seen : unpolarised) luminance.push_back(scene::tristimulus(seen).Y);
  const double white = white_level(column, luminance);
  if (!(white > 0)) return {};
  const double exposure = std::exp2(texts.exposure) / white;

  // A pixel is the mean of the light of its angles; where angles are coarser than pixels, light between two.
  const auto pixels = static_cast<std::size_t>(texts.width);
  const auto strip = [&](const char* label, const std::vector<scene::LinearRgb>& seen) {
    scene::ColourStrip made{
        .label = label, .first = column.theta_deg.front(), .last = column.theta_deg.back()};
    std::size_t t = 0;
    for (std::size_t p = 0; p < pixels; ++p) {
      const auto edge = [&](std::size_t k) {
        return made.first + (made.last - made.first) * static_cast<double>(k) / static_cast<double>(pixels);
      };
      scene::LinearRgb mean;
      int count = 0;
      for (; t < rows && column.theta_deg[t] < edge(p + 1); ++t, ++count) {
        mean.r += seen[t].r;
        mean.g += seen[t].g;
        mean.b += seen[t].b;
      }
      if (count == 0) {
        const double middle = (edge(p) + edge(p + 1)) / 2;
        const std::size_t high = std::clamp<std::size_t>(t, 1, rows - 1);
        const double share = std::clamp(
            (middle - column.theta_deg[high - 1]) / (column.theta_deg[high] - column.theta_deg[high - 1]),
            0.0, 1.0);
        const auto &a = seen[high - 1], &b = seen[high];
        mean = {a.r + share * (b.r - a.r), a.g + share * (b.g - a.g), a.b + share * (b.b - a.b)};
        count = 1;
      }
      const double scale = exposure / count;
      made.pixels.push_back(scene::srgb_bytes({mean.r * scale, mean.g * scale, mean.b * scale}));
    }
    return made;
  };
  std::vector<scene::ColourStrip> strips;
  if (!column.slabs[0].phase_matrix.empty() || !column.slabs[0].stokes.empty()) {
    strips.push_back(strip("perpendicular", light(Polarisation::perpendicular)));
    strips.push_back(strip("parallel", light(Polarisation::parallel)));
  }
  strips.push_back(strip("unpolarised", unpolarised));
  return strips;
}

std::string title(const table::TableHeader& head, double phi_deg) {
  const auto& made = head.provenance;
  std::string words = table::find_constant(made, "shape").value_or("drop");
  for (std::size_t i = 0; i < words.size(); ++i) // "Beard-Chuang"
    if (i == 0 || words[i - 1] == '-')
      words[i] = static_cast<char>(std::toupper(static_cast<unsigned char>(words[i])));
  if (const auto radius = table::find_constant(made, "radius_m")) try {
      words += fmt::format(", radius {:.6g} mm", std::stod(*radius) * 1e3);
    } catch (const std::exception&) {
      words += ", radius " + *radius + " m";
    }
  const auto sun = table::find_constant(made, "sun_elevation_deg");
  const bool sphere = table::find_constant(made, "shape") == "sphere";
  if (sun && !sphere) words += ", sun " + *sun + "°";
  if (!sphere || head.phi_deg.size() > 1) words += fmt::format(", φ = {:.6g}°", phi_deg);
  const std::string method = made.method.substr(0, made.method.find(':'));
  return words + " (" + (method == "mie" ? "Lorenz-Mie" : method) + ")";
}

void check_size(int width, int height) {
  if (width < 300 || width > 10000 || height < 250 || height > 10000)
    throw InputError(fmt::format(
        "--width {} --height {}: a picture has 300 to 10000 pixels across and 250 to 10000 down", width,
        height));
}

void run(const Texts& texts) {
  // Refused before the table is read.
  static_cast<void>(scene::picture_format(texts.output));
  check_size(texts.width, texts.height);
  if (!std::isfinite(texts.exposure) || std::abs(texts.exposure) > 50)
    throw InputError(fmt::format("--exposure {}: give stops between -50 and 50", texts.exposure));
  const auto source = table::open_table(texts.file);
  const table::TableHeader& head = source->header();
  const std::size_t phi =
      texts.phi ? nearest(head.phi_deg, parse_angle_deg(*texts.phi), "--phi", *texts.phi) : std::size_t{0};
  std::vector<std::size_t> chosen;
  if (texts.wavelengths)
    for (const double wavelength : parse_lengths(*texts.wavelengths)) {
      const std::size_t w = nearest(head.wavelength_m, wavelength, "--wavelength", *texts.wavelengths);
      if (std::find(chosen.begin(), chosen.end(), w) == chosen.end()) chosen.push_back(w);
    }
  else
    chosen = default_wavelengths(head.wavelength_m);
  const Column column = load(*source, phi, texts);

  scene::Plot plot;
  plot.title = title(head, head.phi_deg[phi]);
  plot.x_label = "scattering angle (°)";
  plot.y_label = "phase function (sr⁻¹)";
  plot.log_y = true;
  plot.width = texts.width;
  plot.height = texts.height;
  plot.x_range = {column.theta_deg.front(), column.theta_deg.back()};
  for (const std::size_t w : chosen) {
    const table::Slab& slab = column.slabs[w];
    scene::Curve curve;
    curve.label = fmt::format("λ = {:.6g} nm", head.wavelength_m[w] * 1e9);
    curve.x = column.theta_deg;
    curve.y = slab.phase_function;
    if (std::any_of(slab.error_estimate.begin(), slab.error_estimate.end(), [](double e) { return e > 0; }))
      for (std::size_t t = 0; t < curve.y.size(); ++t) {
        curve.lower.push_back(curve.y[t] * (1 - slab.error_estimate[t]));
        curve.upper.push_back(curve.y[t] * (1 + slab.error_estimate[t]));
      }
    plot.curves.push_back(std::move(curve));
  }
  if (std::none_of(plot.curves.begin(), plot.curves.end(), [](const scene::Curve& curve) {
        return std::any_of(curve.y.begin(), curve.y.end(), [](double y) { return y > 0; });
      }))
    throw InputError(
        fmt::format("{}: the phase function is zero at all angles that are to be drawn", texts.file));
  if (!texts.no_strip) {
    const bool seen = std::any_of(head.wavelength_m.begin(), head.wavelength_m.end(), [](double wavelength) {
      return scene::colour_matching(wavelength).Y > 0;
    });
    if (seen)
      plot.strips = colour_strips(column, head.wavelength_m, texts);
    else
      spdlog::info("no colour strip: none of the wavelengths can be seen");
  }
  scene::write_plot(texts.output, plot);
}

/// What is drawn has options of its own; the others' have nothing to say to it. A table has those of no
/// group.
void refuse_mixed(const CLI::App& verb, bool lee, bool azimuthal, bool cloth) {
  struct Kind {
    const char *option, *group, *name;
    bool wanted;
    std::vector<std::string> also; ///< options of a table that it has too
  };
  const Kind kinds[] = {
      {"--lee", "Lee diagram", "a Lee diagram", lee, {"--exposure"}},
      {"--azimuthal", "Azimuthal figure", "an azimuthal figure", azimuthal, {"--width", "--height"}},
      {"--cloth", "Cloth", "a fabric's plot", cloth, {"--width"}}};
  const Kind* drawn = nullptr;
  for (const Kind& kind : kinds) {
    if (!kind.wanted) continue;
    if (drawn != nullptr)
      throw InputError(
          std::string(kind.option) + ": " + drawn->option + " asks for another picture; give one of the two");
    drawn = &kind;
  }
  for (const CLI::Option* const option : verb.get_options()) {
    if (option->count() == 0) continue;
    const std::string name = option->get_name();
    if (name == "--output" || name == "--verbose") continue;
    const auto owner = std::ranges::find(
        kinds, option->get_group(), [](const Kind& kind) { return std::string(kind.group); });
    const bool of_table = owner == std::end(kinds);
    if (!of_table && !owner->wanted)
      throw InputError(name + ": belongs to " + owner->name + "; add " + owner->option);
    if (of_table && drawn != nullptr && std::ranges::find(drawn->also, name) == drawn->also.end())
      throw InputError(name + ": " + drawn->name + " is computed, not read from a table; leave it out");
  }
  if (drawn == nullptr && verb.count("FILE") == 0)
    throw InputError(
        "FILE is missing: name a table made by scatter phase, or use --lee, --azimuthal or --cloth");
}

} // namespace

void add_plot(CLI::App& app, Context&) {
  CLI::App* const verb =
      app.add_subcommand("plot", "Draw a table: curves, and the colours that one would see");
  const auto texts = std::make_shared<Texts>();
  verb->add_option(
      "FILE", texts->file,
      "Table made by scatter phase: .nc, .exr or .json; none with --lee, --azimuthal or --cloth");
  verb->add_option("--output", texts->output, "Picture to write: .png or .svg")
      ->type_name("PICTURE")
      ->required();
  verb->add_option("--phi", texts->phi, "Azimuth to draw, the nearest in the table [the first]")
      ->type_name("ANGLE");
  verb->add_option(
          "--wavelength,--wavelengths", texts->wavelengths,
          "Wavelengths to draw as curves, the nearest in the table [all up to 5, else blue, green and red]")
      ->type_name("LENGTHS");
  verb->add_option("--from", texts->from, "First scattering angle to draw [the table's first]")
      ->type_name("ANGLE");
  verb->add_option("--to", texts->to, "Last scattering angle to draw [the table's last]")->type_name("ANGLE");
  verb->add_option("--exposure", texts->exposure, "Make the colour strip brighter by so many stops [0]")
      ->type_name("STOPS");
  verb->add_option("--width", texts->width, "Pixels across [1000]")->type_name("N");
  verb->add_option("--height", texts->height, "Pixels down [640]")->type_name("N");
  verb->add_flag("--no-strip", texts->no_strip, "Leave out the colour strip");
  verb->footer(
      "Shaded bands are the table's error estimate. The strip shows sunlight (5772 K) from all wavelengths "
      "of the\n"
      "table through the CIE 1931 observer, white at the brightest angle of 120 .. 150 deg; with the phase "
      "matrix one\n"
      "strip each for light polarised perpendicular and parallel to the scattering plane, and for both.\n"
      "Example: scatter plot bow.nc --from 120 --to 150 --output bow.png");
  const auto lee = std::make_shared<LeeTexts>();
  add_lee_options(*verb, *lee);
  const auto azimuthal = std::make_shared<AzimuthalTexts>();
  add_azimuthal_options(*verb, *azimuthal);
  const auto cloth = std::make_shared<ClothPlotTexts>();
  add_cloth_plot_options(*verb, *cloth);
  verb->callback([texts, lee, azimuthal, cloth, verb] {
    refuse_mixed(*verb, lee->wanted, azimuthal->wanted, cloth->cloth.has_value());
    if (cloth->cloth) return run_cloth_plot(*cloth, texts->width, texts->output);
    if (azimuthal->wanted) {
      const bool square = azimuthal->polar && verb->count("--width") + verb->count("--height") == 0;
      const int width = square ? 800 : texts->width, height = square ? 830 : texts->height;
      check_size(width, height);
      return run_azimuthal(*azimuthal, width, height, texts->output);
    }
    if (lee->wanted) return run_lee(*lee, texts->exposure, texts->output);
    run(*texts);
  });
}

} // namespace scatter::app
