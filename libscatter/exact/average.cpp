#include <scatter/exact/average.hpp>
#include <scatter/exact/mie_accuracy.hpp>
#include <scatter/exact/sun_disc.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <limits>
#include <map>
#include <mutex>
#include <numeric>
#include <sstream>
#include <system_error>
#include <thread>

namespace scatter::exact {
namespace {

/// Second component of the lattices of 2^m points. Found by search: the shortest vector of the dual lattice
/// is at least 0.7 sqrt(N) for every N = 2^4 .. 2^20.
constexpr std::uint64_t generator = 461943;
/// Shifts of the third set, in steps of the first coordinate and in turns of the second.
constexpr double third_shift = 0.3090169943749474, third_turn = 0.7548776662466927;
constexpr double golden = 0.6180339887498949;
/// The disc's mean from every second point of its grid has at least so many times the error.
constexpr double disc_check_ratio = 32;

[[noreturn]] void refuse(const std::ostringstream& message) {
  throw InputError(message.str());
}

struct Sphere {
  double radius_m = 0, wavelength_m = 0;
  double weight = 0; ///< share of this sphere in the sum of its set
};

/// Where the spheres are: maps points of the unit interval or square to spheres.
class Domain {
public:
  Domain(const Radii& radii, const Band& band) : radii_(radii), band_(band) {
    const bool line = band.first_m == band.last_m;
    dimensions_ = (radii.radius_m.empty() ? 1 : 0) + (line ? 0 : 1);
    if (!radii.radius_m.empty()) total_ = std::accumulate(radii.number.begin(), radii.number.end(), 0.0);
    if (!line) {
      // The band's own weight, once and for all with the same substitution.
      constexpr int steps = 20000;
      double sum = 0;
      for (int i = 0; i < steps; ++i) sum += wavelength((i + 0.5) / steps).second / steps;
      band_total_ = sum;
    }
  }
  /// 0: a list at one wavelength, nothing to refine.
  [[nodiscard]] int dimensions() const { return dimensions_; }
  /// How many spheres a point stands for.
  [[nodiscard]] std::size_t copies() const { return std::max<std::size_t>(1, radii_.radius_m.size()); }

  /// Point number j of n of the set with this shift; copy: which radius of a list.
  [[nodiscard]] Sphere at(std::size_t j, std::size_t n, double shift, double turn, std::size_t copy) const {
    const double count = static_cast<double>(n);
    const double first = (static_cast<double>(j) + shift) / count;
    Sphere sphere;
    sphere.weight = 1 / count;
    double second = first;
    if (!radii_.radius_m.empty()) {
      sphere.radius_m = radii_.radius_m[copy];
      sphere.weight *= radii_.number[copy] / total_;
      // Radii of a list take different wavelengths each: together they see more of them.
      second = (static_cast<double>(j) + fraction(shift + golden * static_cast<double>(copy))) / count;
    } else {
      const auto [radius, density] = radius_at(first);
      sphere.radius_m = radius;
      sphere.weight *= density;
      if (dimensions_ == 2) {
        // z (j + shift) / n, modulo 1 without rounding of the large product.
        const double whole = static_cast<double>((j * generator) % n) / count;
        second = fraction(whole + shift * static_cast<double>(generator % n) / count + turn);
      }
    }
    if (band_.first_m == band_.last_m) {
      sphere.wavelength_m = band_.first_m;
    } else {
      const auto [wavelength_m, weight] = wavelength(second);
      sphere.wavelength_m = wavelength_m;
      sphere.weight *= weight / band_total_;
    }
    return sphere;
  }

private:
  static double fraction(double value) { return value - std::floor(value); }
  /// Sidi's sin^2 substitution: place and slope.
  static std::pair<double, double> smooth(double t) {
    return {t - std::sin(2 * pi * t) / (2 * pi), 2 * std::sin(pi * t) * std::sin(pi * t)};
  }
  [[nodiscard]] std::pair<double, double> wavelength(double t) const {
    const auto [place, slope] = smooth(t);
    const double wide = band_.last_m - band_.first_m;
    const double value = std::clamp(band_.first_m + wide * place, band_.first_m, band_.last_m);
    return {value, slope * wide * (band_.weight ? band_.weight(value) : 1.0)};
  }
  [[nodiscard]] std::pair<double, double> radius_at(double t) const {
    const double wide = std::log(radii_.largest_m / radii_.smallest_m);
    const auto [place, slope] = radii_.fades ? std::pair(t, 1.0) : smooth(t);
    const double radius =
        std::clamp(radii_.smallest_m * std::exp(wide * place), radii_.smallest_m, radii_.largest_m);
    return {radius, slope * wide * radius * radii_.density(radius)};
  }

