#pragma once

#include <scatter/fiber/cross_section.hpp>
#include <scatter/fiber/fiber_scattering.hpp>
#include <scatter/fiber/longitudinal.hpp>
#include <scatter/fiber/moment_table.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/fiber/ray_section_kernel.hpp>

#include <memory>
#include <span>
#include <vector>

/// Hair as Marschner et al. (2003) and section 4.6 of the dissertation have it: light that is reflected (R),
/// that passes (TT), that is reflected once inside (TRT), and a residual lobe of all that is reflected more
/// often. f_s = sum over lobes X of M_X(theta_h) N_X(theta_d, phi) / cos^2 theta_d.
namespace scatter::fiber {

/// The dissertation as printed, or with its errors corrected.
enum class Variant { corrected, printed };

struct HairParameters {
  double eta = 1.55;               ///< index of refraction, > 1 (Robbins 1994)
  Rgb sigma_a{0.2, 0.3, 0.5};      ///< absorption per radius, >= 0 (appendix C)
  double shift = -0.0872664625997; ///< of R [rad], -5 deg: the cuticle tilts it toward the root
  double width = 0.1308996938996;  ///< of R [rad], 7.5 deg, a standard deviation of theta_h
  /// The lobe of the orders from 3 on. Without it light that is reflected twice inside or more is lost.
  bool residual = true;
  /// printed: M_X = g(beta_X^2, theta_h - alpha_X), twice the energy; corrected: half of it, since
  /// d theta_o = 2 d theta_h.
  Variant variant = Variant::corrected;
};

/// TT has the shift -shift/2 and the width width/2, TRT -3 shift/2 and 2 width (Marschner et al., table 1),
/// the residual lobe those of TRT. The residual lobe has the energy of all orders from 3 on and is uniform in
/// phi. Reciprocal to rounding. eval() has the accuracy of the section; energies 1e-10. Near grazing light
/// the factor 1 / cos^2 theta_d lets wide lobes gain energy: hair of the standard widths without absorption
/// has an albedo below 1 up to 80 deg, 1.6 at 89 deg.
class HairScattering : public LobedScattering {
public:
  static constexpr std::size_t lobe_count = 4; ///< R, TT, TRT, residual

  /// A round, smooth section traced by rays. Throws InputError that names the field.
  explicit HairScattering(const HairParameters& parameters);
  /// Any section, one per colour (they may be the same object). Its moments are tabulated over theta_d, in as
  /// many panels as the tolerance, absolute, 1e-14..1e-2, asks for: up to 33,000 places with four moments
  /// each. A WaveSection solves Maxwell's equations for each: give it 1e-6 and a small size parameter, or
  /// leave out the residual lobe, which has the resonances. Its R has all diffraction in it, and its residual
  /// the interference of all orders; energies then add up to more than 1. Throws InputError that names the
  /// field, and for a section that is missing.
  HairScattering(
      const HairParameters& parameters, std::array<std::shared_ptr<const CrossSection>, 3> sections,
      double tolerance = 1e-12);

  using FiberScattering::eval;
  [[nodiscard]] Rgb eval(const Angles& angles) const override;
  /// Many directions at once, on vectors: value [colour][direction], 3
  /// times as many as directions. Against eval() relative 1e-12 where phi is 1e-3 rad or more from a caustic
  /// and from the rims of lit azimuths, 1e-15 over the distance where nearer. Sections other than round ones
  /// are evaluated one by one. Throws InputError for NaN and lengths that do not match.
  void eval(
      std::span<const double> theta_i, std::span<const double> theta_o, std::span<const double> phi,
      std::span<double> value, const exact::VectorUnit& unit = exact::vector_units()[0]) const;
  [[nodiscard]] double pdf(const Angles& angles) const override;
  /// A lobe by its energy, theta_o by its kernel, phi by the offset h of a ray across the section: no caustic
  /// makes a weight large.
  [[nodiscard]] ScatteringSample sample(double theta_i, const std::array<double, 3>& u) const override;
  /// |theta_i| < pi/2. Four lobes, or three without the residual.
  [[nodiscard]] std::vector<LobeEnergy> lobe_energies(double theta_i) const override;
  [[nodiscard]] Rgb eval_scattered(const Angles& angles, const Rgb& variance) const override;
  [[nodiscard]] std::vector<ScatteredLobe>
  scattered_lobes(double theta_i, const Rgb& variance) const override;

  [[nodiscard]] const HairParameters& parameters() const { return parameters_; }
  [[nodiscard]] std::size_t lobes() const { return parameters_.residual ? 4 : 3; }
  [[nodiscard]] const LongitudinalKernel& kernel(std::size_t lobe) const { return kernels_[lobe]; }
  /// N_X(theta_d, phi) of a colour [1/rad].
  [[nodiscard]] double azimuthal(std::size_t lobe, std::size_t channel, double theta_d, double phi) const;
  /// The residual lobe's energy per colour; empty when the section is not round.
  [[nodiscard]] const std::vector<ResidualEnergy>& residual_series() const { return residual_energy_; }
  /// Moments of N_X, from a table: 1e-10 with the default tolerance.
  [[nodiscard]] OrderMoments moments(std::size_t lobe, std::size_t channel, double theta_d) const;

private:
  void build(double tolerance);
  [[nodiscard]] double residual(std::size_t channel, double theta_d) const;
  /// As moments() has it.
  [[nodiscard]] double forward_half(std::size_t lobe, std::size_t channel, double theta_d) const;
  HairScattering(
      const HairParameters& parameters, std::array<std::shared_ptr<const CrossSection>, 3> sections,
      double least_uniform, double tolerance);
  [[nodiscard]] std::array<double, lobe_count> choice(double theta_i) const;

  HairParameters parameters_;
  std::array<LongitudinalKernel, lobe_count> kernels_;
  std::array<std::shared_ptr<const CrossSection>, 3> sections_;
  RaySection rays_;      ///< without absorption: where rays go, for sampling
  double least_uniform_; ///< share of samples that no ray of a round section leads; 0: the section is round
  MomentTable table_;    ///< [channel][R, TT, TRT][energy, forward, forward_half]
  /// Energy of the residual lobe per colour: a series for round sections, a table for others.
  std::vector<ResidualEnergy> residual_energy_;
  MomentTable residual_table_;
};

/// Throws InputError for lists of directions with NaN or of lengths that do not match, with 3 values per
/// direction.
void check_directions(
    std::span<const double> theta_i, std::span<const double> theta_o, std::span<const double> phi,
    std::size_t values);

} // namespace scatter::fiber
