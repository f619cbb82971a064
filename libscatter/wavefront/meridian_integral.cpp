// Method. Rays of one order are traced on rings around the light. At one azimuth phi every ring has one ray,
// as long as the direction's azimuth grows with the impact's; all that belongs to a ray is a smooth periodic
// function of the impact azimuth, so that a few rays a ring and its Fourier series give it. Over the rays of
// one azimuth the far field is the integral
//   S(theta) = -i exp(-i pi/4) k sqrt(k / (2 pi sin theta)) sum w sqrt|d(u,v)/d(X,phi)| E
//              exp(i k (L + X (theta_ray - theta))) i^-mu dX,   X = dr/dtheta . p,
// mu the focal lines to infinity less one where theta_ray falls while X grows: stationary phase gives
// geometric optics, a fold of directions Airy's function. On a sphere X is the angular momentum, and the sum
// is that of Debye's series.

#include <scatter/exact/vector_clones.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/fftw_planner.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/fourier_grid.hpp>
#include <scatter/wavefront/integral_taper.hpp>
#include <scatter/wavefront/meridian_integral.hpp>
#include <scatter/wavefront/outline.hpp>
#include <scatter/wavefront/side_by_side.hpp>

#include <embedded/kernel_outline.hpp>
#include <embedded/kernel_rings.hpp>
#include <fftw3.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <memory>
#include <new>
#include <numeric>
#include <optional>
#include <ranges>

