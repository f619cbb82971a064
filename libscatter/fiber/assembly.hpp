#pragma once

#include <scatter/fiber/fiber_scattering.hpp>
#include <scatter/fiber/hair.hpp>
#include <scatter/fiber/longitudinal.hpp>

#include <memory>
#include <span>

/// Many fibres: dual scattering (Zinke et al. 2008; section 4.7 of the dissertation). Light that comes
/// through n strands is attenuated and spread n times forward (global); around the strand that is looked at,
/// all strands are parallel, and the light that turns back once or three times among them is summed up
/// (local).
namespace scatter::fiber {

/// Sums over the paths that turn back once or three times among parallel strands.
struct LadderSums {
  double A_b = 0;     ///< energy that comes back
  double Delta_b = 0; ///< its mean shift of theta_h [rad], to first order in a_b^2
  double sigma_b = 0; ///< its standard deviation of theta_h [rad], 4 to 25 % above the sum over paths
};

/// One colour: energies that a strand sends on and back (a_f <= 1 - 1e-4 or it is clamped; a_b >= 0), mean
/// shifts and widths [rad]. corrected: A_b ends in a_b^3 a_f^2 / (1 - a_f^2)^3, Delta_b has 1 + 2 a_b^2 / ..,
/// sigma_b as Zinke et al. have it. printed: (4.27), (4.28), (4.29) to the letter, with d_b = 0.7.
[[nodiscard]] LadderSums ladder_sums(
    double a_f, double a_b, double alpha_f, double alpha_b, double beta_f, double beta_b,
    Variant variant = Variant::corrected);

/// What an assembly of parallel fibres does to light from theta_i, per colour; angles in radians.
struct AssemblyAverages {
  Rgb a_f{}, a_b{};         ///< energy on and back: weights |phi|/pi and 1 - |phi|/pi; a_f <= 1 - 1e-4
  Rgb alpha_f{}, alpha_b{}; ///< mean shifts
  Rgb beta_f{}, beta_b{};   ///< mean widths (standard deviations)
  Rgb A_b{}, Delta_b{}, sigma_b{};
};

/// Of any fibre, |theta_i| < pi/2, from its lobe_energies(), with their accuracy: for HairScattering 1e-10.
/// The variant is that of the ladder sums; that of the lobes is the fibre's own. Where no energy goes, shifts
/// and widths are plain means over the lobes. Throws InputError for theta_i out of bounds.
[[nodiscard]] AssemblyAverages
assembly_averages(const FiberScattering& fiber, double theta_i, Variant variant = Variant::corrected);

/// The averages over all theta_i, for rendering: six-point interpolation between equidistant nodes. Beyond
/// the outermost nodes, 0.1 deg from the axis, their values hold.
class AssemblyTable {
public:
  /// nodes: 12 or more, InputError otherwise.
  explicit AssemblyTable(
      const FiberScattering& fiber, Variant variant = Variant::corrected, std::size_t nodes = 181);
  /// |theta_i| <= pi/2; throws InputError for what is beyond and for NaN.
  [[nodiscard]] AssemblyAverages operator()(double theta_i) const;
  /// Bound of the errors of a_f, a_b and the shifts and widths [rad] up to |theta_i| = 80 deg: six times what
  /// was found at 24 places half way between nodes. For hair at the standard widths and 181 nodes below 1e-6.
  [[nodiscard]] double error_estimate() const { return error_; }

private:
  static constexpr std::size_t per_node = 18;
  [[nodiscard]] std::array<double, per_node> interpolate(double theta_i) const;

  Variant variant_;
  std::size_t nodes_;
  double first_, step_;
  std::vector<double> values_; ///< [node][a_f, a_b, alpha_f, alpha_b, beta_f, beta_b][colour]
  double error_ = 0;
};

/// What lies between the light and a strand.
struct Shadow {
  double direct = 1;          ///< delta: share of the light that comes straight, 0..1
  Rgb transmittance{1, 1, 1}; ///< product of a_f over the strands before, without density factors
  Rgb variance{};             ///< sum of beta_f^2 [rad^2]
};

/// The artists' adjustments of multiple scattering (4.6.2); the defaults change nothing.
struct MultipleAdjustments {
  Rgb back_colour{1, 1, 1}, forward_colour{1, 1, 1};
  double back_intensity = 1, forward_intensity = 1;
  double back_shift = 0;    ///< alpha_Back [rad]: g(theta_h - Delta_b + alpha_Back, ..), as printed
  double back_variance = 0; ///< beta_Back [rad^2], added to the variance; what is left of it is at least 1e-8
};

/// How much energy f_back carries. Both have the shape of g(.., theta_h - Delta_b) / cos^2 theta_d.
enum class BackEnergy {
  zinke,     ///< 2 A_b / pi: as Zinke et al. (2008) and the dissertation have it. Over the half circle of
             ///< azimuths from which light is seen to come back, 4 A_b: g has its area over theta_h, half of
             ///< theta_o's
  conserved, ///< A_b / (2 pi): over that half circle A_b, what the ladder sums say comes back
};

struct DualScatteringOptions {
  double d_f = 0.7, d_b = 0.7; ///< density factors, 0..1
  /// printed: the pseudo-code of 4.7.2, with d_f twice and T_f - delta, which goes negative in lit hair.
  Variant variant = Variant::corrected;
  BackEnergy back_energy = BackEnergy::zinke;
  MultipleAdjustments adjustments;
  std::size_t nodes = 181; ///< of the table over theta_i
};

/// F(T, sigma_f^2, delta) of section 4.7.2.
class DualScattering {
public:
  /// The parts of F cos theta_i, each per colour; times L_i d omega_i they are radiance. Add them up.
  struct Parts {
    Rgb single{};       ///< delta f_s
    Rgb back{};         ///< delta d_b f_back
    Rgb forward{};      ///< (1 - delta) d_f T sum of M^G N^G / cos^2 theta_d
    Rgb forward_back{}; ///< (1 - delta) d_f T pi d_b f_back
    [[nodiscard]] Rgb sum() const;
  };

