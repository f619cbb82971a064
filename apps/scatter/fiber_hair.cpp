#include "directions.hpp"
#include "exact_options.hpp"
#include "fiber.hpp"
#include <scatter/fiber/absorption.hpp>
#include <scatter/fiber/artist_hair.hpp>
#include <scatter/fiber/assembly.hpp>
#include <scatter/fiber/hair.hpp>
#include <scatter/optics/units.hpp>

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <memory>
#include <set>

namespace scatter::app {
namespace {

using fiber::Rgb;
using fiber::Variant;
using nlohmann::ordered_json;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Variant parse_variant(const std::string& text) {
  if (text == "corrected") return Variant::corrected;
  if (text == "printed") return Variant::printed;
  throw InputError(quote(text) + " is no variant; use corrected or printed");
}

/// "0.2,0.3,0.5", or one number for all three.
Rgb parse_rgb(const std::string& text) {
  std::vector<double> values;
  for (std::size_t from = 0; from <= text.size();) {
    const std::size_t comma = std::min(text.find(',', from), text.size());
    values.push_back(parse_number(std::string_view(text).substr(from, comma - from)));
    from = comma + 1;
  }
  if (values.size() == 1) return {values[0], values[0], values[0]};
  if (values.size() != 3)
    throw InputError(quote(text) + " is not three numbers, for red, green and blue, or one for all");
  return {values[0], values[1], values[2]};
}

/// The library's messages begin with the name of a member; files give angles in degrees, and say so in the
/// field's name.
std::string with_unit(std::string message) {
  const std::size_t colon = std::min(message.find(": "), message.size());
  const std::string path = message.substr(0, colon), name = path.substr(path.rfind('.') + 1);
  for (const char* const angle :
       {"shift", "width", "transmission_azimuthal_width", "glint_azimuthal_width", "glint_half_angle"})
    if (name == angle) return message.insert(colon, "_deg");
  return message;
}

/// The library's messages, with the option or the file and its field in front.
template <typename Make>
auto named(const std::string& where, Make&& make) {
  try {
    return make();
  } catch (const InputError& error) {
    throw InputError(where + with_unit(error.what()));
  }
}

// ---- assembly

struct AssemblyTexts {
  std::string eta = "1.55", sigma_a = "0.2,0.3,0.5", shift = "-5deg", width = "7.5deg",
              theta_i = "-60:60:30deg", variant = "corrected", output = "-";
  bool residual = false;
};

void run_assembly(const AssemblyTexts& texts, const Context& context) {
  fiber::HairParameters parameters;
  parameters.eta = read("--eta", texts.eta, parse_number);
  if (!(parameters.eta > 1 && parameters.eta <= 10))
    throw InputError(fmt::format("--eta: {} is not above 1 (and at most 10); hair has 1.55", texts.eta));
  parameters.sigma_a = read("--sigma-a", texts.sigma_a, parse_rgb);
  for (const double sigma : parameters.sigma_a)
    if (!(sigma >= 0))
      throw InputError(fmt::format("--sigma-a: {} is negative; absorption is 0 or more per radius", sigma));
  const double shift = read("--shift", texts.shift, parse_angle_deg);
  if (!(std::abs(shift) < 60))
    throw InputError(fmt::format(
        "--shift: {:g} deg is not between -60deg and 60deg (TRT has 3/2 of it); hair has -10deg to -5deg",
        shift));
  const double width = read("--width", texts.width, parse_angle_deg);
  if (!(width > 0 && width < 45))
    throw InputError(fmt::format(
        "--width: {:g} deg is not between 0deg and 45deg, both excluded (TRT has twice of it); hair has 5deg "
        "to 10deg",
        width));
  parameters.shift = shift * radians_per_degree;
  parameters.width = width * radians_per_degree;
  parameters.residual = texts.residual;
  parameters.variant = read("--variant", texts.variant, parse_variant);
  const std::vector<double> theta_deg = read("--theta-i", texts.theta_i, parse_angles_deg);
  for (const double theta : theta_deg)
    if (!(std::abs(theta) < 90))
      throw InputError(
          fmt::format("--theta-i: {:g} deg is not between -90deg and 90deg, both excluded", theta));
  ExactOutput output(texts.output);

  const auto start = std::chrono::steady_clock::now();
  const fiber::HairScattering hair(parameters);
  std::vector<fiber::AssemblyAverages> found;
  for (const double theta : theta_deg)
    found.push_back(fiber::assembly_averages(hair, theta * radians_per_degree, parameters.variant));
  const double seconds = seconds_since(start);
  spdlog::info("{} inclinations, {} lobes, {:.3g} s", found.size(), hair.lobes(), seconds);

  using Averages = fiber::AssemblyAverages;
  struct Column {
    const char* name;
    Rgb Averages::*part;
    bool angle;
  };
  constexpr Column columns[] = {
      {"a_f", &Averages::a_f, false},
      {"a_b", &Averages::a_b, false},
      {"A_b", &Averages::A_b, false},
      {"alpha_f_deg", &Averages::alpha_f, true},
      {"alpha_b_deg", &Averages::alpha_b, true},
      {"beta_f_deg", &Averages::beta_f, true},
      {"beta_b_deg", &Averages::beta_b, true},
      {"Delta_b_deg", &Averages::Delta_b, true},
      {"sigma_b_deg", &Averages::sigma_b, true}};
  const auto value = [](const Averages& averages, const Column& column, std::size_t c) {
    return (averages.*column.part)[c] / (column.angle ? radians_per_degree : 1);
  };
  const Constants constants{
      {"eta", fmt::format("{}", parameters.eta)},
      {"sigma_a",
       fmt::format("{} {} {}", parameters.sigma_a[0], parameters.sigma_a[1], parameters.sigma_a[2])},
      {"shift_deg", fmt::format("{}", shift)},
      {"width_deg", fmt::format("{}", width)},
      {"lobes", parameters.residual ? "R TT TRT residual" : "R TT TRT"},
      {"variant", texts.variant}};
  if (output.is_csv()) {
    std::string text = "# Averages of an assembly of parallel fibres\n" +
                       csv_provenance(constants, seconds, context.command_line) + "theta_i_deg";
    for (const Column& column : columns)
      for (const char* colour : {"r", "g", "b"}) text += fmt::format(",{}_{}", column.name, colour);
    text += "\n";
    for (std::size_t i = 0; i < found.size(); ++i) {
      text += fmt::format("{}", theta_deg[i]);
      for (const Column& column : columns)
        for (std::size_t c = 0; c < 3; ++c) text += fmt::format(",{}", value(found[i], column, c));
      text += "\n";
    }
    return output.write(text);
  }
  ordered_json json;
  json["theta_i_deg"] = theta_deg;
  for (const Column& column : columns) {
    auto& list = json[column.name] = ordered_json::array();
    for (const Averages& averages : found)
      list.push_back({value(averages, column, 0), value(averages, column, 1), value(averages, column, 2)});
  }
  json["variant"] = texts.variant;
  json["lobes"] = parameters.residual ? std::vector<std::string>{"R", "TT", "TRT", "residual"}
                                      : std::vector<std::string>{"R", "TT", "TRT"};
  // Energies and averages are good to 1e-9; sums over paths that turn back divide by (1 - a_f^2)^3.
  auto& errors = json["error_estimate"] = ordered_json::array();
  for (const Averages& averages : found) {
    Rgb error{};
    for (std::size_t c = 0; c < 3; ++c) error[c] = 1e-9 / std::pow(1 - averages.a_f[c] * averages.a_f[c], 4);
    errors.push_back(error);
  }
  json["method"] = "quadrature over theta_o of the section's moments; ladder sums over one and three turns";
  json["seconds"] = seconds;
  output.write(finish_json(std::move(json), constants, context.command_line));
}

// ---- files of parameters

/// An object of a JSON file whose fields are read by name. What is left over is refused.
class Fields {
public:
  Fields(nlohmann::json object, std::string where) : object_(std::move(object)), where_(std::move(where)) {
    if (!object_.is_object()) throw InputError(where_ + "this must be an object such as {\"eta\": 1.55}");
  }

