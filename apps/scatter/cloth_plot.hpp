#pragma once

#include "verbs.hpp"

#include <optional>
#include <string>

namespace scatter::app {

/// The options of `scatter plot --cloth`, as typed.
struct ClothPlotTexts {
  std::optional<std::string> cloth; ///< a fabric
  std::optional<std::string> thread;
  std::string light = "0,30,60", plane = "0deg", samples = "64";
};

void add_cloth_plot_options(CLI::App& verb, ClothPlotTexts& texts);

/// Throws InputError before anything is written.
void run_cloth_plot(const ClothPlotTexts& texts, int width, const std::string& output);

} // namespace scatter::app
