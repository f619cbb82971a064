#include "words.hpp"

#include <fmt/format.h>

#include <cmath>

namespace scatter::validation {

std::string percent(double value) {
  const double p = 100 * value, size = std::abs(p);
  return size < 0.995  ? fmt::format("{:.2g} %", p)
         : size < 9.95 ? fmt::format("{:.1f} %", p)
                       : fmt::format("{:.0f} %", p);
}

std::string millimetres(double metres) {
  return fmt::format("{:.4g} mm", metres * 1e3);
}

std::string seconds_text(double seconds) {
  return seconds < 0.0995 ? fmt::format("{:.0f} ms", seconds * 1e3)
         : seconds < 99.5 ? fmt::format("{:.2g} s", seconds)
                          : fmt::format("{:.0f} s", seconds);
}

} // namespace scatter::validation
