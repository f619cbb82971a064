#include <scatter/exact/bessel.hpp>

#include <algorithm>
#include <cmath>

namespace scatter::exact {
namespace {

/// How far series and recurrences go until what is left out is below the last digit.
template <class Complex>
struct Reach {
  static constexpr real far = 30;    ///< |z| from which Hankel's series has all digits
  static constexpr int fraction = 1; ///< terms of the continued fraction, in units of the long double's
  static constexpr int sum = 60;     ///< of a Neumann series, beyond |z|
  static constexpr real turn = 10, margin = 40; ///< of the ratios: turn |z|^(1/3) + margin beyond |z|
};
template <>
struct Reach<ExtendedComplex> {
  static constexpr real far = 40;
  static constexpr int fraction = 3, sum = 120;
  static constexpr real turn = 14, margin = 60;
};

/// exp(i z) = value * 2^exponent
HankelStart<LongComplex> exponential(LongComplex z) {
  const real halvings = std::floor(z.im / std::numbers::ln2_v<real>);
  const real size = std::exp(halvings * std::numbers::ln2_v<real> - z.im);
  return {{size * std::cos(z.re), size * std::sin(z.re)}, -static_cast<long>(halvings), {}};
}
HankelStart<ExtendedComplex> exponential(const ExtendedComplex& z) {
  const auto [size, exponent] = exponential_of_minus(z.im);
  const auto turn = sine_cosine(z.re);
  return {size * ExtendedComplex{turn.cosine, turn.sine}, exponent, {}};
}

LongComplex log(LongComplex z) {
  return {std::log(abs(z)), std::atan2(z.im, z.re)};
}

/// Hankel's asymptotic series (DLMF 10.17.5): its smallest term is exp(-2 |z|).
template <class Complex>
HankelStart<Complex> far_start(const Complex& z) {
  using Real = RealOf<Complex>;
  const Complex i_over_8z = times_i(inverse(exactly<Real>(8) * z));
  Complex sums[2];
  for (const int order : {0, 1}) {
    Complex term{exactly<Real>(1), {}};
    for (int k = 1; k < 100; ++k) {
      sums[order] = sums[order] + term;
      const double odd = 2 * k - 1;
      term = (exactly<Real>(4 * order - odd * odd) / exactly<Real>(k)) * (term * i_over_8z);
      if (abs(rounded(term)) < Constants<Real>::rounding / 4) break;
    }
  }
  HankelStart<Complex> start = exponential(z);
  constexpr Real diagonal = Constants<Real>::diagonal; // exp(-i pi/4)
  start.value = start.value * Complex{diagonal, -diagonal} *
                sqrt(exactly<Real>(2) / Constants<Real>::pi * inverse(z)) * sums[0];
  start.ratio = -times_i(sums[1] / sums[0]);
  return start;
}

/// H_1 / H_0 = -H_0' / H_0 from Steed's continued fraction (Numerical Recipes 6.7.2), H_0 from the Wronskian
/// J_1 H_0 - J_0 H_1 = 2i / (pi z), and J_0 and J_1 from exp(-iz) = J_0 + 2 sum (-i)^n J_n: no term of that
/// sum is larger than its total.
template <class Complex>
HankelStart<Complex> middle_start(const Complex& z) {
  using Real = RealOf<Complex>;
  const Complex i{{}, exactly<Real>(1)};
  const real size = abs(rounded(z));
  Complex tail;
  for (int k = Reach<Complex>::fraction * (60 + static_cast<int>(600 / size)); k >= 1; --k) {
    const double half_odd = k - 0.5;
    const Complex denominator = exactly<Real>(2) * (z + exactly<Real>(k) * i) + tail;
    tail = exactly<Real>(half_odd * half_odd) * inverse(denominator);
  }
  const Complex inverse_z = inverse(z);
  const Complex ratio = exactly<Real>(0.5) * inverse_z - i - i * inverse_z * tail;

  const auto top = static_cast<std::size_t>(size) + Reach<Complex>::sum;
  const auto q = bessel_ratios<Complex>({}, z * z, -(z * z), top);
  Complex term{exactly<Real>(1), {}}, sum = term; // (-i)^n J_n / J_0
  for (std::size_t n = 0; n < top; ++n) {
    term = -times_i(term * z * q.inside[n]);
    sum = sum + exactly<Real>(2) * term;
  }
  // exp(-iz) grows with Im z < 40: no exponent is needed.
  const auto wave = exponential(-z);
  const Complex J_0 = exactly<Real>(std::ldexp(1.0, static_cast<int>(wave.exponent))) * wave.value / sum;
  const Complex J_1 = J_0 * z * q.inside[0];
  const Complex H_0 = exactly<Real>(2) / Constants<Real>::pi * (i * inverse(z * (J_1 - J_0 * ratio)));
  return {H_0, 0, ratio};
}

/// Power series (DLMF 10.2.2, 10.8.2); J_0 has no zero here.
template <class Complex>
HankelStart<Complex> near_start(const Complex& z) {
  using Real = RealOf<Complex>;
  const Complex t = -(exactly<Real>(0.25) * (z * z));
  Complex J_0, J_1, Y_0, power{exactly<Real>(1), {}}; // power: t^k / k!^2
  Real harmonic{};
  for (int k = 0; k < 30; ++k) {
    const Real share = exactly<Real>(1) / exactly<Real>(k + 1);
    J_0 = J_0 + power;
    J_1 = J_1 + share * power;
    Y_0 = Y_0 - harmonic * power;
    harmonic = harmonic + share;
    power = share * share * (power * t);
  }
  J_1 = exactly<Real>(0.5) * (z * J_1);
  const Complex logarithm = log(exactly<Real>(0.5) * z) + Complex{Constants<Real>::egamma, {}};
  const Real two_over_pi = exactly<Real>(2) / Constants<Real>::pi;
  Y_0 = two_over_pi * (Y_0 + logarithm * J_0);
  const Complex H_0 = J_0 + times_i(Y_0);
  const Complex H_1 = (J_1 * H_0 - two_over_pi * times_i(inverse(z))) / J_0;
  return {H_0, 0, H_1 / H_0};
}

} // namespace

template <class Complex>
BesselRatios<Complex> bessel_ratios(
    const RealOf<Complex>& z1_squared, const Complex& z2_squared, const Complex& difference,
    std::size_t count) {
  using Real = RealOf<Complex>;
  constexpr double nothing = Constants<Real>::rounding * 1e-6;
  const real size1 = rounded(z1_squared), size2 = abs(rounded(z2_squared));
  const real largest = std::sqrt(std::max(size1, size2));
  const auto start = static_cast<std::size_t>(
      std::max(largest, static_cast<real>(count)) + Reach<Complex>::turn * std::cbrt(largest) +
      Reach<Complex>::margin);
  BesselRatios<Complex> ratios;
  ratios.outside.resize(count);
  ratios.inside.resize(count);
  ratios.difference.resize(count);
  // Of the two forms of the difference's recurrence the one that forgets errors: they grow by z_small /
  // z_large.
  const bool inside_larger = size2 > size1;
  const Real z1 = z1_squared; // by value: nothing else writes to them
  const Complex z2 = z2_squared, apart = difference;
  const Real one = exactly<Real>(1), first = one / exactly<Real>(static_cast<double>(2 * start + 2));
  Real q1 = first;
  Complex q2{first, {}}, change{};
  for (std::size_t n = start; n >= 1; --n) {
    const Real twice = exactly<Real>(static_cast<double>(2 * n));
    Real denominator1 = twice - z1 * q1;
    Complex denominator2 = Complex{twice, {}} - z2 * q2;
    // J_{n-1} = 0 to the last bit; the next step brings the digits back.
    if (rounded(denominator1) == 0) denominator1 = exactly<Real>(nothing);
    if (rounded(denominator2.re) == 0 && rounded(denominator2.im) == 0)
      denominator2.re = exactly<Real>(nothing);
    const Real next1 = one / denominator1;
    const Complex next2 = inverse(denominator2);
    change = next1 * (next2 * (inside_larger ? q2 * apart + z1 * change : q1 * apart + z2 * change));
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

template <class Complex>
HankelStart<Complex> hankel_start(const Complex& z) {
  const real size = abs(rounded(z));
  if (size >= Reach<Complex>::far) return far_start(z);
  return size >= 2 ? middle_start(z) : near_start(z);
}

template BesselRatios<LongComplex>
bessel_ratios(const real&, const LongComplex&, const LongComplex&, std::size_t);
template BesselRatios<ExtendedComplex>
bessel_ratios(const Extended&, const ExtendedComplex&, const ExtendedComplex&, std::size_t);
template HankelStart<LongComplex> hankel_start(const LongComplex&);
template HankelStart<ExtendedComplex> hankel_start(const ExtendedComplex&);

} // namespace scatter::exact
