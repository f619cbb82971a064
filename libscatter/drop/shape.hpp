#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Shapes of falling drops: bodies of revolution about the vertical, as polar curves r(theta) with theta = 0
/// DOWN (the flat side). Lengths are in units of a, the radius of the sphere of equal volume.
namespace scatter::drop {

/// A drop's surface as the ray tracer needs it. Either a spheroid or a cosine series, scaled so that its
/// volume is 4 pi / 3 (a = 1).
struct Shape {
  enum class Kind { spheroid, cosine_series };
  Kind kind = Kind::spheroid;
  std::string name = "sphere";     ///< as the command line takes it
  double radius_m = 0;             ///< a, radius of the equal-volume sphere [m]
  double horizontal_semi_axis = 1; ///< spheroid: in units of a
  double vertical_semi_axis = 1;   ///< spheroid: in units of a
  std::vector<double>
      cosine; ///< cosine series: r/a = sum_n cosine[n] cos(n theta), n = 0.., volume scaled exactly

  /// True when the surface is a sphere about the origin of the polar curve.
  [[nodiscard]] bool is_sphere() const;
  /// r/a at the angle theta from straight down [rad], any theta; relative error below 1e-14.
  [[nodiscard]] double radius(double theta) const;
  /// d(r/a)/d theta [1/rad].
  [[nodiscard]] double slope(double theta) const;
  /// d^2(r/a)/d theta^2 [1/rad^2].
  [[nodiscard]] double second_derivative(double theta) const;
  /// The cosine series as a polynomial in c = cos(theta): r/a = sum_n p[n] c^n, exact up to rounding of the
  /// coefficients (which grow as 2^n: fine for the tables, n <= 10). Throws std::logic_error for a spheroid.
  [[nodiscard]] std::vector<double> polynomial() const;
  /// Volume in units of 4 pi a^3 / 3: 1 to rounding.
  [[nodiscard]] double volume() const;
  /// Height over width, from the curve's extent (not from r at 0 and 90 deg: a dented base rests on its rim).
  [[nodiscard]] double axis_ratio() const;
  /// False where the curve dents (a large drop's base): rays may then meet the surface more often than
  /// traced.
  [[nodiscard]] bool is_convex() const;
};

// All of these throw InputError, one line, for a radius that is not finite and positive or is outside the
// table.

[[nodiscard]] Shape sphere(double radius_m);
/// axis_ratio = vertical / horizontal, 0.2 .. 5.
[[nodiscard]] Shape spheroid(double radius_m, double axis_ratio);
/// Table 3.1 of the dissertation (Beard & Chuang 1987), a = 0.4 .. 3.0 mm, linear between rows; a sphere
/// below 0.4 mm. Always a cosine series of 8 terms, also where it is a sphere. c_0 and c_1 are the table's;
/// then the volume is scaled.
[[nodiscard]] Shape beard_chuang(double radius_m);
/// Chuang & Beard 1990, table 1, D = 1.0 .. 6.0 mm by diameter, linear between rows; from the sphere at D = 0
/// to the first row the coefficients grow as D^2 (distortion goes with the Weber and Bond numbers). Always 11
/// terms. The row D = 8.0 mm of the print is not used: it misses its volume by 0.25 %.
[[nodiscard]] Shape chuang_beard(double radius_m);
/// A series r/a = 1 + sum c[n] cos(n theta), n = 0 .. c.size() - 1, scaled to the volume of the sphere of
/// radius_m. Throws InputError unless there are 1..64 finite coefficients with r > 0 everywhere.
[[nodiscard]] Shape cosine_series(double radius_m, const std::vector<double>& c);

/// By name: "sphere", "spheroid" (needs axis_ratio > 0), "beard-chuang", "chuang-beard". axis_ratio = 0: not
/// given. Throws InputError that names the option, the value and the range that would be right.
[[nodiscard]] Shape make_shape(std::string_view name, double radius_m, double axis_ratio = 0);

} // namespace scatter::drop
