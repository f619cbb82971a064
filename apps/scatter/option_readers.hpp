#pragma once

#include <scatter/optics/errors.hpp>

#include <string>

namespace scatter::app {

/// Reads one option's text; whatever is wrong with it then names the option.
template <typename Reader>
auto read(const char* option, const std::string& text, Reader&& reader) {
  try {
    return reader(text);
  } catch (const InputError& error) {
    throw InputError(std::string(option) + ": " + error.what());
  }
}

/// Throws InputError for anything but a whole number from least to most.
[[nodiscard]] long whole_number(const char* option, const std::string& text, long least, long most);

/// --threads: 0 (all cores) to 4096. Throws InputError.
[[nodiscard]] int thread_count(const std::string& text);

} // namespace scatter::app
