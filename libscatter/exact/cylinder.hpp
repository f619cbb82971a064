#pragma once

#include <complex>
#include <span>
#include <vector>

/// Scattering of a plane wave by an infinitely long, straight, homogeneous circular cylinder at any tilt: the
/// judge of fibres.
///
/// Conventions of Bohren & Huffman (1983), section 8.4: time factor exp(-i omega t), m = n + ik with k >= 0,
/// the axis along z, the wave travelling along -(sin zeta) x - (cos zeta) z. tilt = 90 deg - zeta: 0 is
/// normal incidence, and a tilted wave travels toward -z for tilt > 0, toward +z for tilt < 0. Case I: the
/// electric field lies in the plane of the axis and the direction of incidence (TM); case II: it is
/// perpendicular to both (TE). The scattered waves travel on a cone about the axis; theta is the azimuth on
/// it, 180 deg - phi in Bohren & Huffman's coordinates: 0 is straight on, 180 deg back toward the light.
///
/// Far from the axis, at r, Bohren & Huffman 8.34:
///   (E_par, E_perp)_s = exp(3 i pi/4) sqrt(2 / (pi k r cos tilt)) exp(i k (r cos tilt - z sin tilt))
///                       [[T1, T4], [T3, T2]] (E_par, E_perp)_i
/// with e_perp = -y for the incident and the azimuthal unit vector e_phi for the scattered wave, e_par such
/// that e_perp x e_par points along the wave.
namespace scatter::exact {

/// Largest size parameter and |tilt| [deg] at which results were compared with 50 digits.
inline constexpr double cylinder_validated_size_parameter = 5e3, cylinder_validated_tilt_deg = 89.5;

/// A number for each polarisation of the incident wave.
struct ByCase {
  double I = 0, II = 0;
};

/// One value per angle.
struct CylinderAmplitudes {
  std::vector<std::complex<double>> T1, T2, T3, T4;
};

/// One term of the Debye series: p = 0 is external reflection with all diffraction, p >= 1 light that crossed
/// the cylinder p times, reflected p - 1 times inside.
/// The terms of every order n of the wave are a geometric series, so that all p together are the whole. For m
/// < 1 it converges slowly: where the surface reflects totally the waves inside are no rays. At a tilt the
/// terms couple both polarisations, as the whole does (T3, T4). For x far below 1 the notion of rays makes no
/// sense, and the terms lose digits as 1e-19 / x^2, at grazing tilts 1e-17 / x^2; error_estimate says so.
struct CylinderOrder {
  int p = 0;
  CylinderAmplitudes amplitudes;
  /// Of the amplitudes, against the largest of them over the angles asked for. Where an order casts no light
  /// its amplitudes are as small as their error.
  double error_estimate = 0;
};

struct CylinderResult {
  double size_parameter = 0;
  std::complex<double> index;
  double tilt_deg = 0;
  /// Cross sections per unit length over the diameter 2a, Bohren & Huffman 8.36 and 8.37. The shadow of a
  /// tilted cylinder is 2a cos(tilt) wide: Qext of a large one goes to 2 cos(tilt). Qabs is summed on its
  /// own, not as a difference: it keeps its digits however small k is, and is 0 for k = 0.
  ByCase Qext, Qsca, Qabs;
  CylinderAmplitudes amplitudes;
  std::vector<CylinderOrder> orders; ///< the Debye terms asked for, as asked for
  CylinderAmplitudes remainder;      ///< what they leave out: amplitudes less their sum; empty without orders
  double error_estimate = 0;         ///< relative: of the Q's, and of T against max |T| at the same angle
};

/// tilt in radians, |tilt| <= 89.9 deg. theta in radians, [-2 pi, 2 pi], any order. orders: 0..1000.
/// threads = 0: all cores. Each angle's result depends on the cylinder and that angle alone, bit for bit.
///
/// Accuracy against Maxwell's equations solved with 50 digits, 53 cylinders, x <= 5000, tilt <= 89.5 deg: the
/// Q's 1e-15; T 1e-16 .. 5e-15 of max |T| at the same angle, also on the peaks of resonances of widths 3e-13
/// .. 2e-6 in x (x, m, tilt and theta count as exact), except 5e-14 some 3e-7 beside one of width 3e-9 and
/// 5e-12 for m = 1.0001 near 180 deg (partial waves cancel to 1e-5 there); Debye terms 2e-15 of their largest
/// value, 1e-13 where absorption leaves 1e-100 of them. error_estimate was above the error of these, by less
/// than 100 with errors below 1e-16 taken as 1e-16. Up to x = 1e5 and 89.9 deg
/// (cylinder_validated_size_parameter, _tilt_deg) it computes the same way, not compared. Rounding an angle
/// to radians moves the phase of T by x times 2e-16; see cylinder_at_degrees.
///
/// Cost: x (|m| + 1) long double steps for the coefficients, and again x for each Debye order up to the
/// highest; then about x / 4 vectorised steps per angle, thrice, and thrice more for each order given. The
/// coefficients take some five times as long where a narrow resonance asks for 32 digits, an angle some
/// twenty times where its waves cancel by so much that its estimate would be above 1e-11.
///
/// Exact symmetries of the result: T4 = -T3; T1 and T2 are even, T3 is odd in theta; T3 is odd in tilt, T1
/// and T2 even; T3 = 0 at normal incidence.
///
/// Throws InputError for x outside [1e-6, 1e5], an index that is not finite, n <= 0, k < 0, m = 1, |m| x >
/// 1e7, a tilt, angle or order outside its range, and for orders exactly at the critical tilt of a cylinder
/// thinner than its surroundings (sin(tilt) = m < 1: no wave travels inside).
[[nodiscard]] CylinderResult cylinder(
    double size_parameter, std::complex<double> index, double tilt, std::span<const double> theta,
    std::span<const int> orders = {}, int threads = 0);

/// The same for tilt and theta in degrees, which count as exact in degrees: |tilt| <= 89.9, theta in [-360,
/// 360].
[[nodiscard]] CylinderResult cylinder_at_degrees(
    double size_parameter, std::complex<double> index, double tilt_deg, std::span<const double> theta_deg,
    std::span<const int> orders = {}, int threads = 0);

} // namespace scatter::exact
