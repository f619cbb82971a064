#pragma once

#include <scatter/phase/request.hpp>
#include <scatter/table/files.hpp>

#include <CLI/CLI.hpp>

#include <optional>
#include <string>

namespace scatter::app {

/// What one `scatter phase` asks for.
struct PhaseJob {
  phase::Request request;
  table::FileOptions file_options;
  std::string output = "-"; ///< a path, "-" (JSON to standard output) or "none" (compute, write nothing)
  bool explain = false;
  bool output_given = false;
};

/// The options of `scatter phase` as texts, before anything is read out of them.
class PhaseOptions {
public:
  /// Adds the options to the verb; this object must outlive it.
  void add_to(CLI::App& verb);

  /// Reads the texts. Throws InputError with one line that names the option, quotes its value and says what
  /// would be right. Checks what one option says; whether the options fit together is phase::plan()'s to
  /// check.
  [[nodiscard]] PhaseJob job() const;

private:
  std::string shape_ = "beard-chuang", index_ = "iapws", method_ = "auto", diffraction_ = "gaussian";
  std::string focal_lines_ = "exact", search_ = "auto", compression_ = "none", precision_ = "double";
  std::string sun_ = "0deg", theta_ = "0:180:1deg", orders_ = "0..3", rays_ = "1000", threads_ = "0",
              output_ = "-";
  std::optional<std::string> radius_, axis_ratio_, wavelengths_, phi_, sun_disc_, tolerance_;
  CLI::Option *output_option_ = nullptr, *diffraction_option_ = nullptr, *rays_option_ = nullptr,
              *orders_option_ = nullptr, *focal_lines_option_ = nullptr;
  bool no_interference_ = false, no_dispersion_ = false, no_absorption_ = false;
  bool matrix_ = false, amplitudes_ = false, per_order_ = false, explain_ = false;
};

} // namespace scatter::app
