#pragma once

#include <scatter/drop/shape.hpp>

#include <array>
#include <cmath>
#include <complex>
#include <functional>
#include <numbers>
#include <optional>
#include <vector>

/// A ray tracer that shares nothing with the library's kernels but the drop's coefficients: long double,
/// surfaces as level sets in spherical or Cartesian coordinates, meetings by bisection, Snell's law for the
/// tangential part of n d, fields as vectors in space. Slow.
namespace reference {

using real = long double;
using complex = std::complex<real>;
inline constexpr real pi = std::numbers::pi_v<real>;

struct vec {
  real x, y, z;
};
inline vec operator+(vec a, vec b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline vec operator-(vec a, vec b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline vec operator*(real s, vec a) {
  return {s * a.x, s * a.y, s * a.z};
}
inline real dot(vec a, vec b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline vec cross(vec a, vec b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline real norm(vec a) {
  return std::sqrt(dot(a, a));
}
inline vec unit(vec a) {
  return (1 / norm(a)) * a;
}

/// Electric field in space.
struct field {
  complex x, y, z;
};
inline complex along(const field& e, vec a) {
  return e.x * a.x + e.y * a.y + e.z * a.z;
}
inline field operator+(const field& a, const field& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline field operator*(complex s, vec a) {
  return {s * a.x, s * a.y, s * a.z};
}

/// The drop's surface in the frame of the sunlight: z along the light, x most downward.
struct Surface {
  scatter::drop::Shape shape;
  vec down;
  Surface(scatter::drop::Shape of, real sun_elevation_deg) : shape(std::move(of)) {
    const real h = sun_elevation_deg * pi / 180;
    down = {std::cos(h), 0, std::sin(h)};
  }
  /// Negative inside.
  [[nodiscard]] real level(vec p) const {
    const real z = dot(p, down), rho = norm(p - z * down);
    if (shape.kind == scatter::drop::Shape::Kind::spheroid) {
      const real A = shape.horizontal_semi_axis, B = shape.vertical_semi_axis;
      return (rho / A) * (rho / A) + (z / B) * (z / B) - 1;
    }
    const real theta = std::atan2(rho, z);
    real r = norm(p);
    for (std::size_t n = 0; n < shape.cosine.size(); ++n)
      r -= static_cast<real>(shape.cosine[n]) * std::cos(static_cast<real>(n) * theta);
    return r;
  }
  /// Outward.
  [[nodiscard]] vec normal(vec p) const {
    const real z = dot(p, down);
    const vec across = p - z * down;
    if (shape.kind == scatter::drop::Shape::Kind::spheroid) {
      const real A = shape.horizontal_semi_axis, B = shape.vertical_semi_axis;
      return unit((1 / (A * A)) * across + (z / (B * B)) * down);
    }
    const real rho = norm(across), theta = std::atan2(rho, z), r = norm(p);
    if (rho == 0) return unit(p);
    real slope = 0;
    for (std::size_t n = 0; n < shape.cosine.size(); ++n)
      slope -=
          static_cast<real>(n) * static_cast<real>(shape.cosine[n]) * std::sin(static_cast<real>(n) * theta);
    const vec e = (1 / rho) * across;
    const vec theta_hat = std::cos(theta) * e - std::sin(theta) * down;
    return unit((1 / r) * p - (slope / r) * theta_hat);
  }
  /// Where the line start + t d is deepest inside; convex drops have one such place.
  [[nodiscard]] real deepest(vec start, vec d, real low, real high) const {
    constexpr real golden = 0.61803398874989484820L;
    for (int i = 0; i < 70; ++i) {
      const real a = high - golden * (high - low), b = low + golden * (high - low);
      if (level(start + a * d) < level(start + b * d))
        high = b;
      else
        low = a;
    }
    return (low + high) / 2;
  }
  /// The root between inside and outside, to the last bit that level() can tell.
  [[nodiscard]] real meet(vec start, vec d, real inside, real outside) const {
    for (int i = 0; i < 90; ++i) {
      const real middle = (inside + outside) / 2;
      (level(start + middle * d) < 0 ? inside : outside) = middle;
    }
    return (inside + outside) / 2;
  }
};

struct Ray {
  bool valid = false; ///< false beyond total reflection
  vec direction{};
  real path = 0;
  vec point{}, inwards{}; ///< where it left, and where the rest goes on inside
  complex S1, S2, S3, S4;
};

/// Reflection and refraction of a wave with two incident polarisations; fields of flux one per unit of area
/// across the ray, so that |r|^2 + |t|^2 = 1.
struct Wave {
  vec d;
  std::array<field, 2> e;
};
struct Split {
  Wave reflected;
  std::optional<Wave> refracted;
};
inline Split at_interface(const Wave& in, vec against, real n1, real n2) {
  const real ci = -dot(in.d, against);
  vec s = cross(in.d, against);
  s = norm(s) > 1e-17L ? unit(s) : unit(cross(in.d, std::abs(in.d.x) < 0.5L ? vec{1, 0, 0} : vec{0, 1, 0}));
  const vec tangential = (n1 / n2) * (in.d + ci * against);
  const real sine2 = dot(tangential, tangential);
  const complex ct = sine2 <= 1 ? complex(std::sqrt(1 - sine2)) : complex(0, std::sqrt(sine2 - 1));
  const complex rs = (n1 * ci - n2 * ct) / (n1 * ci + n2 * ct),
                rp = (n2 * ci - n1 * ct) / (n2 * ci + n1 * ct);
  const vec p = cross(s, in.d);
  Split out;
  out.reflected.d = in.d + (2 * ci) * against;
  const vec pr = cross(s, out.reflected.d);
  for (int k = 0; k < 2; ++k)
    out.reflected.e[k] = (rs * along(in.e[k], s)) * s + (rp * along(in.e[k], p)) * pr;
  if (sine2 < 1) {
    const real c = ct.real(), flux = std::sqrt(n2 * c / (n1 * ci));
    Wave t;
    t.d = unit(tangential - c * against);
    const vec pt = cross(s, t.d);
    for (int k = 0; k < 2; ++k)
      t.e[k] = (flux * 2 * n1 * ci / (n1 * ci + n2 * c) * along(in.e[k], s)) * s +
               (flux * 2 * n1 * ci / (n2 * ci + n1 * c) * along(in.e[k], p)) * pt;
    out.refracted = t;
  }
  return out;
}

/// What leaves as seen in its scattering plane (Bohren & Huffman 1983, figure 3.1).
inline Ray outgoing(const Wave& w, vec from, real path) {
  Ray ray;
  ray.valid = true;
  ray.direction = w.d;
  ray.path = path - dot(from, w.d);
  const real rho = std::hypot(w.d.x, w.d.y), c = rho > 0 ? w.d.x / rho : 1, s = rho > 0 ? w.d.y / rho : 0;
  const vec theta = {w.d.z * c, w.d.z * s, -rho}, phi = {-s, c, 0};
  const auto component = [&](vec a, real x, real y) { return along(w.e[0], a) * x + along(w.e[1], a) * y; };
  ray.S2 = component(theta, c, s);
  ray.S3 = component(theta, s, -c);
  ray.S4 = -component(phi, c, s);
  ray.S1 = -component(phi, s, -c);
  return ray;
}

/// Orders 0..last of the ray at (u, v); empty if it misses. Real index n.
inline std::vector<Ray> trace(const Surface& surface, real n, real u, real v, int last) {
  std::vector<Ray> rays;
  const vec z{0, 0, 1}, start{u, v, 0};
  const real deepest = surface.deepest(start, z, -3, 3);
  if (surface.level(start + deepest * z) >= 0) return rays;
  vec p = start + surface.meet(start, z, deepest, -3) * z;
  Wave in{z, {field{1, 0, 0}, field{0, 1, 0}}};
  Split split = at_interface(in, surface.normal(p), 1, n);
  rays.push_back(outgoing(split.reflected, p, p.z));
  Wave inside = *split.refracted;
  rays.back().point = p;
  rays.back().inwards = inside.d;
  real path = p.z;
  for (int order = 1; order <= last; ++order) {
    const real middle = surface.deepest(p, inside.d, 0, 4), t = surface.meet(p, inside.d, middle, 4);
    p = p + t * inside.d;
    path += n * t;
    split = at_interface(inside, -1 * surface.normal(p), n, 1);
    rays.push_back(split.refracted ? outgoing(*split.refracted, p, path) : Ray{});
    inside = split.reflected;
    rays.back().point = p;
    rays.back().inwards = inside.d;
  }
  return rays;
}

} // namespace reference
