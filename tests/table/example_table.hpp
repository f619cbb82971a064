#pragma once

#include <scatter/optics/units.hpp>
#include <scatter/table/phase_table.hpp>

#include <cmath>
#include <cstddef>

/// Tables with numbers that are all different and none round, for the tests of what holds tables.
namespace scatter::table::example {

inline TableHeader header(std::size_t wavelengths, std::size_t rows, std::size_t columns) {
  TableHeader head;
  for (std::size_t w = 0; w < wavelengths; ++w) {
    head.wavelength_m.push_back(
        (380.0 + 320.0 * static_cast<double>(w) / static_cast<double>(wavelengths)) * 1e-9);
    head.index.emplace_back(1.34 - 1e-3 * static_cast<double>(w) / 3, 1e-9 / static_cast<double>(w + 1));
  }
  for (std::size_t t = 0; t < rows; ++t)
    head.theta_deg.push_back(180.0 * static_cast<double>(t) / static_cast<double>(rows > 1 ? rows - 1 : 1));
  for (std::size_t f = 0; f < columns; ++f)
    head.phi_deg.push_back(360.0 * static_cast<double>(f) / static_cast<double>(columns));
  head.orders = {0, 1, 2, 5};
  head.provenance = {
      .command = "scatter phase --radius 0.4mm --output \"a 'b'.nc\"",
      .version = "9.8.7",
      .device = "a device, with \xC2\xB5",
      .method = "patches, 1000 x 1000 rays",
      .created = "2024-01-02T03:04:05Z",
      .constants = {{"radius_m", "0.0004"}, {"shape", "beard-chuang"}, {"sun elevation", "20 deg"}}};
  return head;
}

/// Henyey-Greenstein (g = 0.85) with fringes: positive, integral over the sphere near 1.
inline double phase_function(double theta_deg, double phi_deg, double wavelength_m) {
  const double g = 0.85, mu = std::cos(radians_per_degree * theta_deg);
  const double fringes =
      1 + 0.3 * std::sin(theta_deg * 500e-9 / wavelength_m) * std::cos(radians_per_degree * phi_deg);
  return fringes * (1 - g * g) / (4 * pi * std::pow(1 + g * g - 2 * g * mu, 1.5));
}

inline Slab slab(const TableHeader& head, std::size_t w) {
  const std::size_t rows = head.theta_deg.size(), columns = head.phi_deg.size();
  Slab slab;
  for (std::size_t t = 0; t < rows; ++t) {
    slab.error_estimate.push_back(0.01 + 0.1 * std::exp(-std::pow((head.theta_deg[t] - 138) / 10, 2)) / 3);
    for (std::size_t f = 0; f < columns; ++f) {
      const double value = phase_function(head.theta_deg[t], head.phi_deg[f], head.wavelength_m[w]);
      slab.phase_function.push_back(value);
      if (head.matrix)
        for (int k = 0; k < 16; ++k)
          slab.phase_matrix.push_back(value * (k == 0 ? 1.0 : std::cos(k + value)));
      const auto amplitude = [&](double seed) {
        return Amplitude{
            {seed + value, 1 / (3 + seed)},
            {-seed, value / 7},
            {1e-12 * value, seed / 11},
            {seed * value, -1e-20}};
      };
      if (head.amplitudes) slab.amplitude.push_back(amplitude(1000.1));
    }
  }
  if (head.per_order)
    for (std::size_t p = 0; p < head.orders.size(); ++p)
      for (std::size_t i = 0; i < rows * columns; ++i) {
        const double x = static_cast<double>(p * rows * columns + i) / 7;
        slab.order_amplitude.push_back({{x, -x}, {x / 3, 2 * x}, {x / 13, 1}, {-1e-9, x * 1e6}});
      }
  for (std::size_t p = 0; p < head.orders.size(); ++p)
    slab.order_energy.push_back(0.9 / static_cast<double>(p * p + 1) + static_cast<double>(w) / 3000);
  slab.scattering_cross_section = 1.0053096491487338e-6 / (1 + static_cast<double>(w) / 1000);
  slab.extinction_cross_section = 1.1 * slab.scattering_cross_section;
  return slab;
}

inline void write(Sink& sink, const TableHeader& head, double seconds = 12.345678901234567) {
  sink.begin(head);
  for (std::size_t w = 0; w < head.wavelength_m.size(); ++w) sink.write(w, slab(head, w));
  sink.finish(seconds);
}

} // namespace scatter::table::example
