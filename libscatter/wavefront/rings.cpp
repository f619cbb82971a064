#include <scatter/exact/vector_clones.hpp>
#include <scatter/optics/fftw_planner.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/wavefront/rings.hpp>
#include <scatter/wavefront/side_by_side.hpp>

#include <embedded/kernel_outline.hpp>
#include <embedded/kernel_rings.hpp>

#include <algorithm>
#include <cmath>
#include <complex>
#include <new>
#include <numeric>
#include <string_view>

namespace scatter::wavefront {
namespace {

/// Rays on a ring: at first, and at most.
constexpr int fewest_azimuths = 32, most_azimuths = 128;
/// The azimuth of directions grows at least this fast with that of the impact.
constexpr double slowest_azimuth = 0.2;
/// About grazing exit azimuths turn back in narrow stretches, by so much at most [rad]: one of the three rays
/// there, all of them faint, is enough.
constexpr double most_turned_back = 0.2;
/// Angles of incidence from here on count as next to the rim in any case.
constexpr double rim_from = 0.93 * pi / 2;

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

constexpr std::string_view sources[] = {embedded::kernel_outline, embedded::kernel_rings};

} // namespace

Places
ring_places(const CoarseRays& coarse, int order, double ka, std::span<const Stretch> stretches, double more) {
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
  const int per_cell =
      std::max(2, static_cast<int>(std::ceil(more * ka * steepest * spread / (pi * phase_step))));
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
      std::max(24, static_cast<int>(std::ceil(more * ka * reach * 2 * spread / (pi * 0.5 * phase_step))));
  for (int i = 0; i < heights; ++i) {
    places.at.push_back((i + 0.5) * reach / heights);
    places.step.push_back(reach / heights);
  }
  return places;
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

RingProgram::RingProgram(RayProgram& rays, const Light& light, int order, const Places& places)
    : rays_(rays), places_(places), order_(order),
      program_(rays.build(light, sources, true, " -DUNIFORM -DBEYOND")),
      job_(rays.job_buffer(rays.make_job(light, 2, order))),
      outline_(outline_series(rays.tracing.shape, rays.tracing.sun_elevation_deg)),
      outline_data_(rays.cl().upload(outline_.both())) {}

RingProgram::Chosen RingProgram::choose(std::span<const std::size_t> which) {
  std::vector<double> at;
  for (const std::size_t ring : which) at.push_back(places_.at[ring]);
  const auto beyond = std::ranges::lower_bound(which, places_.first_beyond) - which.begin();
  return {rays_.cl().upload(at), static_cast<int>(which.size()), static_cast<int>(beyond)};
}

template <typename... Arguments>
void RingProgram::run(const char* kernel, const Chosen& chosen, const Arguments&... arguments) {
  rays_.cl().queue.enqueueNDRangeKernel(
      compute::with_arguments(
          cl::Kernel(program_, kernel), rays_.surface_buffer, job_, outline_data_,
          static_cast<int>(outline_.radius.size()), chosen.at, chosen.count, chosen.first_beyond,
          arguments...),
      cl::NullRange, cl::NDRange(16 * rays_.device.info().compute_units), cl::NDRange(1));
}

std::vector<double> RingProgram::rings(std::span<const std::size_t> which, int azimuths) {
  const Chosen chosen = choose(which);
  std::vector<double> samples(which.size() * ring_fields * azimuths);
  const cl::Buffer out = rays_.cl().allocate<double>(samples.size());
  run("trace_rings", chosen, azimuths, order_, out);
  rays_.cl().download(out, std::span<double>(samples));
  return samples;
}

std::vector<double> RingProgram::meridians(
    std::span<const std::size_t> which, std::span<const Ring> rings, std::span<const double> phi) {
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

} // namespace scatter::wavefront
