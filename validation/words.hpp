#pragma once

#include <string>

/// Numbers as the report's tables show them.
namespace scatter::validation {

/// 0.0437 -> "4.4 %", 12.3 -> "1230 %", 0.00123 -> "0.12 %".
[[nodiscard]] std::string percent(double value);
/// 0.0004 -> "0.4 mm".
[[nodiscard]] std::string millimetres(double metres);
/// 0.0213 -> "21 ms", 12.34 -> "12 s".
[[nodiscard]] std::string seconds_text(double seconds);

} // namespace scatter::validation
