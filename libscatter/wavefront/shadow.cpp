#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/far_field.hpp>
#include <scatter/wavefront/shadow.hpp>
#include <scatter/wavefront/vectors.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <sstream>
#include <thread>

namespace scatter::wavefront {
namespace {

using Complex = std::complex<double>;
constexpr Complex i{0, 1};

constexpr int rim_points = 512, surface_steps = 4096, sizes_at_most = 6, reflection_steps = 1200;
constexpr int azimuth_steps = 128;
/// Size parameters: of a drop, and of a piece of its surface, beyond which curvature it counts as that.
constexpr double smallest_drop = smallest_size_with_shadow, smallest_curvature = 10;
/// Of (x/2)^(1/3) theta between entries.
constexpr double edge_step = 0.04;
/// Beyond twice this angle [rad] two points stand for the outline, however small the drop.
constexpr double contour_end_at_most = 0.25;

double smooth_step(double a, double begin, double end) {
  const double s = std::clamp((a - begin) / (end - begin), 0.0, 1.0), s2 = s * s;
  return 1 - s2 * s2 * s * (126 - s * (420 - s * (540 - s * (315 - 70 * s))));
}

/// Lagrange's weights of four even nodes, place between the two in the middle: at = first node.
struct Cubic {
  int first = 0;
  std::array<double, 4> weight{};
};
Cubic cubic(double place, int count) {
  Cubic c;
  c.first = std::clamp(static_cast<int>(std::floor(place)) - 1, 0, count - 4);
  const double t = place - c.first;
  c.weight = {
      -(t - 1) * (t - 2) * (t - 3) / 6, t * (t - 2) * (t - 3) / 2, -t * (t - 1) * (t - 3) / 2,
      t * (t - 1) * (t - 2) / 6};
  return c;
}

Polarised operator*(double a, const Polarised& b) {
  return {a * b[0], a * b[1]};
}
Polarised& operator+=(Polarised& a, const Polarised& b) {
  a[0] += b[0];
  a[1] += b[1];
  return a;
}

double derivative(const std::vector<double>& series, double psi, int times) {
  double sum = 0;
  for (std::size_t n = 1; n < series.size(); ++n) {
    const double order = static_cast<double>(n);
    sum -= series[n] * (times == 1 ? order * std::sin(order * psi) : order * order * std::cos(order * psi));
  }
  return sum;
}

/// Principal curvatures at the polar angle t of the curve, and where the normal points.
struct Curve {
  double meridian = 1, across = 1, normal = 0, support = 1;
};
Curve curve(const drop::Shape& shape, double t) {
  const double r = shape.radius(t), first = shape.slope(t), second = shape.second_derivative(t);
  const double length2 = r * r + first * first, length = std::sqrt(length2);
  Curve b;
  b.normal = t - std::atan2(first, r);
  b.support = r * r / length;
  b.meridian = (length2 + first * first - r * second) / (length2 * length);
  const double sine = std::sin(t);
  b.across = std::abs(sine) < 1e-6 ? b.meridian : std::sin(b.normal) / (r * sine);
  return b;
}

} // namespace

Shadow::Shadow(const drop::Shape& shape, double sun_elevation_deg, const Light& light, double contour_end)
    : ka_(2 * pi * shape.radius_m / light.wavelength_m),
      contour_end_(std::min(contour_end / ka_, contour_end_at_most)), convex_(shape.is_convex()) {
  if (!(ka_ >= smallest_drop)) {
    std::ostringstream message;
    message << "--diffraction integral: a drop of size parameter " << ka_ << " is too small for order 0; use "
            << smallest_drop << " or more (radius " << smallest_drop * light.wavelength_m / (2 * pi) * 1e6
            << " um at this wavelength), or --method mie";
    throw InputError(message.str());
  }
  const double h = sun_elevation_deg * radians_per_degree;
  axis_ = {std::cos(h), 0, std::sin(h)};
  describe_surface(shape);
  describe_rim(shape, sun_elevation_deg);
  double least = 1e300, most = 0;
  for (const RimPoint& p : rim_) {
    least = std::min(least, p.size);
    most = std::max(most, p.size);
  }
  for (const SurfacePoint& p : surface_) {
    least = std::min(least, ka_ / std::max(p.meridian, p.across));
    most = std::max(most, ka_ / std::min(p.meridian, p.across));
  }
  least = std::max(least, smallest_curvature);
  const int count = most > least * (1 + 1e-9) ? sizes_at_most : 1;
  edges_.resize(count);
  for (int s = 0; s < count; ++s) {
    sizes_.push_back(
        count == 1 ? most : least * std::pow(most / least, static_cast<double>(s) / (count - 1)));
    const EdgeWave wave(sizes_[s], light.index);
    if (s == 0) reach_ = wave.furthest();
    const int steps = static_cast<int>(std::floor(wave.furthest() * wave.gamma() / edge_step + 1e-9));
    for (int n = -steps; n <= steps; ++n) {
      const auto at = wave.at(n * edge_step / wave.gamma());
      edges_[s].push_back({at.weight, at.moment, at.second_moment, at.tail, at.line_weight, at.reflected});
    }
    std::vector<Polarised> by_angle;
    for (int n = 0; n <= reflection_steps; ++n) {
      const double root = static_cast<double>(n) / reflection_steps;
      by_angle.push_back(wave.reflection(pi * root * root));
    }
    reflection_.push_back(std::move(by_angle));
  }
  for (int n = 0; n < (count == 1 ? 1 : rim_points); ++n) rim_tables_.push_back(rim_table(rim_[n]));
}

Shadow::RimTable Shadow::rim_table(const RimPoint& p) const {
  RimTable table;
  table.steps_per_angle = std::cbrt(0.5 * p.size) / edge_step;
  table.middle = static_cast<int>(2 * contour_end_ * table.steps_per_angle) + 3;
  for (int n = -table.middle; n <= table.middle; ++n) {
    const EdgeEntry e = edge(p.size, n / table.steps_per_angle);
    const auto mean = [](const Polarised& both) { return 0.5 * (both[0] + both[1]); };
    table.entries.push_back(
        {mean(e.weight), mean(e.tail), mean(e.moment) + mean(e.second_moment) / (ka_ * p.outline_radius),
         0.5 * (e.tail[0] - e.tail[1])});
  }
  return table;
}

void Shadow::describe_surface(const drop::Shape& shape) {
  const auto keep = [&](double t) {
    const Curve b = curve(shape, t);
    surface_.push_back({b.support, std::max(b.meridian, 0.02), std::max(b.across, 0.02)});
  };
  if (!convex_) {
    // Shadows are those of the convex hull: the point furthest along each normal.
    constexpr int samples = 4096;
    std::vector<double> radius;
    for (int n = 0; n <= samples; ++n) radius.push_back(shape.radius(pi * n / samples));
    for (int n = 0; n <= surface_steps; ++n) {
      const double normal = pi * n / surface_steps;
      int best = 0;
      double furthest = -1;
      for (int m = 0; m <= samples; ++m)
        if (const double reach = radius[m] * std::cos(pi * m / samples - normal); reach > furthest) {
          furthest = reach;
          best = m;
        }
      double low = pi * std::max(best - 1, 0) / samples, high = pi * std::min(best + 1, samples) / samples;
      constexpr double golden = 0.6180339887498949;
      const auto reach = [&](double t) { return shape.radius(t) * std::cos(t - normal); };
      for (int step = 0; step < 40; ++step) {
        const double left = high - golden * (high - low), right = low + golden * (high - low);
        (reach(left) > reach(right) ? high : low) = reach(left) > reach(right) ? right : left;
      }
      keep(0.5 * (low + high));
      surface_.back().support = reach(0.5 * (low + high));
    }
    return;
  }
  double t = 0;
  for (int n = 0; n <= surface_steps; ++n) {
    // The normal's polar angle grows with t: Newton's steps from the last.
    const double normal = pi * n / surface_steps;
    for (int step = 0; step < 8; ++step) {
      const Curve b = curve(shape, t);
      const double turn = b.meridian * std::hypot(shape.radius(t), shape.slope(t));
      const double change = std::clamp((normal - b.normal) / std::max(turn, 1e-3), -0.02, 0.02);
      t = std::clamp(t + change, 0.0, pi);
      if (std::abs(change) < 1e-13) break;
    }
    keep(t);
  }
}

void Shadow::describe_rim(const drop::Shape& shape, double sun_elevation_deg) {
  const Outline outline = outline_series(shape, sun_elevation_deg);
  for (int n = 0; n < rim_points; ++n) {
    const double psi = 2 * pi * n / rim_points, c = std::cos(psi), s = std::sin(psi);
    const double R = series_value(outline.radius, c), R1 = derivative(outline.radius, psi, 1);
    const double R2 = derivative(outline.radius, psi, 2), speed = std::hypot(R, R1);
    RimPoint p;
    p.x = R * c;
    p.y = R * s;
    p.z = series_value(outline.z, c);
    p.normal_x = (R * c + R1 * s) / speed;
    p.normal_y = (R * s - R1 * c) / speed;
    p.length = speed * 2 * pi / rim_points;
    p.outline_radius = speed * speed * speed / std::max(R * R + 2 * R1 * R1 - R * R2, 0.05 * R * R);
    // The surface's curvature along the light: between its principal ones.
    const Vector P{p.x, p.y, p.z}, N{p.normal_x, p.normal_y, 0};
    const double r = std::hypot(p.x, p.y, p.z);
    const double on_axis = (P[0] * axis_[0] + P[2] * axis_[2]) / r;
    const Curve b = curve(shape, std::acos(std::clamp(on_axis, -1.0, 1.0)));
    // The parallel circle's direction is axis x N.
    const Vector circle{-axis_[2] * N[1], axis_[2] * N[0], axis_[0] * N[1]};
    const double length2 = circle[0] * circle[0] + circle[1] * circle[1] + circle[2] * circle[2];
    const double share = length2 < 1e-12 ? 0 : circle[2] * circle[2] / length2;
    p.size = ka_ / std::max(share * b.across + (1 - share) * b.meridian, 0.05);
    rim_.push_back(p);
  }
}

Shadow::Blend Shadow::between_sizes(double x) const {
  Blend blend;
  const int count = static_cast<int>(sizes_.size());
  if (count == 1) {
    blend.weight = {1, 0, 0, 0};
    return blend;
  }
  const double place = std::log(x / sizes_.front()) / std::log(sizes_.back() / sizes_.front()) * (count - 1);
  const Cubic c = cubic(std::clamp(place, 0.0, count - 1.0), count);
  for (int k = 0; k < 4; ++k) blend.at[k] = c.first + k;
  blend.weight = c.weight;
  return blend;
}

Shadow::EdgeEntry Shadow::edge(double x, double theta) const {
  const Blend sizes = between_sizes(x);
  const double place = std::cbrt(0.5 * x) * theta / edge_step;
  EdgeEntry sum{};
  for (int k = 0; k < 4; ++k) {
    if (sizes.weight[k] == 0) continue;
    const auto& table = edges_[sizes.at[k]];
    const int count = static_cast<int>(table.size());
    const Cubic c = cubic(place + (count - 1) / 2, count);
    // moment and tail scale with (x/2)^(1/3).
    const double scale_once = std::cbrt(x / sizes_[sizes.at[k]]), scale = sizes.weight[k] * scale_once;
    for (int n = 0; n < 4; ++n) {
      const EdgeEntry& e = table[c.first + n];
      sum.weight += sizes.weight[k] * c.weight[n] * e.weight;
      sum.line += sizes.weight[k] * c.weight[n] * e.line;
      sum.reflected += sizes.weight[k] * c.weight[n] * e.reflected;
      sum.moment += scale * c.weight[n] * e.moment;
      sum.second_moment += scale * scale_once * c.weight[n] * e.second_moment;
      sum.tail += scale * c.weight[n] * e.tail;
    }
  }
  return sum;
}

double Shadow::share(double theta_deg) const {
  if (convex_) return 1;
  return smooth_step(theta_deg * radians_per_degree, contour_end_, 2 * contour_end_);
}

Shadow::Bend Shadow::surface_at(const Vector& normal, const Vector& level) const {
  const double cosine = std::clamp(normal[0] * axis_[0] + normal[2] * axis_[2], -1.0, 1.0);
  const Cubic c = cubic(std::acos(cosine) / pi * surface_steps, surface_steps + 1);
  SurfacePoint p{0, 0, 0};
  for (int n = 0; n < 4; ++n) {
    const SurfacePoint& from = surface_[c.first + n];
    p.support += c.weight[n] * from.support;
    p.meridian += c.weight[n] * from.meridian;
    p.across += c.weight[n] * from.across;
  }
  // Part of `level` on the parallel circle, whose direction is axis x normal.
  const Vector circle{
      -axis_[2] * normal[1], axis_[2] * normal[0] - axis_[0] * normal[2], axis_[0] * normal[1]};
  const double length2 = circle[0] * circle[0] + circle[1] * circle[1] + circle[2] * circle[2];
  const double on_circle = level[0] * circle[0] + level[1] * circle[1] + level[2] * circle[2];
  const double share = length2 < 1e-12 ? 0 : on_circle * on_circle / length2;
  return {p.support, ka_ / (share * p.across + (1 - share) * p.meridian), p.meridian * p.across};
}

Shadow::Azimuth Shadow::azimuth(double phi_deg) const {
  Azimuth a;
  a.cos_phi = cos_deg(phi_deg);
  a.sin_phi = sin_deg(phi_deg);
  for (int side = 0; side < 2; ++side) {
    // The wave follows the surface from the normal of the rim to that of the rim seen from the direction,
    // over the angle theta. It leaves half-way, on average, as rays do that are reflected. Its path is the
    // integral of the support function over the normal's angle: arcs and tangents together.
    const double sign = side == 0 ? 1 : -1;
    auto& steps = a.sides[side];
    double path = 0, scaled = 0, support_before = 0, gamma_before = 0;
    const double step = reach_ / azimuth_steps;
    const auto at = [&](double angle) {
      const double c = sign * std::cos(angle), s = sign * std::sin(angle);
      return surface_at({c * a.cos_phi, c * a.sin_phi, -s}, {s * a.cos_phi, s * a.sin_phi, c});
    };
    for (int n = 0; n < azimuth_steps + 4; ++n) {
      const Bend here = at(n * step);
      const double gamma = std::cbrt(0.5 * here.x);
      if (n > 0) {
        // Simpson's rule.
        const Bend between = at((n - 0.5) * step);
        path += step / 6 * (support_before + 4 * between.support + here.support);
        scaled += step / 6 * (gamma_before + 4 * std::cbrt(0.5 * between.x) + gamma);
      }
      support_before = here.support;
      gamma_before = gamma;
      const Bend middle = at(0.5 * n * step);
      steps.push_back({-sign * ka_ * path, sign * scaled, ka_ * ka_ / (middle.x * middle.gauss)});
    }
  }
  return a;
}

Polarised Shadow::reflected(double theta, const Azimuth& azimuth) const {
  if (!convex_) return {};
  // The normal halves the angle between -light and the direction.
  const double along = std::cos(0.5 * theta), back = std::sin(0.5 * theta);
  const Bend p = surface_at(
      {along * azimuth.cos_phi, along * azimuth.sin_phi, -back},
      {back * azimuth.cos_phi, back * azimuth.sin_phi, along});
  const Blend sizes = between_sizes(p.x);
  const Cubic a = cubic(std::sqrt(theta / pi) * reflection_steps, reflection_steps + 1);
  Polarised r{};
  for (int k = 0; k < 4; ++k) {
    if (sizes.weight[k] == 0) continue;
    for (int n = 0; n < 4; ++n) r += sizes.weight[k] * a.weight[n] * reflection_[sizes.at[k]][a.first + n];
  }
  const Complex ray = std::polar(0.5 * ka_ / std::sqrt(p.gauss), -2 * ka_ * p.support * back);
  return {ray * r[0], ray * r[1]};
}

Amplitude Shadow::contour(double theta, const Azimuth& azimuth) const {
  // k^2 / (2 pi) times the transform of the shadow, its edge displaced along the normal n by nu = (lambda -
  // x) / k and averaged. Green's theorem makes it the contour integral of i q . N / q^2 exp(-i q . (rho + nu
  // n)), N the displaced edge's normal times its length; parts integrated once leave (t the tangent, kappa
  // the outline's curvature) i q . n / q^2 + (q . t)^2 / q^2 (nu + kappa nu^2), where nothing cancels at q =
  // 0 but the integral of n, which is taken off. Lengths here are in 1 / k.
  Complex sum = 0, parallel = 0, cross = 0;
  // The trapezoidal rule converges at once beyond two points per turn of the phase.
  int stride = 1;
  while (rim_points / (2 * stride) > 2.5 * ka_ * theta + 60) stride *= 2;
  for (int n = 0; n < rim_points; n += stride) {
    const RimPoint& p = rim_[n];
    const double along = p.normal_x * azimuth.cos_phi + p.normal_y * azimuth.sin_phi;
    const double aside = p.normal_y * azimuth.cos_phi - p.normal_x * azimuth.sin_phi;
    const double place = p.x * azimuth.cos_phi + p.y * azimuth.sin_phi, half = std::sin(0.5 * theta);
    const double phase = -ka_ * std::sin(theta) * place - p.size * (theta - std::sin(theta)) * along +
                         ka_ * p.z * 2 * half * half;
    const double length = ka_ * p.length * stride;
    const Complex phasor = std::polar(1.0, phase);
    const auto& table = rim_tables_[rim_tables_.size() == 1 ? 0 : n];
    const Cubic c = cubic(table.steps_per_angle * theta * along + table.middle, 2 * table.middle + 1);
    RimEntry e{};
    for (int k = 0; k < 4; ++k) {
      const RimEntry& from = table.entries[c.first + k];
      e.weight += c.weight[k] * from.weight;
      e.tail += c.weight[k] * from.tail;
      e.moments += c.weight[k] * from.moments;
      e.difference += c.weight[k] * from.difference;
    }
    const Complex turned = 2.0 * i * std::sin(0.5 * phase) * std::polar(1.0, 0.5 * phase); // phasor - 1
    sum += length * (i / theta * along * turned * e.weight - along * along * e.tail +
                     aside * aside * phasor * e.moments);
    // What both polarisations differ by stays next to the rim.
    const Complex difference = length * phasor * e.difference;
    parallel += difference * (along * along - aside * aside);
    cross += difference * (2 * along * aside);
  }
  const double scale = 1 / (2 * pi) * std::sqrt(theta / std::sin(theta));
  sum *= scale;
  parallel *= scale;
  cross *= scale;
  return {sum - parallel, sum + parallel, -cross, -cross};
}

Amplitude Shadow::two_points(double theta, const Azimuth& azimuth) const {
  Polarised sum = reflected(theta, azimuth);
  if (theta >= reach_) return {sum[0], sum[1], 0, 0};
  const Cubic at = cubic(theta / reach_ * azimuth_steps, azimuth_steps + 4);
  const double last = edge_step * static_cast<double>((edges_.front().size() - 1) / 2);
  for (int side = 0; side < 2; ++side) {
    const double sign = side == 0 ? 1 : -1;
    double path = 0, scaled = 0, across = 0;
    for (int n = 0; n < 4; ++n) {
      const auto& from = azimuth.sides[side][at.first + n];
      path += at.weight[n] * from.path;
      scaled += at.weight[n] * from.scaled;
      across += at.weight[n] * from.across;
    }
    if (std::abs(scaled) >= last) continue;
    // The sphere on whose surface the wave would come as far.
    const double gamma = scaled / (sign * theta);
    const EdgeEntry e = edge(2 * gamma * gamma * gamma, sign * theta);
    const double X = across * theta;
    // Hankel's function of the outline's circle (DLMF 10.17.5), two terms.
    const Complex hankel{1 + 15 / (128 * X * X), -sign * 3 / (8 * X)};
    const Complex factor = sign * i * std::sqrt(X / (2 * pi)) / (theta * theta) *
                           std::sqrt(theta / std::sin(theta)) * std::polar(1.0, path + sign * pi / 4);
    const double left = smooth_step(std::abs(scaled), last - 0.7, last);
    for (int q = 0; q < 2; ++q) {
      // Across the plane of scattering the other polarisation's wave comes in.
      const Complex line = e.line[q] + sign * i / X * (e.line[1 - q] - e.line[q]);
      sum[q] += left * factor * (hankel * line - e.reflected[q]);
    }
  }
  return {sum[0], sum[1], 0, 0};
}

Amplitude Shadow::at(double theta_deg, const Azimuth& azimuth) const {
  const double theta = std::max(theta_deg * radians_per_degree, 1e-9 / ka_);
  const double near = smooth_step(theta, contour_end_, 2 * contour_end_);
  Amplitude sum{};
  if (near > 0) {
    const Amplitude a = contour(theta, azimuth);
    sum = {near * a.S1, near * a.S2, near * a.S3, near * a.S4};
  }
  if (near < 1) {
    const Amplitude a = two_points(theta, azimuth);
    sum.S1 += (1 - near) * a.S1;
    sum.S2 += (1 - near) * a.S2;
  }
  return sum;
}

void add_shadow(
    const Shadow& shadow, double ka, const Layout& layout, Columns columns, unsigned threads,
    std::span<double> sums) {
  const std::size_t rows = layout.theta_deg.size();
  std::atomic<int> next = 0;
  const auto run = [&] {
    for (int column = next++; column < columns.count(); column = next++) {
      const double phi = layout.phi_deg[columns.first + column];
      const auto azimuth = shadow.azimuth(phi);
      const double c = cos_deg(phi), s = sin_deg(phi);
      for (std::size_t row = 0; row < rows; ++row) {
        const double theta = layout.theta_deg[row];
        const Amplitude a = shadow.at(theta, azimuth);
        // The inverse of amplitude_matrix() in kernels/far_field.cl.
        const double h = cos_deg(theta) < 0 ? -1 : 1;
        const Complex x_theta = a.S2 * c + a.S3 * s, x_phi = -a.S4 * c - a.S1 * s;
        const Complex y_theta = a.S2 * s - a.S3 * c, y_phi = -a.S4 * s + a.S1 * c;
        const Complex parts[] = {
            h * c * x_theta - s * x_phi, s * x_theta + h * c * x_phi, h * c * y_theta - s * y_phi,
            s * y_theta + h * c * y_phi};
        double* at = sums.data() + 8 * (static_cast<std::size_t>(column) * rows + row);
        for (int part = 0; part < 4; ++part) {
          at[part] += parts[part].real() / ka;
          at[part + 4] += parts[part].imag() / ka;
        }
      }
    }
  };
  std::vector<std::thread> others;
  for (unsigned t = 1; t < std::min<unsigned>(threads, columns.count()); ++t) others.emplace_back(run);
  run();
  for (std::thread& thread : others) thread.join();
}

} // namespace scatter::wavefront
