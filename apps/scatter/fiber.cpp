#include "fiber.hpp"

namespace scatter::app {

void add_fiber(CLI::App& app, Context& context) {
  CLI::App* const fiber = app.add_subcommand("fiber", "Scattering by fibres: hair, threads and cloth");
  fiber->require_subcommand(1);
  add_fiber_azimuth(*fiber, context);
  add_fiber_hair(*fiber, context);
  add_fiber_cloth(*fiber, context);
}

} // namespace scatter::app
