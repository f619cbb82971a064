#pragma once

#include <scatter/wavefront/kirchhoff.hpp>

#include <memory>
#include <span>

/// The diffraction integral along lines of constant azimuth, where directions have their caustics in theta
/// alone. See papers/kirchhoff-method.md.
namespace scatter::wavefront {

/// One order's part of a block of columns.
class MeridianIntegral {
public:
  /// Takes over `wanted` wherever the azimuth of a ray's direction can stand for that of its impact and
  /// momenta can be kept from folding, and traces the rays. Keeps references to rays and layout.
  MeridianIntegral(
      RayProgram& rays, const CoarseRays& coarse, const Light& light, int order, const Layout& layout,
      Columns columns, const IntegralShare& wanted, const IntegralSampling& sampling);
  ~MeridianIntegral();
  MeridianIntegral(MeridianIntegral&&) noexcept;
  MeridianIntegral& operator=(MeridianIntegral&&) noexcept;

  /// What it takes over: `wanted` or 0.
  [[nodiscard]] const IntegralShare& share() const;

  /// Adds share times the order's integral to sums[column][row][8] (field in transverse_basis(), in units of
  /// k a). Each column is summed by one thread, so that nothing depends on how many run.
  void add(std::span<double> sums);

private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

/// What it takes per order between its making and its end, about: rays of a drop of that size parameter.
[[nodiscard]] constexpr double meridian_rays_bytes(double size_parameter) {
  return (0.3 * size_parameter + 200) * (64 * 16 + 128 * 10) * sizeof(double);
}

} // namespace scatter::wavefront
