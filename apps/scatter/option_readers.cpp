#include "option_readers.hpp"

#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <charconv>

namespace scatter::app {

long whole_number(const char* option, const std::string& text, long least, long most) {
  long value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < least || value > most)
    throw InputError(
        fmt::format("{}: {} is not a whole number from {} to {}", option, quote(text), least, most));
  return value;
}

int thread_count(const std::string& text) {
  try {
    return static_cast<int>(whole_number("--threads", text, 0, 4096));
  } catch (const InputError&) {
    throw InputError("--threads: " + quote(text) + " is not a number of threads; use 0 (all cores) to 4096");
  }
}

} // namespace scatter::app