  const Radii& radii_;
  const Band& band_;
  int dimensions_ = 0;
  double total_ = 1, band_total_ = 1;
};

/// What is summed: bulk numbers, then S11 S12 S33 S34 and the disc's own disagreement per angle.
enum Bulk : std::size_t { extinction, scattering, absorption, asymmetry, r2, r3, r4, bulk_size };
constexpr std::size_t per_angle = 5;
using Sums = std::vector<double>;

void add(Sums& to, const Sums& from) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] += from[i];
}

class Summer {
public:
  Summer(const AverageRequest& request, const Domain& domain, std::vector<double> theta_deg)
      : request_(request), domain_(domain), theta_deg_(std::move(theta_deg)) {}

  [[nodiscard]] std::size_t spheres() const { return spheres_; }
  [[nodiscard]] double sphere_error() const { return sphere_error_; }

  /// The sum over one set of n points. Spheres are dealt to a fixed number of lanes in turn and lanes are
  /// added in order: threads, which take whole lanes, do not show.
  Sums sum(std::size_t n, double shift, double turn) {
    const std::size_t size = bulk_size + per_angle * theta_deg_.size();
    const std::size_t total = n * domain_.copies();
    const std::size_t lane_count =
        std::min(total, std::clamp<std::size_t>((std::size_t{1} << 24) / size, 8, 64));
    std::vector<Sums> lanes(lane_count);
    std::vector<double> errors(lane_count);
    std::vector<std::size_t> computed(lane_count);
    const std::size_t cores = request_.threads > 0
                                  ? static_cast<std::size_t>(request_.threads)
                                  : std::max<std::size_t>(1, std::thread::hardware_concurrency());
    // Few spheres: threads work within them instead.
    const std::size_t across = lane_count < cores ? 1 : cores;
    const int within = across == 1 ? static_cast<int>(cores) : 1;
    std::atomic<std::size_t> next{0};
    std::exception_ptr failure;
    std::mutex mutex;
    const auto work = [&] {
      try {
        for (std::size_t lane = next++; lane < lane_count; lane = next++) {
          lanes[lane].assign(size, 0);
          for (std::size_t i = lane; i < total; i += lane_count) {
            const Sphere sphere = domain_.at(i / domain_.copies(), n, shift, turn, i % domain_.copies());
            if (!(sphere.weight > 0)) continue;
            errors[lane] = std::max(errors[lane], add_sphere(sphere, within, lanes[lane]));
            ++computed[lane];
          }
        }
      } catch (...) {
        next = lane_count;
        const std::scoped_lock lock(mutex);
        if (!failure) failure = std::current_exception();
      }
    };
    std::vector<std::thread> others;
    try {
      for (std::size_t i = 1; i < std::min(across, lane_count); ++i) others.emplace_back(work);
    } catch (const std::system_error&) {
      // No more threads to be had: those that run, and this one, do the work.
    }
    work();
    for (auto& thread : others) thread.join();
    if (failure) std::rethrow_exception(failure);
    Sums result(size);
    for (std::size_t lane = 0; lane < lane_count; ++lane) {
      add(result, lanes[lane]);
      sphere_error_ = std::max(sphere_error_, errors[lane]);
      spheres_ += computed[lane];
    }
    return result;
  }

private:
  /// Returns the sphere's own error estimate.
  double add_sphere(const Sphere& sphere, int threads, Sums& sums) {
    const double k = 2 * pi / sphere.wavelength_m, x = k * sphere.radius_m;
    const SunDisc* const disc = request_.sun_disc_deg > 0 ? &disc_for(x) : nullptr;
    const std::vector<double>& angles = disc ? disc->grid_deg() : theta_deg_;
    const MieResult mie =
        mie_at_degrees_to(1e-3 * request_.tolerance, x, request_.index(sphere.wavelength_m), angles, threads);
    const double r = sphere.radius_m, area = sphere.weight * pi * r * r;
    sums[extinction] += area * mie.Qext;
    sums[scattering] += area * mie.Qsca;
    sums[absorption] += area * mie.Qabs;
    sums[asymmetry] += area * mie.Qsca * mie.g;
    sums[r2] += sphere.weight * r * r;
    sums[r3] += sphere.weight * r * r * r;
    sums[r4] += sphere.weight * r * r * r * r;

    const double scale = sphere.weight / (k * k);
    const std::size_t count = angles.size();
    std::vector<double> elements[4];
    for (auto& element : elements) element.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
      const MuellerElements one = mueller_elements(mie.S1[i], mie.S2[i]);
      elements[0][i] = scale * one.S11;
      elements[1][i] = scale * one.S12;
      elements[2][i] = scale * one.S33;
      elements[3][i] = scale * one.S34;
    }
    double* const out = sums.data() + bulk_size;
    for (std::size_t i = 0; i < theta_deg_.size(); ++i) {
      for (std::size_t e = 0; e < 4; ++e)
        out[per_angle * i + e] += disc ? disc->mean(i, elements[e]) : elements[e][i];
      if (disc) out[per_angle * i + 4] += disc->mean(i, elements[0]) - disc->coarse_mean(i, elements[0]);
    }
    return mie.error_estimate;
  }

  const SunDisc& disc_for(double x) {
    const int level = SunDisc::level_for(x);
    const std::scoped_lock lock(mutex_);
    const auto found = discs_.find(level);
    if (found != discs_.end()) return found->second;
    return discs_.try_emplace(level, theta_deg_, request_.sun_disc_deg, level, true).first->second;
  }

  const AverageRequest& request_;
  const Domain& domain_;
  std::vector<double> theta_deg_;
  std::map<int, SunDisc> discs_;
  std::mutex mutex_;
  double sphere_error_ = 0;
  std::size_t spheres_ = 0;
};

