#pragma once

#include <scatter/wavefront/coarse_rays.hpp>

#include <vector>

/// Internal to scatter::wavefront: what a drop's rim asks of the diffraction integral.
namespace scatter::wavefront {

/// Rays so near to the rim [rad] say how momenta are to be unfolded.
constexpr double off_the_rim = 0.25;

/// What a drop's rim asks of W: at each azimuth of impact, where its ray leaves, and the W'' for which
/// momenta have no fold there that no caustic belongs to. See papers/kirchhoff-method.md.
struct RimBend {
  double azimuth, theta, bend;
};

/// Of the azimuths whose rays at the rim go out; exact where they do so by refraction, fitted to the first
/// rays that do not tunnel out elsewhere.
[[nodiscard]] std::vector<RimBend> rim_bends(const CoarseRays& coarse, int order, double ka);

} // namespace scatter::wavefront
