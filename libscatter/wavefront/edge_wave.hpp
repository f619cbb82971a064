#pragma once

#include <array>
#include <complex>
#include <vector>

/// Order 0 of the Debye series of a large sphere, split into the ray that is reflected and the rest: what the
/// edge of the shadow diffracts. A drop's surface takes it over, piece by piece.
///
/// The partial wave lambda = l + 1/2 has the amplitude (1 - S(lambda)) / 2, S of the wave that is reflected
/// outside; it falls from 1/2 to 0 across the rim lambda = x within gamma = (x/2)^(1/3). Averages over
/// S'(lambda) d lambda, <1> = 1, say what the edge does at the scattering angle theta:
///     weight(theta) = < exp(-i (lambda - x) theta) >,
/// theta > 0 on the side where reflected rays leave, < 0 across the shadow. A sharp edge has weight 1. S is
/// uniform through the rim (Olver: DLMF 10.20), the average goes along a path where S dies out.
///
/// Sources: Nussenzveig 1992, Diffraction Effects in Semiclassical Scattering, chapters 7 and 8; Hovenac &
/// Lock 1992, J. Opt. Soc. Am. A 9, 781, for S.
namespace scatter::wavefront {

/// Perpendicular (S1) and parallel (S2) polarisation.
using Polarised = std::array<std::complex<double>, 2>;

class EdgeWave {
public:
  /// The sphere's size parameter x, 10 .. 1e6, and index m.
  EdgeWave(double x, std::complex<double> m);

  /// Everything at one angle.
  struct At {
    Polarised weight;        ///< see above
    Polarised moment;        ///< < (lambda - x) exp(-i (lambda - x) theta) >
    Polarised second_moment; ///< the same of (lambda - x)^2
    Polarised tail;          ///< integral of (S - [lambda > x]) exp(-i (lambda - x) theta) d lambda
    Polarised line_weight;   ///< < sqrt(lambda / x) exp(-i (lambda - x) theta) >
    Polarised reflected; ///< the reflected ray's part of line_weight, by stationary phase; 0 for theta <= 0
  };
  /// |theta| <= furthest().
  [[nodiscard]] At at(double theta) const;
  [[nodiscard]] double gamma() const { return gamma_; }
  /// At (x/2)^(1/3) theta = 6 edge and ray have parted.
  [[nodiscard]] double furthest() const;

  /// Amplitude of the reflected ray over x/2 exp(-2 i x sin(theta/2)), 0 <= theta <= pi: Fresnel's
  /// coefficient of the curved surface with the partial waves' phase beyond the ray's; where edge and ray
  /// have parted, with the next order in 1/x.
  [[nodiscard]] Polarised reflection(double theta) const;

private:
  [[nodiscard]] Polarised coefficients(double theta) const;
  struct Node {
    std::complex<double> step; ///< lambda - x
    std::complex<double> line; ///< sqrt(lambda / x)
    Polarised S;               ///< times d lambda; beyond the rim S - 1
  };
  [[nodiscard]] Polarised S_over(
      std::complex<double> ratio, std::complex<double> in, std::complex<double> out,
      std::complex<double> cos_squared) const;

  double x_, gamma_;
  std::complex<double> m_;
  std::vector<Node> nodes_;
};

} // namespace scatter::wavefront
