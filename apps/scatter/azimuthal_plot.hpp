#pragma once

#include "verbs.hpp"

#include <string>

namespace scatter::app {

/// The options of `scatter plot --azimuthal`, as typed.
struct AzimuthalTexts {
  bool wanted = false, polar = false;
  std::string eta = "1.55", sigma_a = "0.2,0.3,0.5", theta_d = "0deg", orders = "0..2", average = "2deg";
};

void add_azimuthal_options(CLI::App& verb, AzimuthalTexts& texts);

/// Throws InputError before anything is computed or written.
void run_azimuthal(const AzimuthalTexts& texts, int width, int height, const std::string& output);

} // namespace scatter::app