namespace scatter::wavefront {
namespace {

using compute::with_arguments;

constexpr double band_deg = 12; ///< of scattering angles summed together
constexpr int ray_lanes = 16;   ///< RAY_LANES of the kernels
/// Columns whose searched rays are in memory together.
constexpr std::size_t columns_at_once = 512;
/// Rays on a ring: at first, and at most.
constexpr int fewest_azimuths = 32, most_azimuths = 128;
/// The azimuth of directions grows at least this fast with that of the impact.
constexpr double slowest_azimuth = 0.2;
/// About grazing exit azimuths turn back in narrow stretches, by so much at most [rad]: one of the three rays
/// there, all of them faint, is enough.
constexpr double most_turned_back = 0.2;
/// The momentum grows with the angle of incidence at least by the first share of what it does on a sphere,
/// and nothing is gained beyond the second.
constexpr double slowest_momentum = 0.05, fast_enough = 0.3;
/// Rays so near to the rim [rad] say how momenta are to be unfolded.
constexpr double off_the_rim = 0.25;
/// A twist of 1 costs as much as momenta that change by this much, in units of a sphere's, otherwise than
/// they should.
constexpr double cost_of_twist = 0.2;
/// Angles of incidence from here on count as next to the rim in any case.
constexpr double rim_from = 0.93 * pi / 2;
/// Change of momentum per angle between rays, at most.
constexpr double steepest_momentum = 1.5;

/// RING_FIELDS in kernels/rings.cl and their places.
constexpr int ring_fields = 16;
enum Field { turned, theta_of, path, momentum, determinant, jones, foci = 13, turning = 14, spreading = 15 };

/// What a stretch's momenta refer to: X' = X - dW/dtheta, W = bend t^2 / 2 + twist t^3 / 6, t = theta less
/// the rim's. Stationary phase does not depend on W. Rays that come in at the rim turn with the angle that
/// they come in at; where that changes a drop's momenta, too, X would have a fold there that no caustic
/// belongs to. bend undoes that, twist what comes next. On a sphere both are 0.
struct Reference {
  double theta = 0, bend = 0, twist = 0;
  [[nodiscard]] double path(double other) const {
    const double t = other - theta;
    return t * t * (0.5 * bend + twist * t / 6);
  }
  [[nodiscard]] double momentum(double other) const {
    const double t = other - theta;
    return t * (bend + 0.5 * twist * t);
  }
  [[nodiscard]] double slope(double other) const { return bend + twist * (other - theta); }
};

/// Between these angles from the rim [rad] rays pass from one chart to the other, where one is not enough.
constexpr double chart_overlap[] = {0.12, 0.25};

/// Rays that share a reference.
struct Chart {
  enum class Of { all, rim, rest } of = Of::all;
  Reference reference;
  [[nodiscard]] double weight(double from_rim) const {
    if (of == Of::all) return 1;
    const double next_to_rim = smooth_step(from_rim, chart_overlap[0], chart_overlap[1]);
    return of == Of::rim ? next_to_rim : 1 - next_to_rim;
  }
};

/// Directions of one column and band, and which rays they take.
struct Stretch {
  int column = 0, first = 0, end = 0; ///< rows
  double middle = 0, half = 0;        ///< theta [rad]
  Taper taper;
  std::vector<Chart> charts;
  [[nodiscard]] double from() const { return middle + taper.none[0]; }
  [[nodiscard]] double to() const { return middle + taper.none[1]; }
};

std::vector<Stretch> stretches(
    const CoarseRays& coarse, int order, double ka, const IntegralShare& share, const Layout& layout,
    Columns columns) {
  const int rows = static_cast<int>(layout.theta_deg.size());
  std::vector<Stretch> made;
  for (int column = 0; column < columns.count(); ++column) {
    const double phi = layout.phi_deg[columns.first + column] * radians_per_degree;
    // The rim's directions near this azimuth.
    std::vector<RimAngles> rim;
    for (int j = 0; j < CoarseRays::azimuths; ++j) {
      const auto& last = coarse.node(order, CoarseRays::alphas, j);
      const auto& before = coarse.node(order, CoarseRays::alphas - 1, j);
      if (!last.goes_out() || !before.goes_out()) continue;
      const double apart = std::atan2(last.direction[1], last.direction[0]) - phi;
      if (std::abs(apart - 2 * pi * std::rint(apart / (2 * pi))) > 0.06) continue;
      const auto theta = [](const CoarseRays::Node& n) {
        return std::atan2(std::hypot(n.direction[0], n.direction[1]), n.direction[2]);
      };
      rim.push_back({theta(last), theta(before)});
    }
    for (int row = 0; row < rows;) {
      const int band = static_cast<int>(layout.theta_deg[row] / band_deg);
      Stretch s;
      s.column = column;
      s.first = rows;
      for (; row < rows && static_cast<int>(layout.theta_deg[row] / band_deg) == band; ++row) {
        if (share[static_cast<std::size_t>(column) * rows + row] == 0) continue;
        s.first = std::min(s.first, row);
        s.end = row + 1;
      }
      if (s.first >= s.end) continue;
      const double low = layout.theta_deg[s.first], high = layout.theta_deg[s.end - 1];
      s.middle = 0.5 * (low + high) * radians_per_degree;
      s.half = std::max(0.5 * (high - low) * radians_per_degree, 1e-4);
      std::vector<RimAngles> from_middle = rim;
      for (RimAngles& angles : from_middle) {
        angles.last -= s.middle;
        angles.before -= s.middle;
      }
      s.taper = theta_taper(order, ka, s.middle, s.half, from_middle);
      made.push_back(s);
    }
  }
  return made;
}

/// Where rings are.
struct Places {
  std::vector<double> at;       ///< angles, then one at the rim (without weight), then heights beyond it
  std::vector<double> step;     ///< each one's share of the integral; 0 for the one at the rim
  std::size_t first_beyond = 0; ///< heights from here on
  double rim_from = 0;          ///< angles from which some rays come in or leave at grazing incidence
  /// Change of momentum per angle times the angle between ray and direction that steps are made for.
  double steepest = 0;
};

Places ring_places(const CoarseRays& coarse, int order, double ka, std::span<const Stretch> stretches) {
  constexpr double cell = 0.5 * pi / CoarseRays::alphas;
  // Directions that some stretch takes rays from, joined to ranges.
  struct Range {
    double from, to;
  };
  std::vector<Range> ranges;
  double spread = 0;
  for (const Stretch& s : stretches) {
    ranges.push_back({s.from(), s.to()});
    spread = std::max(spread, s.half + std::max(s.taper.none[1], -s.taper.none[0]));
  }
  std::ranges::sort(ranges, {}, &Range::from);
  std::vector<Range> joined;
  for (const Range& range : ranges) {
    if (joined.empty() || range.from > joined.back().to)
      joined.push_back(range);
    else
      joined.back().to = std::max(joined.back().to, range.to);
  }
  std::vector<int> cells;
  double steepest = 0;
  for (int a = 0; a < CoarseRays::alphas; ++a) {
    double low = pi, high = 0, change = 0;
    for (int j = 0; j < CoarseRays::azimuths; ++j) {
      double at_ends[2] = {};
      int valid = 0;
      for (int end = 0; end < 2; ++end) {
        const auto& node = coarse.node(order, a + end, j);
        if (!node.goes_out()) continue;
        const auto &d = node.direction, &p = node.point;
        const double sine = std::hypot(d[0], d[1]), theta = std::atan2(sine, d[2]);
        low = std::min(low, theta);
        high = std::max(high, theta);
        at_ends[end] = d[2] * (d[0] * p[0] + d[1] * p[1]) / std::max(sine, 1e-12) - sine * p[2];
        if (sine > 0.05) ++valid;
      }
      if (valid == 2) change = std::max(change, std::abs(at_ends[1] - at_ends[0]));
    }
    const double margin = 0.02;
    const bool wanted = std::ranges::any_of(
        joined, [&](const Range& range) { return low - margin < range.to && high + margin > range.from; });
    if (!wanted) continue;
    cells.push_back(a);
    steepest = std::max(steepest, std::min(change, steepest_momentum * cell));
  }
  Places places;
  if (cells.empty()) return places;
  // Coarse rays tunnel out where they would leave beyond grazing.
  int grazing = static_cast<int>(rim_from / cell);
  for (int a = grazing; a > 0; --a)
    for (int j = 0; j < CoarseRays::azimuths; ++j)
      if (!coarse.node(order, a, j).valid) grazing = a - 1;
  places.rim_from = grazing * cell;
  places.steepest = steepest / cell * spread;
  const int per_cell = std::max(2, static_cast<int>(std::ceil(ka * steepest * spread / (pi * phase_step))));
  for (const int a : cells)
    for (int i = 0; i < per_cell; ++i) places.at.push_back((a + (i + 0.5) / per_cell) * cell);
  places.step.assign(places.at.size(), cell / per_cell);
  places.first_beyond = places.at.size();
  if (cells.back() != CoarseRays::alphas - 1) return places;
  places.at.push_back(0.5 * pi - 1e-5);
  places.step.push_back(0);
  ++places.first_beyond;
  // Beyond the rim waves die out within some Airy widths.
  const double reach = rim_reach * std::cbrt(0.5 / (ka * ka));
  const int heights =
      std::max(24, static_cast<int>(std::ceil(ka * reach * 2 * spread / (pi * 0.5 * phase_step))));
  for (int i = 0; i < heights; ++i) {
    places.at.push_back((i + 0.5) * reach / heights);
    places.step.push_back(reach / heights);
  }
  return places;
}

/// A ring's fields as Fourier series of the impact azimuth.
class Ring {
public:
  enum class State {
    series,   ///< all fields are smooth functions of the impact azimuth
    unsmooth, ///< but each azimuth of directions has one ray: it is to be searched
    none
  };

