#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>
#include <string>

namespace scatter {
namespace {

/// A list longer than this is a slip of the pen: no axis of a table needs it, and it would fill the memory.
constexpr double most_values = 1e7;

/// value in the base unit = value * multiply / divide; powers of ten divide, so that 380nm is exactly the
/// double 3.8e-7.
struct Unit {
  std::string_view name;
  double multiply;
  double divide;
};

constexpr Unit length_units[] = {
    {"m", 1, 1},    {"cm", 1, 1e2},        {"mm", 1, 1e3},        {"um", 1, 1e6},
    {"nm", 1, 1e9}, {"\xC2\xB5m", 1, 1e6}, {"\xCE\xBCm", 1, 1e6}, // both characters that look like a micro
                                                                  // sign
};
constexpr Unit angle_units[] = {
    {"deg", 1, 1}, {"rad", 180 / pi, 1}, {"arcmin", 1, 60}, {"arcsec", 1, 3600}, {"", 1, 1}, // bare: degrees
};

/// One kind of quantity, with the words that its error messages need.
struct Quantity {
  std::span<const Unit> units;
  bool positive;            ///< refuse zero and below
  std::string_view noun;    ///< "a length"
  std::string_view example; ///< a value that is right
  std::string_view known;   ///< its units in words
  std::string_view range;   ///< a range that is right
};
constexpr Quantity length{length_units, true, "a length", "0.4mm", "m, cm, mm, um or nm", "380:700:10nm"};
constexpr Quantity angle{angle_units,   false, "an angle", "20deg", "deg, rad, arcmin or arcsec",
                         "0:180:0.5deg"};

[[noreturn]] void refuse(std::string_view text, const std::string& why) {
  throw InputError(quote(text) + " " + why);
}

/// The number at the front of the text, and what stands behind it.
struct Number {
  double value;
  std::string_view rest;
};

/// `whole` is what the message quotes; `should` ends the message with what would be right.
Number leading_number(std::string_view text, std::string_view whole, const std::string& should) {
  std::string_view digits = text;
  if (digits.size() > 1 && digits[0] == '+' && digits[1] != '+' && digits[1] != '-') digits.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error == std::errc::invalid_argument) refuse(whole, "does not start with a number; " + should);
  if (error == std::errc::result_out_of_range)
    refuse(whole, "holds a number outside what a double can hold (about 1e-308 to 1e308); " + should);
  if (!std::isfinite(value)) refuse(whole, "is not a finite number; " + should);
  return {value, digits.substr(static_cast<std::size_t>(end - digits.data()))};
}

std::string should_be(const Quantity& quantity) {
  return "write " + std::string(quantity.noun) + " such as " + std::string(quantity.example);
}

const Unit& find_unit(std::string_view name, std::string_view whole, const Quantity& quantity) {
  const auto found = std::ranges::find(quantity.units, name, &Unit::name);
  if (found != quantity.units.end()) return *found;
  if (name.empty())
    refuse(whole, "has no unit; " + should_be(quantity) + " (units: " + std::string(quantity.known) + ")");
  refuse(whole, "ends with the unknown unit " + quote(name) + "; units are " + std::string(quantity.known));
}

double in_base(double value, const Unit& unit, std::string_view whole, const Quantity& quantity) {
  const double base = value * unit.multiply / unit.divide;
  if (!std::isfinite(base) || (base == 0) != (value == 0))
    refuse(whole, "is outside what a double can hold; " + should_be(quantity));
  if (quantity.positive && !(base > 0)) refuse(whole, "must be greater than zero; " + should_be(quantity));
  return base;
}

double parse_quantity(std::string_view text, const Quantity& quantity) {
  if (text.empty()) refuse(text, "is empty; " + should_be(quantity));
  const Number number = leading_number(text, text, should_be(quantity));
  return in_base(number.value, find_unit(number.rest, text, quantity), text, quantity);
}

/// first:last:step; a unit at the end holds for all three, and the others may repeat or differ from it.
void append_range(std::string_view text, const Quantity& quantity, std::vector<double>& values) {
  const std::string should = "write a range as first:last:step, such as " + std::string(quantity.range);
  const std::size_t one = text.find(':'), two = text.find(':', one + 1);
  if (two == std::string_view::npos || text.find(':', two + 1) != std::string_view::npos)
    refuse(text, "is not a range of three; " + should);
  const Number first = leading_number(text.substr(0, one), text, should);
  const Number last = leading_number(text.substr(one + 1, two - one - 1), text, should);
  const Number step = leading_number(text.substr(two + 1), text, should);
  const Unit& common = find_unit(step.rest, text, quantity);
  for (const std::string_view own : {first.rest, last.rest}) {
    if (own.empty()) continue;
    if (find_unit(own, text, quantity).name != common.name)
      refuse(text, "mixes units; " + should + " (the unit at the end holds for all three)");
  }

  if (!(step.value > 0)) refuse(text, "has a step that is not greater than zero; " + should);
  if (!(last.value >= first.value)) refuse(text, "ends before it starts; " + should);
  const double steps = std::floor((last.value - first.value) / step.value + 1e-9);
  if (!(steps + 1 + static_cast<double>(values.size()) <= most_values))
    refuse(text, "holds more than 10 million values; take a larger step");
  if (steps > 0 && (first.value + step.value == first.value || last.value - step.value == last.value))
    refuse(text, "has a step too small to tell its values apart; take a larger step");

  // Steps such as 0.1 or 0.0125 are counted as tenths or eightieths: i / 10 is the double nearest to the
  // decimal that people mean, i * 0.1 often is not.
  const double per_unit = std::round(1 / step.value);
  const bool fraction = per_unit >= 1 && per_unit <= 1e9 && std::abs(per_unit * step.value - 1) < 1e-15;
  const auto count = static_cast<std::size_t>(steps) + 1;
  values.reserve(values.size() + count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto n = static_cast<double>(i);
    double value = first.value + (fraction ? n / per_unit : n * step.value);
    if (value > last.value || (i + 1 == count && last.value - value <= 1e-9 * step.value)) value = last.value;
    values.push_back(in_base(value, common, text, quantity));
  }
}

std::vector<double> parse_quantities(std::string_view text, const Quantity& quantity) {
  if (text.empty())
    refuse(
        text,
        "is an empty list; " + should_be(quantity) + ", a list, or a range " + std::string(quantity.range));
  std::vector<double> values;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view item = text.substr(begin, end - begin);
    if (item.empty())
      refuse(
          text, "has an empty place between its commas; write a list such as " +
                    std::string(quantity.example) + "," + std::string(quantity.example));
    if (item.find(':') != std::string_view::npos)
      append_range(item, quantity, values);
    else
      values.push_back(parse_quantity(item, quantity));
    begin = end + 1;
  }
  if (static_cast<double>(values.size()) > most_values) refuse(text, "holds more than 10 million values");
  return values;
}

