#pragma once

#include "exact_options.hpp"
#include "verbs.hpp"

#include <optional>
#include <string>

namespace scatter::app {

/// The options of `scatter mie` that ask for an average, as typed.
struct AverageTexts {
  std::optional<std::string> distribution, sun_disc, band, band_weight, tolerance, spheres;
  /// Whether any is given.
  [[nodiscard]] bool wanted() const {
    return distribution || sun_disc || band || band_weight || tolerance || spheres;
  }
};

/// The other options of `scatter mie` that an average uses, as typed.
struct SphereTexts {
  BodyTexts body;
  std::optional<std::string> orders;
  std::string angles, output, threads;
};

void add_average_options(CLI::App& verb, AverageTexts& texts);

/// Throws InputError before anything is computed or written.
void run_average(const AverageTexts& average, const SphereTexts& sphere, const Context& context);

} // namespace scatter::app
