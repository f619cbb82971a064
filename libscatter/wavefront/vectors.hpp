#pragma once

#include <array>
#include <cmath>

/// Internal to scatter::wavefront: vectors of the host's own tracing.
namespace scatter::wavefront {

using Vector = std::array<double, 3>;

inline double inner(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline Vector along(const Vector& a, double t, const Vector& b) {
  return {a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]};
}
inline double norm(const Vector& a) {
  return std::sqrt(inner(a, a));
}

} // namespace scatter::wavefront
