#pragma once

#include <scatter/wavefront/coarse_rays.hpp>

#include <optional>
#include <vector>

/// Internal to scatter::wavefront: what a drop's rim asks of the diffraction integral.
namespace scatter::wavefront {

/// Rays so near to the rim [rad] say how momenta are to be unfolded.
constexpr double off_the_rim = 0.25;

/// What a drop's rim asks of W: at each azimuth of impact, where its ray leaves, and the W'' for which
/// momenta have no fold there that no caustic belongs to. See papers/kirchhoff-method.md.
struct RimBend {
  double azimuth, theta, bend;
  bool tunnels; ///< out, there
};

/// A line through points, by least squares.
class LineFit {
public:
  void add(double x, double y) {
    ++count_;
    x_ += x;
    y_ += y;
    xx_ += x * x;
    xy_ += x * y;
  }
  /// None of fewer than three points, or of points above each other.
  [[nodiscard]] std::optional<double> slope() const {
    const double spread = count_ * xx_ - x_ * x_;
    if (count_ < 3 || !(spread > 0)) return {};
    return (count_ * xy_ - x_ * y_) / spread;
  }

private:
  double count_ = 0, x_ = 0, y_ = 0, xx_ = 0, xy_ = 0;
};

/// Of the azimuths whose rays at the rim go out; exact where they do so by refraction, fitted to the first
/// rays that do not tunnel out elsewhere.
[[nodiscard]] std::vector<RimBend> rim_bends(const CoarseRays& coarse, int order, double ka);

} // namespace scatter::wavefront
