#include "fiber.hpp"

namespace scatter::app {

void add_fiber_hair(CLI::App&, Context&) {}

} // namespace scatter::app
