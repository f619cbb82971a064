// Method. Rays of one order are traced on rings around the light. At one azimuth phi every ring has one ray,
// as long as the direction's azimuth grows with the impact's; all that belongs to a ray is a smooth periodic
// function of the impact azimuth, so that a few rays a ring and its Fourier series give it. Over the rays of
// one azimuth the far field is the integral
//   S(theta) = -i exp(-i pi/4) k sqrt(k / (2 pi sin theta)) sum w sqrt|d(u,v)/d(X,phi)| E
//              exp(i k (L + X (theta_ray - theta))) i^-mu dX,   X = dr/dtheta . p,
// mu the focal lines to infinity less one where theta_ray falls while X grows: stationary phase gives
// geometric optics, a fold of directions Airy's function. On a sphere X is the angular momentum, and the sum
// is that of Debye's series.

#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/fourier_grid.hpp>
#include <scatter/wavefront/meridian_integral.hpp>
#include <scatter/wavefront/references.hpp>
#include <scatter/wavefront/side_by_side.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <memory>
#include <optional>
#include <ranges>

namespace scatter::wavefront {
namespace {

/// Columns whose searched rays are in memory together.
constexpr std::size_t columns_at_once = 512;
/// A taper that has to end before rays with several azimuths reaches so many of Fresnel's widths at least,
/// and ends so far [rad] before the first of them.
constexpr double shortest_taper = 4, wall_margin = 0.01;

/// Confines a stretch to directions that lie so far from rays of rings with several rays per azimuth that its
/// taper ends before them. False: there are none.
bool confine(
    Stretch& s, std::span<const Ring> rings, double phi, int order, double ka, const Layout& layout,
    double wider) {
  std::vector<double> walls;
  for (const Ring& ring : rings) {
    if (ring.state() != Ring::State::none) continue;
    for (int j = 0; j < ring.azimuths(); ++j) {
      const double theta = ring.sample(theta_of, j), apart = ring.psi(j) + ring.sample(turned, j) - phi;
      if (!std::isfinite(theta) || !std::isfinite(apart)) return false;
      if (theta > s.from() && theta < s.to() && std::abs(apart - 2 * pi * std::rint(apart / (2 * pi))) < 0.3)
        walls.push_back(theta);
    }
  }
  if (walls.empty()) return true;
  std::ranges::sort(walls);
  // Of the gaps between walls that with the most rows.
  const double away = shortest_taper * fresnel_width(order, ka) + wall_margin;
  const auto row_from = [&](double theta) {
    const auto rows = std::span(layout.theta_deg).subspan(s.first, s.end - s.first);
    return s.first +
           static_cast<int>(std::ranges::lower_bound(rows, theta / radians_per_degree) - rows.begin());
  };
  int first = 0, end = 0;
  std::array<double, 2> ends{};
  for (std::size_t gap = 0; gap <= walls.size(); ++gap) {
    const bool is_lowest = gap == 0, is_highest = gap == walls.size();
    const double low = is_lowest ? -1 : walls[gap - 1] + away, high = is_highest ? 4 : walls[gap] - away;
    if (const int from = row_from(low), to = row_from(high); to - from > end - first) {
      first = from;
      end = to;
      ends = {
          is_lowest ? between_poles[0] : walls[gap - 1] + wall_margin,
          is_highest ? between_poles[1] : walls[gap] - wall_margin};
    }
  }
  if (first >= end) return false;
  s.take_rows(first, end, layout);
  s.lay_taper(order, ka, ends, wider);
  // A taper must not end among the rim's own rays.
  return std::ranges::none_of(s.rim, [&](const RimAngles& rim) {
    const double angle = rim.last - s.middle, margin = fresnel_width(order, ka);
    return (angle > s.taper.full[1] && angle < s.taper.none[1] + margin) ||
           (angle < s.taper.full[0] && angle > s.taper.none[0] - margin);
  });
}

/// A ray of one azimuth.
struct MeridianRay {
  double theta, path, momentum;
  double determinant, spreading;               ///< as Field has them
  double traced_determinant, traced_spreading; ///< the same of a traced ray nearby, for their signs
  double step;                                 ///< share of the integral
  double lines;                                ///< focal lines to infinity
  bool spreads;                                ///< its theta falls
  std::array<double, 8> jones;
};

/// The sum over rays for the directions of one stretch.
class StretchSum {
public:
  explicit StretchSum(double wave) : wave_(wave) {}

  void
  add(const Stretch& s, std::span<const MeridianRay> rays, const Layout& layout, double phi_deg,
      std::span<const float> share, std::span<double> sums);

private:
  static std::array<double, taps> tap_values(double z) {
    const std::vector<double>& polynomials = tap_polynomials();
    std::array<double, taps> values{};
    for (int tap = 0; tap < taps; ++tap) {
      const double* const c = polynomials.data() + tap * (tap_degree + 1);
      double value = c[tap_degree];
      for (int n = tap_degree - 1; n >= 0; --n) value = value * z + c[n];
      values[tap] = value;
    }
    return values;
  }

