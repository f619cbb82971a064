#include <scatter/optics/units.hpp>
#include <scatter/wavefront/integral_taper.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::wavefront {
namespace {

/// A taper begins this far behind the rim's direction [rad].
constexpr double behind_rim = 0.02;

} // namespace

double smooth_step(double a, double inner_end, double outer_end) {
  const double s = std::clamp((a - inner_end) / (outer_end - inner_end), 0.0, 1.0), s2 = s * s;
  return 1 - s2 * s2 * s * (126 - s * (420 - s * (540 - s * (315 - 70 * s))));
}

double fresnel_width(int order, double ka) {
  return std::sqrt(std::max(order, 2) / ka);
}

Taper theta_taper(
    int order, double ka, double half, std::span<const RimAngles> rim, std::array<double, 2> room,
    double wider) {
  const double begin = wider * taper_begin, finish = wider * taper_end;
  const double fresnel = fresnel_width(order, ka);
  // Fresnel's width at an angle from the rim's direction: there directions turn fast.
  const auto rim_fresnel = [&](double angle) {
    return std::max(fresnel, std::sqrt(8 / (ka * std::max(angle, 1e-6))));
  };
  // How far outward so many widths reach, where the rim lies `ahead` and its rays beyond.
  const auto reach_along_rim = [&](double widths, double ahead) {
    double low = std::max(ahead, 0.0), high = low + 3;
    for (int step = 0; step < 30; ++step) {
      const double middle = 0.5 * (low + high);
      (middle < widths * rim_fresnel(middle - ahead) ? low : high) = middle;
    }
    return high;
  };
  Taper taper;
  for (int end = 0; end < 2; ++end) {
    const double sign = end == 0 ? -1 : 1;
    double full = begin * fresnel, none = finish * fresnel, rim_ahead = -1;
    // A taper ends well before the rim or begins behind it, where directions have turned back with a kink;
    // and it takes many of its widths where it falls on the rim's own rays.
    for (const auto& [last, before] : rim) {
      const double ahead = sign * last - half;
      if (sign * before > sign * last) {
        if (ahead > none) continue;
        full = std::max(full, reach_along_rim(begin, ahead));
        none = std::max(none, reach_along_rim(finish, ahead));
      } else if (ahead > -behind_rim) {
        const double width = rim_fresnel(ahead);
        if (finish * width + behind_rim < ahead) {
          full = std::max(full, begin * width);
          none = std::max(none, finish * width);
        } else {
          rim_ahead = std::max(rim_ahead, ahead + behind_rim);
        }
      }
    }
    if (rim_ahead > full) {
      full = rim_ahead;
      none = std::max(none, full + (finish - begin) * fresnel);
    }
    full = std::min(half + full, 1.2);
    none = std::min(half + none, 1.5);
    if (none > room[end]) {
      none = room[end];
      full = std::min(full, std::max(room[end] - 2 * fresnel, half));
    }
    taper.full[end] = sign * full;
    taper.none[end] = sign * none;
  }
  return taper;
}

} // namespace scatter::wavefront
