#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <type_traits>

/// Rays through an elliptical section, one at a time.
///
/// A point of the section is (a cos s, b sin s). Seen from the light it lies at the offset w sin(s - s0), so
/// that g = s - s0, -pi/2 .. pi/2, runs over what is lit and nothing is singular at the rims. The rays
/// inside, their points, normals and the sine that each would leave with are analytic in g, total reflection
/// or not; only the cosine it leaves with has square roots, where |sine| = 1.
namespace scatter::fiber {

/// A value and its first two derivatives by g.
template <typename Real>
struct Jet {
  Real v = 0, d = 0, e = 0;
  Jet() = default;
  Jet(Real value, Real first = 0, Real second = 0) // NOLINT: constants are jets
      : v(value), d(first), e(second) {}

  friend Jet operator+(Jet a, Jet b) { return {a.v + b.v, a.d + b.d, a.e + b.e}; }
  friend Jet operator-(Jet a, Jet b) { return {a.v - b.v, a.d - b.d, a.e - b.e}; }
  friend Jet operator*(Jet a, Jet b) {
    return {a.v * b.v, a.d * b.v + a.v * b.d, a.e * b.v + 2 * a.d * b.d + a.v * b.e};
  }
  friend Jet operator/(Jet a, Jet b) {
    const Real q = a.v / b.v, first = (a.d - q * b.d) / b.v;
    return {q, first, (a.e - 2 * first * b.d - q * b.e) / b.v};
  }
  friend Jet sqrt(Jet a) {
    const Real r = std::sqrt(a.v), first = a.d / (2 * r);
    return {r, first, (a.e / 2 - first * first) / r};
  }
};

namespace detail {

template <typename Number>
struct Vector {
  Number x, y;
};
template <typename Number>
Number dot(const Vector<Number>& a, const Vector<Number>& b) {
  return a.x * b.x + a.y * b.y;
}
template <typename Number>
Number cross(const Vector<Number>& a, const Vector<Number>& b) {
  return a.x * b.y - a.y * b.x;
}
template <typename Number>
Vector<Number> along(const Vector<Number>& a, Number s, const Vector<Number>& b) {
  return {a.x + s * b.x, a.y + s * b.y};
}

} // namespace detail

/// Where a ray meets the surface.
template <typename Number>
struct RayAtSurface {
  detail::Vector<Number> normal; ///< outward, of length 1
  Number sine; ///< of the angle, across, that it would leave with; positive left of the normal. Beyond +-1 it
               ///< is reflected totally
  Number cosine;                    ///< order 0 only: of the angle of incidence, across
  Number chord;                     ///< the way behind it inside, across
  detail::Vector<Number> at;        ///< (cos s, sin s)
  detail::Vector<Number> direction; ///< of the ray before, across, of length 1
};

/// A ray on leaving; `out` is false where it is reflected totally instead.
template <typename Real>
struct Leaving {
  bool out = false;
  Real phi = 0;    ///< azimuth less the light's, -pi..pi
  Real energy = 0; ///< A_p
};

/// How the azimuth turns at one g: its derivative is slope / cosine.
template <typename Real>
struct Turning {
  Real phi = 0;
  Real cosine = 0; ///< of the angle, across, that the ray leaves with; 0 where it does not. Order 0: 1
  Real slope = 0;
  Real slope_left = 0; ///< derivative of slope less what that of cosine adds: normal times it
  Real normal = 0;     ///< derivative of the normal's azimuth
  Real sines = 0;      ///< - cosine times the derivative of cosine
  Real noise = 0;      ///< of slope: what its parts, which may cancel, have of rounding
};

/// Where the light of a ray went: logarithms of the shares that remained, and what is inside at last.
template <typename Real>
struct Losses {
  Real left = 0, absorbed = 0, inside = 0;
};

template <typename Real>
class EllipticalTracer {
public:
  EllipticalTracer(Real eta, Real sigma_a, Real axis_ratio, Real theta_d, Real phi_i)
      : b_(std::sqrt(axis_ratio)), sigma_a_(sigma_a), eta2_(eta * eta), cos_d_(std::cos(theta_d)) {
    a_ = 1 / b_;
    contrast_ = (eta - 1) * (eta + 1);
    excess_ = contrast_ / (cos_d_ * cos_d_);
    index_ = std::sqrt(1 + excess_);
    cos_t_ = std::sqrt(contrast_ + cos_d_ * cos_d_) / eta;
    toward_ = {std::cos(phi_i), std::sin(phi_i)};
    start_ = std::atan2(a_ * toward_.y, b_ * toward_.x);
    width_ = std::hypot(a_ * toward_.y, b_ * toward_.x);
  }

