#pragma once

#include <scatter/wavefront/edge_wave.hpp>
#include <scatter/wavefront/far_field.hpp>
#include <scatter/wavefront/kirchhoff.hpp>
#include <scatter/wavefront/outline.hpp>

#include <array>
#include <complex>
#include <span>
#include <vector>

/// Order 0 of a drop without patches: light that its surface reflects outside, and forward diffraction by
/// the outline of its shadow. See papers/kirchhoff-method.md.
namespace scatter::wavefront {

/// Order 0 of one drop under one sun at one wavelength.
///
/// Reflection is geometric optics at the one point whose normal halves the angle between the light and the
/// direction, with the coefficients of the sphere of the surface's curvature in the plane of incidence. The
/// edge is a contour integral over the outline, each piece weighted by that sphere's EdgeWave; far from the
/// axis two points of the outline stand for it. Of drops that are not convex only the edge is computed.
///
/// Accuracy on spheres of m = 1.331 against Debye's p = 0, relative to what shines at the angle: S1 5e-4 at
/// k a = 483, 7e-5 from 3900 on; S2 2e-3 and 1e-4, worse about Brewster's angle only. Drops:
/// papers/kirchhoff-method.md. It is meant for k a >= 50 and |m - 1| > 0.05. Surfaces that absorb take the
/// complex index.
class Shadow {
public:
  /// contour_end: up to here, in k a theta, the whole outline is summed, beyond twice that two points stand
  /// for it; 10 .. 80. Throws InputError for k a < 20.
  Shadow(const drop::Shape& shape, double sun_elevation_deg, const Light& light, double contour_end = 25);

  /// What does not change along one half-plane of azimuth phi.
  struct Azimuth {
    double cos_phi = 1, sin_phi = 0;
    /// Waves that leave the rim where it faces phi (0) and where it faces away (1), at even steps of theta.
    struct Step {
      double path = 0;   ///< phase of the edge's wave [rad], -k a theta and k a theta on a sphere
      double scaled = 0; ///< integral of (x/2)^(1/3) over theta along the surface, x its curvature's
      double across = 1; ///< size parameter of the curvature across the plane of scattering
    };
    std::array<std::vector<Step>, 2> sides;
  };
  [[nodiscard]] Azimuth azimuth(double phi_deg) const;

  /// Bohren & Huffman amplitudes of order 0, phase referred to the origin of the drop's polar curve; theta in
  /// degrees, [0, 180].
  [[nodiscard]] Amplitude at(double theta_deg, const Azimuth& azimuth) const;
  [[nodiscard]] Amplitude at(double theta_deg, double phi_deg) const {
    return at(theta_deg, azimuth(phi_deg));
  }

  /// Of order 0 that at() stands for: all of it for convex drops, else next to the axis, where patches leave
  /// off.
  [[nodiscard]] double share(double theta_deg) const;

private:
  struct RimPoint {
    double x = 0, y = 0, z = 0;        ///< units of a
    double normal_x = 1, normal_y = 0; ///< outward
    double length = 0;                 ///< of its piece of the outline
    double outline_radius = 1;         ///< of curvature
    double size = 1;                   ///< parameter of the curvature across the rim
  };
  /// What an edge wave comes to, at even steps of (x/2)^(1/3) theta.
  struct EdgeEntry {
    Polarised weight, moment, second_moment, tail, line, reflected;
  };
  /// The same for one point of the rim, as contour() sums it: mean of both polarisations, and half of what
  /// they differ by.
  struct RimEntry {
    std::complex<double> weight, tail, moments, difference;
  };
  struct RimTable {
    std::vector<RimEntry> entries;
    double steps_per_angle = 1;
    int middle = 0;
  };
  struct Blend {
    std::array<int, 4> at{};
    std::array<double, 4> weight{};
  };
  [[nodiscard]] Blend between_sizes(double x) const;
  [[nodiscard]] EdgeEntry edge(double x, double theta) const;
  [[nodiscard]] RimTable rim_table(const RimPoint& p) const;
  [[nodiscard]] Amplitude contour(double theta, const Azimuth& azimuth) const;
  [[nodiscard]] Amplitude two_points(double theta, const Azimuth& azimuth) const;
  [[nodiscard]] Polarised reflected(double theta, const Azimuth& azimuth) const;
  /// The surface where its normal is that, curvatures in the plane of the normal and `level`.
  struct Bend {
    double support = 1; ///< distance of the tangent plane, units of a
    double x = 1;       ///< size parameter of the curvature along `level`
    double gauss = 1;   ///< Gaussian curvature, 1 / a^2
  };
  [[nodiscard]] Bend
  surface_at(const std::array<double, 3>& normal, const std::array<double, 3>& level) const;
  void describe_surface(const drop::Shape& shape);
  void describe_rim(const drop::Shape& shape, double sun_elevation_deg);

  double reach_ = 1;                ///< theta up to which an edge's wave is followed
  double ka_ = 0, contour_end_ = 0; ///< the latter in theta
  bool convex_ = true;
  std::array<double, 3> axis_{};
  std::vector<RimPoint> rim_;

  /// By the polar angle of the surface's normal, even steps over [0, pi].
  struct SurfacePoint {
    double support = 1;              ///< distance of the tangent plane
    double meridian = 1, across = 1; ///< curvatures
  };
  std::vector<SurfacePoint> surface_;

  std::vector<double> sizes_;                      ///< even in the logarithm
  std::vector<std::vector<EdgeEntry>> edges_;      ///< per size
  std::vector<RimTable> rim_tables_;               ///< per point of the rim, or one for all
  std::vector<std::vector<Polarised>> reflection_; ///< per size, even steps of sqrt(theta)
};

/// Adds share(theta) of order 0 to sums[column][row][8] (field in transverse_basis(), units of k a), on
/// `threads` threads; no bit depends on how many.
void add_shadow(
    const Shadow& shadow, double ka, const Layout& layout, Columns columns, unsigned threads,
    std::span<double> sums);

} // namespace scatter::wavefront