  double number(const char* name, double otherwise) {
    const nlohmann::json* const value = find(name);
    if (value == nullptr) return otherwise;
    if (!value->is_number()) wrong(name, " is not a number");
    return value->get<double>();
  }
  double degrees(const char* name, double otherwise) {
    return has(name) ? number(name, 0) * radians_per_degree : (known_.insert(name), otherwise);
  }
  Rgb rgb(const char* name, const Rgb& otherwise) {
    const nlohmann::json* const value = find(name);
    if (value == nullptr) return otherwise;
    if (value->is_number()) return {value->get<double>(), value->get<double>(), value->get<double>()};
    if (!value->is_array() || value->size() != 3 || !(*value)[0].is_number() || !(*value)[1].is_number() ||
        !(*value)[2].is_number())
      wrong(name, " is not three numbers such as [0.2, 0.3, 0.5], or one for all");
    return {(*value)[0].get<double>(), (*value)[1].get<double>(), (*value)[2].get<double>()};
  }
  bool flag(const char* name, bool otherwise) {
    const nlohmann::json* const value = find(name);
    if (value == nullptr) return otherwise;
    if (!value->is_boolean()) wrong(name, " is not true or false");
    return value->get<bool>();
  }
  std::string text(const char* name, const std::string& otherwise) {
    const nlohmann::json* const value = find(name);
    if (value == nullptr) return otherwise;
    if (!value->is_string()) wrong(name, " is not a text");
    return value->get<std::string>();
  }
  Fields object(const char* name) {
    const nlohmann::json* const value = find(name);
    if (value != nullptr && !value->is_object()) wrong(name, " is not an object");
    return {value == nullptr ? nlohmann::json::object() : *value, where_ + name + "."};
  }
  [[nodiscard]] bool has(const char* name) const { return object_.contains(name); }
  [[nodiscard]] const std::string& where() const { return where_; }

