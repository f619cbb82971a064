#pragma once

#include <scatter/fiber/assembly.hpp>
#include <scatter/fiber/fiber_scattering.hpp>
#include <scatter/fiber/longitudinal.hpp>

#include <cstdint>
#include <memory>
#include <optional>

/// Hair with controls for artists: sections 4.6.1 to 4.6.3 and appendix B of the dissertation. It is not
/// bound to conserve energy; for multiple scattering it is normalised.
namespace scatter::fiber {

/// One highlight. The artists' names of appendix B stand beside the technical ones.
struct Highlight {
  Rgb colour{1, 1, 1};  ///< C_X; "color"
  double intensity = 1; ///< I_X; "scale"
  double shift = 0;     ///< alpha_X, longitudinal position [rad]; "angular offset"
  double width = 0.1;   ///< beta_X, longitudinal width, a standard deviation [rad]; "roughness"
};

/// Colours and intensities are 0 or more, widths between 0 and 90 deg, both excluded.
struct ArtistHairParameters {
  Highlight primary{{1, 1, 1}, 0.1, -0.0872664625997, 0.1308996938996}; ///< R; "specular component"
  Highlight transmission{
      {0.8, 0.6, 0.4}, 1, 0.0436332312999, 0.0654498469498}; ///< TT; "transmission component"
  Highlight secondary{
      {0.8, 0.6, 0.4}, 0.1, 0.1308996938996, 0.2617993877992}; ///< TRT; "subspecular component"
  double transmission_azimuthal_width = 0.35; ///< gamma_TT [rad]; "spread" of the transmission component
  double glint_intensity = 0.4;       ///< I_g, relative to the secondary highlight; "glint scale", may be 0
  double glint_azimuthal_width = 0.1; ///< gamma_g [rad]; "spread" of the glints
  double glint_half_angle =
      0.65449846949787; ///< G [rad], 30 to 45 deg: draw it per strand, glint_half_angle_of()
};

/// G of strand number `strand` [rad], uniform over 30..45 deg: the same for the same seed and strand,
/// whatever the order of work (a hash, no generator's state).
[[nodiscard]] double glint_half_angle_of(std::uint64_t strand, std::uint64_t seed = 0);

/// f' = sum of C_X I_X M'_X(theta_h) N'_X(phi) / cos^2 theta_d, M' a Gaussian of unit height, N'_R =
/// cos(phi/2), N'_TT = g'(gamma_TT^2, pi - |phi|), N'_TRT = cos(phi/2) + I_g g'(gamma_g^2, G - |phi|).
/// Reciprocal. Values to rounding, energies 1e-12. Light spread by other strands keeps each lobe's energy
/// (Variant::corrected), or its height, as the pseudo-code of 4.6.2 prints it.
class ArtistHair : public LobedScattering {
public:
  /// Throws InputError that names the field.
  explicit ArtistHair(const ArtistHairParameters& parameters, Variant variant = Variant::corrected);

  using FiberScattering::eval;
  [[nodiscard]] Rgb eval(const Angles& angles) const override;
  [[nodiscard]] double pdf(const Angles& angles) const override;
  [[nodiscard]] ScatteringSample sample(double theta_i, const std::array<double, 3>& u) const override;
  [[nodiscard]] std::vector<LobeEnergy> lobe_energies(double theta_i) const override;
  [[nodiscard]] Rgb eval_scattered(const Angles& angles, const Rgb& variance) const override;
  [[nodiscard]] std::vector<ScatteredLobe>
  scattered_lobes(double theta_i, const Rgb& variance) const override;
  [[nodiscard]] const ArtistHairParameters& parameters() const { return parameters_; }

private:
  static constexpr std::size_t lobe_count = 3, part_count = 4; ///< the glints are a part of the TRT lobe
  struct Azimuth {
    double energy, forward, forward_half; ///< as OrderMoments
  };
  [[nodiscard]] double azimuthal(std::size_t lobe, double phi) const;
  /// Integral of M' cos^2 theta_o / cos^2 theta_d over theta_o.
  [[nodiscard]] double longitudinal_energy(std::size_t lobe, double theta_i) const;
  [[nodiscard]] std::array<double, part_count> choice(double theta_i) const;

  ArtistHairParameters parameters_;
  Variant variant_;
  std::array<LongitudinalKernel, lobe_count> kernels_;
  std::array<Rgb, lobe_count> tint_;
  std::array<Azimuth, part_count> parts_;
  std::vector<std::array<double, lobe_count>> energy_table_; ///< for the choice of a lobe only
};

/// How (4.17) divides. The formula to the letter makes every colour's energy 1, and so the hair white when
/// light has been scattered often.
enum class Normalisation {
  brightest, ///< by the largest of the three energies: that colour conserves energy, the others stay in
             ///< proportion
  each,      ///< each colour by its own, as printed
};

/// f'norm(theta_i, ..) = f' / E(theta_i), E the integral of f' cos theta_o d omega (4.17, corrected: the
/// print integrates f' d theta d phi). At each theta_i all of the energy comes out again; not reciprocal
/// unless E is even. A fibre whose energy is zero stays black.
class NormalisedScattering : public LobedScattering {
public:
  /// E is tabulated over theta_i in 361 nodes, relative error below 1e-8 for widths of 2 deg and more.
  explicit NormalisedScattering(
      std::shared_ptr<const LobedScattering> of, Normalisation normalisation = Normalisation::brightest);

  using FiberScattering::eval;
  [[nodiscard]] Rgb eval(const Angles& angles) const override;
  [[nodiscard]] double pdf(const Angles& angles) const override;
  [[nodiscard]] ScatteringSample sample(double theta_i, const std::array<double, 3>& u) const override;
  [[nodiscard]] std::vector<LobeEnergy> lobe_energies(double theta_i) const override;
  [[nodiscard]] Rgb eval_scattered(const Angles& angles, const Rgb& variance) const override;
  [[nodiscard]] std::vector<ScatteredLobe>
  scattered_lobes(double theta_i, const Rgb& variance) const override;

private:
  /// 1 / E per colour.
  [[nodiscard]] Rgb factors(double theta_i) const;
  [[nodiscard]] Rgb factors_of(const Rgb& energy) const;

  std::shared_ptr<const LobedScattering> of_;
  Normalisation normalisation_;
  double first_, step_;
  std::vector<Rgb> energy_;
};

/// The whole of 4.6: one set of parameters for single scattering, and one for multiple scattering, which is
/// the same unless it is given (4.6.3).
struct ArtistHairShading {
  ArtistHairParameters single;
  std::optional<ArtistHairParameters> multiple{}; ///< without: linked to single
  Normalisation normalisation = Normalisation::brightest;
  DualScatteringOptions dual{}; ///< with the adjustments of back and forward scattering
};
/// f_s of `single` for direct light; averages and scattered light from `multiple`, or `single` without it,
/// normalised. Throws InputError that names the field of either set that ArtistHair refuses, and for density
/// factors outside 0..1.
[[nodiscard]] DualScattering dual_scattering(const ArtistHairShading& shading);

} // namespace scatter::fiber
