#pragma once

#include <scatter/compute/device.hpp>
#include <scatter/drop/shape.hpp>

#include <array>
#include <complex>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

/// The dissertation's algorithm (section 3.4): a grid of rays with phasors is traced through the drop, four
/// neighbouring rays of one order make a patch of the sphere of directions, and the field in a direction is
/// the sum over the patches that hold it.
///
/// Conventions: time factor exp(-i omega t); theta is the scattering angle, phi the azimuth about the
/// sunlight, 0 = most downward; amplitudes of Bohren & Huffman (1983, eq. 3.12) with the phase referred to
/// the origin of the drop's polar curve; azimuths phi and -phi are images in the vertical plane of the sun.
namespace scatter::wavefront {

/// How the quarter turns of phase at focal lines are counted. none: not at all. rule: van de Hulst's count
/// for spheres (section 12.22) taken over to any drop. exact: from the curvature of the wavefront along every
/// ray.
enum class FocalLines { none, rule, exact };
enum class Search { automatic, raster, tree };

/// The drop and how it is sampled: the same for every wavelength.
struct Tracing {
  drop::Shape shape;
  double sun_elevation_deg = 0;        ///< 0..90
  int rays = 1000;                     ///< rays x rays over the square around the drop; 2..20000
  std::vector<int> orders{0, 1, 2, 3}; ///< p that count, sorted
  bool interference = true;            ///< false: the intensities of patches add
  FocalLines focal_lines = FocalLines::exact;
  Search search = Search::automatic;
};

/// One wavelength.
struct Light {
  double wavelength_m = 0;
  std::complex<double> index; ///< of the drop; rays bend by the real part, fields by all of it
};

/// How the diffraction integral is made: results do not depend on it but for their error, which `scatter
/// validate --case drops` finds by varying it. Factors are of what is used otherwise.
struct IntegralSampling {
  /// Per angle of incidence; of windows also per azimuth, of which lines choose their own number.
  double rays = 1;
  double tapers = 1; ///< widths of tapers
  double zone = 1;   ///< reach around caustics, not rims, beyond which patches carry the light
  /// Over windows of directions everywhere, also where lines of constant azimuth are enough: slower.
  bool by_windows = false;
};

/// Where the field is wanted and what of it.
struct Wanted {
  std::vector<double> theta_deg; ///< increasing, in [0, 180]
  std::vector<double> phi_deg;   ///< any
  bool matrix = false;
  bool amplitudes = false; ///< needs interference
  bool per_order = false;  ///< needs interference
  double filter_sigma_deg =
      0; ///< Gaussian over the primary bow's edge, (p - 1) times that over the edge of order p; 0: none
  /// The diffraction integral near caustics; order 0 in closed form, with forward diffraction by the shadow.
  /// Needs interference and exact focal lines.
  bool integral = false;
  IntegralSampling sampling;
  double sun_disc_deg = 0; ///< angular diameter of a uniform disc that intensities are averaged over; 0: none
};

/// The amplitude matrix [[S2, S3], [S4, S1]].
struct Amplitude {
  std::complex<double> S1, S2, S3, S4;
};

/// What order 0 with its diffraction (Wanted::integral) is for: size parameters from here on.
inline constexpr double smallest_size_with_shadow = 20;

/// One wavelength's answer; T x F as in Wanted, row-major.
struct FarField {
  std::vector<double> phase_function;     ///< [T][F], sr^-1: S11 / (k^2 C_sca)
  std::vector<double> phase_matrix;       ///< [T][F][4][4], same normalisation; empty unless wanted
  std::vector<Amplitude> amplitude;       ///< [T][F], before filter and sun's disc
  std::vector<Amplitude> order_amplitude; ///< [P][T][F]
  std::vector<double>
      order_energy; ///< [P], share of the energy that meets the drop, carried by complete patches
  double scattering_cross_section = 0; ///< m2: extinction less absorption
  /// m2: twice the shadow, and the edge term of a sphere with that shadow, 1.99 (k a)^(-2/3) of it
  /// (Nussenzveig & Wiscombe 1980, Phys. Rev. Lett. 45, 1490). A sphere's ripple is left out: 1e-2 at 0.01
  /// mm, 1e-3 at 0.1 mm.
  double extinction_cross_section = 0;
};

/// What one ray does at one order.
struct TracedRay {
  bool valid = false;                ///< false: missed, was lost, or reflected totally
  std::array<double, 3> direction{}; ///< sun frame: x most downward, z along the light
  double path = 0;                   ///< optical path between the planes through the origin, in units of a
  int axis_crossings = 0;            ///< how often it passed the axis of the light
  int foci_inside = 0;               ///< focal lines passed before it left the drop
  int foci = 0;                      ///< the same from the sun to infinity: each takes pi/2 off the phase
  std::array<double, 3> point{};     ///< where it left the drop, units of a
  /// Derivatives by the impact point (u, v): of the point along the surface, and of the direction [1/a].
  /// Their triple product direction . (direction_u x direction_v) is the solid angle per area of the incident
  /// beam, with the sign (-1)^(foci + reflections).
  std::array<double, 3> point_u{}, point_v{}, direction_u{}, direction_v{};
  /// Energy-normalised Jones matrix in the scattering plane, rows (parallel, perpendicular) like [[S2, S3],
  /// [S4, S1]]: the amplitude without sqrt(a/s), phase of the path and focal lines.
  Amplitude jones;
};

/// A drop under a sun, ready to be traced at any wavelength. Not thread-safe; uses all of the device itself.
class Tracer {
public:
  /// Throws InputError for rays or orders out of range, compute::DeviceError when kernels do not build.
  Tracer(const Tracing& tracing, const compute::Device& device);
  ~Tracer();
  Tracer(Tracer&&) noexcept;
  Tracer& operator=(Tracer&&) noexcept;

  /// Calls done(i, field) for lights[i] in order; the field's memory is used again for a later wavelength,
  /// unless done() moves it away. Results are the same bits whatever the number of threads. Accuracy: see
  /// papers/ and `scatter validate`; the interpolated phase is off by about (k a) (2 / rays)^2 / 8 rad times
  /// the drop's magnification.
  void far_field(
      std::span<const Light> lights, const Wanted& wanted,
      const std::function<void(std::size_t, FarField&)>& done);

  /// Peak memory that far_field() will take [bytes].
  [[nodiscard]] double memory(std::size_t lights, const Wanted& wanted) const;

  /// How far_field() will search ("raster" or "tree") and over how many azimuths, in words.
  [[nodiscard]] std::string describe(std::size_t lights, const Wanted& wanted) const;

  /// Single rays from (u, v) of the incident plane in units of a, all orders 0..last: result[ray][order].
  [[nodiscard]] std::vector<std::vector<TracedRay>>
  trace(const Light& light, std::span<const double> u, std::span<const double> v, int last_order);

  /// Where order p's deflection is stationary along the impact parameter: the geometric bow, as (theta, phi)
  /// in degrees, one point per bow and azimuth of incidence in [0, 180] deg.
  [[nodiscard]] std::vector<std::array<double, 2>> bow_curve(const Light& light, int order);

  /// Area of the drop's shadow in units of a^2.
  [[nodiscard]] double shadow_area() const;

private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

} // namespace scatter::wavefront