  /// Throws InputError for a field that nobody has asked for.
  void finish() const {
    for (const auto& [name, value] : object_.items()) {
      if (known_.contains(name)) continue;
      std::string list;
      for (const std::string& one : known_) list += (list.empty() ? "" : ", ") + one;
      throw InputError(where_ + quote(name) + " is no field; known are " + list);
    }
  }

private:
  const nlohmann::json* find(const char* name) {
    known_.insert(name);
    const auto found = object_.find(name);
    return found == object_.end() ? nullptr : &*found;
  }
  [[noreturn]] void wrong(const char* name, const char* what) const {
    throw InputError(
        where_ + name + ": " +
        quote(object_.at(name).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)) + what);
  }

  nlohmann::json object_;
  std::string where_;
  std::set<std::string> known_;
};

Fields read_parameters(const std::string& file) {
  std::ifstream stream(file);
  if (!stream) throw InputError("--params: " + quote(file) + " cannot be read");
  try {
    return {nlohmann::json::parse(stream), "--params: " + file + ": "};
  } catch (const nlohmann::json::exception& error) {
    const std::string message = error.what();
    const auto at = message.find("at line");
    throw InputError(
        "--params: " + quote(file) + " is no JSON: " + (at != message.npos ? message.substr(at) : message));
  } catch (const std::ios_base::failure&) { // a folder, for one
    throw InputError("--params: " + quote(file) + " cannot be read");
  }
}

Rgb read_absorption(Fields& fields, double eta) {
  const Rgb standard = fields.rgb("sigma_a", fiber::HairParameters{}.sigma_a);
  const Rgb colour = fields.rgb("colour", {}), share = fields.rgb("single_scattering", {});
  Fields melanin = fields.object("melanin");
  const double eumelanin = melanin.number("eumelanin", 0), pheomelanin = melanin.number("pheomelanin", 0);
  melanin.finish();
  std::string given;
  for (const char* const name : {"sigma_a", "colour", "single_scattering", "melanin"})
    if (fields.has(name)) {
      if (!given.empty())
        throw InputError(fields.where() + name + ": " + given + " says the absorption already; give one");
      given = name;
    }
  if (given == "colour") return named(fields.where(), [&] { return fiber::absorption_from_colour(colour); });
  if (given == "single_scattering")
    return named(fields.where() + "single_scattering: ", [&] {
      return fiber::absorption_from_single_scattering(share, eta);
    });
  if (given == "melanin")
    return named(melanin.where(), [&] { return fiber::absorption_from_melanin(eumelanin, pheomelanin); });
  return standard;
}

fiber::Highlight read_highlight(Fields fields, const fiber::Highlight& standard) {
  fiber::Highlight highlight;
  highlight.colour = fields.rgb("colour", standard.colour);
  highlight.intensity = fields.number("intensity", standard.intensity);
  highlight.shift = fields.degrees("shift_deg", standard.shift);
  highlight.width = fields.degrees("width_deg", standard.width);
  fields.finish();
  return highlight;
}

void read_artist(Fields& fields, fiber::ArtistHairParameters& p) {
  p.primary = read_highlight(fields.object("primary"), p.primary);
  p.transmission = read_highlight(fields.object("transmission"), p.transmission);
  p.secondary = read_highlight(fields.object("secondary"), p.secondary);
  p.transmission_azimuthal_width =
      fields.degrees("transmission_azimuthal_width_deg", p.transmission_azimuthal_width);
  p.glint_intensity = fields.number("glint_intensity", p.glint_intensity);
  p.glint_azimuthal_width = fields.degrees("glint_azimuthal_width_deg", p.glint_azimuthal_width);
  p.glint_half_angle = fields.degrees("glint_half_angle_deg", p.glint_half_angle);
  // Refuses what is out of range, with the field's name.
  named(fields.where(), [&] { return fiber::ArtistHair(p); });
}

fiber::DualScatteringOptions read_dual(Fields fields, Variant variant) {
  fiber::DualScatteringOptions options;
  options.variant = variant;
  options.d_f = fields.number("d_f", options.d_f);
  options.d_b = fields.number("d_b", options.d_b);
  fiber::MultipleAdjustments& adjust = options.adjustments;
  adjust.back_colour = fields.rgb("back_colour", adjust.back_colour);
  adjust.back_intensity = fields.number("back_intensity", adjust.back_intensity);
  adjust.back_shift = fields.degrees("back_shift_deg", 0);
  adjust.back_variance = fields.number("back_variance_deg2", 0) * radians_per_degree * radians_per_degree;
  adjust.forward_colour = fields.rgb("forward_colour", adjust.forward_colour);
  adjust.forward_intensity = fields.number("forward_intensity", adjust.forward_intensity);
  fields.finish();
  for (const auto& [name, value] : {std::pair{"d_f", options.d_f}, {"d_b", options.d_b}})
    if (!(value >= 0 && value <= 1))
      throw InputError(fields.where() + fmt::format("{}: {} is not between 0 and 1", name, value));
  return options;
}

// ---- hair and artist-hair

struct HairTexts {
  std::string params, directions, output = "-", strands, opacity = "1";
};

/// What a file of parameters describes.
struct Model {
  std::shared_ptr<const fiber::FiberScattering> single;
  std::shared_ptr<const fiber::LobedScattering> multiple;
  std::shared_ptr<const fiber::HairScattering> by_rays; ///< the single scattering, when it is that
  fiber::DualScatteringOptions dual;
  double narrowest = 1;      ///< of the single scattering's Gaussians [rad]
  double multiple_error = 0; ///< of multiple scattering's values themselves, relative
  std::string method;
  Constants constants;
};

/// Of single scattering, relative: the lobes' own 1e-12; what an arc sine's rounding, larger toward the
/// fibre's ends, does to a narrow Gaussian; caustics and rims of rays. R has neither where it is bright.
double single_error(const Model& model, const fiber::Angles& at) {
  const double cosine = std::min(std::cos(at.theta_i), std::cos(at.theta_o));
  const double narrow = std::max(model.narrowest * cosine, 1e-9);
  double error = 1e-12 + 2e-15 / (narrow * narrow);
  if (model.by_rays) {
    const fiber::RaySection section(model.by_rays->parameters().eta, 0);
    const double theta_d = std::clamp(at.theta_d(), -fiber::largest_theta_d, fiber::largest_theta_d);
    for (const int order : {1, 2}) error = std::max(error, section.error_estimate(order, theta_d, at.phi));
  }
  return std::min(error, 1.0);
}

Model read_hair(const std::string& file) {
  Fields fields = read_parameters(file);
  fiber::HairParameters p;
  p.eta = fields.number("eta", p.eta);
  if (!(p.eta > 1 && p.eta <= 10))
    throw InputError(fields.where() + fmt::format("eta: {} is not above 1 (and at most 10)", p.eta));
  p.sigma_a = read_absorption(fields, p.eta);
  p.shift = fields.degrees("shift_deg", p.shift);
  p.width = fields.degrees("width_deg", p.width);
  p.residual = fields.flag("residual", p.residual);
  const std::string variant = fields.text("variant", "corrected");
  p.variant = named(fields.where() + "variant: ", [&] { return parse_variant(variant); });
  Model model;
  model.dual = read_dual(fields.object("multiple_scattering"), p.variant);
  fields.finish();
  const auto hair = named(fields.where(), [&] { return std::make_shared<const fiber::HairScattering>(p); });
  model.single = hair;
  model.multiple = hair;
  model.by_rays = hair;
  model.narrowest = 0.5 * p.width; // TT's
  model.method = "lobes R, TT, TRT by rays through a smooth cylinder";
  if (p.residual) model.method += ", and a residual lobe";
  model.constants = {
      {"params", file},
      {"eta", fmt::format("{}", p.eta)},
      {"sigma_a", fmt::format("{} {} {}", p.sigma_a[0], p.sigma_a[1], p.sigma_a[2])},
      {"shift_deg", fmt::format("{:.12g}", p.shift / radians_per_degree)},
      {"width_deg", fmt::format("{:.12g}", p.width / radians_per_degree)},
      {"variant", variant}};
  return model;
}

Model read_artist_hair(const std::string& file) {
  Fields fields = read_parameters(file);
  fiber::ArtistHairParameters single;
  // A strand's own glint angle, unless the angle itself is given.
  const double strand = fields.number("strand", -1), seed = fields.number("seed", 0);
  for (const auto& [name, value] : {std::pair{"strand", strand}, {"seed", seed}})
    if (fields.has(name) && !(value >= 0 && value <= 9e15 && value == std::floor(value)))
      throw InputError(fields.where() + fmt::format("{}: {} is not a whole number from 0 on", name, value));
  if (strand >= 0)
    single.glint_half_angle =
        fiber::glint_half_angle_of(static_cast<std::uint64_t>(strand), static_cast<std::uint64_t>(seed));
  read_artist(fields, single);
  const std::string variant_name = fields.text("variant", "corrected");
  const Variant variant = named(fields.where() + "variant: ", [&] { return parse_variant(variant_name); });
  const std::string normalisation = fields.text("normalisation", "brightest");
  if (normalisation != "brightest" && normalisation != "each")
    throw InputError(
        fields.where() + "normalisation: " + quote(normalisation) + " is none; use brightest or each");
  Model model;
  model.dual = read_dual(fields.object("multiple_scattering"), variant);
  // Linked to the single scattering's set, field by field, until it says otherwise.
  fiber::ArtistHairParameters multiple = single;
  Fields other = fields.object("multiple");
  read_artist(other, multiple);
  other.finish();
  fields.finish();
  model.single = std::make_shared<const fiber::ArtistHair>(single, variant);
  model.multiple = std::make_shared<const fiber::NormalisedScattering>(
      std::make_shared<const fiber::ArtistHair>(multiple, variant),
      normalisation == "each" ? fiber::Normalisation::each : fiber::Normalisation::brightest);
  model.narrowest = std::min(
      {single.primary.width, single.transmission.width, single.secondary.width,
       single.transmission_azimuthal_width, single.glint_azimuthal_width});
  // NormalisedScattering says 1e-8 for widths of 2 deg and more; it interpolates between six nodes.
  const double width =
      std::min({multiple.primary.width, multiple.transmission.width, multiple.secondary.width});
  model.multiple_error = 1e-8 * std::pow(std::max(1.0, 2 * radians_per_degree / width), 6);
  model.method = "artists' lobes";
  model.constants = {
      {"params", file},
      {"variant", variant_name},
      {"normalisation", normalisation},
      {"glint_half_angle_deg", fmt::format("{:.12g}", single.glint_half_angle / radians_per_degree)}};
  return model;
}

void run_model(
    const HairTexts& texts, const Context& context, const char* verb,
    Model (*read_model)(const std::string&)) {
  const bool dual = !texts.strands.empty();
  double strands = 0;
  const double opacity = read("--opacity", texts.opacity, parse_number);
  if (!(opacity >= 0 && opacity <= 1))
    throw InputError("--opacity: " + quote(texts.opacity) + " is not between 0 and 1");
  if (dual) {
    strands = read("--strands", texts.strands, parse_number);
    if (!(strands >= 0 && strands <= 1e6))
      throw InputError("--strands: " + quote(texts.strands) + " is not a number from 0 to 1e6");
  }
  const Model model = read_model(texts.params);
  const DirectionPairs pairs = read_directions(texts.directions, verb);
  std::vector<fiber::Angles> angles;
  for (std::size_t i = 0; i < pairs.light.size(); ++i) {
    for (const auto& [name, w] : {std::pair{"light", &pairs.light[i]}, {"view", &pairs.view[i]}})
      if (std::hypot(w->y, w->z) < 1e-9)
        throw InputError(fmt::format(
            "--directions: {}: entry {} (counted from 0): {} lies along the fibre (theta = {} deg), where "
            "nothing falls on it",
            texts.directions, i, name, w->x > 0 ? 90 : -90));
    angles.push_back(fiber::angles(fiber::Frame{}, pairs.light[i], pairs.view[i]));
  }
  ExactOutput output(texts.output);

  double seconds = 0;
  auto start = std::chrono::steady_clock::now();
  std::vector<Rgb> values;
  std::vector<fiber::DualScattering::Parts> parts;
  if (dual) {
    const fiber::DualScattering shading(model.single, model.multiple, model.dual);
    for (const fiber::Angles& at : angles) {
      parts.push_back(shading.eval(at, shading.estimated(at.theta_i, opacity, strands)));
      values.push_back(parts.back().sum());
    }
  } else if (model.by_rays) {
    const std::size_t count = angles.size();
    std::vector<double> theta_i, theta_o, phi, found(3 * count);
    for (const fiber::Angles& at : angles) {
      theta_i.push_back(at.theta_i);
      theta_o.push_back(at.theta_o);
      phi.push_back(at.phi);
    }
    start = std::chrono::steady_clock::now();
    model.by_rays->eval(theta_i, theta_o, phi, found);
    seconds = seconds_since(start);
    for (std::size_t i = 0; i < count; ++i)
      values.push_back({found[i], found[count + i], found[2 * count + i]});
  } else {
    for (const fiber::Angles& at : angles) values.push_back(model.single->eval(at));
  }
  if (seconds == 0) seconds = seconds_since(start);
  spdlog::info("{} pairs of directions, {:.3g} s", values.size(), seconds);

  std::vector<double> errors;
  if (!output.is_csv())
    for (const fiber::Angles& at : angles) errors.push_back(single_error(model, at));
  if (dual && !output.is_csv()) {
    // Tables of half the nodes are worse by far, so that the difference bounds the error of the others; the
    // ladder sums add what they do in assemblies.
    fiber::DualScatteringOptions options = model.dual;
    options.nodes = options.nodes / 2 + 1;
    const fiber::DualScattering coarse(model.single, model.multiple, options);
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const fiber::Angles& at = angles[i];
      const Rgb other = coarse.eval(at, coarse.estimated(at.theta_i, opacity, strands)).sum();
      const Rgb a_f = coarse.table()(at.theta_i).a_f;
      double largest = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const double difference = std::abs(other[c] - values[i][c]);
        const double relative = difference > 0 ? difference / std::max(std::abs(values[i][c]), 1e-300) : 0;
        largest = std::max(largest, relative + 1e-9 / std::pow(1 - a_f[c] * a_f[c], 4));
      }
      errors[i] = std::min(1.0, errors[i] + model.multiple_error + largest);
    }
  }

  const std::string method = model.method + (dual ? "; dual scattering, times cos theta_i" : "");
  Constants constants = model.constants;
  if (dual) {
    constants.emplace_back("strands", texts.strands);
    constants.emplace_back("opacity", texts.opacity);
  }
  const auto degrees = [](double angle) { return angle / radians_per_degree; };
  if (output.is_csv()) {
    std::string text = "# " + method + "\n" + csv_provenance(constants, seconds, context.command_line) +
                       "theta_i_deg,theta_o_deg,phi_deg,red,green,blue\n";
    for (std::size_t i = 0; i < values.size(); ++i)
      text += fmt::format(
          "{},{},{},{},{},{}\n", degrees(angles[i].theta_i), degrees(angles[i].theta_o),
          degrees(angles[i].phi), values[i][0], values[i][1], values[i][2]);
    return output.write(text);
  }
  ordered_json json;
  const auto list = [&](const char* name, auto&& one) {
    auto& to = json[name] = ordered_json::array();
    for (std::size_t i = 0; i < values.size(); ++i) to.push_back(one(i));
  };
  list("theta_i_deg", [&](std::size_t i) { return degrees(angles[i].theta_i); });
  list("theta_o_deg", [&](std::size_t i) { return degrees(angles[i].theta_o); });
  list("phi_deg", [&](std::size_t i) { return degrees(angles[i].phi); });
  list("value", [&](std::size_t i) { return values[i]; });
  if (dual) {
    using Parts = fiber::DualScattering::Parts;
    for (const auto& [name, part] :
         {std::pair{"single", &Parts::single},
          {"back", &Parts::back},
          {"forward", &Parts::forward},
          {"forward_back", &Parts::forward_back}})
      list(name, [&, member = part](std::size_t i) { return parts[i].*member; });
  }
  json["error_estimate"] = errors;
  json["method"] = method;
  json["seconds"] = seconds;
  output.write(finish_json(std::move(json), constants, context.command_line));
}

