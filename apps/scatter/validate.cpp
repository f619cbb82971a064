// scatter validate: runs validation cases and writes a report.
#include "option_readers.hpp"
#include "verbs.hpp"
#include <scatter/compute/device.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/optics/version.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>
#include <validation/cases.hpp>
#include <validation/report.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace scatter::app {
namespace {

/// The options as typed.
struct Texts {
  std::string cases, index = "iapws", output = "validation-report", threads = "0";
  std::optional<std::string> radius, wavelengths, rays, orders;
  bool list = false, quick = false;
};

std::vector<validation::Case> chosen_cases(const std::string& names) {
  const auto& all = validation::cases();
  if (names.empty()) return all;
  std::vector<validation::Case> chosen;
  std::size_t start = 0;
  while (start <= names.size()) {
    const std::size_t comma = std::min(names.find(',', start), names.size());
    const std::string name = names.substr(start, comma - start);
    const auto found = std::ranges::find(all, name, &validation::Case::name);
    if (found == all.end()) {
      std::string known;
      for (const auto& one : all) known += (known.empty() ? "" : ", ") + std::string(one.name);
      throw InputError("--case: " + quote(name) + " is not a case; choose from " + known);
    }
    if (std::ranges::find(chosen, name, &validation::Case::name) == chosen.end()) chosen.push_back(*found);
    start = comma + 1;
  }
  return chosen;
}

validation::Settings settings_of(const Texts& texts) {
  validation::Settings settings = validation::standard_settings(texts.quick);
  settings.index = read("--index", texts.index, parse_index_source);
  if (texts.radius) {
    settings.radius_m = read("--radius", *texts.radius, parse_lengths);
    std::ranges::sort(settings.radius_m);
    const auto duplicates = std::ranges::unique(settings.radius_m);
    settings.radius_m.erase(duplicates.begin(), duplicates.end());
    // Below, rays mean nothing; above, the angles that resolve the ripple would fill the memory.
    for (const double radius : settings.radius_m)
      if (!(radius >= 5e-6 && radius <= 3e-3))
        throw InputError(fmt::format("--radius: {:.6g}mm is outside 0.005mm to 3mm", radius * 1e3));
  }
  if (texts.wavelengths) {
    settings.wavelength_m = read("--wavelengths", *texts.wavelengths, parse_lengths);
    std::ranges::sort(settings.wavelength_m);
  }
  for (const double wavelength : settings.wavelength_m) {
    if (!(wavelength >= 200e-9 && wavelength <= 10e-6))
      throw InputError(fmt::format("--wavelengths: {:.6g}nm is outside 200nm to 10000nm", wavelength * 1e9));
    (void)read("--wavelengths", "", [&](const std::string&) {
      return refractive_index(settings.index, wavelength);
    });
  }
  if (texts.rays) settings.rays = static_cast<int>(whole_number("--rays", *texts.rays, 2, 20000));
  if (texts.orders) settings.orders = read("--orders", *texts.orders, parse_orders);
  settings.threads = thread_count(texts.threads);
  return settings;
}

/// A line on standard error while it is a terminal, nothing otherwise.
class ProgressLine {
public:
  ProgressLine() = default;
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;
  ~ProgressLine() {
    if (drawn_) fmt::print(stderr, "\r\x1b[K");
  }
  void show(std::string_view name, std::size_t number, std::size_t count, double done) {
    if (!terminal_) return;
    const auto now = std::chrono::steady_clock::now();
    if (drawn_ && now - last_ < std::chrono::milliseconds(100)) return;
    last_ = now;
    drawn_ = true;
    const double seconds = std::chrono::duration<double>(now - start_).count();
    fmt::print(stderr, "\r{} of {}: {} {:3.0f} %  {:.0f} s\x1b[K", number, count, name, 100 * done, seconds);
    (void)std::fflush(stderr);
  }

private:
  bool terminal_ = ::isatty(STDERR_FILENO) == 1;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now(), last_{};
};

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void run(const Texts& texts, const Context& context) {
  if (texts.list) {
    for (const auto& one : validation::cases()) fmt::print("{:<12} {}\n", one.name, one.description);
    return;
  }
  const std::vector<validation::Case> chosen = chosen_cases(texts.cases);
  const validation::Settings settings = settings_of(texts);
  const auto in_colour = [](const validation::Case& one) { return one.name.starts_with("figure"); };
  const auto visible = [](double wavelength) { return wavelength >= 380e-9 && wavelength <= 780e-9; };
  if (std::ranges::any_of(chosen, in_colour) && std::ranges::none_of(settings.wavelength_m, visible))
    throw InputError(
        "--wavelengths: the figures show colours and need some light from 380nm to 780nm; add some or choose "
        "--case sphere,energy,bow-angles");
  if (texts.output.empty())
    throw InputError("--output: \"\" is empty; name a folder such as validation-report");
  validation::Report report;
  try {
    report.device = compute::Device(settings.threads).info().name;
  } catch (const compute::DeviceError& error) {
    throw InputError(error.what());
  }
  validation::ReportFolder folder(texts.output);

  report.command = context.command_line;
  report.version = version();
  report.created = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  report.quick = texts.quick;
  report.settings = {
      {"radius_m", settings.radius_m},
      {"wavelength_m", settings.wavelength_m},
      {"index", index_source_name(settings.index)},
      {"rays", settings.rays},
      {"orders", settings.orders},
      {"sun_disc_deg", validation::sun_diameter_deg}};
  const auto start = std::chrono::steady_clock::now();
  {
    ProgressLine line;
    for (std::size_t i = 0; i < chosen.size(); ++i) {
      const auto case_start = std::chrono::steady_clock::now();
      line.show(chosen[i].name, i + 1, chosen.size(), 0);
      try {
        report.cases.push_back(chosen[i].run(
            settings, [&](double done) { line.show(chosen[i].name, i + 1, chosen.size(), done); }));
      } catch (const compute::DeviceError& error) {
        throw RunError(error.what());
      }
      report.cases.back().seconds = seconds_since(case_start);
      spdlog::info("{}: {:.1f} s", chosen[i].name, report.cases.back().seconds);
    }
  }
  report.seconds = seconds_since(start);
  folder.write(report);

  std::size_t checks = 0, missed = 0;
  for (const auto& one : report.cases)
    for (const auto& check : one.checks) {
      ++checks;
      if (check.holds()) continue;
      ++missed;
      fmt::print(
          "missed: {}, {}: {:.3g} {} where {:.3g} {} was the bound\n", one.name, check.name, check.value,
          check.unit, check.bound, check.unit);
    }
  fmt::print(
      "{} of {} published bounds held; report in {}/index.html and {}/report.json, {:.0f} s\n",
      checks - missed, checks, texts.output, texts.output, report.seconds);
}

} // namespace

