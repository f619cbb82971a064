#pragma once

#include "option_readers.hpp"
#include <scatter/optics/errors.hpp>
#include <scatter/table/atomic_file.hpp>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <complex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// What the verbs with exact solutions, `mie` with its averages and `cylinder`, share: size and index as
/// typed, and files in JSON and CSV.
namespace scatter::app {

/// The body's options as typed.
struct BodyTexts {
  std::optional<std::string> size_parameter, radius, wavelength, index;
  /// Adds the options; group and body are names for the help, size_limits such as "1e-6 to 5e5".
  void add_to(
      CLI::App& verb, const std::string& group, const std::string& size_limits,
      const std::string& index_help);
};

/// Names and values of what a result was computed from.
using Constants = std::vector<std::pair<std::string, std::string>>;

struct Body {
  double size_parameter = 0;
  std::complex<double> index;
  std::string index_source;
  std::optional<double> radius_m, wavelength_m;
  /// Of the index, radius and wavelength, for provenance.
  [[nodiscard]] Constants constants() const;
};

/// water: an index that is not given is water's at the wavelength. Throws InputError that names the option.
[[nodiscard]] Body read_body(const BodyTexts& texts, bool water);

/// Of the size, for messages: the option as typed with what it means, such as "--size-parameter 60000".
[[nodiscard]] std::string size_text(const Body& body);

/// One line on standard error: `what`, a value with its name, is beyond `limit`, up to which `results` were
/// compared with so many digits.
void tell_not_validated(
    std::string_view verb, std::string_view what, double limit, std::string_view results, int digits);

/// Where an exact result goes: FILE.json, FILE.csv or "-", JSON to standard output.
class ExactOutput {
public:
  /// Opens the file, before the work: a folder that is not there is told at once. Throws InputError.
  explicit ExactOutput(const std::string& output);
  [[nodiscard]] bool is_csv() const { return csv_; }
  void write(const std::string& text);

private:
  bool csv_ = false;
  std::optional<table::PartFile> file_;
};

/// [[re, im], ...]
[[nodiscard]] nlohmann::ordered_json complex_pairs(const std::vector<std::complex<double>>& values);

/// Adds "provenance" and writes one line.
[[nodiscard]] std::string
finish_json(nlohmann::ordered_json json, const Constants& constants, const std::string& command);

/// The comment lines that say what made a CSV file.
[[nodiscard]] std::string
csv_provenance(const Constants& constants, double seconds, const std::string& command);

} // namespace scatter::app
