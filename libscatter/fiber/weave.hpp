#pragma once

#include <scatter/exact/vector_unit.hpp>
#include <scatter/fiber/thread.hpp>

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

/// Cloth seen from afar: a weave of threads whose tangents follow curves, with masking and reweighting.
///
/// The cloth's frame: thread 1 along x, thread 2 along y, normal z; right-handed. Directions are unit vectors
/// away from the cloth. Source: the dissertation, section 5.6, with the areas and the gap in the
/// normalisation (papers/sadeghi-fibres.md).
namespace scatter::fiber {

struct WeaveConstants;

/// How far the tangent of a thread is turned from the cloth toward the normal, along one period of the weave.
struct TangentCurve {
  std::vector<double> offsets; ///< at the control points [rad], -pi/2..pi/2, two or more
  std::vector<double> lengths; ///< of the segments between them, any unit, one fewer; 0 is a jump
};

/// The curve's offsets [rad] at the middles of `count` equal steps of its length; linear along each segment;
/// a point that falls on a jump has the offset after it. Throws InputError for a curve that check() refuses,
/// or a count outside 1..100000.
[[nodiscard]] std::vector<double> sample_curve(const TangentCurve& curve, int count);

struct WeaveThread {
  ThreadParameters thread;
  double coverage = 0.5; ///< share of the cloth's area, 0..1
  double direction = 0;  ///< azimuth of the thread in the cloth, from x toward y [rad]
  TangentCurve curve;
};

struct Weave {
  std::vector<WeaveThread> threads;                 ///< one or more
  double masking_width = 20 * 0.017453292519943295; ///< s [rad]: how near light and view hide the same
};

/// Whether threads of one direction hide those of another.
enum class FamilyMasking {
  none,   ///< as the dissertation has it: a thread is hidden by itself alone
  crowns, ///< by the crowns of the other families, Cloth::unmasked()
};

/// "none" or "crowns". Throws InputError that lists both.
[[nodiscard]] FamilyMasking parse_family_masking(const std::string& name);
[[nodiscard]] const char* family_masking_name(FamilyMasking masking);

/// Throws InputError for what check(ThreadParameters) refuses, coverages outside 0..1 or with a sum above 1,
/// offsets beyond 90 deg, lengths that are negative, all zero or not one fewer than offsets, a masking width
/// outside 5..45 deg, and no thread at all. The message begins with `where` and names thread (from 1) and
/// field.
void check(const Weave& weave, const std::string& where);

/// What Cloth::eval wants of many pairs: throws std::invalid_argument for unequal numbers, InputError with
/// the number of the first pair with a direction whose squared length is not 1 to 1e-9.
void check_pairs(std::span<const glm::dvec3> light, std::span<const glm::dvec3> view, std::size_t values);

/// Light from a sampled direction.
struct ClothSample {
  glm::dvec3 light{0, 0, 1};
  double pdf = 0; ///< per solid angle
  Rgb weight{};   ///< value / pdf; 0 for light from below the cloth
};

/// The light that a cloth sends toward the view is the integral of value(light, view) L(light) d omega:
///
///   value = sum_j a_j <f_s M P cos theta_i>_j / Q,   Q = sum_j a_j <P>_j + (1 - sum_j a_j) max(n . view, 0),
///
/// averages over the samples of thread j's tangent curve, theta_i the inclination to the sampled tangent (the
/// cosine is the thread's, not the cloth's). M and P: (1 - u) m_i m_r + u min(m_i, m_r),
/// u = exp(-d^2 / (2 s^2)); m = cos phi and d = phi_i - phi_r for M, cos psi and psi_i - psi_r for P, about
/// the normal of the tangent, never negative. Zero for light or view at or below the cloth's plane (z <= 0):
/// light that passes through is not part of the model. Zero where Q is zero.
///
/// Not reciprocal: the cosine is that of the light alone, and Q has the view alone in the gap. The printed
/// surface lobe carries about eight times a smooth cylinder's energy. papers/sadeghi-fibres.md has figures
/// for each fabric. Objects do not change and may be shared by threads.
///
/// With FamilyMasking::crowns thread j counts with G(view) = unmasked(j, view) in Q, with (1 - u) G(light)
/// G(view) + u min(G(light), G(view)) in the sum, d of u the angle between the azimuths of light and view,
/// and the gap as if hidden by all families.
class Cloth {
public:
  /// samples: of every tangent curve, 1..100000. Throws InputError as check() does.
  explicit Cloth(
      const Weave& weave, int samples = 64, SurfaceLobe surface = SurfaceLobe::printed,
      FamilyMasking masking = FamilyMasking::none);
  ~Cloth();
  Cloth(Cloth&&) noexcept;
  Cloth& operator=(Cloth&&) noexcept;
  Cloth(const Cloth&) = delete;
  Cloth& operator=(const Cloth&) = delete;

