#pragma once

#include <scatter/wavefront/ray_program.hpp>

#include <vector>

/// Energy that leaves an axisymmetric drop order by order, from rays along one radius.
namespace scatter::wavefront {

/// Orders 0..last in units of a^2, from rays up to the rim: Gauss-Legendre would not see the rim's
/// square-root singularity, a midpoint rule in the angle of incidence does.
[[nodiscard]] std::vector<double>
energy_by_quadrature(RayProgram& rays, const Light& light, int last, double rim);

/// The same for the grid's own rays: every complete cell on the centre line stands for its ring.
[[nodiscard]] std::vector<double> energy_of_rings(RayProgram& rays, const Light& light, int last);

} // namespace scatter::wavefront