  /// Calls met(order, RayAtSurface) for order 0, 1, ... until it returns false. Number: Real, or Jet<Real>.
  template <typename Number, typename Met>
  void trace(Real g, Met&& met) const {
    using std::sqrt;
    const Real s = std::sin(start_ + g), c = std::cos(start_ + g), w = width_ * std::cos(g);
    Vector<Number> at{c, s};
    Number lit = w;
    if constexpr (std::is_same_v<Number, Jet<Real>>) {
      at = {{c, -s, -c}, {s, c, -s}};
      lit = {w, -width_ * std::sin(g), -w};
    }
    // On the circle that the ellipse becomes when its axes are scaled, a chord is a reflection of the point.
    const auto outward = [&](const Vector<Number>& n) {
      const Number size = sqrt(dot(n, n));
      return Vector<Number>{n.x / size, n.y / size};
    };
    const Vector<Number> d{-toward_.x, -toward_.y}, scaled{b_ * at.x, a_ * at.y};
    Vector<Number> normal = outward(scaled);
    const Number cosine = lit / sqrt(dot(scaled, scaled)); // - d . normal
    if (!met(0, RayAtSurface<Number>{normal, cross(normal, d), cosine, 0, at, d})) return;
    const Number inside = sqrt(excess_ + cosine * cosine); // eta' times the cosine inside
    Vector<Number> t =
        along<Number>({d.x / index_, d.y / index_}, -excess_ / ((cosine + inside) * index_), normal);
    for (int order = 1;; ++order) {
      const Vector<Number> direction{t.x / a_, t.y / b_};
      const Number length = -2 * dot(at, direction) / dot(direction, direction);
      at = along(at, length, direction);
      normal = outward({b_ * at.x, a_ * at.y});
      if (!met(order, RayAtSurface<Number>{normal, index_ * cross(normal, t), 0, length, at, t})) return;
      t = along<Number>(t, -2 * dot(t, normal), normal);
    }
  }

  /// Calls left(order, Leaving) for order 0, 1, ... until it returns false or no light is left.
  template <typename Left>
  void light(Real g, Left&& left, Losses<Real>* losses = nullptr) const {
    Real inside = 1;
    trace<Real>(g, [&](int order, const RayAtSurface<Real>& surface) {
      Leaving<Real> leaving;
      Real depth = 0, passed = 0;
      if (order == 0) {
        leaving = {true, azimuth(mirrored(surface)), reflectivity(surface.cosine)};
        inside = through(surface.cosine);
      } else {
        depth = sigma_a_ * surface.chord / cos_t_;
        if (depth > 0) inside *= std::exp(-depth);
        const Real square = (1 - surface.sine) * (1 + surface.sine);
        if (square > 0) {
          const Real cosine = std::sqrt(square);
          passed = through(cosine);
          leaving = {true, azimuth(refracted(surface, cosine)), inside * passed};
          inside *= reflectivity(cosine);
        }
      }
      if (losses != nullptr) {
        losses->left -= std::log1p(-passed);
        losses->absorbed += depth;
        losses->inside = inside;
      }
      return left(order, leaving) && inside > 0;
    });
  }