void check(const AverageRequest& request) {
  std::ostringstream message;
  const Radii& radii = request.radii;
  double smallest = radii.smallest_m, largest = radii.largest_m;
  if (!radii.radius_m.empty()) {
    if (radii.number.size() != radii.radius_m.size())
      throw InputError("the list of radii needs one number of spheres for each");
    double sum = 0;
    for (std::size_t i = 0; i < radii.radius_m.size(); ++i) {
      if (!(radii.radius_m[i] > 0) || !std::isfinite(radii.radius_m[i]) || !(radii.number[i] >= 0) ||
          !std::isfinite(radii.number[i])) {
        message << "entry " << i + 1 << " of the list of radii, " << radii.radius_m[i] << " m with number "
                << radii.number[i] << ", is not possible: give a positive radius and a number from 0";
        refuse(message);
      }
      sum += radii.number[i];
    }
    if (!(sum > 0) || !std::isfinite(sum))
      throw InputError("the numbers of spheres of the list add up to nothing");
    const auto [low, high] = std::minmax_element(radii.radius_m.begin(), radii.radius_m.end());
    smallest = *low;
    largest = *high;
  } else if (!radii.density || !(smallest > 0 && largest > smallest && std::isfinite(largest))) {
    throw InputError("a density of radii needs a smallest and a larger largest radius, both positive");
  }
  const Band& band = request.band;
  if (!(band.first_m > 0 && band.last_m >= band.first_m && std::isfinite(band.last_m)))
    throw InputError("a band of wavelengths needs a first and a last wavelength, positive and in this order");
  if (!request.index) throw InputError("the refractive index is missing");
  if (request.theta_deg.empty()) throw InputError("there are no scattering angles");
  for (const double theta : request.theta_deg)
    if (!(theta >= 0 && theta <= 180)) {
      message << "scattering angle " << theta << " deg is outside 0..180 deg";
      refuse(message);
    }
  if (!(request.tolerance >= 1e-10 && request.tolerance <= 1)) {
    message << "the tolerance " << request.tolerance << " is outside 1e-10..1";
    refuse(message);
  }
  // The ends' size parameters, refused here in words of radii.
  for (const auto& [radius, wavelength] :
       {std::pair(smallest, band.last_m), std::pair(largest, band.first_m)}) {
    const double x = 2 * pi * radius / wavelength;
    if (!(x >= 1e-6 && x <= 5e5)) {
      message << "radius " << radius * 1e6 << " um at wavelength " << wavelength * 1e9
              << " nm has the size parameter " << x << ", outside 1e-6..5e5";
      refuse(message);
    }
  }
}

