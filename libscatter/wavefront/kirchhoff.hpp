#pragma once

#include <scatter/wavefront/integral_share.hpp>

/// Diffraction without a tuned constant: near caustics the far field of an order is the Kirchhoff integral
/// over its traced wavefront. See papers/kirchhoff-method.md.
namespace scatter::wavefront {

/// Sines and cosines of a block's rows and columns on the device.
struct DirectionBuffers {
  const cl::Buffer &sin_theta, &cos_theta, &cos_phi, &sin_phi;
};

/// Adds share times the order's integral to sums[column][row][8] (field in transverse_basis(), in units of k
/// a). Windows of directions run side by side; each is one work-item's, so that nothing depends on how many
/// run.
void add_integral(
    RayProgram& rays, const CoarseRays& coarse, const Light& light, int order, const IntegralShare& share,
    const Layout& layout, Columns columns, const DirectionBuffers& directions,
    const IntegralSampling& sampling, cl::Buffer& sums);

} // namespace scatter::wavefront