  Ring() = default;
  /// samples: [field][azimuth].
  Ring(std::span<const double> samples, fftw_plan plan, double ka, bool next_to_rim)
      : samples_(samples.begin(), samples.end()), azimuths_(static_cast<int>(samples.size()) / ring_fields) {
    state_ = describe(plan, ka, next_to_rim);
  }
  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] int azimuths() const { return azimuths_; }
  [[nodiscard]] double psi(int azimuth) const { return 2 * pi * azimuth / azimuths_; }
  [[nodiscard]] double sample(Field field, int azimuth) const {
    return samples_[static_cast<std::size_t>(field) * azimuths_ + azimuth];
  }
  [[nodiscard]] std::span<const double> samples(Field field) const {
    return std::span(samples_).subspan(static_cast<std::size_t>(field) * azimuths_, azimuths_);
  }

  using Values = std::array<double, ring_fields>;

  /// Impact azimuths between which lies that of the ray whose direction has this azimuth.
  struct Bracket {
    double low, high, guess;
  };
  [[nodiscard]] Bracket around(double phi) const;

  /// From the series: the ray whose direction has this azimuth.
  struct Found {
    Values values{};
    int nearest = 0; ///< of the traced rays
  };
  [[nodiscard]] Found towards(double phi) const;

private:
  State describe(fftw_plan plan, double ka, bool next_to_rim);

