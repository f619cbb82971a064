#pragma once

#include <scatter/fiber/frame.hpp>

#include <array>
#include <span>
#include <vector>

/// What every fibre's scattering function offers, whatever it is made of.
///
/// f_s is the curve scattering function of Marschner et al. (2003): the curve radiance that leaves toward the
/// eye over the curve irradiance from the light's direction [1/sr]. Neither cosine is in it. What leaves is
/// D * integral of f_s L_i cos theta_i d omega_i for a fibre of diameter D (4.4), and the share of the
/// energy from theta_i that leaves at all is albedo = integral of f_s cos theta_o d omega_o, with d omega =
/// cos theta d theta d phi: no other cosines.
namespace scatter::fiber {

/// Red, green, blue, or any three wavelengths.
using Rgb = std::array<double, 3>;

/// A direction drawn for light that comes from theta_i.
struct ScatteringSample {
  double theta_o = 0, phi = 0;
  Rgb weight{};   ///< f_s cos theta_o / pdf
  double pdf = 0; ///< per solid angle, as pdf() gives it
};

/// One lobe's share of the energy from theta_i: the integrals of f_X cos theta_o d omega with the weights
/// |phi| / pi (forward) and 1 - |phi| / pi (backward).
struct LobeEnergy {
  double shift = 0, width = 0; ///< of theta_h [rad]: where the lobe lies, and its standard deviation
  Rgb forward{}, backward{};
};

/// Objects do not change: they may be used by many threads. Angles in radians; outside of |theta| <= pi/2
/// they are clamped to it. Nothing returns NaN or infinity.
class FiberScattering {
public:
  virtual ~FiberScattering() = default;

  /// f_s [1/sr].
  [[nodiscard]] virtual Rgb eval(const Angles& angles) const = 0;
  /// Density [1/sr] with which sample() draws the eye's direction for light from angles.theta_i.
  [[nodiscard]] virtual double pdf(const Angles& angles) const = 0;
  /// u: three numbers in [0, 1), independent and uniform. A function that is reciprocal serves both ways: for
  /// light sought from a given eye, exchange i and o.
  [[nodiscard]] virtual ScatteringSample sample(double theta_i, const std::array<double, 3>& u) const = 0;
  /// The energies of its lobes, |theta_i| < pi/2. Here, by adaptive quadrature of eval() to 1e-9: one lobe,
  /// its shift and width those of the average over the colours.
  [[nodiscard]] virtual std::vector<LobeEnergy> lobe_energies(double theta_i) const;

  /// Share of the energy from theta_i that is scattered, not absorbed.
  [[nodiscard]] Rgb albedo(double theta_i) const;
  /// f_s between two directions, which need not have unit length. Throws InputError for one that is zero or
  /// not finite.
  [[nodiscard]] Rgb eval(const Frame& frame, const glm::dvec3& to_light, const glm::dvec3& to_eye) const;

protected:
  /// For sample(): a direction with its density and its weight, which is 0 where the density is.
  [[nodiscard]] ScatteringSample weighed(const Angles& angles) const;
};

/// One lobe of light that other strands have spread before, as LobedScattering::scattered_lobes() gives it.
struct ScatteredLobe {
  double shift = 0; ///< of theta_h [rad]
  Rgb variance{};   ///< of theta_h [rad^2], the strands' included
  Rgb energy{}; ///< about what eval_scattered() has of the lobe times cos theta_o d omega, over all theta_o
};

/// A fibre whose lobes are kernels along it times functions around it, as dual scattering takes them apart.
class LobedScattering : public FiberScattering {
public:
  /// Light that has passed through strands before: sum of M^G_X N^G_X / cos^2 theta_d, where each lobe's
  /// variance has grown by variance[channel] [rad^2], and N^G_X is the mean of N_X over pi/2 <= |phi| <= pi
  /// (4.34, 4.35). phi of the angles does not matter. Throws InputError for a variance that is negative or
  /// not finite, as scattered_lobes() does.
  [[nodiscard]] virtual Rgb eval_scattered(const Angles& angles, const Rgb& variance) const = 0;
  /// The lobes that eval_scattered() is a sum of, to draw directions from: normal distributions of theta_h,
  /// uniform around the fibre. Shifts and variances are exact; an energy leaves out cos^2 theta_o /
  /// cos^2 theta_d and takes what goes around the fibre where it is brightest: of the lobe's peak and one and
  /// two deviations of theta_o to either side.
  [[nodiscard]] virtual std::vector<ScatteredLobe>
  scattered_lobes(double theta_i, const Rgb& variance) const = 0;
};

/// Where formulas divide by cos theta_d or need |theta_d| < pi/2, it is taken no larger than this: 1e-5 rad
/// short of the fibre's axis, where the light that falls on the fibre has all but vanished.
inline constexpr double largest_theta_d = 1.5707863267948966;

/// Angles within bounds: |theta| <= pi/2. A NaN is refused with InputError.
[[nodiscard]] Angles bounded(const Angles& angles);

/// Throws InputError unless -pi/2 < theta_i < pi/2.
void check_inclination(double theta_i);

/// Throws InputError unless every colour's variance is finite and 0 or more.
void check_variance(const Rgb& variance);

/// Which of the shares, 0 or more with the sum 1, has u in 0..1: never one that is 0, however sums round, if
/// any other is not.
[[nodiscard]] std::size_t chosen(std::span<const double> shares, double u);

} // namespace scatter::fiber
