#include "azimuthal_plot.hpp"

#include "option_readers.hpp"
#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/scene/plot.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

namespace scatter::app {
namespace {

constexpr const char* group = "Azimuthal figure";

/// One to three absorptions; three are those of red, green and blue.
std::vector<double> parse_absorptions(const std::string& text) {
  std::vector<double> list;
  std::size_t from = 0;
  while (from <= text.size()) {
    const std::size_t comma = std::min(text.find(',', from), text.size());
    const double value = parse_number(text.substr(from, comma - from));
    if (!(value >= 0)) throw InputError(quote(text) + " holds a negative absorption; it is 0 or more");
    list.push_back(value);
    from = comma + 1;
  }
  if (list.size() != 1 && list.size() != 3)
    throw InputError(
        quote(text) + " holds " + std::to_string(list.size()) +
        " absorptions; give one, or three for red, green and blue");
  return list;
}

std::string name_of(int order) {
  std::string name = order == 0 ? "R" : "T";
  for (int p = 1; p < order; ++p) name += "R";
  return order == 0 ? name : order > 4 ? fmt::format("order {}", order) : name + "T";
}

} // namespace

void add_azimuthal_options(CLI::App& verb, AzimuthalTexts& texts) {
  verb.add_flag("--azimuthal", texts.wanted, "What a smooth fibre sends around its axis, order by order")
      ->group(group);
  verb.add_flag("--polar", texts.polar, "Draw it around the fibre, the light from above")->group(group);
  const auto add = [&](const char* name, std::string& text, const char* type,
                       const std::string& description) {
    verb.add_option(name, text, description + " [" + text + "]")->type_name(type)->group(group);
  };
  add("--eta", texts.eta, "INDEX", "Index of the fibre over its surroundings', greater than 1");
  add("--sigma-a", texts.sigma_a, "NUMBERS",
      "Absorption per radius: one number, or three for red, green and blue");
  add("--theta-d", texts.theta_d, "ANGLE", "Half the difference of the inclinations of view and light");
  add("--fiber-orders", texts.orders, "ORDERS", "0 is R, 1 TT, 2 TRT, and on");
  add("--average", texts.average, "ANGLE",
      "Standard deviation of a Gaussian average over azimuth, 0deg (none) or 0.1deg to 90deg");
}

void run_azimuthal(const AzimuthalTexts& texts, int width, int height, const std::string& output) {
  const scene::PictureFormat format = scene::picture_format(output);
  static_cast<void>(format);
  const double eta = read("--eta", texts.eta, parse_number);
  if (!(eta > 1))
    throw InputError("--eta: " + quote(texts.eta) + " is not greater than 1; use a number such as 1.55");
  const std::vector<double> sigma_a = read("--sigma-a", texts.sigma_a, parse_absorptions);
  const double theta_d_deg = read("--theta-d", texts.theta_d, parse_angle_deg),
               theta_d = theta_d_deg * radians_per_degree;
  if (!(std::abs(theta_d_deg) < 90) || !(std::abs(theta_d) < pi / 2))
    throw InputError("--theta-d: " + quote(texts.theta_d) + " is not between -90deg and 90deg");
  const std::vector<int> orders = read("--fiber-orders", texts.orders, parse_orders);
  if (orders.size() > 7 || orders.back() > 20)
    throw InputError(
        "--fiber-orders: " + quote(texts.orders) + " are more than a picture shows; up to seven, from 0..20");
  const double average_deg = read("--average", texts.average, parse_angle_deg);
  if (average_deg != 0 && !(average_deg >= 0.1 && average_deg <= 90))
    throw InputError("--average: " + quote(texts.average) + " is neither 0deg nor within 0.1deg..90deg");

  std::vector<scene::Curve> curves;
  constexpr std::array<const char*, 3> channel{"#c0392b", "#2e8b57", "#2c5faa"};
  for (const int order : orders) {
    // Reflection outside knows no absorption.
    const std::size_t colours = order == 0 ? 1 : sigma_a.size();
    for (std::size_t k = 0; k < colours; ++k) {
      const fiber::RaySection section(eta, sigma_a[k]);
      scene::Curve curve;
      curve.label = name_of(order);
      if (colours == 3) {
        curve.label += fmt::format(", σ = {:g}", sigma_a[k]);
        curve.colour = channel[k];
      } else if (order == 0) {
        curve.colour = "#777777";
        curve.width = 2.2;
      }
      if (order > 1) curve.width = 2.2; // the glints, small beside TT
      for (double phi = -180; phi <= 180; phi += 0.25) {
        const double angle = phi * radians_per_degree;
        curve.x.push_back(phi);
        curve.y.push_back(
            average_deg > 0 ? section.averaged(order, theta_d, angle, average_deg * radians_per_degree)
                            : section.distribution(order, theta_d, angle));
      }
      curves.push_back(std::move(curve));
    }
  }
  // Where an order sends nothing to speak of there is no line along the axis.
  double largest = 0;
  for (const scene::Curve& curve : curves)
    for (const double N : curve.y) largest = std::isfinite(N) ? std::max(largest, N) : largest;
  for (scene::Curve& curve : curves)
    for (double& N : curve.y)
      if (N < 1e-4 * largest) N = std::numeric_limits<double>::quiet_NaN();
  std::string title = fmt::format("Around a fibre of η = {:g}, θd = {:g}°", eta, theta_d_deg);
  if (sigma_a.size() == 1) title += fmt::format(", σ = {:g} per radius", sigma_a[0]);
  if (average_deg > 0) title += fmt::format(", averaged over {:g}°", average_deg);
  if (texts.polar) {
    scene::PolarPlot plot;
    plot.title = title;
    plot.curves = std::move(curves);
    plot.width = width;
    plot.height = height;
    scene::write_plot(output, plot);
    return;
  }
  scene::Plot plot;
  plot.title = title;
  plot.x_label = "azimuth φ: 0° back toward the light, 180° straight on";
  plot.y_label = "N (1/rad)";
  plot.x_range = {{-180, 180}};
  plot.curves = std::move(curves);
  plot.width = width;
  plot.height = height;
  scene::write_plot(output, plot);
}

} // namespace scatter::app