  std::vector<double> samples_;
  int azimuths_ = 0;
  State state_ = State::none;
  std::vector<double> azimuth_; ///< of directions, the farthest so far; one turn and its end
  std::vector<double> series_;  ///< [harmonic][cosine, sine][field]
};

/// What a series may leave out of a field.
double allowed_error(int field, double ka, double largest) {
  switch (field) {
  case path:
  case theta_of:
  case momentum:
    return 5e-4 / ka;
  case turned:
  case turning:
    return 5e-3 / ka;
  case determinant:
  case spreading:
    return 1e-3 * largest;
  default:
    return 5e-4;
  }
}

Ring::State Ring::describe(fftw_plan plan, double ka, bool next_to_rim) {
  std::vector<double> unwrapped(azimuths_);
  for (int j = 0; j < azimuths_; ++j) {
    if (sample(foci, j) == -1) return State::none;
    for (int f = 0; f < ring_fields; ++f)
      if (!std::isfinite(sample(static_cast<Field>(f), j))) return State::none;
    const double here = sample(turned, j), before = j == 0 ? here : unwrapped[j - 1];
    unwrapped[j] = here - 2 * pi * std::rint((here - before) / (2 * pi));
  }
  // Once around the ring the azimuth has grown by one turn.
  if (std::abs(unwrapped.front() - unwrapped.back()) > 0.5 * pi) return State::none;
  azimuth_.resize(azimuths_ + 1);
  for (int j = 0; j < azimuths_; ++j) azimuth_[j] = psi(j) + unwrapped[j];
  azimuth_.back() = azimuth_.front() + 2 * pi;
  bool steady = true;
  double turned_back = 0;
  for (int j = 0; j < azimuths_; ++j) {
    const double change = azimuth_[j + 1] - azimuth_[j];
    steady = steady && change > slowest_azimuth * 2 * pi / azimuths_;
    turned_back = std::max(turned_back, -change);
    azimuth_[j + 1] = std::max(azimuth_[j], azimuth_[j + 1]);
  }
  if (turned_back > (next_to_rim ? most_turned_back : 0.0)) return State::none;
  if (!steady) return State::unsmooth;

  const int harmonics = azimuths_ / 2;
  series_.assign(static_cast<std::size_t>(harmonics) * 2 * ring_fields, 0.0);
  int needed = 1;
  std::vector<double> in(azimuths_);
  std::vector<std::complex<double>> out(harmonics + 1);
  for (int f = 0; f < ring_fields; ++f) {
    if (f == foci) continue;
    double largest = 0;
    for (int j = 0; j < azimuths_; ++j) {
      in[j] = f == turned ? unwrapped[j] : sample(static_cast<Field>(f), j);
      largest = std::max(largest, std::abs(in[j]));
    }
    fftw_execute_dft_r2c(plan, in.data(), reinterpret_cast<fftw_complex*>(out.data()));
    // What the series leave out is about as much as their last terms.
    const double allowed = allowed_error(f, ka, largest);
    double tail = 2 * std::abs(out[harmonics]) / azimuths_;
    for (int h = 0; h < harmonics; ++h) {
      const double factor = (h == 0 ? 1.0 : 2.0) / azimuths_, size = factor * std::abs(out[h]);
      series_[(2 * h) * ring_fields + f] = factor * out[h].real();
      series_[(2 * h + 1) * ring_fields + f] = -factor * out[h].imag();
      if (h >= 3 * azimuths_ / 8) tail = std::max(tail, size);
      if (size > 0.1 * allowed) needed = std::max(needed, h + 1);
    }
    if (tail > allowed) return State::unsmooth;
  }
  series_.resize(static_cast<std::size_t>(needed) * 2 * ring_fields);
  return State::series;
}

Ring::Bracket Ring::around(double phi) const {
  const double above = phi - 2 * pi * std::floor((phi - azimuth_.front()) / (2 * pi));
  const auto next =
      std::clamp<std::ptrdiff_t>(std::ranges::upper_bound(azimuth_, above) - azimuth_.begin(), 1, azimuths_);
  const double low = psi(static_cast<int>(next) - 1), high = psi(static_cast<int>(next));
  const double share = (above - azimuth_[next - 1]) / std::max(azimuth_[next] - azimuth_[next - 1], 1e-12);
  return {low, high, low + share * (high - low)};
}

/// Fields at the angle with this cosine and sine.
SCATTER_VECTOR_CLONES
void add_harmonics(const double* series, std::size_t harmonics, double cosine, double sine, double* values) {
  double sums[ring_fields] = {}, c = 1, s = 0;
  for (std::size_t h = 0; h < harmonics; ++h, series += 2 * ring_fields) {
    for (int f = 0; f < ring_fields; ++f) sums[f] += c * series[f] + s * series[ring_fields + f];
    const double next = c * cosine - s * sine;
    s = s * cosine + c * sine;
    c = next;
  }
  for (int f = 0; f < ring_fields; ++f) values[f] = sums[f];
}

Ring::Found Ring::towards(double phi) const {
  Bracket bracket = around(phi);
  // The series leave out a little of what the traced rays have.
  const double slack = 0.01 * (bracket.high - bracket.low);
  bracket.low -= slack;
  bracket.high += slack;
  double psi = bracket.guess;
  for (;;) {
    Found found;
    add_harmonics(
        series_.data(), series_.size() / (2 * ring_fields), std::cos(psi), std::sin(psi),
        found.values.data());
    const double missed = psi + found.values[turned] - phi;
    const double away = missed - 2 * pi * std::rint(missed / (2 * pi));
    (away > 0 ? bracket.high : bracket.low) = psi;
    if (std::abs(away) < 1e-9 || bracket.high - bracket.low < 1e-12) {
      const int nearest = static_cast<int>(std::rint(psi / (2 * pi) * azimuths_));
      found.nearest = ((nearest % azimuths_) + azimuths_) % azimuths_;
      return found;
    }
    // Newton's step, or the middle.
    const double next = psi - away / found.values[turning];
    psi = next > bracket.low && next < bracket.high ? next : 0.5 * (bracket.low + bracket.high);
  }
}

/// A plan for one length, freed with it.
struct RealTransform {
  explicit RealTransform(int size) {
    std::vector<double> in(size);
    std::vector<std::complex<double>> out(size / 2 + 1);
    const std::lock_guard lock(fftw_planner());
    plan = fftw_plan_dft_r2c_1d(
        size, in.data(), reinterpret_cast<fftw_complex*>(out.data()), FFTW_ESTIMATE | FFTW_UNALIGNED);
    if (plan == nullptr) throw std::bad_alloc();
  }
  ~RealTransform() {
    const std::lock_guard lock(fftw_planner());
    fftw_destroy_plan(plan);
  }
  RealTransform(const RealTransform&) = delete;
  RealTransform& operator=(const RealTransform&) = delete;
  fftw_plan plan;
};

/// The device's part: rings, and single rays of them.
class RingProgram {
public:
  RingProgram(RayProgram& rays, const Light& light, int order, const Places& places)
      : rays_(rays), places_(places), order_(order),
        program_(rays.build(light, sources, true, " -DUNIFORM -DBEYOND")),
        job_(rays.job_buffer(rays.make_job(light, 2, order))),
        outline_(outline_series(rays.tracing.shape, rays.tracing.sun_elevation_deg)),
        outline_data_(rays.cl().upload(outline_.both())) {}