  double wave_;
  std::vector<double> grid_;
  struct Prepared {
    std::unique_ptr<GridTransform> transform;
    int modes = -1;
    std::vector<double> corrections;
  };
  std::map<int, Prepared> prepared_; ///< by points
};

void StretchSum::add(
    const Stretch& s, std::span<const MeridianRay> rays, const Layout& layout, double phi_deg,
    std::span<const float> share, std::span<double> sums) {
  const double ka = pi * wave_;
  const Reference& reference = *s.reference;
  auto taken = rays | std::views::filter(
                          [&](const MeridianRay& ray) { return ray.theta > s.from() && ray.theta < s.to(); });
  if (taken.empty()) return; // no light of this order comes here
  const auto momentum_of = [&](const MeridianRay& ray) {
    return ray.momentum - reference.momentum(ray.theta);
  };
  const auto [lowest, highest] = std::ranges::minmax(taken | std::views::transform(momentum_of));
  const double centre = 0.5 * (lowest + highest);
  // In steps, so that many columns share their plans.
  const double reach = std::ceil((0.5 * (highest - lowest) + 0.005) * 32) / 32;
  // Modes lie so close that the extent of the momentum is 1 / oversampling of their period.
  const double mode = pi / (oversampling * ka * reach), xi_per_length = ka * mode;
  const int modes = static_cast<int>(s.half / mode) + taps, points = quick_size(2 * oversampling * modes);
  const double points_per_xi = points / (2 * pi);
  grid_.assign(8 * static_cast<std::size_t>(points), 0.0);
  for (const MeridianRay& ray : taken) {
    const double angle = ray.theta - s.middle, momentum = momentum_of(ray);
    const double slope = reference.slope(ray.theta);
    // The index is the number of focal lines, less one where theta falls while the momentum grows.
    const bool falls = (ray.traced_determinant - slope * ray.traced_spreading < 0) != ray.spreads;
    const double xi = (momentum - centre) * xi_per_length;
    const double y = std::sqrt(tap_shape * tap_shape - xi * xi * (0.25 * taps * taps));
    const double weight = ray.step * std::sqrt(std::abs(ray.determinant - slope * ray.spreading)) *
                          s.taper(angle) * (y / (std::exp(y) - std::exp(-y)));
    const double half_turns = wave_ * (ray.path + reference.path(ray.theta) + momentum * angle) -
                              0.5 * (ray.lines - (falls ? 1 : 0));
    // The next order in 1 / lambda of the partial wave lambda = k X that the ray stands for, at the direction
    // that it is meant for: its phase, and the field's turn with the azimuth.
    const double towards = s.middle + std::clamp(angle, -s.half, s.half);
    const double sine_towards = std::sin(towards);
    const double inverse_lambda = 1 / std::copysign(std::max(std::abs(ka * ray.momentum), 5.0), ray.momentum);
    const double phase = 0.375 * inverse_lambda * std::cos(towards) / sine_towards,
                 turned_by = inverse_lambda / sine_towards;
    const double turns = pi * (half_turns - 2 * std::rint(0.5 * half_turns)) - phase;
    const double c = weight * std::cos(turns), sine = weight * std::sin(turns);
    // As azimuth grows, fields of incident x and y turn into -y and x on a sphere: E + i / (lambda sin theta)
    // times (-dE_phi, dE_theta) / dphi.
    const std::array<double, 8>& E = ray.jones;
    const double jones[8] = {E[0] - turned_by * E[7], E[1] + turned_by * E[6], E[2] + turned_by * E[5],
                             E[3] - turned_by * E[4], E[4] + turned_by * E[3], E[5] - turned_by * E[2],
                             E[6] - turned_by * E[1], E[7] + turned_by * E[0]};
    double value[8];
    for (int part = 0; part < 4; ++part) {
      value[part] = c * jones[part] - sine * jones[part + 4];
      value[part + 4] = c * jones[part + 4] + sine * jones[part];
    }
    const double at = xi * points_per_xi + (0.5 * points - 0.5 * taps), first = std::ceil(at);
    const int start = static_cast<int>(first);
    if (!(std::abs(weight) < 1e300) || start < 0 || start + taps > points)
      throw RunError("diffraction integral: a ray fell outside its window or is no number");
    const auto tap = tap_values(2 * (first - at) - 1);
    for (int i = 0; i < taps; ++i)
      for (int part = 0; part < 8; ++part) grid_[8 * (start + i) + part] += tap[i] * value[part];
  }
  Prepared& prepared = prepared_[points];
  if (!prepared.transform) prepared.transform = std::make_unique<GridTransform>(points, 1, grid_.data());
  if (prepared.modes != modes) {
    prepared.modes = modes;
    prepared.corrections = mode_corrections(modes, points);
  }
  prepared.transform->run(grid_.data());

  const double scale = std::sqrt(ka / (2 * pi)) * inverse_transform_scale();
  const double cos_phi = cos_deg(phi_deg), sin_phi = sin_deg(phi_deg);
  for (int row = s.first; row < s.end; ++row) {
    if (share[row] == 0) continue;
    const double theta_deg = layout.theta_deg[row], rho = theta_deg * radians_per_degree - s.middle;
    const double at = rho / mode - 0.5 * taps, first = std::ceil(at);
    const int start = static_cast<int>(first);
    const auto tap = tap_values(2 * (first - at) - 1);
    double sum[8] = {};
    for (int i = 0; i < taps; ++i) {
      const int m = start + i, point = m < 0 ? m + points : m;
      const double factor = tap[i] * prepared.corrections[m + modes];
      for (int part = 0; part < 8; ++part) sum[part] += factor * grid_[8 * point + part];
    }
    const double half_turns = wave_ * (rho * centre + reference.path(theta_deg * radians_per_degree)) + 0.75;
    const double turns = -pi * (half_turns - 2 * std::rint(0.5 * half_turns));
    const std::complex<double> factor = std::polar(scale * share[row] / std::sqrt(sin_deg(theta_deg)), turns);
    // From (theta, phi) to transverse_basis().
    const double h = theta_deg > 90 ? -1 : 1;
    for (int x = 0; x < 4; x += 2) {
      const std::complex<double> along_theta = factor * std::complex(sum[x], sum[x + 4]);
      const std::complex<double> along_phi = factor * std::complex(sum[x + 1], sum[x + 5]);
      const std::complex<double> e1 = h * cos_phi * along_theta - sin_phi * along_phi;
      const std::complex<double> e2 = sin_phi * along_theta + h * cos_phi * along_phi;
      double* const to = sums.data() + 8 * static_cast<std::size_t>(row) + x;
      to[0] += e1.real();
      to[1] += e2.real();
      to[4] += e1.imag();
      to[5] += e2.imag();
    }
  }
}

} // namespace

struct MeridianIntegral::Implementation {
  Implementation(
      RayProgram& rays, const CoarseRays& coarse, const Light& light, int order, const Layout& on,
      Columns block, const IntegralShare& wanted, const IntegralSampling& sampling)
      : layout(on), columns(block), wave(rays.make_job(light, 2, order).wave), share(wanted),
        workers(rays.device.info().compute_units),
        all(stretches(coarse, order, pi * wave, wanted, on, block, sampling.tapers)),
        places(ring_places(coarse, order, pi * wave, all, sampling.rays)),
        program(rays, light, order, places) {
    if (all.empty()) return;
    rings = make_rings(program, workers, pi * wave, places);
    const References references(
        rings, places, program.outline(), rim_bends(coarse, order, pi * wave), pi * wave);
    // What is not served is left to others.
    const std::size_t rows = layout.theta_deg.size();
    side_by_side(workers, all.size(), [&](std::size_t, std::size_t i) {
      Stretch& s = all[i];
      const auto leave = [&](int first, int end) {
        std::fill_n(share.begin() + static_cast<std::ptrdiff_t>(s.column * rows) + first, end - first, 0.0F);
      };
      const int first = s.first, end = s.end;
      const double azimuth = phi(s.column);
      const bool served = confine(s, rings, azimuth, order, pi * wave, on, sampling.tapers);
      if (served) s.reference = references.serving(azimuth, s);
      if (!s.reference) {
        leave(first, end);
      } else {
        leave(first, s.first);
        leave(s.end, end);
      }
    });
    std::erase_if(all, [](const Stretch& s) { return !s.reference; });
  }

