#include "phase_options.hpp"

#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <charconv>
#include <initializer_list>
#include <string_view>
#include <utility>

namespace scatter::app {
namespace {

/// The sun's mean angular diameter, 31.99 arcmin.
constexpr const char* sun_diameter = "31.99arcmin";

/// Reads one option's text; whatever is wrong with it then names the option.
template <typename Read>
auto read(const char* option, Read&& reader, const std::string& text) -> decltype(reader(text)) {
  try {
    return reader(text);
  } catch (const InputError& error) {
    const std::string_view message = error.what();
    if (message.starts_with("--")) throw; // it names an option itself
    throw InputError(std::string(option) + ": " + std::string(message));
  }
}

/// A whole number; its domain is for the one who uses it to judge.
int whole_number(const std::string& text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::invalid_argument || end != text.data() + text.size())
    throw InputError(quote(text) + " is not a whole number; write one such as 1000");
  if (error == std::errc::result_out_of_range) throw InputError(quote(text) + " is too large");
  return value;
}

/// A relative error: 0.01 or 1%.
double share(const std::string& text) {
  const bool percent = text.ends_with('%');
  const double value = parse_number(percent ? text.substr(0, text.size() - 1) : text) / (percent ? 100 : 1);
  if (!(value > 0 && value < 1))
    throw InputError(quote(text) + " is not a relative error; write one between 0 and 1, such as 0.01 or 1%");
  return value;
}

template <typename Choice>
Choice choose(const std::string& text, std::initializer_list<std::pair<const char*, Choice>> choices) {
  std::string names;
  for (const auto& [name, choice] : choices) {
    if (text == name) return choice;
    names += (names.empty() ? "" : ", ") + std::string(name);
  }
  throw InputError(quote(text) + " is not one of " + names);
}

phase::Method method(const std::string& text) {
  using phase::Method;
  return choose<Method>(
      text, {{"auto", Method::automatic}, {"patches", Method::patches}, {"mie", Method::mie}});
}

phase::Diffraction diffraction(const std::string& text) {
  using phase::Diffraction;
  return choose<Diffraction>(
      text, {{"gaussian", Diffraction::gaussian},
             {"integral", Diffraction::integral},
             {"none", Diffraction::none}});
}

phase::FocalLines focal_lines(const std::string& text) {
  using phase::FocalLines;
  return choose<FocalLines>(
      text, {{"exact", FocalLines::exact}, {"rule", FocalLines::rule}, {"none", FocalLines::none}});
}

phase::Search search(const std::string& text) {
  using phase::Search;
  return choose<Search>(
      text, {{"auto", Search::automatic}, {"raster", Search::raster}, {"tree", Search::tree}});
}

table::Precision precision(const std::string& text) {
  using table::Precision;
  return choose<Precision>(
      text, {{"double", Precision::double_precision}, {"single", Precision::single_precision}});
}

} // namespace

void PhaseOptions::add_to(CLI::App& verb) {
  const char* group = "Drop";
  const auto add = [&](const char* name, auto& text, const char* type, const std::string& description) {
    return verb.add_option(name, text, description)->type_name(type)->group(group);
  };
  const auto add_flag = [&](const char* name, bool& flag, const std::string& description) {
    verb.add_flag(name, flag, description)->group(group);
  };
  const auto standard = [](const std::string& text) { return " [" + text + "]"; };

  add("--shape", shape_, "NAME", "beard-chuang, chuang-beard, sphere or spheroid" + standard(shape_));
  add("--radius", radius_, "LENGTH", "Radius of the sphere of equal volume, such as 0.5mm (required)");
  add("--axis-ratio", axis_ratio_, "NUMBER", "Height over width of a spheroid, such as 0.9");
  add("--index", index_, "INDEX",
      "Refractive index: iapws, daimon-masumura, hale-querry, or a number such as 1.333 or "
      "1.33+1e-9i" +
          standard(index_));

  group = "Light";
  add("--sun", sun_, "ANGLE", "Elevation of the sun above the horizon, 0deg to 90deg" + standard(sun_));
  add("--wavelengths,--wavelength", wavelengths_, "LENGTHS",
      "Wavelengths in vacuum, such as 650nm or 380:700:10nm (required)");
  add("--sun-disc", sun_disc_, "ANGLE",
      "Average over a sun of this angular diameter; without a value " + std::string(sun_diameter) +
          " [0deg, a point]")
      ->expected(0, 1);

  group = "Directions";
  add("--theta", theta_, "ANGLES", "Scattering angles, increasing, 0deg to 180deg" + standard(theta_));
  add("--phi", phi_, "ANGLES",
      "Azimuths about the sunlight, increasing; 0deg is the top of the bow [0:360:10deg; 0deg "
      "for a sphere]");

  group = "Method";
  add("--method", method_, "NAME",
      "patches, mie or auto: Mie for a sphere, patches otherwise, and wherever --rays, --orders, "
      "--diffraction or --focal-lines is given" +
          standard(method_));
  rays_option_ =
      add("--rays", rays_, "N", "Rays across the drop: a grid of N x N is traced" + standard(rays_));
  orders_option_ =
      add("--orders", orders_, "ORDERS",
          "Orders p: 0 external reflection, 1 transmission, p - 1 internal reflections" + standard(orders_));
  diffraction_option_ =
      add("--diffraction", diffraction_, "NAME", "gaussian, integral or none" + standard(diffraction_));
  focal_lines_option_ =
      add("--focal-lines", focal_lines_, "NAME",
          "exact, rule (as on a sphere) or none: how phase jumps at focal lines are counted" +
              standard(focal_lines_));
  add_flag("--no-interference", no_interference_, "Add intensities of patches, not amplitudes");
  add_flag("--no-dispersion", no_dispersion_, "Use the index at 589.3nm for every wavelength");
  add_flag("--no-absorption", no_absorption_, "Drop the imaginary part of the index");
  add("--search", search_, "NAME",
      "raster, tree or auto: how directions find their patches" + standard(search_));
  add("--threads", threads_, "N",
      "Threads to use, 0 for all cores; results do not depend on it" + standard(threads_));
  add("--tolerance", tolerance_, "NUMBER",
      "Choose --diffraction, --orders and --rays, where they are not given, so that the intensity averaged "
      "over "
      "the sun's disc is right to this share (root mean square over the scattering angles), such as 1% or "
      "0.01");
  add_flag(
      "--explain", explain_,
      "Say how the request would be computed, its predicted error and time; compute it only with --output, "
      "and "
      "then say what they came to");

  group = "Output";
  output_option_ =
      add("--output", output_, "FILE",
          "FILE.nc, FILE.exr, FILE.json, - (JSON to standard output) or none "
          "(compute, write nothing)" +
              standard(output_));
  add_flag("--matrix", matrix_, "Also write the 4x4 phase matrix");
  add_flag("--amplitudes", amplitudes_, "Also write the 2x2 amplitude matrix");
  add_flag("--per-order", per_order_, "Also write the amplitude matrix of every order");
  add("--compression", compression_, "NAME",
      "none or deflate; for .exr also piz and pxr24" + standard(compression_));
  add("--precision", precision_, "NAME", "double or single, for .nc" + standard(precision_));
}