  [[nodiscard]] const Outline& outline() const { return outline_; }

  /// Rings `which` of all places, in their order: [ring][field][azimuth].
  [[nodiscard]] std::vector<double> rings(std::span<const std::size_t> which, int azimuths) {
    const Chosen chosen = choose(which);
    std::vector<double> samples(which.size() * ring_fields * azimuths);
    const cl::Buffer out = rays_.cl().allocate<double>(samples.size());
    run("trace_rings", chosen, azimuths, order_, out);
    rays_.cl().download(out, std::span<double>(samples));
    return samples;
  }

  /// Of the same the rays with azimuths phi, whose number is a multiple of ray_lanes: [ring][field][azimuth].
  [[nodiscard]] std::vector<double>
  meridians(std::span<const std::size_t> which, std::span<const Ring> rings, std::span<const double> phi) {
    const Chosen chosen = choose(which);
    std::vector<double> low, high;
    for (const std::size_t r : which)
      for (const double azimuth : phi) {
        const Ring::Bracket bracket = rings[r].around(azimuth);
        low.push_back(bracket.low);
        high.push_back(bracket.high);
      }
    std::vector<double> values(which.size() * ring_fields * phi.size());
    compute::OpenCL& opencl = rays_.cl();
    const cl::Buffer out = opencl.allocate<double>(values.size());
    run("trace_meridians", chosen, opencl.upload(phi), opencl.upload(low), opencl.upload(high),
        static_cast<int>(phi.size()), order_, out);
    opencl.download(out, std::span<double>(values));
    return values;
  }

private:
  static constexpr std::string_view sources[] = {embedded::kernel_outline, embedded::kernel_rings};
  struct Chosen {
    cl::Buffer at;
    int count, first_beyond;
  };
  [[nodiscard]] Chosen choose(std::span<const std::size_t> which) {
    std::vector<double> at;
    for (const std::size_t ring : which) at.push_back(places_.at[ring]);
    const auto beyond = std::ranges::lower_bound(which, places_.first_beyond) - which.begin();
    return {rays_.cl().upload(at), static_cast<int>(which.size()), static_cast<int>(beyond)};
  }
  template <typename... Arguments>
  void run(const char* kernel, const Chosen& chosen, const Arguments&... arguments) {
    rays_.cl().queue.enqueueNDRangeKernel(
        with_arguments(
            cl::Kernel(program_, kernel), rays_.surface_buffer, job_, outline_data_,
            static_cast<int>(outline_.radius.size()), chosen.at, chosen.count, chosen.first_beyond,
            arguments...),
        cl::NullRange, cl::NDRange(16 * rays_.device.info().compute_units), cl::NDRange(1));
  }

