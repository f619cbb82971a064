#pragma once

#include "verbs.hpp"

#include <string>

namespace scatter::app {

/// The options of `scatter plot --lee`, as typed.
struct LeeTexts {
  bool wanted = false, check = false;
  std::string radii = "10um:1mm", angles = "120:150deg", size = "400x600", sun_disc = "0.533deg",
              wavelengths = "380:700:10nm", index = "iapws", normalise = "radius", spheres = "1",
              threads = "0";
};

void add_lee_options(CLI::App& verb, LeeTexts& texts);

/// Throws InputError before anything is computed or written.
void run_lee(const LeeTexts& texts, double exposure, const std::string& output);

} // namespace scatter::app
