#pragma once

#include <scatter/exact/sun_disc.hpp>
#include <scatter/phase/request.hpp>

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace scatter::phase {

/// How wrong settings are on a sphere, where exact theory knows: the sphere of the drop's volume is traced as
/// the drop would be and held to Lorenz-Mie. Spheres beyond a size parameter of 50000 at
/// the shortest wavelength are judged by smaller ones with fewer rays, which may miss what rows too far apart
/// make of their ripple. Not for several threads at once.
class SphereTrial {
public:
  /// Angles, drop and sun's disc (the mean sun's, if there is none) are the request's.
  SphereTrial(const Request& request, std::span<const wavefront::Light> lights);

  /// Relative errors of the intensity averaged over the sun's disc at some of the lights, [which][theta]:
  /// root of the mean square about each angle, 0.5 deg to both sides or half a fringe of the rim's rays if
  /// that is more; on deformed drops the worst of these as far as bows may be shifted. 1e-9 at least. Throws
  /// compute::DeviceError.
  [[nodiscard]] std::vector<std::vector<double>>
  errors(std::span<const std::size_t> which, Diffraction diffraction, int rays, std::span<const int> orders);

private:
  /// Averages at centres_deg_ as exact theory has them.
  [[nodiscard]] const std::vector<double>& truth(std::size_t light);
  /// About theta_deg_, of relative errors at centres_deg_.
  [[nodiscard]] std::vector<double>
  about_angles(std::span<const double> errors, double half_window_deg) const;

  Request trial_;                 ///< the sphere's; its angles are those that are traced
  std::vector<double> theta_deg_; ///< of the request
  double size_parameter_;         ///< of trial_ at the shortest wavelength
  double fewer_rays_;             ///< share of the rays that stand for all of a larger drop's
  double pole_deg_;               ///< angles nearer to a pole have the errors of those alone
  double shift_deg_;
  std::vector<double> centres_deg_;
  std::vector<std::size_t>
      centre_at_; ///< places in what is traced; none: it is sharp, and exact_disc_ averages
  std::optional<exact::SunDisc> exact_disc_;
  std::vector<wavefront::Light> lights_;
  std::vector<std::vector<double>> truth_; ///< [light][centre]; empty: not yet known
};

} // namespace scatter::phase
