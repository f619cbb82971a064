#include "cases.hpp"
#include "strand_assembly.hpp"
#include <scatter/fiber/hair.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <memory>

namespace scatter::validation {
namespace {

using fiber::Rgb;

/// Seen from above at right angles to the strands; the light around them at this azimuth from the eye, and at
/// this inclination.
struct Lighting {
  const char* name;
  double azimuth_deg, inclination_deg;
};
constexpr Lighting lightings[] = {
    {"front", 20, 10}, {"side", 75, 10}, {"behind", 165, 10}, {"front, along", 20, 45}};

glm::dvec3 direction(const Lighting& light) {
  const double phi = light.azimuth_deg * radians_per_degree,
               theta = light.inclination_deg * radians_per_degree;
  return {std::sin(theta), std::cos(theta) * std::sin(phi), std::cos(theta) * std::cos(phi)};
}

std::string signed_percent(double ratio) {
  return fmt::format("{:+.0f} %", 100 * (ratio - 1));
}

} // namespace

CaseReport run_fiber_dual(const Settings& settings, const Progress& progress) {
  using Clock = std::chrono::steady_clock;
  CaseReport report;
  report.name = "fiber-dual";
  report.title = "Dual scattering against random walks among strands";
  const int paths = settings.quick ? 500 : 10'000;

  fiber::HairParameters parameters;
  parameters.sigma_a = {0.03, 0.2, 1.0};
  const char* const shades[] = {"blond", "brown", "dark"};
  const auto hair = std::make_shared<const fiber::HairScattering>(parameters);
  const auto before = Clock::now();
  const fiber::DualScattering corrected(hair, hair);
  const double table_seconds = std::chrono::duration<double>(Clock::now() - before).count();
  fiber::DualScatteringOptions conserving_options;
  conserving_options.back_energy = fiber::BackEnergy::conserved;
  const fiber::DualScattering conserving(hair, hair, conserving_options);
  parameters.variant = fiber::Variant::printed;
  const auto printed_hair = std::make_shared<const fiber::HairScattering>(parameters);
  fiber::DualScatteringOptions printed_options;
  printed_options.variant = fiber::Variant::printed;
  const fiber::DualScattering printed(printed_hair, printed_hair, printed_options);

  struct Geometry {
    const char* name;
    double tangle_deg;
  };
  constexpr Geometry geometries[] = {{"parallel", 0}, {"tangled", 15}};
  Table table{
      "Mean radiance of the strands that a camera above a slab sees first, of light of irradiance 1; "
      "standard "
      "errors in brackets. Strands: mean number between them and the light. Dual scattering's relative "
      "error: with "
      "strands counted along the ray; with the same number as a shadow's opacity tells it; with as much "
      "light from f_back "
      "as the ladder sums send back, a quarter; and as printed.",
      {"strands", "light", "hair", "before", "random walk", "scattered once", "dual", "by opacity",
       "printed"},
      {}};
  report.numbers["paths"] = paths;
  report.numbers["rows"] = nlohmann::ordered_json::array();
  double walk_seconds = 0, dual_seconds = 0, worst_statistical = 0;
  double sum_log = 0, sum_log_conserved = 0, sum_log_printed = 0;
  int rows = 0, rows_printed = 0, done = 0;
  for (const Geometry& geometry : geometries) {
    SlabParameters slab_parameters;
    slab_parameters.tangle_deg = geometry.tangle_deg;
    const StrandAssembly slab(slab_parameters);
    for (const Lighting& light : lightings) {
      const glm::dvec3 to_light = direction(light), to_eye(0, 0, 1);
      const Seen truth = walk(slab, *hair, to_light, to_eye, paths, settings.threads);
      const Seen counted = dual(slab, corrected, to_light, to_eye, paths, Count::exact, settings.threads);
      const Seen opacity = dual(slab, corrected, to_light, to_eye, paths, Count::opacity, settings.threads);
      const Seen conserved = dual(slab, conserving, to_light, to_eye, paths, Count::exact, settings.threads);
      const Seen as_printed = dual(slab, printed, to_light, to_eye, paths, Count::exact, settings.threads);
      walk_seconds += truth.seconds / paths;
      dual_seconds += counted.seconds / paths;
      for (std::size_t c = 0; c < 3; ++c) {
        table.rows.push_back(
            {geometry.name, light.name, shades[c], fmt::format("{:.1f}", truth.strands_before),
             fmt::format("{:.4g} ({:.1g})", truth.mean[c], truth.error[c]),
             fmt::format("{:.4g}", truth.single[c]), signed_percent(counted.mean[c] / truth.mean[c]),
             signed_percent(opacity.mean[c] / truth.mean[c]),
             signed_percent(conserved.mean[c] / truth.mean[c]),
             signed_percent(as_printed.mean[c] / truth.mean[c])});
        report.numbers["rows"].push_back(
            {{"strands", geometry.name},
             {"light", light.name},
             {"azimuth_deg", light.azimuth_deg},
             {"inclination_deg", light.inclination_deg},
             {"sigma_a", hair->parameters().sigma_a[c]},
             {"strands_before", truth.strands_before},
             {"walk", truth.mean[c]},
             {"standard_error", truth.error[c]},
             {"single", truth.single[c]},
             {"dual", counted.mean[c]},
             {"dual_single", counted.single[c]},
             {"dual_by_opacity", opacity.mean[c]},
             {"dual_energy_conserved", conserved.mean[c]},
             {"dual_printed", as_printed.mean[c]}});
        worst_statistical = std::max(worst_statistical, truth.error[c] / truth.mean[c]);
        sum_log += std::abs(std::log(counted.mean[c] / truth.mean[c]));
        sum_log_conserved += std::abs(std::log(conserved.mean[c] / truth.mean[c]));
        if (as_printed.mean[c] > 0) {
          sum_log_printed += std::abs(std::log(as_printed.mean[c] / truth.mean[c]));
          ++rows_printed;
        }
        ++rows;
      }
      progress(static_cast<double>(++done) / (std::size(geometries) * std::size(lightings)));
    }
  }
  const double mean_factor = std::exp(sum_log / rows),
               mean_factor_conserved = std::exp(sum_log_conserved / rows),
               mean_factor_printed = std::exp(sum_log_printed / std::max(rows_printed, 1));
  walk_seconds /= done;
  dual_seconds /= done;

  report.blocks.emplace_back(Paragraph{fmt::format(
      "A slab of strands of radius 1, 80 thick, 15 % of its volume filled, seen from above at right angles "
      "to the "
      "strands: parallel, and tangled by 15 deg. The light stands in front (20 deg from the eye around the "
      "strands), "
      "to the side (75 deg) or behind the slab (165 deg), inclined by 10 or 45 deg along them. The reference "
      "traces "
      "{} paths per light among Embree's curves and scatters them by the same function that dual scattering "
      "averages, so that what differs is dual scattering alone.",
      paths)});
  report.blocks.emplace_back(std::move(table));
  report.blocks.emplace_back(Paragraph{fmt::format(
      "Time per seen point, all threads together: random walk {:.3g} us, dual scattering {:.3g} us, most of "
      "it the "
      "count of strands; its tables take {:.2g} s once.",
      1e6 * walk_seconds, 1e6 * dual_seconds, table_seconds)});
  report.numbers["mean_factor"] = mean_factor;
  report.numbers["mean_factor_energy_conserved"] = mean_factor_conserved;
  report.numbers["mean_factor_printed"] = mean_factor_printed;
  report.numbers["walk_seconds_per_point"] = walk_seconds;
  report.numbers["dual_seconds_per_point"] = dual_seconds;
  report.numbers["table_seconds"] = table_seconds;
  report.findings.push_back(fmt::format(
      "Dual scattering is within a factor of {:.2f} (geometric mean) of random walks among strands, and of "
      "{:.2f} when its backscattering carries the energy of the ladder sums; as printed of {:.2f}, and below "
      "zero in {} of {} rows. It takes {:.0f} % of the time per point.",
      mean_factor, mean_factor_conserved, mean_factor_printed, rows - rows_printed, rows,
      100 * dual_seconds / walk_seconds));
  report.checks.push_back(
      {"random walk's standard error, largest of all rows", worst_statistical, settings.quick ? 0.6 : 0.15,
       "of 1"});
  report.checks.push_back({"mean factor, default", mean_factor, settings.quick ? 4.0 : 3.0, ""});
  report.checks.push_back(
      {"mean factor with f_back's energy conserved", mean_factor_conserved, settings.quick ? 3.0 : 2.2, ""});
  report.checks.push_back(
      {"mean factor corrected over mean factor printed", mean_factor / mean_factor_printed, 1, ""});
  return report;
}

} // namespace scatter::validation
