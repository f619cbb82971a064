#pragma once

#include <scatter/drop/shape.hpp>
#include <scatter/optics/refractive_index.hpp>
#include <scatter/wavefront/far_field.hpp>

#include <string>
#include <vector>

namespace scatter::phase {

enum class Method { automatic, patches, mie };
enum class Diffraction { none, gaussian, integral };
using wavefront::FocalLines;
/// How a direction finds the patches that hold it: raster (uniform grids), tree (Embree; any list), or
/// whichever fits.
using wavefront::Search;

/// What to compute: a tabulated phase function of one drop under one sun. Every field has a working default
/// but shape, wavelengths and angles.
struct Request {
  drop::Shape shape;                   ///< see drop::make_shape; carries the radius
  double sun_elevation_deg = 0;        ///< 0 .. 90
  std::vector<double> wavelength_m;    ///< in vacuum, any order, not empty
  IndexSource index;                   ///< refractive index of the drop
  std::vector<double> theta_deg;       ///< scattering angles in [0, 180], increasing
  std::vector<double> phi_deg;         ///< azimuths in [-360, 360], increasing
  int rays = 1000;                     ///< grid of rays x rays across the drop
  std::vector<int> orders{0, 1, 2, 3}; ///< p, sorted
  /// automatic: Mie for a sphere with all of `open`, interference and no per_order; patches otherwise
  Method method = Method::automatic;
  Diffraction diffraction = Diffraction::gaussian;
  FocalLines focal_lines = FocalLines::exact;
  Search search = Search::automatic;
  bool interference = true; ///< false: intensities of patches add (figure 3.12, "dispersion")
  bool dispersion = true;   ///< false: the index at 589.3 nm serves every wavelength
  bool absorption = true;   ///< false: the imaginary part of the index is dropped
  double sun_disc_deg = 0;  ///< angular diameter of the sun that the table is averaged over; 0: a point
  bool matrix = false;      ///< also the 4x4 phase matrix
  bool amplitudes = false;  ///< also the 2x2 amplitude matrix (sum over orders)
  bool per_order = false;   ///< also the amplitude of every order
  /// Relative error of the intensity averaged over the sun's disc, root of the mean square over theta, that
  /// plan() reaches by choosing what is open; 0: everything is as it stands here. In (0, 1).
  double tolerance = 0;
  /// What nobody asked for: with a tolerance plan() may choose it, and where all of it is open an automatic
  /// method may be one that knows nothing of it.
  struct Open {
    bool diffraction = true, rays = true, orders = true, focal_lines = true;
  } open;
  int threads = 0;     ///< 0: all cores; results do not depend on it
  std::string command; ///< goes into the provenance
};

} // namespace scatter::phase
