#include "fiber.hpp"

namespace scatter::app {

void add_fiber_azimuth(CLI::App&, Context&) {}

} // namespace scatter::app
