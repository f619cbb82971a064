#pragma once

#include "reference_tracer.hpp"

/// Focal lines counted by looking: a tube of four neighbouring rays of the reference tracer is followed along
/// every chord in fine steps. Nothing here knows about curvature.
namespace reference {

/// Focal lines that a ray has passed when it leaves.
struct Foci {
  int inside = 0, total = 0;
  /// Smallest area at a surface or at infinity, in units of what the tube's sides would make at right angles:
  /// where it is next to nothing, a focus sits there and belongs to either side.
  real margin = 1;
};

/// The tube's ends: a ray and its four neighbours, u-, u+, v-, v+.
struct Tube {
  vec point, direction;
  std::array<vec, 4> points, directions;

  /// Area across the ray at a distance s, divided by (1 + s)^2.
  [[nodiscard]] real area(real s) const { return dot(direction, cross(side(0, s), side(2, s))); }
  [[nodiscard]] real margin(real s) const {
    const vec a = side(0, s), b = side(2, s);
    return std::abs(dot(direction, cross(a, b))) / (norm(a) * norm(b));
  }

private:
  [[nodiscard]] vec side(int first, real s) const {
    return (1 / (1 + s)) * (meet(first + 1, s) - meet(first, s));
  }
  /// Where a neighbour meets the plane across the ray.
  [[nodiscard]] vec meet(int i, real s) const {
    const vec apart = point + s * direction - points[i];
    return points[i] + (dot(direction, apart) / dot(direction, directions[i])) * directions[i];
  }
};

/// Zeros of the area for 0 < s < length; a touching counts twice. The steps are even in s / (1 + s).
inline int zeros_along(const Tube& tube, real length) {
  constexpr int steps = 300;
  const real end = length / (1 + length);
  const auto area = [&](real part) { return tube.area(part / (1 - part)); };
  int zeros = 0;
  real before = 0, middle = 0, latest = area(0);
  for (int i = 1; i <= steps; ++i) {
    before = middle;
    middle = latest;
    latest = area(end * i / steps);
    if (middle * latest < 0) ++zeros;
    // Between steps two zeros may hide, where the area comes close to none and turns away.
    if (i < 2 || before * middle < 0 || middle * latest < 0 || std::abs(middle) > std::abs(before) ||
        std::abs(middle) > std::abs(latest))
      continue;
    real low = end * (i - 2) / steps, high = end * i / steps;
    const real sign = middle < 0 ? -1 : 1;
    for (int k = 0; k < 80; ++k) {
      const real a = low + (high - low) / 3, b = high - (high - low) / 3;
      if (sign * area(a) < sign * area(b))
        high = b;
      else
        low = a;
    }
    if (sign * area((low + high) / 2) < 1e-9L * std::max(std::abs(before), std::abs(latest))) zeros += 2;
  }
  return zeros;
}

/// A ray with its four neighbours, u-, u+, v-, v+.
struct Bundle {
  static constexpr real apart = 1e-10L;
  std::vector<Ray> ray;
  std::array<std::vector<Ray>, 4> around;

  /// Empty where one of the five misses.
  Bundle(const Surface& surface, real n, real u, real v, int last)
      : ray(trace(surface, n, u, v, last)), around{
                                                trace(surface, n, u - apart, v, last),
                                                trace(surface, n, u + apart, v, last),
                                                trace(surface, n, u, v - apart, last),
                                                trace(surface, n, u, v + apart, last)} {
    for (const auto& other : around)
      if (other.empty()) ray.clear();
  }
  /// Whether all five leave at order p.
  [[nodiscard]] bool leaves(std::size_t p) const {
    return ray[p].valid && around[0][p].valid && around[1][p].valid && around[2][p].valid &&
           around[3][p].valid;
  }
  /// Central difference by u (axis 0) or v (1).
  [[nodiscard]] vec direction_by(int axis, std::size_t p) const {
    return (1 / (2 * apart)) * (around[2 * axis + 1][p].direction - around[2 * axis][p].direction);
  }
  [[nodiscard]] vec point_by(int axis, std::size_t p) const {
    return (1 / (2 * apart)) * (around[2 * axis + 1][p].point - around[2 * axis][p].point);
  }
};

/// Of all orders of the bundle.
inline std::vector<Foci> count_foci(const Bundle& bundle) {
  constexpr real far_away = 1e6L;
  const auto& [ray, around] = bundle;
  const int last = static_cast<int>(ray.size()) - 1;
  std::vector<Foci> foci;
  Foci sofar;
  for (int p = 0; p <= last; ++p) {
    Tube tube{ray[p].point, {}, {}, {}};
    for (int i = 0; i < 4; ++i) tube.points[i] = around[i][p].point;
    if (p > 0) {
      Tube chord{ray[p - 1].point, ray[p - 1].inwards, {}, {}};
      for (int i = 0; i < 4; ++i) {
        chord.points[i] = around[i][p - 1].point;
        chord.directions[i] = around[i][p - 1].inwards;
      }
      const real length = norm(ray[p].point - ray[p - 1].point);
      sofar.inside += zeros_along(chord, length);
      sofar.margin = std::min(sofar.margin, chord.margin(length));
    }
    Foci leaving = sofar;
    leaving.total = leaving.inside;
    if (bundle.leaves(p)) {
      tube.direction = ray[p].direction;
      for (int i = 0; i < 4; ++i) tube.directions[i] = around[i][p].direction;
      leaving.total += zeros_along(tube, far_away);
      leaving.margin = std::min(leaving.margin, tube.margin(far_away));
    }
    foci.push_back(leaving);
  }
  return foci;
}

} // namespace reference
