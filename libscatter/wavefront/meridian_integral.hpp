#pragma once

#include <scatter/wavefront/kirchhoff.hpp>

#include <span>

/// The diffraction integral along lines of constant azimuth, where directions have their caustics in theta
/// alone. See papers/kirchhoff-method.md.
namespace scatter::wavefront {

/// Adds share times the order's integral to sums[column][row][8] (field in transverse_basis(), in units of k
/// a), wherever the azimuth of a ray's direction can stand for that of its impact; there share becomes 0, and
/// elsewhere it stays. Each column is summed by one thread, so that nothing depends on how many run.
void add_meridian_integral(
    RayProgram& rays, const CoarseRays& coarse, const Light& light, int order, const Layout& layout,
    Columns columns, IntegralShare& share, std::span<double> sums);

} // namespace scatter::wavefront
