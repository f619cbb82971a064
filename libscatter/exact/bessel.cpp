#include <scatter/exact/bessel.hpp>

#include <algorithm>
#include <numbers>

namespace scatter::exact {
namespace {

constexpr real pi = std::numbers::pi_v<real>;

/// exp(i z) = value * 2^exponent
HankelStart exponential(LongComplex z) {
  const real halvings = std::floor(z.im / std::numbers::ln2_v<real>);
  const real size = std::exp(halvings * std::numbers::ln2_v<real> - z.im);
  return {{size * std::cos(z.re), size * std::sin(z.re)}, -static_cast<long>(halvings), {}};
}

/// Hankel's asymptotic series (DLMF 10.17.5): its smallest term is exp(-2 |z|).
HankelStart far_start(LongComplex z) {
  const LongComplex i_over_8z = times_i(inverse(8 * z));
  LongComplex sums[2];
  for (const int order : {0, 1}) {
    LongComplex term{1, 0};
    for (int k = 1; k < 50; ++k) {
      sums[order] = sums[order] + term;
      const auto odd = static_cast<real>(2 * k - 1);
      term = ((4 * static_cast<real>(order) - odd * odd) / static_cast<real>(k)) * (term * i_over_8z);
      if (abs(term) < real_epsilon / 8) break;
    }
  }
  HankelStart start = exponential(z);
  const real diagonal = 1 / std::numbers::sqrt2_v<real>; // exp(-i pi/4)
  start.value = start.value * LongComplex{diagonal, -diagonal} * sqrt(2 / pi * inverse(z)) * sums[0];
  start.ratio = -times_i(sums[1] / sums[0]);
  return start;
}

/// H_1 / H_0 = -H_0' / H_0 from Steed's continued fraction (Numerical Recipes 6.7.2), H_0 from the Wronskian
/// J_1 H_0 - J_0 H_1 = 2i / (pi z), and J_0 and J_1 from exp(-iz) = J_0 + 2 sum (-i)^n J_n: no term of that
/// sum is larger than its total.
HankelStart middle_start(LongComplex z) {
  const LongComplex i{0, 1};
  LongComplex tail;
  for (int k = 60 + static_cast<int>(600 / abs(z)); k >= 1; --k) {
    const real half_odd = static_cast<real>(k) - 0.5L;
    const LongComplex denominator = 2 * (z + static_cast<real>(k) * i) + tail;
    tail = (half_odd * half_odd) * inverse(denominator);
  }
  const LongComplex ratio = 0.5L * inverse(z) - i - i * inverse(z) * tail;

  const auto top = static_cast<std::size_t>(abs(z)) + 60;
  const auto q = bessel_ratios(0, z * z, -(z * z), top);
  LongComplex term{1, 0}, sum{1, 0}; // (-i)^n J_n / J_0
  for (std::size_t n = 0; n < top; ++n) {
    term = -times_i(term * z * q.inside[n]);
    sum = sum + 2 * term;
  }
  // exp(-iz) grows with Im z < 30: no exponent is needed.
  const HankelStart wave = exponential({-z.re, -z.im});
  const LongComplex J_0 = std::ldexp(1.0L, static_cast<int>(wave.exponent)) * wave.value / sum;
  const LongComplex J_1 = J_0 * z * q.inside[0];
  return {2 / pi * (i * inverse(z * (J_1 - J_0 * ratio))), 0, ratio};
}

/// Power series (DLMF 10.2.2, 10.8.2); J_0 has no zero here.
HankelStart near_start(LongComplex z) {
  const LongComplex t = -(0.25L * (z * z));
  LongComplex J_0, J_1, Y_0, power{1, 0}; // power: t^k / k!^2
  real harmonic = 0;
  for (int k = 0; k < 30; ++k) {
    const auto next = static_cast<real>(k + 1);
    J_0 = J_0 + power;
    J_1 = J_1 + (1 / next) * power;
    Y_0 = Y_0 - harmonic * power;
    harmonic += 1 / next;
    power = (1 / (next * next)) * (power * t);
  }
  J_1 = 0.5L * (z * J_1);
  const LongComplex logarithm{std::log(abs(z) / 2) + std::numbers::egamma_v<real>, std::atan2(z.im, z.re)};
  Y_0 = 2 / pi * (Y_0 + logarithm * J_0);
  const LongComplex H_0 = J_0 + times_i(Y_0);
  const LongComplex H_1 = (J_1 * H_0 - 2 / pi * times_i(inverse(z))) / J_0;
  return {H_0, 0, H_1 / H_0};
}

} // namespace

BesselRatios
bessel_ratios(real z1_squared, LongComplex z2_squared, LongComplex difference, std::size_t count) {
  const real largest = std::sqrt(std::max(z1_squared, abs(z2_squared)));
  const auto start =
      static_cast<std::size_t>(std::max(largest, static_cast<real>(count)) + 10 * std::cbrt(largest) + 40);
  BesselRatios ratios;
  ratios.outside.resize(count);
  ratios.inside.resize(count);
  ratios.difference.resize(count);
  // Of the two forms of the difference's recurrence the one that forgets errors: they grow by z_small /
  // z_large.
  const bool inside_larger = abs(z2_squared) > z1_squared;
  const real first = 1 / static_cast<real>(2 * start + 2);
  real q1 = first;
  LongComplex q2{first, 0}, change;
  for (std::size_t n = start; n >= 1; --n) {
    const auto twice = static_cast<real>(2 * n);
    real denominator1 = twice - z1_squared * q1;
    LongComplex denominator2 = LongComplex{twice, 0} - z2_squared * q2;
    // J_{n-1} = 0 to the last bit; the next step brings the digits back.
    if (denominator1 == 0) denominator1 = 1e-25L;
    if (denominator2.re == 0 && denominator2.im == 0) denominator2.re = 1e-25L;
    const real next1 = 1 / denominator1;
    const LongComplex next2 = inverse(denominator2);
    change = next1 * (next2 * (inside_larger ? q2 * difference + z1_squared * change
                                             : q1 * difference + z2_squared * change));
    q1 = next1;
    q2 = next2;
    if (n <= count) {
      ratios.outside[n - 1] = q1;
      ratios.inside[n - 1] = q2;
      ratios.difference[n - 1] = change;
    }
  }
  return ratios;
}

HankelStart hankel_start(LongComplex z) {
  const real size = abs(z);
  if (size >= 30) return far_start(z);
  return size >= 2 ? middle_start(z) : near_start(z);
}

} // namespace scatter::exact
