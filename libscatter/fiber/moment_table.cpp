#include <scatter/fiber/fiber_scattering.hpp>
#include <scatter/fiber/moment_table.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::fiber {
namespace {

constexpr std::size_t points = 16;
constexpr double least_panel = 1e-3;

} // namespace

MomentTable::MomentTable(
    std::size_t count, const std::function<void(double, std::span<double>)>& fill, double tolerance)
    : count_(count) {
  struct Panel {
    double a, b;
  };
  // A stack from the right end, so that panels come out from left to right.
  std::vector<Panel> open;
  constexpr int first_panels = 4;
  for (int i = first_panels; i-- > 0;)
    open.push_back({largest_theta_d * i / first_panels, largest_theta_d * (i + 1) / first_panels});
  edges_.push_back(0);
  std::vector<double> values(points * count), coefficients(count * points);
  while (!open.empty()) {
    const Panel panel = open.back();
    open.pop_back();
    for (std::size_t i = 0; i < points; ++i) {
      const double x = std::cos(pi * (static_cast<double>(i) + 0.5) / points);
      fill(
          0.5 * (panel.a + panel.b) + 0.5 * (panel.b - panel.a) * x,
          std::span(values).subspan(i * count, count));
    }
    double tail = 0;
    for (std::size_t k = 0; k < count; ++k)
      for (std::size_t n = 0; n < points; ++n) {
        double sum = 0;
        for (std::size_t i = 0; i < points; ++i)
          sum += values[i * count + k] *
                 std::cos(pi * static_cast<double>(n) * (static_cast<double>(i) + 0.5) / points);
        sum *= (n == 0 ? 1.0 : 2.0) / points;
        coefficients[k * points + n] = sum;
        if (n >= points - 3) tail = std::max(tail, std::abs(sum));
      }
    if (tail > tolerance && panel.b - panel.a > 2 * least_panel) {
      const double middle = 0.5 * (panel.a + panel.b);
      open.push_back({middle, panel.b});
      open.push_back({panel.a, middle});
      continue;
    }
    edges_.push_back(panel.b);
    coefficients_.insert(coefficients_.end(), coefficients.begin(), coefficients.end());
  }
}

double MomentTable::operator()(std::size_t index, double theta_d) const {
  const double at = std::min(std::abs(theta_d), largest_theta_d);
  const auto above = std::upper_bound(edges_.begin() + 1, edges_.end() - 1, at);
  const auto panel = static_cast<std::size_t>(above - edges_.begin()) - 1;
  const double a = edges_[panel], b = edges_[panel + 1];
  const double x = (2 * at - a - b) / (b - a);
  const double* const c = &coefficients_[(panel * count_ + index) * points];
  double y = 0, z = 0; // Clenshaw's recurrence
  for (std::size_t n = points; n-- > 1;) {
    const double next = 2 * x * y - z + c[n];
    z = y;
    y = next;
  }
  return x * y - z + c[0];
}

} // namespace scatter::fiber
