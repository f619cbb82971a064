#pragma once

#include <scatter/fiber/fiber_scattering.hpp>

#include <glm/vec3.hpp>

#include <array>
#include <string>
#include <vector>

/// Scattering by one thread of a fabric, a bundle of fibres seen from afar: a reflection at its surface and
/// light that comes back out of its volume.
namespace scatter::fiber {

/// The dissertation's surface lobe, equation 5.7, and the same with the energy that a smooth cylinder of
/// that index reflects: the Gaussian's area is taken over the inclination of one direction, not over
/// theta_h, and cos(phi/2) is the share cos(phi/2) / 4 of a circular section. It is an eighth of the print.
enum class SurfaceLobe { printed, energy_true };

/// "printed" or "energy-true". Throws InputError that lists both.
[[nodiscard]] SurfaceLobe parse_surface_lobe(const std::string& name);
[[nodiscard]] const char* surface_lobe_name(SurfaceLobe lobe);

/// Table 5.2 of the dissertation. Angles in radians.
struct ThreadParameters {
  double eta = 1.46;          ///< refractive index
  double kd = 0.3;            ///< share of the volume's light that is isotropic, 0..1
  double gamma_s = 0.2;       ///< standard deviation of the surface's Gaussian in theta_h
  double gamma_v = 0.4;       ///< the same of the volume's
  glm::dvec3 albedo{1, 1, 1}; ///< A: red, green, blue, 0..1
};

/// Throws InputError for eta outside (1, 10], kd or albedo outside 0..1, gammas outside 0.01 deg <= gamma <
/// 90 deg: the message begins with `where` and the field's name as fabric files spell it.
void check(const ThreadParameters& thread, const std::string& where);

/// The parts of f_s [1/sr]: f_s = surface + albedo * volume.
struct ThreadLobes {
  double surface = 0, volume = 0;
};

/// f_s(light, view) of radiance = integral f_s L cos theta_i d omega_i (equation 5.6). Reciprocal: f_s does
/// not change when light and view are exchanged. Objects do not change and may be shared by threads.
///
///   f_s = [F cos(phi/2) g(gamma_s, theta_h) + A (1-F)^2 ((1-kd) g(gamma_v, theta_h) + kd) /
///          (cos theta_i + cos theta_o)] / cos^2 theta_d,
///
/// g a Gaussian of unit area, F the exact reflectivity of unpolarised light at the incidence whose cosine is
/// cos theta_d cos(phi/2); theta_h, theta_d half sum and half difference. Source: the dissertation, equations
/// 5.7-5.11; the half differences, and the same F on the way in and out, are ours (papers/sadeghi-fibres.md).
/// Zero where a direction is along the thread, to 1e-8 rad; cos^2 theta_d is not taken below 1e-8, which
/// matters only where both are within 0.006 deg of the thread's two ends. Accuracy: relative 1e-12 where both
/// are 0.1 deg or more away from the thread.
class Thread : public FiberScattering {
public:
  /// Throws InputError as check() does.
  explicit Thread(const ThreadParameters& parameters, SurfaceLobe surface = SurfaceLobe::printed);

  [[nodiscard]] const ThreadParameters& parameters() const { return parameters_; }
  [[nodiscard]] SurfaceLobe surface() const { return surface_; }

  /// Angles as bounded() returns them.
  [[nodiscard]] ThreadLobes lobes(const Angles& angles) const;

  using FiberScattering::eval;
  [[nodiscard]] Rgb eval(const Angles& angles) const override;
  /// Density of sample(): one of three lobes is picked by its energy, then theta and phi by inverting their
  /// distributions: a truncated Gaussian and cos(phi/2); a truncated Gaussian; 1/cos^2 theta_d.
  [[nodiscard]] double pdf(const Angles& angles) const override;
  [[nodiscard]] ScatteringSample sample(double theta_i, const std::array<double, 3>& u) const override;
  /// Surface, the volume's Gaussian, and what is isotropic in the volume; to 1e-9 of their sum for
  /// |theta_i| <= 89 deg. With the printed surface lobe the sum, albedo(), may exceed 1.
  [[nodiscard]] std::vector<LobeEnergy> lobe_energies(double theta_i) const override;

private:
  using LobeWeights = std::array<double, 3>;
  [[nodiscard]] LobeWeights lobe_weights(double theta_i) const;

  ThreadParameters parameters_;
  SurfaceLobe surface_;
  double surface_scale_ = 1;
  std::vector<LobeWeights> weights_; ///< at equal steps of |theta_i|
};

/// Inclinations and azimuth from directions in the thread's frame; unlike an arc sine keeps all digits near
/// the tangent.
[[nodiscard]] Angles thread_angles(const Frame& frame, const glm::dvec3& to_light, const glm::dvec3& to_eye);

} // namespace scatter::fiber
