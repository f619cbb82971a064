#pragma once

#include <cstddef>
#include <vector>

/// Internal to scatter::fiber: Gauss-Legendre quadrature.
namespace scatter::fiber {

struct LegendreRule {
  std::vector<double> x, weight;
};

/// Nodes and weights on [-1, 1], increasing; to 1e-15. count 1..1000.
[[nodiscard]] LegendreRule legendre_rule(std::size_t count);

} // namespace scatter::fiber