  RayProgram& rays_;
  const Places& places_;
  int order_;
  cl::Program& program_;
  cl::Buffer job_;
  Outline outline_;
  cl::Buffer outline_data_;
};

/// Each ring with as many rays as it needs.
std::vector<Ring> make_rings(RingProgram& program, std::size_t workers, double ka, const Places& places) {
  std::vector<Ring> rings(places.at.size());
  std::vector<std::size_t> left(rings.size());
  std::iota(left.begin(), left.end(), std::size_t{0});
  for (int azimuths = fewest_azimuths; azimuths <= most_azimuths && !left.empty(); azimuths *= 2) {
    const std::vector<double> samples = program.rings(left, azimuths);
    const RealTransform transform(azimuths);
    const std::size_t ring_size = static_cast<std::size_t>(ring_fields) * azimuths;
    side_by_side(workers, left.size(), [&](std::size_t, std::size_t i) {
      const std::size_t r = left[i];
      rings[r] = Ring(
          std::span(samples).subspan(i * ring_size, ring_size), transform.plan, ka,
          r >= places.first_beyond || places.at[r] > places.rim_from);
    });
    std::erase_if(left, [&](std::size_t r) { return rings[r].state() != Ring::State::unsmooth; });
  }
  return rings;
}

/// Whether all rays that a stretch takes are of rings with one ray per azimuth.
bool one_ray_per_azimuth(std::span<const Ring> rings, const Stretch& s, double phi) {
  return std::ranges::none_of(rings, [&](const Ring& ring) {
    if (ring.state() != Ring::State::none) return false;
    for (int j = 0; j < ring.azimuths(); ++j) {
      const double theta = ring.sample(theta_of, j), apart = ring.psi(j) + ring.sample(turned, j) - phi;
      if (!(theta < s.from() || theta > s.to() ||
            std::abs(apart - 2 * pi * std::rint(apart / (2 * pi))) > 0.3))
        return true;
    }
    return false;
  });
}

/// References by azimuth, and whether they keep momenta from folding.
class References {
public:
  References(std::span<const Ring> rings, const Places& places, const Outline& outline, double ka);

  /// Charts of all rays that a stretch takes at this azimuth, in each of which the momentum grows with the
  /// angle of incidence. Empty: there are none.
  [[nodiscard]] std::vector<Chart> charts(double phi, const Stretch& s) const;

private:
  [[nodiscard]] Reference at_rim(double phi) const;

  static constexpr int knots = 128; ///< even in azimuth
  /// Of one ring's ray at a knot, by angle of incidence and in units of what the momentum changes by on a
  /// sphere.
  struct Change {
    double from_rim = 0, from_grazing = 0, theta = 0, of_momentum = 0, of_theta = 0;
    [[nodiscard]] bool is_next_to_rim() const { return from_grazing < off_the_rim; }
    [[nodiscard]] double with(double slope) const { return of_momentum - slope * of_theta; }
  };
  [[nodiscard]] static int knot_at(double phi) {
    const int knot = static_cast<int>(std::lrint(phi / (2 * pi) * knots)) % knots;
    return knot < 0 ? knot + knots : knot;
  }
  /// By least squares, of rays by angle of incidence.
  [[nodiscard]] static double bend_of_rays(std::span<const Change> changes);
  /// At the rim.
  struct Rim {
    double azimuth = 0, theta = 0, bend = 0;
    bool tunnels = false;
  };

