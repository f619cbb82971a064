// Hair for many directions at once: what costs is done by ray_lobes(); here are the angles' functions before
// it and the kernels after it, on vectors.

#include <scatter/exact/vector_clones.hpp>
#include <scatter/fiber/hair.hpp>
#include <scatter/fiber/lane_math.hpp>
#include <scatter/fiber/ray_section_kernel.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace scatter::fiber {
namespace {

constexpr std::size_t block = 256; ///< directions at a time: all lists stay in the first cache

/// sin(x), 0 <= x <= pi/2, relative 3e-16: Taylor's series to x^21 / 21!, whose rest is 3e-18.
SCATTER_LANE double sine_of_first_quadrant(double x) {
  const double y = x * x, y2 = y * y, y4 = y2 * y2;
  const double a = (-1.0 / 6 + y * (1.0 / 120)) + y2 * (-1.0 / 5040 + y * (1.0 / 362880));
  const double b =
      (-1.0 / 39916800 + y * (1.0 / 6227020800)) + y2 * (-1.0 / 1307674368000 + y * (1.0 / 355687428096000));
  const double c = -1.0 / 121645100408832000 + y * (1.0 / 51090942171709440000.0);
  return x + x * y * (a + y4 * (b + y4 * c));
}

struct Halves {
  std::array<double, block> theta_h, cos_theta_d, sin_half_phi, cos_half_phi;
};

SCATTER_INTEGER_VECTOR_CLONES
void halve(std::size_t count, const double* theta_i, const double* theta_o, const double* phi, Halves& to) {
  constexpr double quarter = 0.5 * pi, rest = 6.123233995736766e-17; // pi/2 = quarter + rest
  constexpr double rounding = 0x1.8p52;
  for (std::size_t k = 0; k < count; ++k) {
    const double i = lane::smaller(lane::larger(theta_i[k], -quarter), quarter);
    const double o = lane::smaller(lane::larger(theta_o[k], -quarter), quarter);
    to.theta_h[k] = 0.5 * (i + o);
    const double difference = 0.5 * (o - i);
    const double d = lane::smaller(difference < 0 ? -difference : difference, largest_theta_d);
    to.cos_theta_d[k] = sine_of_first_quadrant((quarter - d) + rest);
    const double turns = (phi[k] * (0.5 / pi) + rounding) - rounding;
    // The rest of 2 pi, so that angles beyond the first turn keep their digits.
    const double wrapped = (phi[k] - turns * (2 * pi)) - turns * 2.4492935982947064e-16;
    const double half = lane::smaller(0.5 * (wrapped < 0 ? -wrapped : wrapped), quarter);
    to.sin_half_phi[k] = sine_of_first_quadrant(half);
    to.cos_half_phi[k] = sine_of_first_quadrant((quarter - half) + rest);
  }
}

/// A kernel's Gaussian: height exp(-(theta_h - shift)^2 / (2 width^2)).
struct Bell {
  double shift, scale, height; ///< scale: log2(e) / (2 width^2)
};

/// Sum of M_X N_X over cos^2 theta_d, of one colour. N: R, TT and TRT; E: energy of the residual lobe.
SCATTER_INTEGER_VECTOR_CLONES
void weigh(
    std::size_t count, const Halves& at, const double* __restrict R, const double* __restrict TT,
    const double* __restrict TRT, const double* __restrict E,
    const std::array<std::array<double, block>, 3>& M, double* __restrict value) {
  for (std::size_t k = 0; k < count; ++k) {
    const double inverse = 1 / at.cos_theta_d[k];
    value[k] =
        (M[0][k] * R[k] + M[1][k] * TT[k] + M[2][k] * (TRT[k] + E[k] * (0.5 / pi))) * inverse * inverse;
  }
}

SCATTER_INTEGER_VECTOR_CLONES
void ring(std::size_t count, const Halves& at, const Bell& bell, double* __restrict M) {
  for (std::size_t k = 0; k < count; ++k) {
    const double x = at.theta_h[k] - bell.shift;
    M[k] = bell.height * lane::power_of_two(-x * x * bell.scale);
  }
}

} // namespace

void check_directions(
    std::span<const double> theta_i, std::span<const double> theta_o, std::span<const double> phi,
    std::size_t values) {
  const std::size_t count = theta_i.size();
  if (theta_o.size() != count || phi.size() != count || values != 3 * count)
    throw InputError("lists of directions and of values do not match: there are three values, for the "
                     "colours, per direction");
  for (std::size_t k = 0; k < count; ++k)
    if (std::isnan(theta_i[k]) || std::isnan(theta_o[k]) || !std::isfinite(phi[k]))
      throw InputError("an angle of a fibre's scattering is not a number: direction " + std::to_string(k));
}

void HairScattering::eval(
    std::span<const double> theta_i, std::span<const double> theta_o, std::span<const double> phi,
    std::span<double> value) const {
  const std::size_t count = theta_i.size();
  check_directions(theta_i, theta_o, phi, value.size());
  if (residual_energy_.empty()) {
    for (std::size_t k = 0; k < count; ++k) {
      const Rgb one = eval(Angles{theta_i[k], theta_o[k], phi[k]});
      for (std::size_t c = 0; c < 3; ++c) value[c * count + k] = one[c];
    }
    return;
  }
  std::array<Bell, 3> bells;
  for (std::size_t lobe = 0; lobe < 3; ++lobe) {
    const LongitudinalKernel& kernel = kernels_[lobe];
    bells[lobe] = {
        kernel.shift(), 0.72134752044448170368 / (kernel.width() * kernel.width()), kernel(kernel.shift())};
  }
  Halves at;
  std::array<std::array<double, block>, 3> M;
  std::array<double, 9 * block> N;
  std::array<double, block> E{};
  for (std::size_t from = 0; from < count; from += block) {
    const std::size_t n = std::min(block, count - from);
    halve(n, &theta_i[from], &theta_o[from], &phi[from], at);
    const std::span<const double> cosines(at.cos_theta_d.data(), n);
    ray_lobes(
        parameters_.eta, parameters_.sigma_a,
        {cosines, {at.sin_half_phi.data(), n}, {at.cos_half_phi.data(), n}}, std::span(N.data(), 9 * n));
    for (std::size_t lobe = 0; lobe < 3; ++lobe) ring(n, at, bells[lobe], M[lobe].data());
    for (std::size_t c = 0; c < 3; ++c) {
      if (parameters_.residual) residual_energy_[c].evaluate(cosines, {E.data(), n});
      weigh(n, at, &N[c * n], &N[(3 + c) * n], &N[(6 + c) * n], E.data(), M, &value[c * count + from]);
    }
  }
}

} // namespace scatter::fiber