  [[nodiscard]] const Weave& weave() const { return weave_; }
  [[nodiscard]] int samples() const { return samples_; }
  [[nodiscard]] FamilyMasking masking() const { return masking_; }

  /// Red, green and blue. Relative accuracy 1e-12 where no sampled tangent is within 0.1 deg of a direction.
  /// Throws InputError for a direction whose squared length is not 1 to 1e-9.
  [[nodiscard]] Rgb eval(const glm::dvec3& light, const glm::dvec3& view) const;
  /// The same for many pairs, without the masking of families on vector instructions: agrees with eval() to
  /// 1e-12 relative. All spans are of one length. Throws InputError as eval(), with the number of the pair,
  /// and std::invalid_argument for unequal lengths.
  void eval(
      std::span<const glm::dvec3> light, std::span<const glm::dvec3> view, std::span<Rgb> value,
      const exact::VectorUnit& unit = exact::vector_units()[0]) const;

  /// Density per solid angle of the light's direction with which sample() picks it; over the whole sphere.
  [[nodiscard]] double pdf(const glm::dvec3& light, const glm::dvec3& view) const;
  /// A tangent is picked by how well it is seen, then light by Thread::sample, whose directions may be
  /// exchanged. From four numbers in [0, 1).
  [[nodiscard]] ClothSample sample(const glm::dvec3& view, const std::array<double, 4>& u) const;

  /// Share of the area of thread j (from 0) that the crowns of threads of other directions do not hide from
  /// w, w.z > 0, whatever the masking: the product, over these directions t, of min(1, w.z <cos o> / <max(w .
  /// n', 0)>) averaged over the offsets o of the family's curves, n' = cos o n - sin o t. It is what makes
  /// the parts of a rough surface that face w, hidden parts left out, look as large as the cloth (Smith's
  /// masking; Heitz, J. Comput. Graph. Tech. 3(2), 2014), for heights that do not depend on those of the
  /// thread. 1 unless some section of the crowns faces away from w.
  [[nodiscard]] double unmasked(std::size_t thread, const glm::dvec3& w) const;
  /// Share of what is seen from the view that is gap: light from -view comes through it as it is, with this
  /// factor. (1 - sum a) n . view over Q for light from the view's own direction; 0 for view.z <= 0. Light
  /// that comes through threads is not part of the model. Throws InputError as eval().
  [[nodiscard]] double open(const glm::dvec3& view) const;

  /// Integral of value over the directions of the light: the cloth's radiance in surroundings of radiance 1.
  /// Product rule of `rings` inclinations and 2 rings azimuths; at 128 to about 1e-4 (kinks of M and P).
  [[nodiscard]] Rgb albedo(const glm::dvec3& view, int rings = 128) const;
  /// Share of the light from one direction that leaves again above the cloth: integral of value n . view over
  /// the views, over n . light. The same rule.
  [[nodiscard]] Rgb reflectance(const glm::dvec3& light, int rings = 128) const;

  /// For the kernels: every distinct tangent with its share of the samples.
  struct Tangent {
    double cos_offset = 1, sin_offset = 0, share = 1;
  };
  struct Strand {
    double cos_direction = 1, sin_direction = 0; ///< the thread's, in the cloth
    double coverage = 0;
    std::vector<Tangent> tangents;
  };
  [[nodiscard]] std::span<const Strand> strands() const { return strands_; }
  [[nodiscard]] std::span<const Thread> threads() const { return threads_; }
  [[nodiscard]] const WeaveConstants& constants() const;

private:
  Weave weave_;
  int samples_ = 64;
  std::vector<Thread> threads_;
  std::vector<Strand> strands_;
  FamilyMasking masking_ = FamilyMasking::none;
  struct Family;
  /// Product of the crowns of all families but one; none is left out if it is families_.size().
  [[nodiscard]] double past_crowns(std::size_t but, const glm::dvec3& w) const;
  std::vector<Family> families_;       ///< threads of one direction, either way
  std::vector<std::size_t> family_of_; ///< thread j's
  struct Kernel;
  std::unique_ptr<Kernel> kernel_;
};

} // namespace scatter::fiber
