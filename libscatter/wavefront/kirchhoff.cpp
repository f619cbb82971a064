#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/fourier_grid.hpp>
#include <scatter/wavefront/integral_taper.hpp>
#include <scatter/wavefront/kirchhoff.hpp>
#include <scatter/wavefront/outline.hpp>
#include <scatter/wavefront/rim_bends.hpp>
#include <scatter/wavefront/side_by_side.hpp>
#include <scatter/wavefront/vectors.hpp>

#include <embedded/kernel_kirchhoff.hpp>
#include <embedded/kernel_outline.hpp>

#include <algorithm>
#include <cmath>
#include <map>

namespace scatter::wavefront {
namespace {

using compute::OpenCL;
using compute::with_arguments;

constexpr double window_deg = 12;
/// Momenta across the plane of scattering that the rim may add, in units of the radius.
constexpr double most_swing = 0.3;
/// Grids are larger than coarse rays ask for by the first share, and by four times as much whenever other
/// rays fall outside, up to the second.
constexpr double least_slack = 0.1, most_slack = 2;
/// Tapers of orders above 3 along the azimuth, in Fresnel widths. There are no caustics in azimuth, and the
/// orders are faint: half the rays of other tapers, and as reciprocal.
constexpr double faint_taper_begin = 2.5, faint_taper_end = 6;

Vector direction(double theta_deg, double phi_deg) {
  return {sin_deg(theta_deg) * cos_deg(phi_deg), sin_deg(theta_deg) * sin_deg(phi_deg), cos_deg(theta_deg)};
}

/// Layout of window_t in kernels/kirchhoff.cl.
struct Window {
  Vector r0, e1, e2, f0, f1, f2;
  double latitude = 0;
  double shear = 0;
  std::array<double, 4> bend{}, rim{};
  std::array<Taper, 2> taper{}; ///< along phi, along theta
  std::array<double, 2> centre{}, xi_per_length{}, points_per_xi{};
  double tap_shape = 0;
  std::array<double, 2> modes_per_radian{};
  double alpha_step = 0, psi_step = 0, height_step = 0;
  std::array<int, 2> points{}, modes{};
  int alphas = 0, azimuths = 0, heights = 0, rim_cell = CoarseRays::alphas, order = 0, outline_terms = 0;
};
static_assert(sizeof(Window) == 424);

struct Cell {
  int alpha, azimuth, index, unused;
};
struct Target {
  int column, row;
  double weight;
};

/// Beyond the rim waves die out within some Airy widths: heights that rays are taken from.
double reach_beyond(double ka) {
  return rim_reach * std::cbrt(0.5 / (ka * ka));
}

/// Everything that is known of a window before its rays are traced.
struct WindowPlan {
  Window window;
  std::array<double, 2> half{1e-4, 1e-4};                ///< of its directions [rad]
  std::array<double, 2> low{1e9, 1e9}, high{-1e9, -1e9}; ///< of X', as coarse rays have it
  std::vector<Cell> cells;
  std::vector<Target> targets;

