// Hair for many directions at once: what costs is done by ray_lobes(); here are the angles' functions before
// it and the kernels after it, on vectors.

#include <scatter/fiber/hair.hpp>
#include <scatter/fiber/lane_math.hpp>
#include <scatter/fiber/ray_section_kernel.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

namespace scatter::fiber {
namespace {

using lane::absolute;
using lane::inverse;
using lane::power_of_two;

constexpr std::size_t block = 256; ///< directions at a time: all lists stay in the first cache

/// sin(x), 0 <= x <= pi/2, relative 3e-16: Taylor's series to x^21 / 21!, whose rest is 3e-18.
template <class T>
SCATTER_LANE T sine_of_first_quadrant(const T& x) {
  static constexpr double c[] = {
      -1.0 / 6,
      1.0 / 120,
      -1.0 / 5040,
      1.0 / 362880,
      -1.0 / 39916800,
      1.0 / 6227020800,
      -1.0 / 1307674368000,
      1.0 / 355687428096000,
      -1.0 / 121645100408832000,
      1.0 / 51090942171709440000.0};
  const T square = x * x;
  return multiply_add(x * square, lane::polynomial(c, square), x);
}

struct alignas(64) Halves {
  std::array<double, block> theta_h, cos_theta_d, sin_half_phi, cos_half_phi;
};

/// Directions first..first + T::width - 1; `to` counts from them.
template <class T>
SCATTER_LANE void
halve(const double* theta_i, const double* theta_o, const double* phi, std::size_t first, Halves& to) {
  const T quarter = T::all(0.5 * pi), rest = T::all(6.123233995736766e-17); // pi/2 = quarter + rest
  const T rounding = T::all(0x1.8p52), half = T::all(0.5);
  const T i = smaller(larger(T::load(theta_i + first), -quarter), quarter);
  const T o = smaller(larger(T::load(theta_o + first), -quarter), quarter);
  (half * (i + o)).store(&to.theta_h[first]);
  const T d = smaller(absolute(half * (o - i)), T::all(largest_theta_d));
  sine_of_first_quadrant((quarter - d) + rest).store(&to.cos_theta_d[first]);
  const T around = T::load(phi + first), turns = multiply_add(around, T::all(0.5 / pi), rounding) - rounding;
  // The rest of 2 pi, so that angles beyond the first turn keep their digits.
  const T wrapped = subtract_product(
      subtract_product(around, turns, T::all(2 * pi)), turns, T::all(2.4492935982947064e-16));
  const T half_phi = smaller(half * absolute(wrapped), quarter);
  sine_of_first_quadrant(half_phi).store(&to.sin_half_phi[first]);
  sine_of_first_quadrant((quarter - half_phi) + rest).store(&to.cos_half_phi[first]);
}

/// A kernel's Gaussian: height exp(-(theta_h - shift)^2 / (2 width^2)).
struct Bell {
  double shift, scale, height; ///< scale: -log2(e) / (2 width^2)
};

/// What all directions share.
struct Job {
  double eta;
  std::array<double, 3> sigma_a;
  std::array<Bell, 3> bells;
  /// Of the residual lobe per colour over 2 pi, x = 2 sqrt(cos theta_d) - 1: the sum over k of
  /// T_k(2 x^2 - 1) times even[k] + x odd[k].
  struct Term {
    std::array<double, 3> even, odd;
  };
  std::vector<Term> series;
};

/// Sums of M_X N_X over cos^2 theta_d. N: [order][colour][direction], `stride` directions apart.
template <class T>
SCATTER_LANE void weigh(
    const Job& job, const Halves& at, std::size_t first, const double* N, std::size_t stride, double* value) {
  const T theta_h = T::load(&at.theta_h[first]), cosine = T::load(&at.cos_theta_d[first]);
  T M[3];
  for (std::size_t lobe = 0; lobe < 3; ++lobe) {
    const Bell& bell = job.bells[lobe];
    const T x = theta_h - T::all(bell.shift);
    M[lobe] = T::all(bell.height) * power_of_two(T::all(bell.scale) * (x * x));
  }
  T E[3] = {T::all(0), T::all(0), T::all(0)};
  if (!job.series.empty()) {
    // Even and odd terms of all colours share Chebyshev's polynomials.
    const T x = multiply_subtract(T::all(2), lane::root(cosine), T::all(1));
    const T y = multiply_subtract(x + x, x, T::all(1)), twice = y + y;
    T before = y, last = T::all(1); // T_-1, T_0
    T odd[3] = {T::all(0), T::all(0), T::all(0)};
    for (const Job::Term& term : job.series) {
      for (std::size_t c = 0; c < 3; ++c) {
        E[c] = multiply_add(T::all(term.even[c]), last, E[c]);
        odd[c] = multiply_add(T::all(term.odd[c]), last, odd[c]);
      }
      const T next = multiply_subtract(twice, last, before);
      before = last;
      last = next;
    }
    for (std::size_t c = 0; c < 3; ++c) E[c] = multiply_add(x, odd[c], E[c]);
  }
  const T scale = inverse(cosine * cosine);
  for (std::size_t c = 0; c < 3; ++c) {
    const auto order = [&](std::size_t p) { return T::load(N + (3 * p + c) * stride + first); };
    const T sum = multiply_add(M[0], order(0), multiply_add(M[1], order(1), M[2] * (order(2) + E[c])));
    (sum * scale).store(value + c * stride + first);
  }
}

/// Inclinations, azimuths and values of all directions.
struct Lists {
  std::span<const double> theta_i, theta_o, phi;
  std::span<double> value;
};

template <class T>
SCATTER_LANE void evaluate(const Job& job, const Lists& lists, const exact::VectorUnit& unit) {
  const std::size_t count = lists.phi.size();
  Halves at;
  alignas(64) double angles[3][block] = {}, N[9 * block], value[3 * block];
  for (std::size_t from = 0; from < count; from += block) {
    // Whole vectors, filled up where data end: a result then comes from the same instructions whatever
    // stands beside it.
    const std::size_t n = std::min(block, count - from), whole = (n + T::width - 1) / T::width * T::width;
    std::copy_n(&lists.theta_i[from], n, angles[0]);
    std::copy_n(&lists.theta_o[from], n, angles[1]);
    std::copy_n(&lists.phi[from], n, angles[2]);
    for (std::size_t i = 0; i < whole; i += T::width) halve<T>(angles[0], angles[1], angles[2], i, at);
    ray_lobes(
        job.eta, job.sigma_a,
        {{at.cos_theta_d.data(), whole}, {at.sin_half_phi.data(), whole}, {at.cos_half_phi.data(), whole}},
        {N, 9 * whole}, unit);
    for (std::size_t i = 0; i < whole; i += T::width) weigh<T>(job, at, i, N, whole, value);
    for (std::size_t c = 0; c < 3; ++c) std::copy_n(value + c * whole, n, &lists.value[c * count + from]);
  }
}

using lane::Lanes;
using lane::Two;
#if SCATTER_FIBER_X86_LANES
SCATTER_FIBER_AVX512 void
evaluate_on_avx512(const Job& job, const Lists& lists, const exact::VectorUnit& unit) {
  evaluate<Two<Lanes<8>>>(job, lists, unit);
}
SCATTER_FIBER_AVX2 void evaluate_on_avx2(const Job& job, const Lists& lists, const exact::VectorUnit& unit) {
  evaluate<Two<Lanes<4>>>(job, lists, unit);
}
#endif
void evaluate_plainly(const Job& job, const Lists& lists, const exact::VectorUnit& unit) {
  evaluate<Two<Lanes<2>>>(job, lists, unit);
}

} // namespace

void check_directions(
    std::span<const double> theta_i, std::span<const double> theta_o, std::span<const double> phi,
    std::size_t values) {
  const std::size_t count = theta_i.size();
  if (theta_o.size() != count || phi.size() != count || values != 3 * count)
    throw InputError("lists of directions and of values do not match: there are three values, for the "
                     "colours, per direction");
  // Without branches, for vectors: the difference of a finite number with itself is 0.
  std::uint64_t wrong = 0;
  for (std::size_t k = 0; k < count; ++k)
    wrong |= std::uint64_t{std::isunordered(theta_i[k], theta_o[k])} | std::uint64_t{phi[k] - phi[k] != 0};
  if (wrong == 0) return;
  for (std::size_t k = 0; k < count; ++k)
    if (std::isnan(theta_i[k]) || std::isnan(theta_o[k]) || !std::isfinite(phi[k]))
      throw InputError("an angle of a fibre's scattering is not a number: direction " + std::to_string(k));
}

void HairScattering::eval(
    std::span<const double> theta_i, std::span<const double> theta_o, std::span<const double> phi,
    std::span<double> value, const exact::VectorUnit& unit) const {
  const std::size_t count = theta_i.size();
  check_directions(theta_i, theta_o, phi, value.size());
  if (residual_energy_.empty()) {
    for (std::size_t k = 0; k < count; ++k) {
      const Rgb one = eval(Angles{theta_i[k], theta_o[k], phi[k]});
      for (std::size_t c = 0; c < 3; ++c) value[c * count + k] = one[c];
    }
    return;
  }
  Job job{parameters_.eta, parameters_.sigma_a, {}, {}};
  for (std::size_t lobe = 0; lobe < 3; ++lobe) {
    const LongitudinalKernel& kernel = kernels_[lobe];
    job.bells[lobe] = {
        kernel.shift(), -0.5 * std::numbers::log2e / (kernel.width() * kernel.width()),
        kernel(kernel.shift())};
  }
  if (parameters_.residual)
    for (std::size_t c = 0; c < 3; ++c) {
      const std::vector<double>& coefficients = residual_energy_[c].coefficients();
      const auto scaled = [&](std::size_t k) {
        return k < coefficients.size() ? coefficients[k] / (2 * pi) : 0;
      };
      const std::size_t terms = coefficients.size() / 2 + 1;
      if (job.series.size() < terms) job.series.resize(terms);
      // T_2k(x) = T_k(2 x^2 - 1), and T_2k+1(x) = 2 x T_k(2 x^2 - 1) - T_2k-1(x).
      for (std::size_t k = terms; k-- > 0;) {
        job.series[k].even[c] = scaled(2 * k);
        job.series[k].odd[c] = 2 * scaled(2 * k + 1) - (k + 1 < terms ? job.series[k + 1].odd[c] : 0);
      }
      job.series[0].odd[c] *= 0.5;
    }
  const Lists lists{theta_i, theta_o, phi, value};
#if SCATTER_FIBER_X86_LANES
  if (unit.width == 8) return evaluate_on_avx512(job, lists, unit);
  if (unit.width == 4) return evaluate_on_avx2(job, lists, unit);
#endif
  evaluate_plainly(job, lists, unit);
}

} // namespace scatter::fiber
