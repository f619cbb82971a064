#include <scatter/table/grid.hpp>
#include <scatter/table/summary.hpp>

#include <algorithm>

namespace scatter::table {

Summary summarise(Source& source) {
  const TableHeader& head = source.header();
  const std::size_t columns = head.phi_deg.size();
  Summary all;
  all.order_energy.assign(head.orders.size(), 0.0);
  std::vector<double> errors;
  for (std::size_t w = 0; w < head.wavelength_m.size(); ++w) {
    const Slab slab = source.read(w, {.matrix = false, .amplitudes = false});
    const double wavelength = head.wavelength_m[w];
    const auto [low, high] = std::minmax_element(slab.phase_function.begin(), slab.phase_function.end());
    const auto place = [&](auto found) {
      const auto i = static_cast<std::size_t>(found - slab.phase_function.begin());
      return Extreme{*found, wavelength, head.theta_deg[i / columns], head.phi_deg[i % columns]};
    };
    if (w == 0 || *low < all.smallest.value) all.smallest = place(low);
    if (w == 0 || *high > all.largest.value) all.largest = place(high);
    if (const auto integral = sphere_integral(head.theta_deg, head.phi_deg, slab.phase_function))
      all.integral.push_back(*integral);
    all.scattering_cross_section.push_back(slab.scattering_cross_section);
    all.extinction_cross_section.push_back(slab.extinction_cross_section);
    for (std::size_t p = 0; p < head.orders.size(); ++p)
      all.order_energy[p] += slab.order_energy[p] / static_cast<double>(head.wavelength_m.size());
    for (std::size_t t = 0; t < slab.error_estimate.size(); ++t) {
      const double error = slab.error_estimate[t];
      if (errors.empty() || error > all.largest_error.value)
        all.largest_error = {error, wavelength, head.theta_deg[t], 0};
      errors.push_back(error);
    }
  }
  const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
  std::nth_element(errors.begin(), middle, errors.end());
  all.median_error = *middle;
  return all;
}

std::optional<std::string> find_constant(const Provenance& provenance, const std::string& name) {
  for (const auto& [key, value] : provenance.constants)
    if (key == name) return value;
  return std::nullopt;
}

} // namespace scatter::table
