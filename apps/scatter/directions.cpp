#include "directions.hpp"

#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>

namespace scatter::app {
namespace {

using Json = nlohmann::json;

constexpr const char* form = R"(a list such as [{"light": [0, 0, 1], "view": [0.6, 0, 0.8]}])";

Json parse(const std::string& file) {
  std::ifstream opened;
  if (file != "-") {
    opened.open(file);
    if (!opened) throw InputError("--directions: " + quote(file) + " cannot be read");
  }
  std::istream& stream = file == "-" ? std::cin : opened;
  try {
    return Json::parse(stream);
  } catch (const Json::exception& error) {
    // "[json.exception...] parse error at line 3, column 7: ...", or "... number overflow parsing '1e999'"
    const std::string message = error.what();
    const auto at = message.find("at line"), end_of_tag = message.find("] ");
    throw InputError(
        "--directions: " + quote(file) + " is no JSON: " +
        (at != message.npos ? message.substr(at)
                            : message.substr(end_of_tag == message.npos ? 0 : end_of_tag + 2)) +
        "; write " + form);
  } catch (const std::ios_base::failure&) { // a folder, for one
    throw InputError("--directions: " + quote(file) + " cannot be read");
  }
}

} // namespace

DirectionPairs read_directions(const std::string& file, const std::string& verb) {
  const Json json = parse(file);
  const std::string where = "--directions: " + (file == "-" ? "standard input" : file) + ": ";
  if (!json.is_array() || json.empty()) throw InputError(where + "this must be " + form);
  DirectionPairs pairs;
  std::size_t stretched = 0;
  std::string first_stretched;
  for (const Json& entry : json) {
    const std::string which = fmt::format("entry {} (counted from 0)", pairs.view.size());
    if (!entry.is_object()) throw InputError(where + which + " is no object; write " + form);
    for (const auto& [name, value] : entry.items())
      if (name != "light" && name != "view")
        throw InputError(where + which + ": " + quote(name) + " is no field; there are light and view");
    for (const char* const name : {"light", "view"}) {
      if (!entry.contains(name)) throw InputError(where + which + ": " + name + " is missing");
      const Json& list = entry.at(name);
      const bool numbers = list.is_array() && list.size() == 3 &&
                           std::ranges::all_of(list, [](const Json& value) { return value.is_number(); });
      const auto refuse = [&](const char* right) {
        throw InputError(
            where + which + ": " + name + ": " +
            quote(list.dump(-1, ' ', false, Json::error_handler_t::replace)) + right);
      };
      if (!numbers) refuse(" is not a list of three numbers");
      glm::dvec3 w(list[0].get<double>(), list[1].get<double>(), list[2].get<double>());
      const double largest = std::max({std::abs(w.x), std::abs(w.y), std::abs(w.z)});
      if (!(std::isfinite(w.x) && std::isfinite(w.y) && std::isfinite(w.z))) refuse(" is not finite");
      if (largest == 0) refuse(" has no direction; use a vector of unit length");
      const glm::dvec3 scaled = w / largest; // no overflow, no underflow
      const double length = glm::length(scaled);
      if (std::abs(largest * length - 1) > 1e-6 && stretched++ == 0)
        first_stretched = fmt::format("{} of {}", name, which);
      // Vectors that are of unit length but for rounding stay as they are.
      if (std::abs(glm::dot(w, w) - 1) > 4e-16) w = scaled / length;
      (name[0] == 'l' ? pairs.light : pairs.view).push_back(w);
    }
  }
  if (stretched > 0)
    fmt::print(
        stderr,
        "{}: --directions: {} of {} directions were not of unit length and have been normalised, first the "
        "{}\n",
        verb, stretched, 2 * pairs.light.size(), first_stretched);
  return pairs;
}

} // namespace scatter::app