  bool overlaps_;   ///< charts do by six of Fresnel's widths
  double steepest_; ///< change of momentum per angle times the angle between ray and direction, at most
  std::array<std::vector<Change>, knots> changes_; ///< ring by ring, but for those that tunnel
  std::vector<Rim> rim_;                           ///< none: its rays go elsewhere
};

References::References(std::span<const Ring> rings, const Places& places, const Outline& outline, double ka)
    : overlaps_(chart_overlap[1] - chart_overlap[0] > 6 / std::sqrt(ka)), steepest_(1.3 * places.steepest) {
  for (std::size_t r = 0; r < places.first_beyond; ++r) {
    const Ring& ring = rings[r];
    const double alpha = places.at[r], from_rim = 0.5 * pi - alpha;
    if (ring.state() == Ring::State::none || places.step[r] == 0) continue;
    for (int knot = 0; knot < knots; ++knot) {
      // Between the two rays around it.
      const int azimuths = ring.azimuths();
      const Ring::Bracket around = ring.around(2 * pi * knot / knots);
      const double share = (around.guess - around.low) / (around.high - around.low);
      Change change{from_rim};
      bool tunnels = false;
      for (const auto& [psi, part] : {std::pair{around.low, 1 - share}, {around.high, share}}) {
        const int j = static_cast<int>(std::lrint(psi / (2 * pi) * azimuths)) % azimuths;
        tunnels = tunnels || ring.sample(foci, j) < 0;
        const double radius = series_value(outline.radius, std::cos(psi));
        // Incident area per angle and azimuth; determinants are of (.., azimuth) by the impact point. Beyond
        // the axis a sphere's momentum is negative.
        const double area = radius * radius * std::sin(alpha) * std::cos(alpha);
        const double unit = part * ring.sample(turning, j) / (area * std::cos(alpha)) *
                            (ring.sample(momentum, j) < 0 ? -1 : 1);
        change.theta += part * ring.sample(theta_of, j);
        change.of_momentum += unit * ring.sample(determinant, j);
        change.of_theta += unit * ring.sample(spreading, j);
      }
      if (!tunnels) changes_[knot].push_back(change);
    }
  }
  if (places.first_beyond == 0 || places.first_beyond >= rings.size()) return;
  for (std::vector<Change>& changes : changes_) {
    if (changes.empty()) continue;
    // Beyond the last one rays tunnel out. There directions turn infinitely fast, within less than a wave
    // resolves.
    const double last = changes.back().from_rim;
    for (Change& change : changes)
      change.from_grazing = std::sqrt(std::max(change.from_rim * change.from_rim - last * last, 0.0));
    std::erase_if(changes, [&](const Change& change) { return change.from_grazing < std::cbrt(1 / ka); });
  }
  const Ring& last = rings[places.first_beyond - 1];
  if (last.state() == Ring::State::none) return;
  const int count = last.azimuths();
  for (int j = 0; j < count; ++j)
    rim_.push_back(
        {last.psi(j) + last.sample(turned, j), last.sample(theta_of, j),
         last.sample(determinant, j) / last.sample(spreading, j), last.sample(foci, j) < 0});
  // Where rays begin to tunnel out quotients have poles: medians of those that do likewise pass them by.
  const std::vector<Rim> as_traced = rim_;
  for (int j = 0; j < count; ++j) {
    std::vector<double> nearby;
    for (int i = -count / 42; i <= count / 42; ++i)
      if (const Rim& other = as_traced[(j + i + count) % count];
          other.tunnels == as_traced[j].tunnels && std::isfinite(other.bend))
        nearby.push_back(other.bend);
    if (nearby.empty()) nearby.push_back(0);
    const auto middle = nearby.begin() + static_cast<std::ptrdiff_t>(nearby.size() / 2);
    std::ranges::nth_element(nearby, middle);
    rim_[j].bend = *middle;
  }
}

double References::bend_of_rays(std::span<const Change> changes) {
  double rays = 0, p = 0, q = 0, pq = 0, qq = 0;
  for (const Change& change : changes | std::views::filter(&Change::is_next_to_rim)) {
    ++rays;
    p += change.of_momentum;
    q += change.of_theta;
    pq += change.of_momentum * change.of_theta;
    qq += change.of_theta * change.of_theta;
  }
  const double spread = rays * qq - q * q;
  return spread > 0 ? (rays * pq - p * q) / spread : 0;
}

Reference References::at_rim(double phi) const {
  const auto apart = [&](const Rim& rim) {
    const double a = phi - rim.azimuth;
    return a - 2 * pi * std::rint(a / (2 * pi));
  };
  for (std::size_t j = 0; j < rim_.size(); ++j) {
    const Rim &before = rim_[j], &after = rim_[(j + 1) % rim_.size()];
    const double a = apart(before), b = apart(after);
    if (a < 0 || b >= 0 || a - b > 1) continue;
    double share = a / (a - b);
    if (before.tunnels != after.tunnels) share = std::rint(share);
    // Behind rays that tunnel out the bend is that of the first ones that do not: momenta over directions are
    // a line there.
    if ((share < 0.5 ? before : after).tunnels)
      return {(1 - share) * before.theta + share * after.theta, bend_of_rays(changes_[knot_at(phi)]), 0};
    return {
        (1 - share) * before.theta + share * after.theta, (1 - share) * before.bend + share * after.bend, 0};
  }
  return {};
}

std::vector<Chart> References::charts(double phi, const Stretch& s) const {
  const std::vector<Change>& changes = changes_[knot_at(phi)];
  // The least that a chart's momenta grow by; 0 where they turn back, or change faster than rings resolve.
  const auto growth = [&](const Chart& chart) {
    double least = 1;
    for (const Change& change : changes) {
      if (change.theta < s.from() || change.theta > s.to() || chart.weight(change.from_rim) == 0) continue;
      const double here = change.with(chart.reference.slope(change.theta));
      const double angle = std::abs(change.theta - s.middle) + s.half;
      if (here * std::sin(change.from_rim) * angle > steepest_) return 0.0;
      least = std::min(least, std::max(here, 0.0));
    }
    return least;
  };
  const Reference bent = at_rim(phi);
  // The twist for which the momentum changes off the rim as on a sphere, by least squares.
  Reference twisted = bent;
  double above = 0, below = 0;
  for (const Change& change : changes | std::views::filter(&Change::is_next_to_rim)) {
    const double by_twist = (change.theta - bent.theta) * change.of_theta;
    above += by_twist * (change.with(bent.bend) - 1);
    below += by_twist * by_twist + cost_of_twist * cost_of_twist;
  }
  if (below > 0 && !rim_.empty()) twisted.twist = above / below;
  // The bend alone where that is enough.
  const auto better = [&](Chart::Of of) {
    const Chart one{of, bent}, other{of, twisted};
    const double with_bend = growth(one), with_twist = growth(other);
    const bool is_enough = with_bend > fast_enough || with_bend >= with_twist;
    return std::pair{is_enough ? one : other, is_enough ? with_bend : with_twist};
  };
  if (const auto [all, grows] = better(Chart::Of::all); grows > slowest_momentum) return {all};
  const Chart rest{Chart::Of::rest, {}};
  if (!overlaps_ || growth(rest) < slowest_momentum) return {};
  if (const auto [rim, grows] = better(Chart::Of::rim); grows > slowest_momentum) return {rim, rest};
  return {};
}

/// A ray of one azimuth.
struct MeridianRay {
  double theta, path, momentum;
  double determinant, spreading;               ///< as Field has them
  double traced_determinant, traced_spreading; ///< the same of a traced ray nearby, for their signs
  double step, from_rim;                       ///< share of the integral, angle
  double lines;                                ///< focal lines to infinity
  bool spreads;                                ///< its theta falls
  std::array<double, 8> jones;
};

/// The sum over rays for the directions of one stretch.
class StretchSum {
public:
  explicit StretchSum(double wave) : wave_(wave) {}

