#include <scatter/fiber/frame.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace scatter::fiber {
namespace {

/// Unit length without overflow or underflow on the way. The name is for the message.
glm::dvec3 unit(const glm::dvec3& v, const char* name) {
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  if (!(largest > 0 && std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z)))
    throw InputError(std::string("the ") + name + " of a fibre must be finite and not zero");
  return glm::normalize(v / largest);
}

} // namespace

Frame make_frame(const glm::dvec3& tangent, const glm::dvec3& normal) {
  const glm::dvec3 t = unit(tangent, "tangent"), n = unit(normal, "normal");
  const glm::dvec3 across = n - glm::dot(n, t) * t;
  if (!(glm::length(across) > 1e-12))
    throw InputError("the normal of a fibre must not be parallel to its tangent");
  const glm::dvec3 a = glm::normalize(across);
  return {t, a, glm::cross(t, a)};
}

double inclination(const Frame& frame, const glm::dvec3& w) {
  return std::asin(std::clamp(glm::dot(w, frame.tangent), -1.0, 1.0));
}

double azimuth(const Frame& frame, const glm::dvec3& w) {
  return wrap_angle(std::atan2(glm::dot(w, frame.binormal), glm::dot(w, frame.normal)));
}

double longitudinal_angle(const Frame& frame, const glm::dvec3& w) {
  return wrap_angle(std::atan2(glm::dot(w, frame.tangent), glm::dot(w, frame.normal)));
}

double wrap_angle(double angle) {
  const double wrapped = std::remainder(angle, 2 * std::numbers::pi); // exact; [-pi, pi]
  return wrapped <= -std::numbers::pi ? std::numbers::pi : wrapped;
}

Angles angles(const Frame& frame, const glm::dvec3& to_light, const glm::dvec3& to_eye) {
  return {
      inclination(frame, to_light), inclination(frame, to_eye),
      wrap_angle(azimuth(frame, to_eye) - azimuth(frame, to_light))};
}

} // namespace scatter::fiber