void add_validate(CLI::App& app, Context& context) {
  CLI::App* const verb = app.add_subcommand("validate", "Hold results against exact theory; write a report");
  const auto texts = std::make_shared<Texts>();
  const auto add = [&](const char* name, auto& text, const char* type, const char* group,
                       const std::string& description) {
    verb->add_option(name, text, description)->type_name(type)->group(group);
  };
  add("--case,case", texts->cases, "NAME,...", "Cases", "Cases to run, see --list [all]");
  verb->add_flag("--list", texts->list, "List the cases and stop")->group("Cases");
  verb->add_flag("--quick", texts->quick, "A reduced version of every case; the report says so")
      ->group("Cases");
  add("--radius", texts->radius, "LENGTHS", "Spheres", "Radii [0.1mm,0.2mm,0.4mm,0.5mm,1mm]");
  add("--wavelengths,--wavelength", texts->wavelengths, "LENGTHS", "Spheres",
      "Wavelengths in vacuum [380:700:10nm]");
  add("--index", texts->index, "INDEX", "Spheres",
      "Refractive index: iapws, daimon-masumura, hale-querry, or a number such as 1.333 [iapws]");
  add("--rays", texts->rays, "N", "Method", "Rays across the drop [3000]");
  add("--orders", texts->orders, "ORDERS", "Method", "Orders p [0..3]");
  add("--threads", texts->threads, "N", "Method", "Threads to use, 0 for all cores [0]");
  add("--output", texts->output, "FOLDER", "Output",
      "Folder for index.html, report.json and tables [validation-report]");
  verb->footer("Cases that repeat a published figure or number keep its drop.\n"
               "Example: scatter validate --case sphere --radius 0.1mm,0.4mm --output report");
  verb->callback([texts, &context] { run(*texts, context); });
}

} // namespace scatter::app