  /// Lays the grid, whose extent is that of X' and `slack` times as much.
  void lay_grid(double ka, double slack) {
    for (int axis = 0; axis < 2; ++axis) {
      window.centre[axis] = 0.5 * (low[axis] + high[axis]);
      const double reach = 0.5 * (high[axis] - low[axis]) * (1 + slack) + 0.2 * slack + 2 * reach_beyond(ka);
      // Modes lie so close that the extent of X' is 1 / oversampling of their period.
      const double mode = pi / (oversampling * ka * reach);
      window.xi_per_length[axis] = ka * mode;
      window.modes_per_radian[axis] = 1 / mode;
      window.modes[axis] = static_cast<int>(half[axis] / mode) + taps;
      window.points[axis] = quick_size(2 * oversampling * window.modes[axis]);
      window.points_per_xi[axis] = window.points[axis] / (2 * pi);
    }
  }
};

/// A ray in the coordinates of a window: see kernels/kirchhoff.cl.
struct Momentum {
  std::array<double, 2> rho{}, X{};
  double A = 0;     ///< det of the momentum's change by the impact point
  double scale = 0; ///< of its terms, which may cancel
  int negative = 0; ///< eigenvalues
};

/// Derivatives of W = shear rho0^2 / 2 + bend(rho0) (rho1 - rim(rho0))^2 / 2.
struct Reference {
  Reference(const Window& w, const std::array<double, 2>& rho) {
    // Beyond the taper, where rays have no weight, cubics are not followed.
    const double within = std::clamp(rho[0], w.taper[0].none[0], w.taper[0].none[1]);
    const auto [B, B1, B2] = cubic(w.bend, within);
    const auto [rim, rim1, rim2] = cubic(w.rim, within);
    const double off = rho[1] - rim;
    slope = {w.shear * rho[0] + off * (0.5 * off * B1 - B * rim1), B * off};
    curvature = {
        w.shear + off * (0.5 * off * B2 - 2 * B1 * rim1 - B * rim2) + B * rim1 * rim1, B1 * off - B * rim1,
        B};
  }
  /// Value and two derivatives.
  static std::array<double, 3> cubic(const std::array<double, 4>& c, double x) {
    return {
        c[0] + x * (c[1] + x * (c[2] + x * c[3])), c[1] + x * (2 * c[2] + x * 3 * c[3]),
        2 * c[2] + x * 6 * c[3]};
  }
  std::array<double, 2> slope;
  std::array<double, 3> curvature; ///< 00, 01, 11
};

Momentum momentum(const Window& w, const CoarseRays::Node& n) {
  const Vector& d = n.direction;
  const double towards = inner(d, w.f0), east = inner(d, w.f1), sin_2 = inner(d, w.f2);
  const double cos_2 = std::sqrt(std::max(towards * towards + east * east, 1e-12));
  const double cos_1 = towards / cos_2, sin_1 = east / cos_2;
  Vector middle, side, t1, t2;
  for (int c = 0; c < 3; ++c) {
    middle[c] = cos_1 * w.f0[c] + sin_1 * w.f1[c];
    side[c] = -sin_1 * w.f0[c] + cos_1 * w.f1[c];
    t1[c] = cos_2 * side[c];
    t2[c] = cos_2 * w.f2[c] - sin_2 * middle[c];
  }
  Momentum m;
  m.rho = {std::atan2(east, towards), std::asin(std::clamp(sin_2, -1.0, 1.0)) - w.latitude};
  const Reference W(w, m.rho);
  m.X = {inner(n.point, t1) - W.slope[0], inner(n.point, t2) - W.slope[1]};
  std::array<std::array<double, 2>, 2> rho_slope{}, X_slope{};
  const double on_d = inner(n.point, d), on_middle = inner(n.point, middle), on_side = inner(n.point, side);
  for (int q = 0; q < 2; ++q) {
    rho_slope[q] = {inner(n.direction_slope[q], t1) / (cos_2 * cos_2), inner(n.direction_slope[q], t2)};
    X_slope[q] = {
        inner(n.point_slope[q], t1) - (cos_2 * on_middle + W.curvature[0]) * rho_slope[q][0] -
            (sin_2 * on_side + W.curvature[1]) * rho_slope[q][1],
        inner(n.point_slope[q], t2) - (sin_2 * on_side + W.curvature[1]) * rho_slope[q][0] -
            (on_d + W.curvature[2]) * rho_slope[q][1]};
  }
  m.A = X_slope[0][0] * X_slope[1][1] - X_slope[1][0] * X_slope[0][1];
  m.scale = std::hypot(X_slope[0][0], X_slope[1][0]) * std::hypot(X_slope[0][1], X_slope[1][1]);
  const double turn = rho_slope[0][0] * rho_slope[1][1] - rho_slope[1][0] * rho_slope[0][1];
  double trace = 0;
  for (int q = 0; q < 2; ++q)
    for (int axis = 0; axis < 2; ++axis) trace += X_slope[q][axis] * rho_slope[q][axis];
  m.negative = (m.A < 0) != (turn < 0) ? 1 : trace < 0 ? 2 : 0;
  return m;
}

/// Values at places x in [-1, 1] by the powers of x up to the third, by weighted least squares.
struct CubicFit {
  void add(double x, double weight, double bend, double rim) {
    double power = weight;
    for (int n = 0; n < 7; ++n, power *= x) {
      moments[n] += power;
      if (n < 4) {
        values[0][n] += power * bend;
        values[1][n] += power * rim;
      }
    }
    ++count;
  }
  [[nodiscard]] std::array<std::array<double, 4>, 2> solve(int degree) const {
    double m[4][6];
    for (int i = 0; i <= degree; ++i) {
      for (int j = 0; j <= degree; ++j) m[i][j] = moments[i + j];
      m[i][i] += 1e-9 * moments[0];
      for (int v = 0; v < 2; ++v) m[i][4 + v] = values[v][i];
    }
    const auto take = [&](int to, int from, int column, double factor) {
      m[to][column] -= factor * m[from][column];
    };
    for (int i = 0; i <= degree; ++i)
      for (int r = 0; r <= degree; ++r) {
        if (r == i) continue;
        const double factor = m[r][i] / m[i][i];
        for (int j = i; j <= degree; ++j) take(r, i, j, factor);
        for (int v = 4; v < 6; ++v) take(r, i, v, factor);
      }
    std::array<std::array<double, 4>, 2> c{};
    for (int i = 0; i <= degree; ++i)
      for (int v = 0; v < 2; ++v) c[v][i] = m[i][4 + v] / m[i][i];
    return c;
  }
  double moments[7] = {}, values[2][4] = {};
  int count = 0;
};

WindowPlan plan_window(
    const CoarseRays& coarse, std::span<const RimBend> bends, int order, double ka,
    std::vector<Target> targets, const Layout& layout, Columns columns, const Vector& centre,
    int outline_terms, const IntegralSampling& sampling) {
  WindowPlan made;
  made.targets = std::move(targets);
  Window& w = made.window;
  w.r0 = centre;
  w.order = order;
  w.outline_terms = outline_terms;
  // Axes along theta and phi. Planes of incidence cut a sphere's directions along meridians.
  const double sine = std::hypot(centre[0], centre[1]), c = centre[0] / sine, s = centre[1] / sine;
  w.e1 = {centre[2] * c, centre[2] * s, -sine};
  w.e2 = cross(w.r0, w.e1);
  w.f0 = {c, s, 0};
  w.f1 = {s, -c, 0};
  w.f2 = {0, 0, -1};
  w.latitude = -std::asin(centre[2]);
  std::array<double, 2>& half = made.half;
  for (const Target& target : made.targets) {
    const Vector r = direction(layout.theta_deg[target.row], layout.phi_deg[columns.first + target.column]);
    half[0] = std::max(half[0], std::abs(std::atan2(inner(r, w.f1), inner(r, w.f0))));
    half[1] = std::max(half[1], std::abs(std::asin(std::clamp(inner(r, w.f2), -1.0, 1.0)) - w.latitude));
  }
  const double fresnel = fresnel_width(order, ka);
  std::vector<RimAngles> rim;
  for (int j = 0; j < CoarseRays::azimuths; ++j) {
    const CoarseRays::Node& last = coarse.node(order, CoarseRays::alphas, j);
    const CoarseRays::Node& before = coarse.node(order, CoarseRays::alphas - 1, j);
    if (order == 0 || !last.goes_out() || !before.goes_out()) continue;
    const Momentum at_rim = momentum(w, last);
    if (std::abs(at_rim.rho[0]) <= half[0] + taper_end * sampling.tapers * fresnel)
      rim.push_back({at_rim.rho[1], momentum(w, before).rho[1]});
  }
  const bool is_faint = order > 3;
  const double across = sampling.tapers * fresnel;
  const double full = std::min(half[0] + (is_faint ? faint_taper_begin : taper_begin) * across, 1.2),
               none = std::min(half[0] + (is_faint ? faint_taper_end : taper_end) * across, 1.5);
  w.taper[0] = {{-full, full}, {-none, none}};
  const double theta = w.latitude + 0.5 * pi;
  w.taper[1] = theta_taper(
      order, ka, half[1], rim, {theta - between_poles[0], between_poles[1] - theta}, sampling.tapers);
  CubicFit fit;
  for (const RimBend& at : bends) {
    const double apart = std::atan2(centre[1], centre[0]) - at.azimuth;
    const double longitude = apart - 2 * pi * std::rint(apart / (2 * pi)), end = w.taper[0].none[1];
    if (std::abs(longitude) < end)
      fit.add(longitude / end, w.taper[0](longitude) + 0.01, at.bend, at.theta - theta);
  }
  // Where rays begin to tunnel out bends jump, and polynomials of the azimuth swing, which momenta across the
  // plane of scattering would have to follow: there a lower degree.
  for (int degree = fit.count > 3 ? 3 : -1; degree >= 0; --degree) {
    const auto [bend, rim_at] = fit.solve(degree);
    const double end = w.taper[0].none[1];
    for (int n = 0; n < 4; ++n) {
      w.bend[n] = bend[n] / std::pow(end, n);
      w.rim[n] = rim_at[n] / std::pow(end, n);
    }
    const double farthest =
        std::max(std::abs(w.taper[1].none[0] - w.rim[0]), std::abs(w.taper[1].none[1] - w.rim[0]));
    double swing = 0;
    for (int i = -4; i <= 4; ++i)
      swing =
          std::max(swing, 0.5 * farthest * farthest * std::abs(Reference::cubic(w.bend, 0.25 * i * end)[1]));
    if (swing < most_swing) break;
  }
  // Cells of rays that may leave within the taper, and those at the rim with their continuation beyond it.
  std::vector<const CoarseRays::Node*> corners;
  for (int a = 0; a < CoarseRays::alphas; ++a)
    for (int j = 0; j < CoarseRays::azimuths; ++j) {
      const CoarseRays::Node* nodes[] = {
          &coarse.node(order, a, j), &coarse.node(order, a + 1, j), &coarse.node(order, a, j + 1),
          &coarse.node(order, a + 1, j + 1)};
      std::array<double, 2> low{1e9, 1e9}, high{-1e9, -1e9};
      int valid = 0;
      double towards = -1;
      for (const auto* node : nodes) {
        if (!node->goes_out()) continue;
        ++valid;
        const Momentum m = momentum(w, *node);
        towards = std::max(towards, inner(node->direction, w.r0));
        for (int axis = 0; axis < 2; ++axis) {
          low[axis] = std::min(low[axis], m.rho[axis]);
          high[axis] = std::max(high[axis], m.rho[axis]);
        }
      }
      if (valid == 0 || towards < -0.2) continue;
      // Half-way round the longitude jumps.
      bool misses = high[0] - low[0] > pi;
      for (int axis = 0; axis < 2; ++axis) {
        const double margin = 0.3 * (high[axis] - low[axis]) + 0.01;
        misses = misses || low[axis] - margin > w.taper[axis].none[1] ||
                 high[axis] + margin < w.taper[axis].none[0];
      }
      if (misses) continue;
      made.cells.push_back({a, j, 0, 0});
      for (const auto* node : nodes)
        if (node->goes_out()) corners.push_back(node);
      if (a == CoarseRays::alphas - 1 && order > 0 && nodes[1]->goes_out())
        made.cells.push_back({CoarseRays::alphas, j, 0, 0});
    }
  if (made.cells.empty() || corners.empty()) {
    made.cells.clear();
    return made;
  }
  // Shear across the plane of scattering, where A would vanish without: on a sphere the momentum about the
  // light is 0. Plane waves have -sin(theta) cos(theta) X_theta of it in these coordinates, which
  // makes the sum good to the next order of 1 / (k a); its sign is what counts.
  const auto folds = [&](double shear) {
    w.shear = shear;
    int found = 0;
    for (const Cell& cell : made.cells) {
      if (cell.alpha == CoarseRays::alphas) continue;
      int signs = 0, inside = 0;
      for (int corner = 0; corner < 4; ++corner) {
        const CoarseRays::Node& n = coarse.node(order, cell.alpha + corner / 2, cell.azimuth + corner % 2);
        if (!n.goes_out()) continue;
        const Momentum m = momentum(w, n);
        if (w.taper[0](m.rho[0]) * w.taper[1](m.rho[1]) < 0.05) continue;
        signs += m.A < 0 ? -1 : 1;
        ++inside;
      }
      if (inside > 0 && std::abs(signs) < inside) ++found;
    }
    return found;
  };
  double turning = 0;
  for (const auto* n : corners) {
    const Momentum m = momentum(w, *n);
    if (std::abs(m.rho[0]) < half[0] + fresnel && std::abs(m.rho[1]) < half[1] + fresnel) turning += m.X[1];
  }
  const double sign = turning * centre[2] < 0 ? 1 : -1;
  double shear = 0.5 * sign;
  int fewest = folds(shear);
  for (const double candidate : {-0.5, 0.4, -0.4, 0.8, -0.8})
    if (const int here = fewest > 0 ? folds(candidate * sign) : fewest; here < fewest) {
      fewest = here;
      shear = candidate * sign;
    }
  w.shear = shear;
  for (const auto* n : corners) {
    const Momentum m = momentum(w, *n);
    for (int axis = 0; axis < 2; ++axis) {
      made.low[axis] = std::min(made.low[axis], m.X[axis]);
      made.high[axis] = std::max(made.high[axis], m.X[axis]);
    }
  }
  // Phase between neighbouring rays: k (rho - r) . dX.
  const std::array<double, 2> spread{
      half[0] + std::max(w.taper[0].none[1], -w.taper[0].none[0]),
      half[1] + std::max(w.taper[1].none[1], -w.taper[1].none[0])};
  double step_alpha = 0, step_psi = 0;
  for (Cell& cell : made.cells) {
    const auto side = [&](const CoarseRays::Node& a, const CoarseRays::Node& b) {
      if (!a.goes_out() || !b.goes_out()) return 0.0;
      const Momentum from = momentum(w, a), to = momentum(w, b);
      return std::abs(to.X[0] - from.X[0]) * spread[0] + std::abs(to.X[1] - from.X[1]) * spread[1];
    };
    // Rays that tunnel in or out keep the index of the last one that did not; at the rim itself momenta stand
    // still.
    for (int a = std::min(cell.alpha + 1, CoarseRays::alphas - 1); a > 0; --a)
      if (const CoarseRays::Node& node = coarse.node(order, a, cell.azimuth); node.valid) {
        cell.index = node.foci - momentum(w, node).negative;
        break;
      }
    if (cell.alpha == CoarseRays::alphas) continue;
    const auto& n00 = coarse.node(order, cell.alpha, cell.azimuth);
    const auto& n10 = coarse.node(order, cell.alpha + 1, cell.azimuth);
    const auto& n01 = coarse.node(order, cell.alpha, cell.azimuth + 1);
    const auto& n11 = coarse.node(order, cell.alpha + 1, cell.azimuth + 1);
    step_alpha = std::max({step_alpha, side(n00, n10), side(n01, n11)});
    step_psi = std::max({step_psi, side(n00, n01), side(n10, n11)});
  }
  // Momenta change by about the angles that rays are apart; next to the rim, out of the plane of scattering,
  // their derivatives have no bound, but their weight vanishes.
  const auto rays_for = [&](double step, double cell) {
    const double bounded = std::min(step, steepest_momentum * cell * (spread[0] + spread[1]));
    return std::max(2, static_cast<int>(std::ceil(sampling.rays * ka * bounded / (pi * phase_step))));
  };
  w.alphas = rays_for(step_alpha, 0.5 * pi / CoarseRays::alphas);
  w.azimuths = rays_for(step_psi, 2 * pi / CoarseRays::azimuths);
  w.alpha_step = 0.5 * pi / CoarseRays::alphas / w.alphas;
  w.psi_step = 2 * pi / CoarseRays::azimuths / w.azimuths;
  w.heights = std::max(
      24, static_cast<int>(std::ceil(
              sampling.rays * ka * reach_beyond(ka) * (spread[0] + spread[1]) / (pi * 0.5 * phase_step))));
  w.height_step = reach_beyond(ka) / w.heights;
  w.tap_shape = tap_shape;
  made.lay_grid(ka, least_slack);
  return made;
}

/// Directions with a share, sorted into windows: the most expensive first, so that none is left for the end.
std::vector<WindowPlan> plan_windows(
    const CoarseRays& coarse, int order, double ka, const IntegralShare& share, const Layout& layout,
    Columns columns, int outline_terms, const IntegralSampling& sampling, std::size_t workers) {
  const int rows = static_cast<int>(layout.theta_deg.size());
  std::map<std::pair<int, int>, std::vector<Target>> groups;
  for (int column = 0; column < columns.count(); ++column)
    for (int row = 0; row < rows; ++row) {
      const float weight = share[static_cast<std::size_t>(column) * rows + row];
      if (weight == 0) continue;
      const double theta = layout.theta_deg[row], phi = layout.phi_deg[columns.first + column];
      const int band = static_cast<int>(theta / window_deg);
      const double wide = window_deg / sin_deg((band + 0.5) * window_deg);
      const int sector = static_cast<int>(std::floor(phi / wide));
      groups[{band, sector}].push_back({column, row, weight});
    }
  std::vector<std::vector<Target>> windows;
  for (auto& [cell, targets] : groups) windows.push_back(std::move(targets));
  std::vector<WindowPlan> plans(windows.size());
  const std::vector<RimBend> bends = rim_bends(coarse, order, ka);
  side_by_side(workers, windows.size(), [&](std::size_t, std::size_t i) {
    std::array<double, 2> low{1e9, 1e9}, high{-1e9, -1e9};
    for (const Target& t : windows[i]) {
      const double at[] = {layout.theta_deg[t.row], layout.phi_deg[columns.first + t.column]};
      for (int axis = 0; axis < 2; ++axis) {
        low[axis] = std::min(low[axis], at[axis]);
        high[axis] = std::max(high[axis], at[axis]);
      }
    }
    const Vector centre = direction(0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]));
    plans[i] = plan_window(
        coarse, bends, order, ka, std::move(windows[i]), layout, columns, centre, outline_terms, sampling);
  });
  std::erase_if(plans, [](const WindowPlan& plan) { return plan.cells.empty(); });
  std::ranges::stable_sort(plans, std::ranges::greater{}, [](const WindowPlan& plan) {
    return static_cast<double>(plan.cells.size()) * plan.window.alphas * plan.window.azimuths;
  });
  return plans;
}

} // namespace

