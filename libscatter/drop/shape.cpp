#include <scatter/drop/shape.hpp>
#include <scatter/optics/data_table.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <embedded/drops_beard_chuang_1987.hpp>
#include <embedded/drops_chuang_beard_1990.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>

namespace scatter::drop {
namespace {

using std::numbers::pi;

/// sum_n a[n] cos(n theta), by Clenshaw's recurrence.
double cosine_sum(const std::vector<double>& a, double c) {
  double b1 = 0, b2 = 0;
  for (std::size_t n = a.size(); n-- > 1;) {
    const double b = a[n] + 2 * c * b1 - b2;
    b2 = b1;
    b1 = b;
  }
  return (a.empty() ? 0 : a[0]) + c * b1 - b2;
}

/// Product of two cosine series, by cos m cos n = (cos(m+n) + cos(m-n)) / 2.
std::vector<double> cosine_product(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> product(a.size() + b.size() - 1, 0.0);
  for (std::size_t m = 0; m < a.size(); ++m)
    for (std::size_t n = 0; n < b.size(); ++n) {
      product[m + n] += a[m] * b[n] / 2;
      product[m > n ? m - n : n - m] += a[m] * b[n] / 2;
    }
  return product;
}

/// (1/2) integral of r^3 sin(theta) over 0..pi, in closed form: only even n count, each with 2 / (1 - n^2).
double series_volume(const std::vector<double>& a) {
  const auto cube = cosine_product(cosine_product(a, a), a);
  double volume = 0;
  for (std::size_t n = 0; n < cube.size(); n += 2) {
    const double order = static_cast<double>(n);
    volume += cube[n] / (1 - order * order);
  }
  return volume;
}

/// Smallest value of f over theta in [0, pi]: a fine scan, then golden sections around the best sample.
template <typename Function>
double minimum(Function&& f) {
  constexpr int samples = 2048;
  int best = 0;
  double lowest = f(0.0);
  for (int i = 1; i <= samples; ++i)
    if (const double value = f(pi * i / samples); value < lowest) {
      lowest = value;
      best = i;
    }
  double low = pi * std::max(best - 1, 0) / samples;
  double high = pi * std::min(best + 1, samples) / samples;
  constexpr double golden = 0.6180339887498949;
  for (int i = 0; i < 50; ++i) {
    const double left = high - golden * (high - low), right = low + golden * (high - low);
    (f(left) < f(right) ? high : low) = f(left) < f(right) ? right : left;
  }
  return std::min(lowest, f((low + high) / 2));
}

[[noreturn]] void refuse_radius(const char* name, double radius_m, const char* range) {
  std::ostringstream message;
  message << "radius " << radius_m * 1e3 << " mm is outside the " << name << " table: use " << range;
  throw InputError(message.str());
}

void check_radius(double radius_m) {
  if (std::isfinite(radius_m) && radius_m > 0) return;
  std::ostringstream message;
  message << "radius " << radius_m << " m is not possible: use a positive length such as 0.4mm";
  throw InputError(message.str());
}

/// Ends of the tables may be missed by rounding (3mm is not 6mm / 2 after a conversion of units).
constexpr double slack = 1e-12;

Shape scaled_series(std::string name, double radius_m, std::vector<double> c) {
  if (!c.empty()) c[0] += 1;
  const double scale = std::cbrt(series_volume(c));
  for (auto& coefficient : c) coefficient /= scale;
  Shape shape;
  shape.kind = Shape::Kind::cosine_series;
  shape.name = std::move(name);
  shape.radius_m = radius_m;
  shape.cosine = std::move(c);
  return shape;
}

} // namespace

bool Shape::is_sphere() const {
  if (kind == Kind::spheroid) return horizontal_semi_axis == vertical_semi_axis;
  return std::all_of(cosine.begin() + !cosine.empty(), cosine.end(), [](double a) { return a == 0; });
}

double Shape::radius(double theta) const {
  if (kind == Kind::cosine_series) return cosine_sum(cosine, std::cos(theta));
  return 1 / std::hypot(std::sin(theta) / horizontal_semi_axis, std::cos(theta) / vertical_semi_axis);
}

double Shape::slope(double theta) const {
  if (kind == Kind::cosine_series) {
    // -sum n a[n] sin(n theta), by Clenshaw's recurrence for sines.
    const double c = std::cos(theta);
    double b1 = 0, b2 = 0;
    for (std::size_t n = cosine.size(); n-- > 1;) {
      const double b = static_cast<double>(n) * cosine[n] + 2 * c * b1 - b2;
      b2 = b1;
      b1 = b;
    }
    return -std::sin(theta) * b1;
  }
  // With q = 1/r^2: q' = sin(2 theta) (1/A^2 - 1/B^2), r' = -q' r^3 / 2; the difference without cancellation.
  const double A = horizontal_semi_axis, B = vertical_semi_axis;
  const double r = radius(theta);
  return -r * r * r / 2 * std::sin(2 * theta) * (B - A) * (B + A) / (A * A * B * B);
}

double Shape::second_derivative(double theta) const {
  if (kind == Kind::cosine_series) {
    auto a = cosine;
    for (std::size_t n = 0; n < a.size(); ++n) a[n] *= -static_cast<double>(n) * static_cast<double>(n);
    return cosine_sum(a, std::cos(theta));
  }
  // r'' = 3 r'^2 / r - q'' r^3 / 2.
  const double A = horizontal_semi_axis, B = vertical_semi_axis;
  const double r = radius(theta), first = slope(theta);
  const double curvature = 2 * std::cos(2 * theta) * (B - A) * (B + A) / (A * A * B * B);
  return 3 * first * first / r - r * r * r / 2 * curvature;
}

std::vector<double> Shape::polynomial() const {
  if (kind != Kind::cosine_series)
    throw std::logic_error("polynomial() of a shape that is not a cosine series");
  // cos(n theta) = T_n(c), T_{n+1} = 2 c T_n - T_{n-1}.
  std::vector<double> sum(cosine.size(), 0.0), before(cosine.size(), 0.0), current(cosine.size(), 0.0);
  current[0] = 1;
  for (std::size_t n = 0; n < cosine.size(); ++n) {
    for (std::size_t i = 0; i <= n; ++i) sum[i] += cosine[n] * current[i];
    std::vector<double> next(cosine.size(), 0.0);
    for (std::size_t i = 0; i + 1 < cosine.size(); ++i) next[i + 1] = (n == 0 ? 1 : 2) * current[i];
    for (std::size_t i = 0; n > 0 && i < cosine.size(); ++i) next[i] -= before[i];
    before = std::move(current);
    current = std::move(next);
  }
  return sum;
}

double Shape::volume() const {
  if (kind == Kind::cosine_series) return series_volume(cosine);
  return horizontal_semi_axis * horizontal_semi_axis * vertical_semi_axis;
}

double Shape::axis_ratio() const {
  if (kind == Kind::spheroid) return vertical_semi_axis / horizontal_semi_axis;
  const double down = -minimum([&](double t) { return -radius(t) * std::cos(t); });
  const double up = -minimum([&](double t) { return radius(t) * std::cos(t); });
  const double half_width = -minimum([&](double t) { return -radius(t) * std::sin(t); });
  return (down + up) / (2 * half_width);
}

bool Shape::is_convex() const {
  if (kind == Kind::spheroid) return true;
  // The sign of the meridian's curvature; the other curvature of a body of revolution follows it.
  return minimum([&](double t) {
           const double r = radius(t), first = slope(t);
           return r * r + 2 * first * first - r * second_derivative(t);
         }) >= 0;
}

Shape sphere(double radius_m) {
  check_radius(radius_m);
  Shape shape;
  shape.radius_m = radius_m;
  return shape;
}

Shape spheroid(double radius_m, double axis_ratio) {
  check_radius(radius_m);
  if (!(axis_ratio >= 0.2 && axis_ratio <= 5)) {
    std::ostringstream message;
    message << "axis ratio " << axis_ratio << " is outside 0.2..5 (height over width)";
    throw InputError(message.str());
  }
  Shape shape;
  shape.name = "spheroid";
  shape.radius_m = radius_m;
  shape.horizontal_semi_axis = 1 / std::cbrt(axis_ratio);
  shape.vertical_semi_axis = axis_ratio / std::cbrt(axis_ratio);
  return shape;
}

Shape beard_chuang(double radius_m) {
  static const DataTable table = parse_data_table(embedded::drops_beard_chuang_1987);
  check_radius(radius_m);
  const double radius_mm = radius_m * 1e3;
  if (radius_mm > table.rows.back()[0] * (1 + slack))
    refuse_radius("beard-chuang", radius_m, "0..3 mm (a sphere below 0.4 mm)");
  const double key = std::clamp(radius_mm, table.rows.front()[0], table.rows.back()[0]);
  return scaled_series("beard-chuang", radius_m, table.interpolate(key));
}

Shape chuang_beard(double radius_m) {
  static const DataTable table = parse_data_table(embedded::drops_chuang_beard_1990);
  check_radius(radius_m);
  const double diameter_mm = 2 * radius_m * 1e3;
  const double first = table.rows.front()[0], last = table.rows.back()[0];
  if (diameter_mm > last * (1 + slack))
    refuse_radius(
        "chuang-beard", radius_m,
        "0..3 mm (the table is by diameter, 1..6 mm; below it fades to the sphere)");
  auto c = table.interpolate(std::clamp(diameter_mm, first, last));
  const double fade = diameter_mm < first ? (diameter_mm / first) * (diameter_mm / first) : 1;
  for (auto& coefficient : c) coefficient *= 1e-4 * fade;
  return scaled_series("chuang-beard", radius_m, std::move(c));
}

Shape cosine_series(double radius_m, const std::vector<double>& c) {
  check_radius(radius_m);
  if (c.empty() || c.size() > 64)
    throw InputError("cosine series: " + std::to_string(c.size()) + " coefficients, 1..64 are possible");
  for (std::size_t n = 0; n < c.size(); ++n)
    if (!(std::abs(c[n]) <= 1e6))
      throw InputError("cosine series: coefficient " + std::to_string(n) + " is not a number");
  auto raw = c;
  raw[0] += 1;
  if (!(minimum([&](double t) { return cosine_sum(raw, std::cos(t)); }) > 0))
    throw InputError("cosine series: r(theta) is not positive everywhere, so the curve encloses no drop");
  return scaled_series("cosine-series", radius_m, c);
}

Shape make_shape(std::string_view name, double radius_m, double axis_ratio) {
  if (name == "spheroid") {
    if (axis_ratio == 0) throw InputError("--shape spheroid needs --axis-ratio, height over width, 0.2..5");
    return spheroid(radius_m, axis_ratio);
  }
  if (axis_ratio != 0) throw InputError("--axis-ratio belongs to --shape spheroid, not to " + quote(name));
  if (name == "sphere") return sphere(radius_m);
  if (name == "beard-chuang") return beard_chuang(radius_m);
  if (name == "chuang-beard") return chuang_beard(radius_m);
  throw InputError(
      "--shape " + quote(name) + " is not known: use beard-chuang, chuang-beard, sphere or spheroid");
}

} // namespace scatter::drop
