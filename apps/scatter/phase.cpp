// scatter phase: the main job, a tabulated phase function of one drop.
#include "exact_options.hpp"
#include "phase_options.hpp"
#include "verbs.hpp"
#include <scatter/exact/mie.hpp>
#include <scatter/phase/job.hpp>
#include <scatter/table/files.hpp>

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <numbers>

namespace scatter::app {
namespace {

/// A bar on standard error while it is a terminal, nothing otherwise.
class ProgressBar {
public:
  ProgressBar() = default;
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar() {
    if (drawn_) fmt::print(stderr, "\r\x1b[K");
  }

  void operator()(double done) {
    if (!terminal_) return;
    const auto now = std::chrono::steady_clock::now();
    if (drawn_ && now - last_ < std::chrono::milliseconds(100)) return;
    last_ = now;
    drawn_ = true;
    constexpr int width = 40;
    const int filled = static_cast<int>(done * width);
    const double seconds = std::chrono::duration<double>(now - start_).count();
    fmt::print(
        stderr, "\r[{:=<{}}{: <{}}] {:3.0f} %  {:.0f} s\x1b[K", "", filled, "", width - filled, 100 * done,
        seconds);
    (void)std::fflush(stderr);
  }

private:
  bool terminal_ = ::isatty(STDERR_FILENO) == 1;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now(), last_{};
};

/// One line on standard error where a table by Mie goes beyond what Mie was compared at.
void tell_if_not_validated(const phase::Plan& plan) {
  if (plan.method != phase::Method::mie) return;
  const double wavelength_m = *std::ranges::min_element(plan.request.wavelength_m);
  const double x = 2 * std::numbers::pi * plan.request.shape.radius_m / wavelength_m;
  if (x > exact::mie_validated_size_parameter)
    tell_not_validated(
        "phase", fmt::format("--radius: the largest size parameter {:.9g}", x),
        exact::mie_validated_size_parameter, "results", 60);
}

void compute(const PhaseJob& job) {
  const phase::Plan plan = phase::plan(job.request);
  spdlog::info("{}", plan.description);
  // Standard output may be where the table goes.
  std::FILE* const explanation = job.output_given && job.output == "-" ? stderr : stdout;
  if (job.explain) {
    if (!plan.reasons.empty()) fmt::print(explanation, "{}\n", plan.reasons);
    fmt::print(explanation, "{}\n", plan.description);
    const phase::Prediction expected = phase::predict(plan);
    std::string beside;
    if (plan.method == phase::Method::patches)
      beside = fmt::format(
          "; the error estimate took {:.2g} s{}, kernels that were never compiled here take some 10 to 30 s "
          "more",
          expected.judging_seconds,
          expected.judging_seconds_to_come > 0
              ? fmt::format(" and takes {:.2g} s more", expected.judging_seconds_to_come)
              : "");
    fmt::print(
        explanation, "predicted: error {:.2g} %, {:.2g} s{}\n", 100 * expected.error,
        expected.seconds + expected.starting_seconds, beside);
    if (!job.output_given) return;
    (void)std::fflush(explanation);
  }
  tell_if_not_validated(plan);
  const std::unique_ptr<table::Sink> sink =
      job.output == "none" ? std::make_unique<table::NullSink>()
                           : table::make_file_sink(job.output, plan.header, job.file_options);
  const auto start = std::chrono::steady_clock::now();
  phase::Outcome outcome;
  {
    ProgressBar bar;
    outcome = phase::run(plan, *sink, [&bar](double done) { bar(done); });
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  spdlog::info(
      "{} wavelengths x {} theta x {} phi in {:.2f} s, written to {}", plan.header.wavelength_m.size(),
      plan.header.theta_deg.size(), plan.header.phi_deg.size(), seconds, job.output);
  if (job.explain)
    fmt::print(
        explanation, "achieved: error {:.2g} % (estimated in the table), {:.2g} s\n", 100 * outcome.error,
        outcome.seconds);
}

} // namespace

void add_phase(CLI::App& app, Context& context) {
  CLI::App* const verb = app.add_subcommand("phase", "Tabulate the phase function of a raindrop");
  verb->footer(
      "Example: scatter phase --radius 0.5mm --sun 20deg --wavelengths 400:700:50nm --output drop.nc");
  const auto options = std::make_shared<PhaseOptions>();
  options->add_to(*verb);
  verb->callback([options, &context] {
    PhaseJob job = options->job();
    job.request.command = context.command_line;
    compute(job);
  });
}

} // namespace scatter::app
