#pragma once

#include <scatter/wavefront/layout.hpp>
#include <scatter/wavefront/ray_program.hpp>

#include <array>
#include <vector>

/// Diffraction without a tuned constant: near caustics the far field of an order is the Kirchhoff integral
/// over its traced wavefront. See papers/kirchhoff-method.md.
namespace scatter::wavefront {

/// The integral's share of one order at every direction of a block of columns, [column][row] in [0, 1];
/// patches keep the rest. Empty where the order has no caustic there.
using IntegralShare = std::vector<float>;

/// A drop's rays on a coarse grid, for all orders: enough to know where caustics are and which rays go where.
class CoarseRays {
public:
  /// Rays even in the angle of incidence and the azimuth, orders 0..last.
  CoarseRays(RayProgram& rays, const Light& light, int last);

  static constexpr int alphas = 128;
  static constexpr int azimuths = 256;

  struct Node {
    bool valid = false;   ///< it leaves by refraction
    bool tunnels = false; ///< it would be reflected totally, and leaves along the surface
    std::array<double, 3> direction{}, point{};
    /// Derivatives of both by the impact point.
    std::array<std::array<double, 3>, 2> point_slope{}, direction_slope{};
    double turn = 0; ///< solid angle per incident area, with its sign
    int foci = 0;    ///< to infinity
    [[nodiscard]] bool goes_out() const { return valid || tunnels; }
  };
  /// alpha 0..alphas, azimuth any integer (wraps).
  [[nodiscard]] const Node& node(int order, int alpha, int azimuth) const {
    const int a = ((azimuth % azimuths) + azimuths) % azimuths;
    return nodes_[(static_cast<std::size_t>(order) * (alphas + 1) + alpha) * azimuths + a];
  }

private:
  std::vector<Node> nodes_;
};

/// What coarse rays take per order while they are made.
[[nodiscard]] constexpr double coarse_rays_bytes() {
  return (CoarseRays::alphas + 1.0) * CoarseRays::azimuths *
         (sizeof(CoarseRays::Node) + 2.0 * RawRays::fields * sizeof(double));
}

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

/// Sines and cosines of a block's rows and columns on the device.
struct DirectionBuffers {
  const cl::Buffer &sin_theta, &cos_theta, &cos_phi, &sin_phi;
};

/// Adds share times the order's integral to sums[column][row][8] (field in transverse_basis(), in units of k
/// a). Windows of directions run side by side; each is one work-item's, so that nothing depends on how many
/// run.
void add_integral(
    RayProgram& rays, const CoarseRays& coarse, const Light& light, int order, const IntegralShare& share,
    const Layout& layout, Columns columns, const DirectionBuffers& directions, cl::Buffer& sums);

} // namespace scatter::wavefront