  void
  add(const Stretch& s, const Chart& chart, std::span<const MeridianRay> rays, const Layout& layout,
      double phi_deg, std::span<const float> share, std::span<double> sums);

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
    const Stretch& s, const Chart& chart, std::span<const MeridianRay> rays, const Layout& layout,
    double phi_deg, std::span<const float> share, std::span<double> sums) {
  const double ka = pi * wave_;
  auto taken = rays | std::views::filter([&](const MeridianRay& ray) {
                 return ray.theta > s.from() && ray.theta < s.to() && chart.weight(ray.from_rim) > 0;
               });
  if (taken.empty()) return; // no light of this order comes here
  const auto momentum_of = [&](const MeridianRay& ray) {
    return ray.momentum - chart.reference.momentum(ray.theta);
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
    const double slope = chart.reference.slope(ray.theta);
    // The index is the number of focal lines, less one where theta falls while the momentum grows.
    const bool falls = (ray.traced_determinant - slope * ray.traced_spreading < 0) != ray.spreads;
    const double xi = (momentum - centre) * xi_per_length;
    const double y = std::sqrt(tap_shape * tap_shape - xi * xi * (0.25 * taps * taps));
    const double weight = ray.step * std::sqrt(std::abs(ray.determinant - slope * ray.spreading)) *
                          s.taper(angle) * chart.weight(ray.from_rim) * (y / (std::exp(y) - std::exp(-y)));
    const double half_turns = wave_ * (ray.path + chart.reference.path(ray.theta) + momentum * angle) -
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
    const double half_turns =
        wave_ * (rho * centre + chart.reference.path(theta_deg * radians_per_degree)) + 0.75;
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
      Columns block, const IntegralShare& wanted)
      : layout(on), columns(block), wave(rays.make_job(light, 2, order).wave), share(wanted),
        workers(rays.device.info().compute_units),
        all(stretches(coarse, order, pi * wave, wanted, on, block)),
        places(ring_places(coarse, order, pi * wave, all)), program(rays, light, order, places) {
    if (all.empty()) return;
    rings = make_rings(program, workers, pi * wave, places);
    const References references(rings, places, program.outline(), pi * wave);
    // What is not served is left to others.
    const std::size_t rows = layout.theta_deg.size();
    std::erase_if(all, [&](Stretch& s) {
      const double azimuth = phi(s.column);
      if (one_ray_per_azimuth(rings, s, azimuth)) s.charts = references.charts(azimuth, s);
      if (!s.charts.empty()) return false;
      std::fill_n(
          share.begin() + static_cast<std::ptrdiff_t>(s.column * rows) + s.first, s.end - s.first, 0.0F);
      return true;
    });
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
        ray.ring < places.first_beyond ? 0.5 * pi - places.at[ray.ring] : 0,
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
        for (const Chart& chart : all[i].charts)
          sum_of_worker[worker].add(
              all[i], chart, meridian, layout, phi_deg(column),
              std::span<const float>(share).subspan(column * rows, rows),
              sums.subspan(column * rows * 8, rows * 8));
    });
  }
}

MeridianIntegral::MeridianIntegral(
    RayProgram& rays, const CoarseRays& coarse, const Light& light, int order, const Layout& layout,
    Columns columns, const IntegralShare& wanted)
    : implementation_(std::make_unique<Implementation>(rays, coarse, light, order, layout, columns, wanted)) {
}
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