  /// Product of the distances at which the ray inside passes the foci, each signed by the side: the same for
  /// all chords of a ray. Where it is 0 every chord passes a focus, ever nearer to the long axis, and rays
  /// beside it part by (1 + e) / (1 - e) at each, e the eccentricity.
  [[nodiscard]] Jet<Real> focal_product(Real g) const {
    Jet<Real> found;
    trace<Jet<Real>>(g, [&](int order, const RayAtSurface<Jet<Real>>& surface) {
      if (order == 0) return true;
      const Vector<Jet<Real>> at{a_ * surface.at.x, b_ * surface.at.y};
      const Jet<Real> past_centre = cross(at, surface.direction), y = surface.direction.y;
      found = past_centre * past_centre - (a_ - b_) * (a_ + b_) * y * y;
      return false;
    });
    return found;
  }
  /// Where the light meets the end of an axis: g plus or minus any pi/2.
  [[nodiscard]] Real start() const { return start_; }

  [[nodiscard]] Leaving<Real> leaving(Real g, int order) const {
    Leaving<Real> found;
    light(g, [&](int p, const Leaving<Real>& leaving) {
      if (p == order) found = leaving;
      return p < order;
    });
    return found;
  }

  [[nodiscard]] Turning<Real> turning(Real g, int order) const {
    Turning<Real> found;
    trace<Jet<Real>>(g, [&](int p, const RayAtSurface<Jet<Real>>& surface) {
      if (p < order) return true;
      const auto& n = surface.normal;
      const Jet<Real>& s = surface.sine;
      const RayAtSurface<Real> here{{n.x.v, n.y.v}, s.v, surface.cosine.v, 0, {}, {}};
      found.normal = n.x.v * n.y.d - n.y.v * n.x.d;
      const Real normal_turns = n.x.v * n.y.e - n.y.v * n.x.e;
      if (p == 0) { // a mirror: the ray turns by twice the normal's angle
        found.phi = azimuth(mirrored(here));
        found.cosine = 1;
        found.slope = 2 * found.normal;
        found.slope_left = 2 * normal_turns;
      } else {
        found.cosine = std::sqrt(std::max<Real>((1 - s.v) * (1 + s.v), 0));
        found.phi = azimuth(refracted(here, found.cosine));
        found.slope = found.cosine * found.normal + s.d;
        found.slope_left = found.cosine * normal_turns + s.e;
        found.sines = s.v * s.d;
        found.noise = 5 * std::numeric_limits<Real>::epsilon() * (order + 1) *
                      (std::abs(s.d) + index_ * std::abs(found.normal));
      }
      return false;
    });
    return found;
  }

private:
  template <typename Number>
  using Vector = detail::Vector<Number>;

  [[nodiscard]] Real reflectivity(Real cos_gamma) const {
    const Real c = cos_d_ * cos_gamma, w = std::sqrt(contrast_ + c * c), s = c + w, p = eta2_ * c + w;
    const Real r_s = contrast_ / (s * s), r_p = contrast_ * (1 - (eta2_ + 1) * c * c) / (p * p);
    return (r_s * r_s + r_p * r_p) / 2;
  }
  [[nodiscard]] Real through(Real cos_gamma) const {
    const Real c = cos_d_ * cos_gamma, w = std::sqrt(contrast_ + c * c), s = c + w, p = eta2_ * c + w;
    return 2 * c * w * (1 / (s * s) + eta2_ / (p * p));
  }
  [[nodiscard]] Vector<Real> mirrored(const RayAtSurface<Real>& at) const {
    return {2 * at.cosine * at.normal.x - toward_.x, 2 * at.cosine * at.normal.y - toward_.y};
  }
  [[nodiscard]] static Vector<Real> refracted(const RayAtSurface<Real>& at, Real cosine) {
    return {cosine * at.normal.x - at.sine * at.normal.y, cosine * at.normal.y + at.sine * at.normal.x};
  }
  [[nodiscard]] Real azimuth(const Vector<Real>& out) const {
    return std::atan2(cross(toward_, out), dot(toward_, out));
  }

  Real a_ = 1, b_, sigma_a_, eta2_, cos_d_;
  Real contrast_ = 0, excess_ = 0, index_ = 1, cos_t_ = 1; ///< eta^2 - 1, eta'^2 - 1, eta', cos theta_t
  Real start_ = 0, width_ = 1;                             ///< s0, w
  Vector<Real> toward_{1, 0};                              ///< the light
};

} // namespace scatter::fiber
