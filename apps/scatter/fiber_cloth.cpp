#include "fiber.hpp"

namespace scatter::app {

void add_fiber_cloth(CLI::App&, Context&) {}

} // namespace scatter::app
