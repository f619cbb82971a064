#pragma once

#include "verbs.hpp"

/// The verbs below `scatter fiber`; each function adds those of one idea.
namespace scatter::app {

void add_fiber_azimuth(CLI::App& fiber, Context& context); ///< azimuth
void add_fiber_hair(CLI::App& fiber, Context& context);    ///< assembly, hair, artist-hair
void add_fiber_cloth(CLI::App& fiber, Context& context);   ///< thread, cloth

} // namespace scatter::app