void add_model(
    CLI::App& fiber, Context& context, const char* name, const char* description, const char* params,
    const std::string& footer, Model (*read_model)(const std::string&)) {
  CLI::App* const verb = fiber.add_subcommand(name, description);
  const auto texts = std::make_shared<HairTexts>();
  verb->add_option("--params", texts->params, params)->type_name("FILE")->group("Hair")->required();
  verb->add_option(
          "--directions", texts->directions,
          R"(JSON, [{"light": [x, y, z], "view": [x, y, z]}, ...]; - is standard input)")
      ->type_name("FILE")
      ->group("Directions")
      ->required();
  verb->add_option(
          "--strands", texts->strands,
          "Dual scattering with so many strands before this one, 0 or more, a real number: \"value\" is then "
          "F cos theta_i, with its parts beside")
      ->type_name("N")
      ->group("Multiple scattering");
  verb->add_option(
          "--opacity", texts->opacity,
          "Share of the light that those strands take, 0..1; the rest comes straight. n = opacity * strands "
          "[1]")
      ->type_name("X")
      ->group("Multiple scattering");
  verb->add_option("--output", texts->output, "FILE.json, FILE.csv or - (JSON to standard output) [-]")
      ->type_name("FILE")
      ->group("Output");
  verb->footer(footer);
  verb->callback([texts, &context, read_model, title = std::string("scatter fiber ") + name] {
    run_model(*texts, context, title.c_str(), read_model);
  });
}

