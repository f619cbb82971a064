#pragma once

#include <scatter/wavefront/outline.hpp>
#include <scatter/wavefront/stretch.hpp>

#include <fftw3.h>

#include <array>
#include <span>
#include <vector>

/// Internal to scatter::wavefront: rays on rings around the light.
namespace scatter::wavefront {

constexpr int ray_lanes = 16; ///< RAY_LANES of the kernels

/// RING_FIELDS in kernels/rings.cl and their places.
constexpr int ring_fields = 16;
enum Field { turned, theta_of, path, momentum, determinant, jones, foci = 13, turning = 14, spreading = 15 };

/// Where rings are.
struct Places {
  std::vector<double> at;       ///< angles, then one at the rim (without weight), then heights beyond it
  std::vector<double> step;     ///< each one's share of the integral; 0 for the one at the rim
  std::size_t first_beyond = 0; ///< heights from here on
  double rim_from = 0;          ///< angles from which some rays come in or leave at grazing incidence
  /// Change of momentum per angle times the angle between ray and direction that steps are made for.
  double steepest = 0;
};

/// So close that stretches find the rays that they take, times `more`.
[[nodiscard]] Places
ring_places(const CoarseRays& coarse, int order, double ka, std::span<const Stretch> stretches, double more);

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

/// The device's part: rings, and single rays of them. Keeps references to rays and places.
class RingProgram {
public:
  RingProgram(RayProgram& rays, const Light& light, int order, const Places& places);

  [[nodiscard]] const Outline& outline() const { return outline_; }

  /// Rings `which` of all places, in their order: [ring][field][azimuth].
  [[nodiscard]] std::vector<double> rings(std::span<const std::size_t> which, int azimuths);

  /// Of the same the rays with azimuths phi, whose number is a multiple of ray_lanes: [ring][field][azimuth].
  [[nodiscard]] std::vector<double>
  meridians(std::span<const std::size_t> which, std::span<const Ring> rings, std::span<const double> phi);

private:
  struct Chosen {
    cl::Buffer at;
    int count, first_beyond;
  };
  [[nodiscard]] Chosen choose(std::span<const std::size_t> which);
  template <typename... Arguments>
  void run(const char* kernel, const Chosen& chosen, const Arguments&... arguments);

  RayProgram& rays_;
  const Places& places_;
  int order_;
  cl::Program& program_;
  cl::Buffer job_;
  Outline outline_;
  cl::Buffer outline_data_;
};

/// Each ring with as many rays as it needs.
[[nodiscard]] std::vector<Ring>
make_rings(RingProgram& program, std::size_t workers, double ka, const Places& places);

} // namespace scatter::wavefront
