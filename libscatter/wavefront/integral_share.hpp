#pragma once

#include <scatter/wavefront/coarse_rays.hpp>
#include <scatter/wavefront/layout.hpp>

#include <vector>

namespace scatter::wavefront {

/// The integral's share of one order at every direction of a block of columns, [column][row] in [0, 1];
/// patches keep the rest. Empty where the order has no caustic there.
using IntegralShare = std::vector<float>;

/// Where the integral stands in for patches: around a caustic all of it up to `inner` widths of its Airy
/// pattern, none beyond `outer`; and where rays left at grazing incidence, up to this -tau of
/// kernels/grazing.cl.
struct IntegralZone {
  double inner, outer, grazing;
};
/// Over windows of directions, which cost as much as the zone is large, and along lines of constant azimuth.
/// Patches err by 0.2 % of an order's peak at 10 widths, 0.01 % at 35.
constexpr IntegralZone window_zone{8, 12, 6}, line_zone{30, 40, 6};

/// Where the integral stands in for patches.
[[nodiscard]] IntegralShare integral_share(
    const CoarseRays& coarse, const Light& light, double radius_m, int order, const Layout& layout,
    Columns columns, const IntegralZone& zone);

} // namespace scatter::wavefront