PhaseJob PhaseOptions::job() const {
  PhaseJob job;
  job.explain = explain_;
  job.output = output_;
  job.output_given = output_option_->count() > 0;
  if (output_.empty()) throw InputError("--output: \"\" is empty; write a file such as drop.nc, - or none");
  if (!radius_) throw InputError("--radius is missing; write one such as --radius 0.5mm");
  if (!wavelengths_)
    throw InputError("--wavelengths is missing; write some such as --wavelengths 380:700:10nm");

  job.file_options.compression = read("--compression", table::parse_compression, compression_);
  job.file_options.precision = read("--precision", precision, precision_);

  phase::Request& request = job.request;
  const double radius_m = read("--radius", parse_length, *radius_);
  double axis_ratio = 0;
  if (axis_ratio_) {
    axis_ratio = read("--axis-ratio", parse_number, *axis_ratio_);
    if (!(axis_ratio > 0))
      throw InputError("--axis-ratio: " + quote(*axis_ratio_) + " must be greater than zero");
  }
  try {
    request.shape = drop::make_shape(shape_, radius_m, axis_ratio);
  } catch (const InputError& error) {
    const std::string_view message = error.what();
    if (message.starts_with("--")) throw;
    throw InputError(
        (message.starts_with("axis ratio") ? "--axis-ratio: " : "--radius: ") + std::string(message));
  }
  request.sun_elevation_deg = read("--sun", parse_angle_deg, sun_);
  request.wavelength_m = read("--wavelengths", parse_lengths, *wavelengths_);
  request.index = read("--index", parse_index_source, index_);
  request.theta_deg = read("--theta", parse_angles_deg, theta_);
  request.phi_deg = read(
      "--phi", parse_angles_deg,
      phi_                        ? *phi_
      : request.shape.is_sphere() ? "0deg"
                                  : "0:360:10deg");
  request.rays = read("--rays", whole_number, rays_);
  request.orders = read("--orders", parse_orders, orders_);
  request.method = read("--method", method, method_);
  request.diffraction = read("--diffraction", diffraction, diffraction_);
  request.focal_lines = read("--focal-lines", focal_lines, focal_lines_);
  request.search = read("--search", search, search_);
  if (sun_disc_)
    request.sun_disc_deg =
        read("--sun-disc", parse_angle_deg, sun_disc_->empty() ? sun_diameter : *sun_disc_);
  request.interference = !no_interference_;
  request.dispersion = !no_dispersion_;
  request.absorption = !no_absorption_;
  request.matrix = matrix_;
  request.amplitudes = amplitudes_;
  request.per_order = per_order_;
  if (tolerance_) request.tolerance = read("--tolerance", share, *tolerance_);
  const auto open = [](const CLI::Option* option) { return option->count() == 0; };
  request.open = {
      open(diffraction_option_), open(rays_option_), open(orders_option_), open(focal_lines_option_)};
  request.threads = read("--threads", whole_number, threads_);
  return job;
}

} // namespace scatter::app
