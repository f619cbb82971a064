#pragma once

#include <complex>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

/// Tabulated phase functions as data. Angles in degrees (they are what people wrote and what files hold), all
/// else SI.
namespace scatter::table {

/// The 2x2 amplitude matrix of Bohren & Huffman, [[S2, S3], [S4, S1]], parallel component first.
struct Amplitude {
  std::complex<double> S1, S2, S3, S4;
};

/// What made a table: enough to make it again.
struct Provenance {
  std::string command; ///< the command line, or the name of the calling program
  std::string version; ///< of the library
  std::string device;  ///< OpenCL device, or "host"
  std::string method;  ///< "patches" or "mie", with its settings in words
  std::string created; ///< ISO 8601, UTC
  std::vector<std::pair<std::string, std::string>> constants; ///< shape, radius, index per source, rays, ...
};

/// Everything of a table that is known before the first wavelength is computed.
struct TableHeader {
  std::vector<double> wavelength_m; ///< in vacuum
  std::vector<double> theta_deg;    ///< scattering angle
  std::vector<double> phi_deg;      ///< azimuth about the sunlight, 0 = most downward
  std::vector<int> orders;          ///< p of the traced orders; empty for a method without orders (Mie)
  std::vector<std::complex<double>> index; ///< refractive index per wavelength
  bool matrix = false;                     ///< phase_matrix is there
  bool amplitudes = false;                 ///< amplitude (sum over orders) is there
  bool per_order = false;                  ///< order_amplitude is there
  bool stokes = false; ///< stokes is there: only in tables read from OpenEXR, which holds no full matrix
  Provenance provenance;
};

/// One wavelength. T = theta count, F = phi count, P = order count; all arrays are row-major in the order
/// written.
struct Slab {
  std::vector<double> phase_function;     ///< [T][F], sr^-1: S11 / (k^2 C_sca)
  std::vector<double> phase_matrix;       ///< [T][F][4][4] in units of phase_function, or empty
  std::vector<double> stokes;             ///< [T][F][3] Q, U, V scattered from unpolarised light, in units of
                                          ///< phase_function (phase_matrix rows 1..3, column 0), or empty
  std::vector<Amplitude> amplitude;       ///< [T][F], or empty
  std::vector<Amplitude> order_amplitude; ///< [P][T][F], or empty
  std::vector<double> error_estimate;     ///< [T], relative, of the sun-disc averaged intensity
  std::vector<double> order_energy;       ///< [P], share of the energy that meets the drop
  double scattering_cross_section = 0;    ///< m2, all orders and forward diffraction
  double extinction_cross_section = 0;    ///< m2
};

/// A whole table in memory, for small requests and for reading.
struct PhaseTable {
  TableHeader header;
  std::vector<Slab> slabs; ///< one per wavelength
  double seconds = 0;      ///< wall time of the computation
};

/// Where a computation puts its wavelengths, one at a time and in order.
class Sink {
public:
  virtual ~Sink() = default;
  virtual void begin(const TableHeader& header) = 0;
  virtual void write(std::size_t wavelength, const Slab& slab) = 0;
  /// The last call: only now does the file appear under its name. seconds = wall time of the computation.
  virtual void finish(double seconds) = 0;
};

} // namespace scatter::table