void add_integral(
    RayProgram& rays, const CoarseRays& coarse, const Light& light, int order, const IntegralShare& share,
    const Layout& layout, Columns columns, const DirectionBuffers& directions,
    const IntegralSampling& sampling, cl::Buffer& sums) {
  if (std::ranges::all_of(share, [](float value) { return value == 0; })) return;
  OpenCL& opencl = rays.cl();
  const Outline outline = outline_series(rays.tracing.shape, rays.tracing.sun_elevation_deg);
  const Job job = rays.make_job(light, 2, order);
  const double ka = pi * job.wave;
  const std::size_t workers = rays.device.info().compute_units;
  auto plans = plan_windows(
      coarse, order, ka, share, layout, columns, static_cast<int>(outline.radius.size()), sampling, workers);
  if (plans.empty()) return;
  const std::string_view sources[] = {embedded::kernel_outline, embedded::kernel_kirchhoff};
  cl::Program& program = rays.build(light, sources, true, " -DUNIFORM -DBEYOND");
  const cl::Buffer job_data = rays.job_buffer(job), outline_data = opencl.upload(outline.both());
  const cl::Buffer taps_data = opencl.upload(tap_polynomials());
  const int rows = static_cast<int>(layout.theta_deg.size());
  const double scale = 0.5 * job.wave * inverse_transform_scale() * inverse_transform_scale();

  // How many rays fell outside the window or are no numbers; nothing is added if any.
  const auto work = [&](std::size_t lane, const WindowPlan& plan, bool only_compile) {
    const Window& w = plan.window;
    cl::CommandQueue& queue = opencl.lane(lane);
    const std::size_t size = 8 * static_cast<std::size_t>(w.points[0]) * w.points[1];
    const cl::Buffer window_data = opencl.upload(std::span<const Window>(&w, 1));
    const cl::Buffer cell_data = opencl.upload(plan.cells), target_data = opencl.upload(plan.targets);
    const cl::Buffer corrections_x = opencl.upload(mode_corrections(w.modes[0], w.points[0]));
    const cl::Buffer corrections_y = opencl.upload(mode_corrections(w.modes[1], w.points[1]));
    std::vector<double> grid(only_compile ? 8 : size);
    std::vector<int> lost{0};
    const cl::Buffer lost_data(
        opencl.context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR, sizeof(int), lost.data());
    const cl::Buffer grid_data(
        opencl.context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR, grid.size() * sizeof(double), grid.data());
    const int cells = only_compile ? 0 : static_cast<int>(plan.cells.size());
    const int targets = only_compile ? 0 : static_cast<int>(plan.targets.size());
    queue.enqueueNDRangeKernel(
        with_arguments(
            cl::Kernel(program, "spread_rays"), rays.surface_buffer, job_data, window_data, outline_data,
            taps_data, cell_data, cells, grid_data, lost_data),
        cl::NullRange, cl::NDRange(1), cl::NDRange(1));
    queue.enqueueReadBuffer(lost_data, CL_TRUE, 0, sizeof(int), lost.data());
    if (lost[0] > 0) return lost[0];
    if (!only_compile) {
      auto* mapped = static_cast<double*>(
          queue.enqueueMapBuffer(grid_data, CL_TRUE, CL_MAP_READ | CL_MAP_WRITE, 0, size * sizeof(double)));
      GridTransform(w.points[0], w.points[1], mapped).run(mapped);
      queue.enqueueUnmapMemObject(grid_data, mapped);
    }
    queue.enqueueNDRangeKernel(
        with_arguments(
            cl::Kernel(program, "gather_directions"), job_data, window_data, grid_data, corrections_x,
            corrections_y, taps_data, target_data, 0, targets, directions.sin_theta, directions.cos_theta,
            directions.cos_phi, directions.sin_phi, rows, scale, sums),
        cl::NullRange, cl::NDRange(1), cl::NDRange(1));
    queue.finish();
    return 0;
  };
  // Kernels are compiled at their first launch, which must not happen on several queues at once.
  work(0, plans.front(), true);
  side_by_side(workers, plans.size(), [&](std::size_t lane, std::size_t i) {
    double slack = least_slack;
    while (const int lost = work(lane, plans[i], false)) {
      slack *= 4;
      if (slack > most_slack)
        throw RunError(
            "diffraction integral: " + std::to_string(lost) + " rays of order " + std::to_string(order) +
            " fell outside their window or are not numbers; a larger or rounder drop, or --diffraction none, "
            "is without them");
      plans[i].lay_grid(ka, slack);
    }
  });
}

} // namespace scatter::wavefront
