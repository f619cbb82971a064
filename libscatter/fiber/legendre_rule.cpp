#include <scatter/fiber/legendre_rule.hpp>

#include <cmath>
#include <numbers>

namespace scatter::fiber {

LegendreRule legendre_rule(std::size_t count) {
  LegendreRule rule{std::vector<double>(count), std::vector<double>(count)};
  const auto n = static_cast<double>(count);
  for (std::size_t i = 0; i < (count + 1) / 2; ++i) {
    double x = std::cos(std::numbers::pi * (static_cast<double>(i) + 0.75) / (n + 0.5)), slope = 1;
    for (int step = 0; step < 100; ++step) { // Newton; three or four steps from this start
      double before = 1, value = x;
      for (std::size_t k = 2; k <= count; ++k) {
        const auto order = static_cast<double>(k);
        const double next = ((2 * order - 1) * x * value - (order - 1) * before) / order;
        before = value;
        value = next;
      }
      slope = n * (before - x * value) / ((1 - x) * (1 + x));
      const double change = value / slope;
      x -= change;
      if (std::abs(change) < 1e-15) break;
    }
    if (2 * i + 1 == count) x = 0;
    rule.x[i] = -x;
    rule.x[count - 1 - i] = x;
    rule.weight[i] = rule.weight[count - 1 - i] = 2 / ((1 - x) * (1 + x) * slope * slope);
  }
  return rule;
}

} // namespace scatter::fiber
