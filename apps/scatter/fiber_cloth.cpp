#include "directions.hpp"
#include "exact_options.hpp"
#include "fiber.hpp"
#include <scatter/fiber/fabric.hpp>
#include <scatter/fiber/thread.hpp>
#include <scatter/fiber/weave.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace scatter::app {
namespace {

using fiber::Rgb;

/// The options as typed.
struct Texts {
  std::string fabric, params, directions, samples = "64", variant = "printed", family_masking = "none",
                                          output = "-";
};

/// What both verbs write.
struct Result {
  std::string method;
  std::vector<std::string> columns;        ///< of the CSV file, beside directions and colours
  std::vector<std::vector<double>> beside; ///< their values
  std::vector<Rgb> values;
  std::vector<double> errors; ///< of the values, relative
  double seconds = 0;
};

/// The library's accuracy holds where no tangent is within 0.1 deg of a direction; nearer, the squares of
/// cosines that formulas divide by lose digits.
double beside_tangent(double accuracy, double distance) {
  const double nearer = std::max(1.0, 0.1 * radians_per_degree / std::max(distance, 1e-12));
  return std::min(1.0, accuracy * nearer * nearer);
}

/// Angle [rad] between a direction and the nearest of the cloth's sampled tangents, either way; at most 1.
double to_tangents(const fiber::Cloth& cloth, const glm::dvec3& w) {
  double nearest = 1;
  for (const fiber::Cloth::Strand& strand : cloth.strands())
    for (const fiber::Cloth::Tangent& tangent : strand.tangents) {
      const glm::dvec3 t(
          tangent.cos_offset * strand.cos_direction, tangent.cos_offset * strand.sin_direction,
          tangent.sin_offset);
      // The cross product only where it matters.
      if (std::abs(glm::dot(t, w)) > 0.9999) nearest = std::min(nearest, glm::length(glm::cross(t, w)));
    }
  return nearest;
}

void write(
    ExactOutput& output, nlohmann::ordered_json json, const DirectionPairs& pairs, const Result& result,
    const Constants& constants, const std::string& command) {
  if (!output.is_csv()) {
    for (std::size_t k = 0; k < result.columns.size(); ++k) json[result.columns[k]] = result.beside[k];
    auto list = nlohmann::ordered_json::array();
    for (const Rgb& value : result.values) list.push_back({value[0], value[1], value[2]});
    json["value"] = std::move(list);
    json["error_estimate"] = result.errors;
    json["method"] = result.method;
    json["seconds"] = result.seconds;
    return output.write(finish_json(std::move(json), constants, command));
  }
  std::string text = "# " + result.method + "\n" + csv_provenance(constants, result.seconds, command);
  text += "light_x,light_y,light_z,view_x,view_y,view_z";
  for (const std::string& column : result.columns) text += "," + column;
  text += ",red,green,blue\n";
  for (std::size_t k = 0; k < result.values.size(); ++k) {
    const auto &i = pairs.light[k], &r = pairs.view[k];
    text += fmt::format("{},{},{},{},{},{}", i.x, i.y, i.z, r.x, r.y, r.z);
    for (const auto& column : result.beside) text += fmt::format(",{}", column[k]);
    for (const double value : result.values[k]) text += fmt::format(",{}", value);
    text += "\n";
  }
  output.write(text);
}

void run_cloth(const Texts& texts, const Context& context) {
  const int samples = static_cast<int>(whole_number("--samples", texts.samples, 1, 100000));
  const auto lobe = read("--variant", texts.variant, fiber::parse_surface_lobe);
  const auto masking = read("--family-masking", texts.family_masking, fiber::parse_family_masking);
  const fiber::Fabric fabric = read("--fabric", texts.fabric, fiber::load_fabric);
  const DirectionPairs pairs = read_directions(texts.directions, "scatter fiber cloth");
  ExactOutput output(texts.output);

  const fiber::Cloth cloth(fabric.weave, samples, lobe, masking);
  const auto start = std::chrono::steady_clock::now();
  Result result;
  result.values.resize(pairs.light.size());
  cloth.eval(pairs.light, pairs.view, result.values);
  result.columns = {"gap"};
  result.beside.resize(1);
  for (const glm::dvec3& view : pairs.view) result.beside[0].push_back(cloth.open(view));
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (std::size_t k = 0; k < pairs.light.size(); ++k)
    result.errors.push_back(beside_tangent(
        2e-12, std::min(to_tangents(cloth, pairs.light[k]), to_tangents(cloth, pairs.view[k]))));
  result.method = "threads along tangent curves, masked and reweighted";
  spdlog::info(
      "{}: {} threads, {} samples each, {} pairs of directions, {:.3g} s", fabric.name,
      cloth.threads().size(), samples, pairs.light.size(), result.seconds);
  nlohmann::ordered_json json;
  json["fabric"] = fabric.name;
  json["variant"] = texts.variant;
  json["family_masking"] = texts.family_masking;
  json["samples"] = samples;
  Constants constants{
      {"fabric", fabric.name},
      {"source", fabric.source},
      {"variant", texts.variant},
      {"family_masking", texts.family_masking},
      {"samples", fmt::format("{}", samples)},
      {"masking_deg", fmt::format("{:.12g}", fabric.weave.masking_width / radians_per_degree)}};
  write(output, std::move(json), pairs, result, constants, context.command_line);
}

void run_thread(const Texts& texts, const Context& context) {
  const auto lobe = read("--variant", texts.variant, fiber::parse_surface_lobe);
  const fiber::ThreadParameters parameters = read("--params", texts.params, fiber::load_thread);
  const DirectionPairs pairs = read_directions(texts.directions, "scatter fiber thread");
  ExactOutput output(texts.output);

  const fiber::Thread thread(parameters, lobe);
  const auto start = std::chrono::steady_clock::now();
  Result result;
  result.columns = {"theta_i_deg", "theta_o_deg", "phi_deg"};
  result.beside.resize(3);
  for (std::size_t k = 0; k < pairs.light.size(); ++k) {
    const fiber::Angles at = fiber::thread_angles(fiber::Frame{}, pairs.light[k], pairs.view[k]);
    result.values.push_back(thread.eval(at));
    const double angles[] = {at.theta_i, at.theta_o, at.phi};
    for (std::size_t a = 0; a < 3; ++a) result.beside[a].push_back(angles[a] / radians_per_degree);
    const double steeper = std::max(std::abs(at.theta_i), std::abs(at.theta_o));
    result.errors.push_back(beside_tangent(1e-12, pi / 2 - steeper));
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.method = "one thread: surface and volume lobe";
  nlohmann::ordered_json json;
  json["variant"] = texts.variant;
  const auto degrees = [](double angle) { return fmt::format("{:.12g}", angle / radians_per_degree); };
  const Constants constants{
      {"params", texts.params},
      {"variant", texts.variant},
      {"eta", fmt::format("{}", parameters.eta)},
      {"kd", fmt::format("{}", parameters.kd)},
      {"gamma_s_deg", degrees(parameters.gamma_s)},
      {"gamma_v_deg", degrees(parameters.gamma_v)},
      {"albedo", fmt::format("{} {} {}", parameters.albedo.x, parameters.albedo.y, parameters.albedo.z)}};
  write(output, std::move(json), pairs, result, constants, context.command_line);
}

void add_shared(CLI::App& verb, Texts& texts) {
  verb.add_option(
          "--directions", texts.directions,
          R"(JSON, [{"light": [x, y, z], "view": [x, y, z]}, ...]; - is standard input)")
      ->type_name("FILE")
      ->group("Directions")
      ->required();
  verb.add_option(
          "--variant", texts.variant,
          "Surface lobe: printed, as in the dissertation, or energy-true, that of a smooth cylinder, an "
          "eighth "
          "of it [printed]")
      ->type_name("NAME")
      ->group("Method");
  verb.add_option("--output", texts.output, "FILE.json, FILE.csv or - (JSON to standard output) [-]")
      ->type_name("FILE")
      ->group("Output");
}

} // namespace

void add_fiber_cloth(CLI::App& fiber, Context& context) {
  std::string names;
  for (const std::string& name : fiber::fabric_names()) names += (names.empty() ? "" : ", ") + name;

  CLI::App* const cloth = fiber.add_subcommand("cloth", "A fabric: what it sends of light toward the eye");
  const auto texts = std::make_shared<Texts>();
  cloth
      ->add_option(
          "--fabric", texts->fabric, "A file in the form of tables/fabrics/*.json, or one of " + names)
      ->type_name("NAME|FILE")
      ->group("Cloth")
      ->required();
  add_shared(*cloth, *texts);
  cloth->add_option("--samples", texts->samples, "Samples of every tangent curve, 1 to 100000 [64]")
      ->type_name("N")
      ->group("Method");
  cloth
      ->add_option(
          "--family-masking", texts->family_masking,
          "Whether threads of one direction hide those of another: none, as in the dissertation, or crowns "
          "[none]")
      ->type_name("NAME")
      ->group("Method");
  cloth->footer("Frame: thread 1 along x, thread 2 along y, normal z; directions point away from the cloth. "
                "\"value\": red, "
                "green,\nblue; times radiance and solid angle of the light it is the radiance toward the "
                "view (the cosine is "
                "in it).\n\"gap\" is the share of what is behind the cloth that the view sees.\nIt is 0 for "
                "light or view at or below the cloth (z <= 0). \"error_estimate\": "
                "relative, for the number of samples given.\n"
                "Example: scatter fiber cloth --fabric polyester-satin-front --directions pairs.json");
  cloth->callback([texts, &context] { run_cloth(*texts, context); });

  CLI::App* const thread = fiber.add_subcommand("thread", "One thread of a fabric, straight and alone");
  const auto alone = std::make_shared<Texts>();
  thread
      ->add_option(
          "--params", alone->params,
          R"(JSON, such as {"eta": 1.46, "kd": 0.3, "gamma_s_deg": 12, "gamma_v_deg": 24, "albedo": [0.2, 0.8, 1], "albedo_scale": 0.3})")
      ->type_name("FILE")
      ->group("Thread")
      ->required();
  add_shared(*thread, *alone);
  thread->footer(
      "eta: refractive index; kd: isotropic share of the volume's light, 0..1; gamma_s_deg, gamma_v_deg: "
      "standard "
      "deviations\nof the surface's and the volume's Gaussian in theta_h, above 0, below 90; albedo: of red, "
      "green, "
      "blue, times\nalbedo_scale, which may be left out.\n"
      "Frame: the thread along x, normal z; directions point away from it. \"value\": f_s of red, green, "
      "blue "
      "[1/sr], without\ncosine: the radiance toward the view is the integral of f_s L cos theta_i. "
      "\"error_estimate\": relative.\n"
      "Example: scatter fiber thread --params silk.json --directions pairs.json");
  thread->callback([alone, &context] { run_thread(*alone, context); });
}

} // namespace scatter::app