/// The asked angles, and others between and beside them where they are few, increasing.
struct Angles {
  std::vector<double> theta_deg;
  std::vector<std::size_t> place; ///< of each asked angle
};

Angles with_guards(const AverageRequest& request, bool refined) {
  Angles angles{request.theta_deg, {}};
  if (refined && request.theta_deg.size() < 32) {
    const Radii& radii = request.radii;
    const double radius = radii.radius_m.empty()
                              ? std::sqrt(radii.smallest_m * radii.largest_m)
                              : *std::max_element(radii.radius_m.begin(), radii.radius_m.end());
    const double x = 2 * pi * radius / request.band.first_m;
    // About one ripple apart; within a disc, whose grid is there already, neighbours are alike anyway.
    const bool disc = request.sun_disc_deg > 0;
    const int reach = disc ? 2 : 4;
    const double step = std::clamp(disc ? request.sun_disc_deg / 4 : 40 / x, 1e-3, 2.0);
    for (const double theta : request.theta_deg)
      for (int side = -reach; side <= reach; ++side) {
        const double near = std::abs(theta + side * step);
        angles.theta_deg.push_back(near > 180 ? 360 - near : near);
      }
  }
  std::sort(angles.theta_deg.begin(), angles.theta_deg.end());
  angles.theta_deg.erase(
      std::unique(angles.theta_deg.begin(), angles.theta_deg.end()), angles.theta_deg.end());
  for (const double theta : request.theta_deg)
    angles.place.push_back(static_cast<std::size_t>(
        std::lower_bound(angles.theta_deg.begin(), angles.theta_deg.end(), theta) -
        angles.theta_deg.begin()));
  return angles;
}

/// How two sets disagree.
struct Disagreement {
  double bulk = 0;
  std::vector<double> angle; ///< share of S11
};

double relative(double difference, double value) {
  return difference == 0 ? 0 : std::abs(difference) / std::abs(value);
}

Disagreement compare(const Sums& better, const Sums& other) {
  Disagreement result;
  for (const Bulk which : {extinction, scattering, absorption})
    result.bulk = std::max(result.bulk, relative(better[which] - other[which], better[which]));
  const double g = better[asymmetry] / better[scattering];
  result.bulk = std::max(result.bulk, std::abs(other[asymmetry] / other[scattering] - g));
  // One number has no neighbours to guard it against agreement by chance.
  result.bulk *= 2;
  for (std::size_t i = bulk_size; i < better.size(); i += per_angle) {
    double worst = 0;
    for (std::size_t e = 0; e < 4; ++e)
      worst =
          std::max(worst, std::abs(better[i + e] / better[scattering] - other[i + e] / other[scattering]));
    const double reference = better[i] / better[scattering];
    result.angle.push_back(worst == 0 ? 0 : worst / reference);
  }
  // No angle may agree by chance: its neighbours have a say.
  constexpr std::size_t reach = 8;
  const std::vector<double> own = result.angle;
  for (std::size_t i = 0; i < own.size(); ++i) {
    const std::size_t first = i < reach ? 0 : i - reach, last = std::min(i + reach + 1, own.size());
    double squares = 0;
    for (std::size_t k = first; k < last; ++k) squares += own[k] * own[k];
    result.angle[i] = std::max(own[i], std::sqrt(squares / static_cast<double>(last - first)));
  }
  return result;
}

} // namespace

