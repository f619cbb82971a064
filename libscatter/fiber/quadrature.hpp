#pragma once

#include <cstddef>
#include <vector>

/// Internal to scatter::fiber: Gauss-Legendre quadrature.
namespace scatter::fiber {

struct Quadrature {
  std::vector<double> x, weight;
};

/// Nodes and weights on [-1, 1], increasing; to 1e-15. count 1..1000.
[[nodiscard]] Quadrature gauss_legendre(std::size_t count);

} // namespace scatter::fiber
