#pragma once

#include <complex>
#include <string>
#include <string_view>

/// Refractive index of water against wavelength in vacuum. All sources are real (no absorption).
namespace scatter {

/// Where a refractive index comes from.
struct IndexSource {
  enum class Kind {
    hale_querry,     ///< table 3.2 of the dissertation, 380..700 nm, linear between rows, three decimals
    iapws,           ///< IAPWS R9-97 at 20 C, 0.101325 MPa; 200..1100 nm
    daimon_masumura, ///< Daimon & Masumura 2007 at 20 C, 182..1129 nm
    given            ///< the same number at every wavelength
  };
  Kind kind = Kind::iapws;
  std::complex<double> value{}; ///< only for Kind::given
};

/// "hale-querry", "iapws", "daimon-masumura", or a number such as "1.333" or "1.33+1e-9i".
/// Throws InputError that lists the choices.
[[nodiscard]] IndexSource parse_index_source(std::string_view text);

/// Name of the source as the command line takes it; a given index is printed with all its digits.
[[nodiscard]] std::string index_source_name(const IndexSource& source);

/// Index m = n + ik at a wavelength in vacuum [m]. Throws InputError outside the source's range of
/// wavelengths (the message names the range).
[[nodiscard]] std::complex<double> refractive_index(const IndexSource& source, double wavelength_m);

/// Table 3.2 of the dissertation (Hale & Querry 1973), 380..700 nm.
[[nodiscard]] double hale_querry_index(double wavelength_m);

/// IAPWS R9-97 formulation. Temperature [K] 261.15..773.15, density [kg/m3] 0..1060, wavelength [m] 200..1100
/// nm.
[[nodiscard]] double iapws_index(double wavelength_m, double temperature_K, double density_kg_m3);

/// Daimon & Masumura 2007, distilled water at 20 C, 182..1129 nm.
[[nodiscard]] double daimon_masumura_index(double wavelength_m);

} // namespace scatter
