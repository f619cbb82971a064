#pragma once

#include <scatter/wavefront/rim_bends.hpp>
#include <scatter/wavefront/rings.hpp>

#include <array>
#include <optional>
#include <span>
#include <vector>

/// Internal to scatter::wavefront: what keeps a drop's momenta from folding where no caustic is.
namespace scatter::wavefront {

/// References by azimuth.
class References {
public:
  References(
      std::span<const Ring> rings, const Places& places, const Outline& outline, std::vector<RimBend> rim,
      double ka);

  /// One for which the momentum of all rays that a stretch takes at this azimuth grows with the angle of
  /// incidence; none if there is none.
  [[nodiscard]] std::optional<Reference> serving(double phi, const Stretch& s) const;

private:
  [[nodiscard]] Reference at_rim(double phi) const;

  static constexpr int knots = 128; ///< even in azimuth
  /// Of one ring's ray at a knot, by angle of incidence and in units of what the momentum changes by on a
  /// sphere.
  struct Change {
    double from_rim = 0, from_grazing = 0, theta = 0, of_momentum = 0, of_theta = 0;
    [[nodiscard]] bool is_next_to_rim() const { return from_grazing < off_the_rim; }
    [[nodiscard]] double with(double slope) const { return of_momentum - slope * of_theta; }
  };
  [[nodiscard]] static int knot_at(double phi) {
    const int knot = static_cast<int>(std::lrint(phi / (2 * pi) * knots)) % knots;
    return knot < 0 ? knot + knots : knot;
  }

  double steepest_; ///< change of momentum per angle times the angle between ray and direction, at most
  std::array<std::vector<Change>, knots> changes_; ///< ring by ring, but for those that tunnel
  std::vector<RimBend> rim_;                       ///< by azimuth of impact
};

} // namespace scatter::wavefront
