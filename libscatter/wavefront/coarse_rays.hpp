#pragma once

#include <scatter/wavefront/ray_program.hpp>

#include <array>
#include <vector>

namespace scatter::wavefront {

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

} // namespace scatter::wavefront
