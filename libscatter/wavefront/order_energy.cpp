#include <scatter/optics/units.hpp>
#include <scatter/wavefront/order_energy.hpp>

#include <cmath>

namespace scatter::wavefront {

std::vector<double> energy_by_quadrature(RayProgram& program, const Light& light, int last, double rim) {
  constexpr int samples = 4096;
  std::vector<double> u(samples), v(samples, 0.0), by_order(last + 1, 0.0);
  for (int i = 0; i < samples; ++i) u[i] = rim * std::sin(0.5 * pi * (i + 0.5) / samples);
  const auto rays = program.trace(light, u, v, last);
  for (int i = 0; i < samples; ++i) {
    const double angle = 0.5 * pi * (i + 0.5) / samples;
    const double ring = 2 * pi * rim * rim * std::sin(angle) * std::cos(angle) * (0.5 * pi / samples);
    for (int p = 0; p <= last; ++p)
      if (const Amplitude& j = rays[i][p].jones; rays[i][p].valid)
        by_order[p] += ring * 0.5 * (std::norm(j.S1) + std::norm(j.S2) + std::norm(j.S3) + std::norm(j.S4));
  }
  return by_order;
}

std::vector<double> energy_of_rings(RayProgram& program, const Light& light, int last) {
  const double step = 2 * program.surface.largest_radius / program.tracing.rays;
  const double first = program.tracing.rays % 2 == 0 ? 0.5 * step : 0;
  // Corners of the cells at or above the line, inner before outer, one side before the other.
  const double sides[] = {first, program.tracing.rays % 2 == 0 ? first : step};
  std::vector<double> u, v, by_order(last + 1, 0.0);
  for (int i = 0; i < (program.tracing.rays + 1) / 2; ++i)
    for (const double side : sides) {
      u.push_back(first + i * step);
      v.push_back(side);
    }
  const auto rays = program.trace(light, u, v, last);
  const auto energy = [&](std::size_t ray, int p) {
    const Amplitude& j = rays[ray][p].jones;
    return 0.5 * (std::norm(j.S1) + std::norm(j.S2) + std::norm(j.S3) + std::norm(j.S4));
  };
  const auto complete = [&](std::size_t corner, int p) {
    return rays[corner][p].valid && rays[corner + 1][p].valid;
  };
  for (int p = 0; p <= last; ++p) {
    if (complete(0, p)) by_order[p] += pi * first * first * 0.5 * (energy(0, p) + energy(1, p));
    for (std::size_t corner = 0; corner + 2 < u.size(); corner += 2)
      if (complete(corner, p) && complete(corner + 2, p))
        by_order[p] +=
            pi * (u[corner + 2] - u[corner]) * (u[corner + 2] + u[corner]) * 0.25 *
            (energy(corner, p) + energy(corner + 1, p) + energy(corner + 2, p) + energy(corner + 3, p));
  }
  return by_order;
}

} // namespace scatter::wavefront
