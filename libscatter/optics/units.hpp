#pragma once

#include <complex>
#include <string>
#include <string_view>
#include <vector>

/// Quantities as people write them. Everything throws InputError with one line that quotes the text and says
/// what would be right; nothing here returns NaN or infinity.
namespace scatter {

inline constexpr double pi = 3.14159265358979323846;
inline constexpr double radians_per_degree = pi / 180;

/// The text in double quotes as error messages show it: on one line, control characters as '?', cut at 60
/// bytes.
[[nodiscard]] std::string quote(std::string_view text);

/// "0.4mm", "650nm", "5um", "1e-3m" -> metres, the double nearest to the decimal number. A unit (m, cm, mm,
/// um, nm, and um with a micro sign) is required; lengths are greater than zero.
[[nodiscard]] double parse_length(std::string_view text);

/// "20deg", "20", "0.5rad", "31arcmin", "5arcsec" -> degrees, of any sign. A bare number is in degrees.
[[nodiscard]] double parse_angle_deg(std::string_view text);

/// A value, a list or a range of lengths: "650nm", "400nm,0.5um", "380:700:10nm" (a unit at the end holds for
/// all three) -> metres, in the order written. A range includes its last value when the steps meet it (to
/// 1e-9 of a step); a list may hold ranges. At most 10 million values.
[[nodiscard]] std::vector<double> parse_lengths(std::string_view text);

/// The same for angles, in degrees: "0:180:0.0125deg", "137,138.5", "90".
[[nodiscard]] std::vector<double> parse_angles_deg(std::string_view text);

/// "3" -> {3}, "0,2" -> {0,2}, "0..3" -> {0,1,2,3}; sorted, no duplicates, each 0..1000.
[[nodiscard]] std::vector<int> parse_orders(std::string_view text);

/// "1.331", "1.33+1e-9i" -> n + ik. Refuses k < 0 (the time factor is exp(-i omega t): k >= 0 absorbs) and n
/// <= 0.
[[nodiscard]] std::complex<double> parse_index(std::string_view text);

/// A plain finite number, "1e-3". No unit allowed.
[[nodiscard]] double parse_number(std::string_view text);

} // namespace scatter
