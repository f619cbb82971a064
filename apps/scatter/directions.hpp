#pragma once

#include <glm/vec3.hpp>

#include <string>
#include <vector>

/// Files of directions, which all verbs that evaluate a scattering function read.
namespace scatter::app {

/// Unit vectors away from what scatters, toward the light and toward the eye.
struct DirectionPairs {
  std::vector<glm::dvec3> light, view;
};

/// Reads `[{"light": [x, y, z], "view": [x, y, z]}, ...]`; "-" is standard input. Vectors that are not of
/// unit length are normalised; when their lengths are off by more than 1e-6, one line on standard error says
/// so and begins with `verb`. Throws InputError that names --directions, the file and the entry, counted from
/// 0: for no JSON, other fields, vectors that are zero or not finite.
[[nodiscard]] DirectionPairs read_directions(const std::string& file, const std::string& verb);

} // namespace scatter::app
