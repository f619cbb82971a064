// `scatter plot --cloth`: polar plots of fabrics and threads in the plane of incidence, as in the
// dissertation's figures 5.20 and 5.29.
#include "cloth_plot.hpp"

#include "option_readers.hpp"
#include <scatter/fiber/fabric.hpp>
#include <scatter/fiber/thread.hpp>
#include <scatter/fiber/weave.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/scene/plot.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace scatter::app {
namespace {

constexpr const char* group = "Cloth";
/// Of the palette of all plots, those nearest to red, green and blue.
constexpr const char* colours[] = {"#D55E00", "#009E73", "#0072B2"};
constexpr const char* colour_names[] = {"red", "green", "blue"};

glm::dvec3 direction(double angle_deg, double plane_deg) {
  const double t = angle_deg * radians_per_degree, a = plane_deg * radians_per_degree;
  return {std::sin(t) * std::cos(a), std::sin(t) * std::sin(a), std::cos(t)};
}

} // namespace

void add_cloth_plot_options(CLI::App& verb, ClothPlotTexts& texts) {
  const auto add = [&](const char* name, auto& text, const char* type, const std::string& description) {
    verb.add_option(name, text, description)->type_name(type)->group(group);
  };
  add("--cloth", texts.cloth, "NAME|FILE",
      "Draw how a fabric reflects in the plane of incidence, one half disc per direction of the light; names "
      "and files as for scatter fiber cloth");
  add("--thread", texts.thread, "N", "Draw f_s of thread N (from 1) alone instead of the cloth's BRDF");
  add("--light", texts.light, "ANGLES",
      "Directions of the light from the normal, -89deg to 89deg, up to four; positive is left [" +
          texts.light + "]");
  add("--plane", texts.plane, "ANGLE", "Azimuth of the plane, 0deg along thread 1 [" + texts.plane + "]");
  add("--samples", texts.samples, "N", "Samples of every tangent curve [" + texts.samples + "]");
}

void run_cloth_plot(const ClothPlotTexts& texts, int width, const std::string& output) {
  static_cast<void>(scene::picture_format(output));
  if (width < 300 || width > 10000)
    throw InputError(fmt::format("--width {}: a picture has 300 to 10000 pixels across", width));
  const fiber::Fabric fabric = read("--cloth", *texts.cloth, fiber::load_fabric);
  const std::vector<double> lights = read("--light", texts.light, parse_angles_deg);
  if (lights.size() > 4)
    throw InputError(fmt::format("--light: {} angles; a picture has room for four", lights.size()));
  for (const double angle : lights)
    if (!(std::abs(angle) <= 89))
      throw InputError(fmt::format("--light: {} deg is outside -89deg..89deg", angle));
  const double plane = read("--plane", texts.plane, parse_angle_deg);
  const int samples = static_cast<int>(whole_number("--samples", texts.samples, 1, 100000));
  std::optional<std::size_t> thread;
  if (texts.thread)
    thread = static_cast<std::size_t>(
        whole_number("--thread", *texts.thread, 1, static_cast<long>(fabric.weave.threads.size())) - 1);

  scene::HalfDiscPlot plot;
  plot.title = fabric.description.empty() ? fabric.name : fabric.description;
  if (thread) plot.title += fmt::format(", thread {} alone", *thread + 1);
  if (!thread && plane != 0) plot.title += fmt::format(", plane at {:.6g}° from thread 1", plane);
  plot.radius_label =
      std::string(thread ? "f_s" : "BRDF") + " (sr⁻¹); dashed: energy-true surface; orange: the light";
  plot.width = width;
  // Lights on the left, as the dissertation has them. A thread grows without bound toward its end: views to
  // 84 deg, as far as the dissertation measured.
  std::vector<glm::dvec3> views;
  std::vector<double> angles;
  const int last = thread ? 168 : 178;
  for (int k = -last; k <= last; ++k) {
    angles.push_back(0.5 * k);
    views.push_back(direction(angles.back(), plane));
  }
  const auto values_of = [&](fiber::SurfaceLobe lobe, const glm::dvec3& light) {
    std::vector<fiber::Rgb> values(views.size());
    if (thread) {
      const fiber::Thread alone(fabric.weave.threads[*thread].thread, lobe);
      for (std::size_t k = 0; k < views.size(); ++k)
        values[k] = alone.eval(fiber::thread_angles(fiber::Frame{}, light, views[k]));
      return values;
    }
    const fiber::Cloth cloth(fabric.weave, samples, lobe);
    cloth.eval(std::vector<glm::dvec3>(views.size(), light), views, values);
    for (fiber::Rgb& value : values)
      for (double& channel : value) channel /= light.z;
    return values;
  };
  for (const double light : lights) {
    scene::HalfDiscPlot::Panel panel;
    panel.label = fmt::format("light at {:.6g}°", light);
    panel.mark = -light;
    for (const auto lobe : {fiber::SurfaceLobe::printed, fiber::SurfaceLobe::energy_true}) {
      const std::vector<fiber::Rgb> values = values_of(lobe, direction(-light, plane));
      const bool printed = lobe == fiber::SurfaceLobe::printed;
      for (std::size_t channel = 0; channel < 3; ++channel) {
        scene::Curve curve;
        curve.x = angles;
        for (const fiber::Rgb& value : values) curve.y.push_back(value[channel]);
        curve.colour = colours[channel];
        curve.dashed = !printed;
        if (printed) curve.label = colour_names[channel];
        panel.curves.push_back(std::move(curve));
      }
    }
    plot.panels.push_back(std::move(panel));
  }
  const auto is_dark = [](const scene::HalfDiscPlot::Panel& panel) {
    return std::ranges::all_of(panel.curves, [](const scene::Curve& curve) {
      return std::ranges::all_of(curve.y, [](double y) { return y == 0; });
    });
  };
  if (std::ranges::all_of(plot.panels, is_dark))
    throw InputError("--cloth: " + quote(fabric.name) + " sends no light into this plane: nothing to draw");
  scene::write_plot(output, plot);
}

} // namespace scatter::app