constexpr const char* frame_footer = "Frame: the fibre along x, normal z; directions point away from it; "
                                     "along the fibre is refused. \"value\": "
                                     "f_s of red, green,\nblue [1/sr], without cosine: the radiance toward "
                                     "the view is the integral of f_s L cos "
                                     "theta_i.\n\"error_estimate\": of each value, "
                                     "relative, the worst colour's.\n";
constexpr const char* dual_footer =
    "multiple_scattering {d_f, d_b: density factors, 0..1 [0.7]; back_colour, back_intensity, "
    "back_shift_deg,\n"
    "  back_variance_deg2, forward_colour, forward_intensity: the artists' adjustments}.\n";

} // namespace

void add_fiber_hair(CLI::App& fiber, Context& context) {
  CLI::App* const assembly =
      fiber.add_subcommand("assembly", "Averages of an assembly of hair, for dual scattering");
  const auto texts = std::make_shared<AssemblyTexts>();
  const auto add = [&](const char* name, std::string& text, const char* type, const char* group,
                       const std::string& description) {
    assembly->add_option(name, text, description + " [" + text + "]")->type_name(type)->group(group);
  };
  add("--eta", texts->eta, "ETA", "Hair", "Index of refraction, above 1");
  add("--sigma-a", texts->sigma_a, "R,G,B", "Hair",
      "Absorption per radius, 0 or more; one number for all three");
  add("--shift", texts->shift, "ANGLE", "Hair", "Shift of R, -10deg to -5deg; TT has -1/2 of it, TRT -3/2");
  add("--width", texts->width, "ANGLE", "Hair",
      "Width of R, a standard deviation of theta_h, above 0deg, below 45deg; TT has half of it, TRT twice");
  assembly
      ->add_flag(
          "--residual", texts->residual, "Add the lobe of all orders from 3 on, with TRT's shift and width")
      ->group("Hair");
  add("--theta-i", texts->theta_i, "ANGLES", "Directions",
      "Inclinations of the light, between -90deg and 90deg, both excluded");
  add("--variant", texts->variant, "NAME", "Method",
      "corrected, or printed: the dissertation's formulas to the letter, with twice the energy");
  add("--output", texts->output, "FILE", "Output", "FILE.json, FILE.csv or - (JSON to standard output)");
  assembly->footer(
      "a_f, a_b: energy that a strand sends on and back (weights |phi|/pi and 1 - |phi|/pi; a_f at most 1 - "
      "1e-4); A_b: energy\nthat parallel strands send back after one and three turns; alpha, beta: mean "
      "shifts "
      "and widths; Delta_b, sigma_b: of\nthe light that comes back. Angles of theta_h, in degrees. "
      "error_estimate: absolute, of A_b, "
      "Delta_b and sigma_b (angles in\nradians) per colour; of the others it is 1e-9.\n"
      "Example: scatter fiber assembly --sigma-a 0.2,0.3,0.5 --theta-i -60:60:30deg");
  assembly->callback([texts, &context] { run_assembly(*texts, context); });

  add_model(
      fiber, context, "hair", "Hair by rays: R, TT, TRT and a residual lobe",
      R"(JSON, such as {"eta": 1.55, "sigma_a": [0.2, 0.3, 0.5], "shift_deg": -5, "width_deg": 7.5})",
      std::string(
          "Fields, all optional: eta [1.55]; sigma_a: absorption per radius [0.2, 0.3, 0.5], or instead ") +
          "melanin {eumelanin,\npheomelanin: concentrations}, or colour [r, g, b]: after many scatterings, "
          "or "
          "single_scattering [r, g, b]: share of light\nthat one strand scatters; shift_deg, width_deg: of R "
          "[-5, 7.5]; residual [true]; variant: corrected or printed;\n" +
          dual_footer + frame_footer +
          "Example: scatter fiber hair --params blond.json --directions pairs.json",
      read_hair);
  add_model(
      fiber, context, "artist-hair", "Hair with artists' controls",
      R"(JSON, such as {"primary": {"intensity": 0.1}, "transmission": {"colour": [0.8, 0.6, 0.4]}})",
      std::string(
          "Fields, all optional (in brackets the artists' names): primary [specular], transmission, "
          "secondary [subspecular]:\n"
          "each {colour, intensity [scale], shift_deg [angular offset], width_deg [roughness]}; "
          "transmission_azimuthal_width_deg\n[spread]; glint_intensity, glint_azimuthal_width_deg, "
          "glint_half_angle_deg, or instead of the last strand and seed, whole\nnumbers: 30..45 deg "
          "drawn for that strand; variant: corrected or printed; normalisation for multiple "
          "scattering:\nbrightest or each; multiple: another set of the same, linked field by field to "
          "the first until given;\n") +
          dual_footer + frame_footer +
          "Example: scatter fiber artist-hair --params blond.json --directions pairs.json --strands 5",
      read_artist_hair);
}

} // namespace scatter::app