  [[nodiscard]] double phi_deg(int column) const { return layout.phi_deg[columns.first + column]; }
  [[nodiscard]] double phi(int column) const { return phi_deg(column) * radians_per_degree; }
  /// The rays of one azimuth, ring by ring. found: fields of rays that were searched, `stride` apart.
  [[nodiscard]] std::vector<MeridianRay>
  rays_at(double azimuth, std::span<const double> found, std::size_t stride) const;
  void add(std::span<double> sums);

  const Layout& layout;
  Columns columns;
  double wave;
  IntegralShare share;
  std::size_t workers;
  std::vector<Stretch> all; ///< that are served, column by column
  Places places;
  RingProgram program;
  std::vector<Ring> rings;
};

std::vector<MeridianRay> MeridianIntegral::Implementation::rays_at(
    double azimuth, std::span<const double> found, std::size_t stride) const {
  struct RingRay {
    std::size_t ring;
    Ring::Values values;
    double lines, by_momentum, by_theta; ///< focal lines and determinants of one traced ray nearby
  };
  std::vector<RingRay> all_rays;
  std::size_t next_searched = 0;
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const Ring& ring = rings[r];
    if (ring.state() == Ring::State::none) continue;
    if (ring.state() == Ring::State::series) {
      const auto [values, nearest] = ring.towards(azimuth);
      all_rays.push_back(
          {r, values, ring.sample(foci, nearest), ring.sample(determinant, nearest),
           ring.sample(spreading, nearest)});
    } else {
      Ring::Values values;
      for (int f = 0; f < ring_fields; ++f) values[f] = found[(next_searched * ring_fields + f) * stride];
      ++next_searched;
      all_rays.push_back({r, values, values[foci], values[determinant], values[spreading]});
    }
  }
  // Rays that tunnel in or out keep the focal lines of the last one that did not, or of the first.
  const auto tunnels = [&](const RingRay& ray) {
    return ray.lines < 0 || places.step[ray.ring] == 0 || ray.ring >= places.first_beyond;
  };
  double lines = 0;
  bool spreads = false;
  if (const auto first = std::ranges::find_if_not(all_rays, tunnels); first != all_rays.end()) {
    lines = first->lines;
    spreads = first->by_theta < 0;
  }
  std::vector<MeridianRay> meridian;
  for (const RingRay& ray : all_rays) {
    if (!tunnels(ray)) {
      lines = ray.lines;
      spreads = ray.by_theta < 0;
    }
    const Ring::Values& values = ray.values;
    MeridianRay made{
        values[theta_of],
        values[path],
        values[momentum],
        values[determinant],
        values[spreading],
        ray.by_momentum,
        ray.by_theta,
        places.step[ray.ring],
        lines,
        spreads,
        {}};
    std::copy_n(values.begin() + jones, 8, made.jones.begin());
    meridian.push_back(made);
  }
  return meridian;
}

