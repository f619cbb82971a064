#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

/// Functions of |theta_d| as piecewise Chebyshev polynomials: moments of cross-sections cost an integral over
/// the section each, and sums over fibres need thousands of them.
namespace scatter::fiber {

class MomentTable {
public:
  MomentTable() = default;
  /// fill(theta_d, to) writes `count` values for 0 <= theta_d <= largest_theta_d. Panels are halved until the
  /// last coefficients are below the tolerance (absolute), or a panel is a few 1e-3 rad wide: what a kink
  /// leaves there is narrow, and small in integrals.
  MomentTable(
      std::size_t count, const std::function<void(double, std::span<double>)>& fill, double tolerance);

  /// Value `index` at |theta_d|, even in theta_d.
  [[nodiscard]] double operator()(std::size_t index, double theta_d) const;
  [[nodiscard]] std::size_t panels() const { return edges_.empty() ? 0 : edges_.size() - 1; }

private:
  std::size_t count_ = 0;
  std::vector<double> edges_;
  std::vector<double> coefficients_; ///< [panel][index][degree]
};

} // namespace scatter::fiber