Average average(const AverageRequest& request) {
  check(request);
  const Domain domain(request.radii, request.band);
  const bool refined = domain.dimensions() > 0;
  const Angles angles = with_guards(request, refined);
  Summer summer(request, domain, angles.theta_deg);

  const std::size_t copies = domain.copies();
  std::size_t n = refined ? (domain.dimensions() == 2 ? 64 : copies > 8 ? 8 : 32) : 1;
  Sums value = summer.sum(n, 0, 0);
  Disagreement error;
  error.angle.assign(angles.theta_deg.size(), 0);
  /// Of the asked angles only, with what does not come from the sets' disagreement.
  std::vector<double> asked(request.theta_deg.size());
  double bulk = 0, largest = std::numeric_limits<double>::infinity();
  const auto estimate = [&] {
    const double rounding = 2 * summer.sphere_error() + 1e-15 * std::sqrt(static_cast<double>(n));
    bulk = error.bulk + rounding;
    largest = bulk;
    for (std::size_t a = 0; a < asked.size(); ++a) {
      const std::size_t i = angles.place[a];
      const double* const sums = value.data() + bulk_size + per_angle * i;
      asked[a] = error.angle[i] + rounding + relative(sums[4], sums[0]) / disc_check_ratio;
      largest = std::max(largest, asked[a]);
    }
  };
  if (!refined) {
    estimate();
  } else {
    for (;;) {
      // `value` is the mean of n points; the points between are the other half of 2 n.
      const Sums between = summer.sum(n, 0.5, 0);
      const Sums before = value;
      add(value, between);
      for (double& sum : value) sum /= 2;
      error = compare(value, before);
      estimate();
      n *= 2;
      const bool last = summer.spheres() + 3 * n * copies / 2 > request.most_spheres;
      if (largest <= request.tolerance || last) {
        const Disagreement third = compare(value, summer.sum(n / 2, third_shift, third_turn));
        error.bulk = std::max(error.bulk, third.bulk);
        for (std::size_t i = 0; i < error.angle.size(); ++i)
          error.angle[i] = std::max(error.angle[i], third.angle[i]);
        estimate();
      }
      if (request.progress) request.progress(summer.spheres(), largest);
      if (largest <= request.tolerance || last) break;
    }
  }

  Average result;
  result.C_ext = value[extinction];
  result.C_sca = value[scattering];
  result.C_abs = value[absorption];
  result.geometric_m2 = pi * value[r2];
  result.Q_ext = result.C_ext / result.geometric_m2;
  result.Q_sca = result.C_sca / result.geometric_m2;
  result.Q_abs = result.C_abs / result.geometric_m2;
  result.g = value[asymmetry] / value[scattering];
  result.effective_radius_m = value[r3] / value[r2];
  // A single radius has no variance; the difference of moments leaves rounding.
  const double variance = value[r4] * value[r2] / (value[r3] * value[r3]) - 1;
  result.effective_variance = std::abs(variance) < 1e-13 ? 0 : std::max(variance, 0.0);
  result.bulk_error = bulk;
  for (const std::size_t i : angles.place) {
    const double* const sums = value.data() + bulk_size + per_angle * i;
    result.S11.push_back(sums[0] / result.C_sca);
    result.S12.push_back(sums[1] / result.C_sca);
    result.S33.push_back(sums[2] / result.C_sca);
    result.S34.push_back(sums[3] / result.C_sca);
  }
  result.error_estimate = asked;
  result.largest_error = largest;
  result.spheres = summer.spheres();
  result.converged = largest <= request.tolerance;
  return result;
}

} // namespace scatter::exact
