#pragma once

#include <scatter/fiber/assembly.hpp>
#include <scatter/fiber/fiber_scattering.hpp>

#include <cstdint>
#include <memory>
#include <vector>

/// Strands of hair as geometry, and light that walks among them: what dual scattering is held against.
namespace scatter::validation {

/// A slab of strands of radius 1, 0 <= z <= thickness, along x more or less. It is so wide in x and y that
/// what is seen near the middle knows nothing of the edges.
struct SlabParameters {
  double thickness = 80;
  double volume_share = 0.15; ///< of the strands in the slab; the mean free path across is pi / (2 share)
  double tangle_deg =
      0; ///< standard deviation of a strand's direction from x, changed every 20 radii; 0: parallel
  std::uint64_t seed = 1;
};

/// Embree's round linear curves. Rays in single precision, as Embree has them.
class StrandAssembly {
public:
  explicit StrandAssembly(const SlabParameters& parameters);
  ~StrandAssembly();
  StrandAssembly(const StrandAssembly&) = delete;
  StrandAssembly& operator=(const StrandAssembly&) = delete;

  struct Hit {
    int strand = -1;              ///< -1: none
    glm::dvec3 axis{}, tangent{}; ///< the point of the strand's axis beside the hit, and the direction there
  };
  /// The first strand but `skip` (and `skip`'s neighbours in itself) along the ray.
  [[nodiscard]] Hit first(const glm::dvec3& from, const glm::dvec3& direction, int skip) const;
  /// Inclinations of `direction` to all strands but `skip` that a ray passes, each strand once.
  [[nodiscard]] std::vector<double>
  inclinations(const glm::dvec3& from, const glm::dvec3& direction, int skip) const;
  [[nodiscard]] std::size_t strands() const;
  [[nodiscard]] const SlabParameters& parameters() const { return parameters_; }

private:
  struct Scene;
  SlabParameters parameters_;
  std::unique_ptr<Scene> scene_;
};

/// What a camera above the slab sees of light from one direction of irradiance 1, on average over a patch:
/// mean radiance per colour, of the strands that are seen first.
struct Seen {
  fiber::Rgb mean{}, error{}; ///< error: one standard deviation of the mean
  fiber::Rgb single{};        ///< of the mean, what was scattered once
  double seconds = 0;
  double strands_before = 0; ///< mean number of strands between the first strand and the light
};

/// Brute force: paths from the camera, scattered by sample(), with a ray to the light at every strand. The
/// same for any number of threads.
[[nodiscard]] Seen walk(
    const StrandAssembly& slab, const fiber::FiberScattering& hair, const glm::dvec3& to_light,
    const glm::dvec3& to_eye, int paths, int threads);

enum class Count { exact, opacity };
/// Dual scattering at the same first strands, without random walks. Count::opacity takes the number of
/// strands, and the seen strand's own inclination for all.
[[nodiscard]] Seen dual(
    const StrandAssembly& slab, const fiber::DualScattering& shading, const glm::dvec3& to_light,
    const glm::dvec3& to_eye, int points, Count count, int threads);

} // namespace scatter::validation
