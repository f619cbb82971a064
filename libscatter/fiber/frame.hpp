#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

/// A fibre's own coordinates: the one place where signs of angles are chosen.
///
/// All directions point away from the fibre, the one toward the light as well. theta is the inclination to
/// the plane across the fibre, positive toward the tangent; phi the azimuth in that plane from the normal
/// toward the binormal = tangent x normal; psi the angle in the plane of tangent and normal from the normal
/// toward the tangent. All in radians. Source: the dissertation, sections 4.2 and 5.3; differences are halved
/// everywhere (the print mixes both).
namespace scatter::fiber {

/// Right-handed and orthonormal.
struct Frame {
  glm::dvec3 tangent{1, 0, 0}, normal{0, 0, 1}, binormal{0, -1, 0};
};

/// Neither needs unit length; of the normal only what is at right angles to the tangent counts. Throws
/// InputError when one is not finite or zero, or when they are parallel to 1e-12.
[[nodiscard]] Frame make_frame(const glm::dvec3& tangent, const glm::dvec3& normal);

/// asin(w . tangent), -pi/2 .. pi/2; w of unit length, or nearly: the sine is clamped.
[[nodiscard]] double inclination(const Frame& frame, const glm::dvec3& w);
/// Azimuth from the normal, (-pi, pi]. 0 for w along the tangent.
[[nodiscard]] double azimuth(const Frame& frame, const glm::dvec3& w);
/// Longitudinal angle from the normal, (-pi, pi]. 0 for w along the binormal.
[[nodiscard]] double longitudinal_angle(const Frame& frame, const glm::dvec3& w);

/// Any angle [rad] to (-pi, pi].
[[nodiscard]] double wrap_angle(double angle);

/// Light from one direction seen from another: all that a round fibre knows of them.
struct Angles {
  double theta_i = 0, theta_o = 0; ///< inclinations of the directions to the light and to the eye
  double phi = 0; ///< azimuth of the eye less that of the light: 0 back toward the light, pi on

  [[nodiscard]] double theta_h() const { return 0.5 * (theta_i + theta_o); }
  [[nodiscard]] double theta_d() const { return 0.5 * (theta_o - theta_i); }
};

/// Of directions of unit length, or nearly; theta by an arc sine, so that within 0.1 deg of the tangent
/// digits are lost: thread_angles() keeps them.
[[nodiscard]] Angles angles(const Frame& frame, const glm::dvec3& to_light, const glm::dvec3& to_eye);

} // namespace scatter::fiber
