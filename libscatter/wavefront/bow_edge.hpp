#pragma once

#include <scatter/wavefront/far_field.hpp>

#include <functional>
#include <span>
#include <vector>

/// The edge of a bow, where two sheets of rays meet and geometric intensity rises as g / sqrt(x), x the angle
/// from the edge towards the bright side.
namespace scatter::wavefront {

/// Where to look: an impact point near the edge that the column of azimuth phi crosses.
struct BowEdgeSeed {
  double u = 0, v = 0; ///< units of a
  double phi_deg = 0;  ///< of the column
  int order = 0;
};

struct BowEdge {
  /// none: nothing folds near the seed. unclear: rays are lost, the search does not settle, the fold runs
  /// along the column, or a pole is closer than 1 deg; nothing else below holds then.
  enum class State { found, none, unclear };
  State state = State::unclear;
  double u = 0, v = 0;  ///< the ray that leaves along the edge, units of a
  double theta_deg = 0; ///< of the edge in the column
  int side = 1;         ///< +1: bright towards larger theta, -1: towards smaller
  double curvature =
      0; ///< abs(d2 theta / db2) along the column [rad], b in units of a: x = curvature b^2 / 2
  double focal_offset = 0; ///< how far on the bright side the deflection turns along the radius [rad]
  Amplitude
      amplitude; ///< both sheets' intensities together: |S|^2 a^2 / sqrt(x) per sr, x in rad; S in sqrt(rad)
};

/// Traces rays (u, v) up to the order that is asked for: result[ray][order].
using TraceRays =
    std::function<std::vector<std::vector<TracedRay>>(std::span<const double> u, std::span<const double> v)>;

/// The edges next to the seeds: where the map from the ray plane to (theta, phi) folds, by Newton's iteration
/// over second-order stencils of traced rays. theta is good to about 1e-6 deg.
[[nodiscard]] std::vector<BowEdge> find_bow_edges(const TraceRays& trace, std::span<const BowEdgeSeed> seeds);

/// Hurwitz' zeta function at 1/2 for a > 0, to 1e-12: sum over k of (a + k)^(-1/2), less its diverging
/// integral.
[[nodiscard]] double hurwitz_zeta_half(double a);

} // namespace scatter::wavefront