void MeridianIntegral::Implementation::add(std::span<double> sums) {
  struct ColumnWork {
    int column;
    std::size_t first, end;
  };
  std::vector<ColumnWork> work;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (work.empty() || work.back().column != all[i].column) work.push_back({all[i].column, i, i});
    work.back().end = i + 1;
  }
  std::vector<std::size_t> searched;
  for (std::size_t r = 0; r < rings.size(); ++r)
    if (rings[r].state() == Ring::State::unsmooth) searched.push_back(r);
  std::vector<StretchSum> sum_of_worker;
  for (std::size_t worker = 0; worker < workers; ++worker) sum_of_worker.emplace_back(wave);
  const std::size_t rows = layout.theta_deg.size();
  for (std::size_t start = 0; start < work.size(); start += columns_at_once) {
    const auto some = std::span(work).subspan(start, std::min(columns_at_once, work.size() - start));
    std::vector<double> azimuth;
    for (const ColumnWork& w : some) azimuth.push_back(phi(w.column));
    azimuth.resize((azimuth.size() + ray_lanes - 1) / ray_lanes * ray_lanes, azimuth.back());
    const std::vector<double> found =
        searched.empty() ? std::vector<double>{} : program.meridians(searched, rings, azimuth);
    side_by_side(workers, some.size(), [&](std::size_t worker, std::size_t c) {
      const int column = some[c].column;
      const std::vector<MeridianRay> meridian =
          rays_at(azimuth[c], std::span(found).subspan(searched.empty() ? 0 : c), azimuth.size());
      for (std::size_t i = some[c].first; i < some[c].end; ++i)
        sum_of_worker[worker].add(
            all[i], meridian, layout, phi_deg(column),
            std::span<const float>(share).subspan(column * rows, rows),
            sums.subspan(column * rows * 8, rows * 8));
    });
  }
}

MeridianIntegral::MeridianIntegral(
    RayProgram& rays, const CoarseRays& coarse, const Light& light, int order, const Layout& layout,
    Columns columns, const IntegralShare& wanted, const IntegralSampling& sampling)
    : implementation_(
          std::make_unique<Implementation>(rays, coarse, light, order, layout, columns, wanted, sampling)) {}
MeridianIntegral::~MeridianIntegral() = default;
MeridianIntegral::MeridianIntegral(MeridianIntegral&&) noexcept = default;
MeridianIntegral& MeridianIntegral::operator=(MeridianIntegral&&) noexcept = default;

const IntegralShare& MeridianIntegral::share() const {
  return implementation_->share;
}

void MeridianIntegral::add(std::span<double> sums) {
  implementation_->add(sums);
}

} // namespace scatter::wavefront