int parse_order(std::string_view item, std::string_view whole) {
  int order = 0;
  const auto [end, error] = std::from_chars(item.data(), item.data() + item.size(), order);
  const bool whole_number = error != std::errc::invalid_argument && end == item.data() + item.size();
  if (!whole_number) refuse(whole, "is not a list of orders; write 2, 0,2 or 0..3");
  if (error == std::errc::result_out_of_range || order < 0 || order > 1000)
    refuse(whole, "holds an order outside 0..1000; write 2, 0,2 or 0..3");
  return order;
}

} // namespace

std::string quote(std::string_view text) {
  constexpr std::size_t most = 60;
  std::string shown(text.substr(0, most));
  if (text.size() > most) {
    // Do not end in the middle of a UTF-8 character.
    while (!shown.empty() && (static_cast<unsigned char>(text[shown.size()]) & 0xC0) == 0x80)
      shown.pop_back();
    shown += "...";
  }
  for (char& c : shown)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  return '"' + shown + '"';
}

double parse_length(std::string_view text) {
  return parse_quantity(text, length);
}
double parse_angle_deg(std::string_view text) {
  return parse_quantity(text, angle);
}
std::vector<double> parse_lengths(std::string_view text) {
  return parse_quantities(text, length);
}
std::vector<double> parse_angles_deg(std::string_view text) {
  return parse_quantities(text, angle);
}

std::vector<int> parse_orders(std::string_view text) {
  if (text.empty()) refuse(text, "is an empty list of orders; write 2, 0,2 or 0..3");
  std::vector<int> orders;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view item = text.substr(begin, end - begin);
    const std::size_t dots = item.find("..");
    const int first = parse_order(item.substr(0, dots), text);
    const int last = dots == std::string_view::npos ? first : parse_order(item.substr(dots + 2), text);
    if (last < first) refuse(text, "ends before it starts; write orders as 2, 0,2 or 0..3");
    for (int order = first; order <= last; ++order) orders.push_back(order);
    begin = end + 1;
  }
  std::sort(orders.begin(), orders.end());
  orders.erase(std::unique(orders.begin(), orders.end()), orders.end());
  return orders;
}

std::complex<double> parse_index(std::string_view text) {
  const std::string should = "write a refractive index such as 1.331 or 1.33+1e-9i";
  if (text.empty()) refuse(text, "is empty; " + should);
  const Number real = leading_number(text, text, should);
  double imaginary = 0;
  if (!real.rest.empty()) {
    if (real.rest == "i") refuse(text, "has no real part; " + should);
    if (real.rest[0] != '+' && real.rest[0] != '-') refuse(text, "is not a refractive index; " + should);
    const Number part = leading_number(real.rest, text, should);
    if (part.rest != "i") refuse(text, "is not a refractive index; " + should);
    imaginary = part.value;
  }
  if (!(real.value > 0)) refuse(text, "has a real part that is not greater than zero; " + should);
  if (imaginary < 0) refuse(text, "has k < 0, which would amplify light; " + should + " (k >= 0 absorbs)");
  return {real.value, imaginary == 0 ? 0.0 : imaginary};
}

double parse_number(std::string_view text) {
  const std::string should = "write a plain number such as 1e-3";
  if (text.empty()) refuse(text, "is empty; " + should);
  const Number number = leading_number(text, text, should);
  if (!number.rest.empty()) refuse(text, "has " + quote(number.rest) + " after the number; " + should);
  return number.value;
}

} // namespace scatter