  /// single: what is seen of direct light; multiple: what all averages and scattered light are made from
  /// (4.6.3). Often the same object. Throws InputError, before any table is made, for density factors outside
  /// 0..1, adjustments that are not finite or whose colour times intensity is not, and a fibre that is
  /// missing.
  DualScattering(
      std::shared_ptr<const FiberScattering> single, std::shared_ptr<const LobedScattering> multiple,
      const DualScatteringOptions& options = {});

  /// Exact count: the inclinations [rad] of the light to each strand that its ray passes. direct = 1 without
  /// strands and 0 with any. Throws InputError that names the first one that is not |theta_i| <= pi/2.
  [[nodiscard]] Shadow through(std::span<const double> theta_i) const;
  /// The dissertation's estimate (4.23, 4.24): a shadow's opacity 0..1 stands for n = opacity *
  /// strands_of_full_shadow strands, a real number, as inclined to the light as the one looked at; direct =
  /// 1 - opacity. Throws InputError unless |theta_i| <= pi/2 and the other numbers are in range: strands
  /// finite and 0 or more.
  [[nodiscard]] Shadow estimated(double theta_i, double opacity, double strands_of_full_shadow) const;

  /// Angles in radians, clamped to |theta| <= pi/2; the shadow as through() or estimated() give it: direct
  /// 0..1, transmittance and variance [rad^2] 0 or more. Averages are those of the table, with its
  /// error_estimate(). Throws InputError for angles that are not numbers, for a shadow out of range, and when
  /// intensities and transmittances are so large that the light is more than 1e280 times what arrives, or no
  /// finite number.
  [[nodiscard]] Parts eval(const Angles& angles, const Shadow& shadow) const;
  /// Density [1/sr] with which sample() draws the eye's direction for light from angles.theta_i. Throws as
  /// eval() does.
  [[nodiscard]] double pdf(const Angles& angles, const Shadow& shadow) const;
  /// The eye's direction for light from theta_i [rad], by u as FiberScattering::sample() has it, the weight F
  /// cos theta_o / pdf with F the sum of the parts without cos theta_i. A part is drawn by its energy:
  /// `single` by its own sampler, `back`, `forward` and `forward_back` by their Gaussians of theta_h, each
  /// colour and lobe its own, uniform in phi. Weights are bounded. Those of the Gaussians stay below about
  /// four times the energy of all parts and colours, each without cos^2 theta_o / cos^2 theta_d, which is at
  /// most 4; those of `single` are as large as its own sampler's, relative to its energy. Against the sum of
  /// the three albedos: for hair below 4 up to |theta_i| = 60 deg, below 20 at grazing light. Throws as
  /// eval() does. With Variant::printed weights of lit hair may be negative, as F is.
  [[nodiscard]] ScatteringSample
  sample(double theta_i, const Shadow& shadow, const std::array<double, 3>& u) const;
  /// Integral of F cos theta_o d omega, |theta_i| < pi/2, part by part: the light that leaves over what falls
  /// on the strand. `single` has its own albedo's accuracy; the others are integrated along the fibre,
  /// each to 1e-9 of the sum of their magnitudes over all colours, without `single`. Throws InputError for
  /// theta_i out of bounds, and as eval() does. It may be above 1: dual scattering does not conserve energy,
  /// see BackEnergy.
  [[nodiscard]] Parts albedo(double theta_i, const Shadow& shadow) const;
  /// 2 A_b g(sigma_b^2 + variance, theta_h - Delta_b) / (pi cos^2 theta_d): Zinke's local multiple
  /// scattering, with the adjustments; variance [rad^2], finite and 0 or more, is 0 for direct light. Throws
  /// InputError for another variance, for angles that are not numbers, and when the light is no finite
  /// number.
  [[nodiscard]] Rgb back(const Angles& angles, const Rgb& variance) const;
  [[nodiscard]] const AssemblyTable& table() const { return table_; }
  [[nodiscard]] const DualScatteringOptions& options() const { return options_; }

private:
  /// What directions are drawn from: the share of `single`, then those of the spreads of theta_o, by their
  /// energies, about. The sum is 1.
  struct Mixture {
    std::vector<TruncatedNormal> spreads;
    std::vector<double> shares;
  };
  /// The parts times a factor, which is cos theta_i in eval().
  [[nodiscard]] Parts parts(const Angles& angles, const Shadow& shadow, double factor) const;
  /// All of them but `single`.
  [[nodiscard]] Parts multiple(const Angles& angles, const Shadow& shadow, double factor) const;
  /// Of a colour: the share of the light that the shadow scatters on, with d_f.
  [[nodiscard]] double passed(const Shadow& shadow, std::size_t colour) const;
  /// Variance of theta_h of f_back [rad^2].
  [[nodiscard]] double back_variance(double sigma_b, double variance) const;
  [[nodiscard]] Rgb back(const AssemblyAverages& averages, const Angles& angles, const Rgb& variance) const;
  [[nodiscard]] Mixture mixture(double theta_i, const Shadow& shadow) const;
  [[nodiscard]] double density(const Mixture& mixture, const Angles& angles) const;

  std::shared_ptr<const FiberScattering> single_;
  std::shared_ptr<const LobedScattering> multiple_;
  DualScatteringOptions options_;
  AssemblyTable table_;
  std::vector<double> single_energy_; ///< over theta_i, for the choice of a part only
};

} // namespace scatter::fiber
