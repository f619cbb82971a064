#pragma once

#include <scatter/table/files.hpp>

#include <optional>
#include <string>
#include <vector>

namespace scatter::table {

/// A value and where it stands.
struct Extreme {
  double value = 0, wavelength_m = 0, theta_deg = 0, phi_deg = 0;
};

/// What a table says as a whole.
struct Summary {
  Extreme smallest, largest;    ///< of the phase function [sr^-1]
  std::vector<double> integral; ///< per wavelength, over the sphere; empty when the grid does not cover it
  std::vector<double> scattering_cross_section, extinction_cross_section; ///< per wavelength [m2]
  std::vector<double> order_energy; ///< per order, mean over wavelengths
  double median_error = 0;          ///< of error_estimate over wavelengths and theta, relative
  Extreme largest_error;            ///< phi_deg is not used
};

/// Reads the whole table once, one wavelength at a time. Throws as Source::read.
[[nodiscard]] Summary summarise(Source& source);

/// The value of a constant in the provenance, if it is there.
[[nodiscard]] std::optional<std::string> find_constant(const Provenance& provenance, const std::string& name);

} // namespace scatter::table
