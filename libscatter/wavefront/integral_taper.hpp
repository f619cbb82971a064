#pragma once

#include <scatter/optics/units.hpp>

#include <array>
#include <span>

/// Internal to scatter::wavefront: which rays the diffraction integral takes for a range of directions.
namespace scatter::wavefront {

/// Phase between neighbouring rays, in half-turns, at most: at 2 they would add up like those of another
/// direction.
constexpr double phase_step = 1.2;
/// Change of momentum per angle between rays, at most.
constexpr double steepest_momentum = 1.5;
/// The taper begins and ends this many Fresnel widths outside the range.
constexpr double taper_begin = 4, taper_end = 10;
/// How far beyond the rim rays are taken, in tau of kernels/grazing.cl.
constexpr double rim_reach = 5;

/// From 1 at inner_end to 0 at outer_end and beyond, with four continuous derivatives; inner_end <
/// outer_end, or both negative and the other way round.
[[nodiscard]] double smooth_step(double a, double inner_end, double outer_end);

/// Fresnel's width of an order in angle [rad], ka = size parameter.
[[nodiscard]] double fresnel_width(int order, double ka);

/// Rays count fully between `full`, and not at all outside `none`: angles [rad] from the middle of the range,
/// negative ones first.
struct Taper {
  std::array<double, 2> full{}, none{};
  [[nodiscard]] double operator()(double angle) const {
    return smooth_step(angle, full[0], none[0]) * smooth_step(angle, full[1], none[1]);
  }
};

/// Scattering angles of the rim's ray at some azimuth and of a ray just inside it [rad], from the middle of
/// the range.
struct RimAngles {
  double last, before;
};

/// Scattering angles [rad] that tapers keep to: short of the poles of theta and phi, where azimuths change
/// fast.
constexpr std::array<double, 2> between_poles = {0.07, pi - 0.07};

/// The taper of scattering angles within `half` of theta (radians), by so much wider than usual. It ends well
/// before the rim's direction, where directions turn fast, or behind it, and within `room`, angles from the
/// middle downward and upward.
[[nodiscard]] Taper theta_taper(
    int order, double ka, double half, std::span<const RimAngles> rim, std::array<double, 2> room,
    double wider);

} // namespace scatter::wavefront
