// Method. The coefficients need one pass over the partial waves and set all the digits there are, so they are
// computed in long double (64-bit mantissa where there is one), each in the form that does not cancel:
//   - rho_n(z) = psi_{n+1}(z) / psi_n(z) by downward recurrence, started 10 |z|^(1/3) + 40 above |z|;
//   - chi_n(x) by upward recurrence, and psi_n(x) = 1 / (chi_{n+1} - rho_n chi_n) from the Wronskian, so that
//   nothing is
//     anchored on sin x or on any other number that may vanish;
//   - a_n = N / (N - i M) with N and M from differences of rho, and the absorbed share Re a_n - |a_n|^2 in
//   closed form.
// The sum over partial waves is partial_waves.cpp's.

#include <scatter/exact/long_complex.hpp>
#include <scatter/exact/mie.hpp>
#include <scatter/exact/partial_waves.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;

using Complex = LongComplex;

std::complex<double> to_double(Complex a) {
  return {static_cast<double>(a.re), static_cast<double>(a.im)};
}

/// rho_n(z) = psi_{n+1}(z) / psi_n(z), n = 0..count-1, for Im z >= 0. The imaginary part is a sum of terms of
/// one sign: it keeps its digits when it is tiny.
std::vector<Complex> riccati_ratios(Complex z, std::size_t count) {
  const real size = abs(z);
  const auto start =
      static_cast<std::size_t>(std::max(size, static_cast<real>(count)) + 10 * std::cbrt(size) + 40);
  const Complex inverse_z = inverse(z);
  std::vector<Complex> ratios(count);
  Complex rho = (1 / static_cast<real>(2 * start + 3)) * z;
  for (std::size_t n = start; n >= 1; --n) {
    Complex w = static_cast<real>(2 * n + 1) * inverse_z - rho;
    if (w.re == 0 && w.im == 0)
      w.re = 1e-25L; // psi_{n-1} = 0 to the last bit; the next step brings the digits back
    rho = inverse(w);
    if (n <= count) ratios[n - 1] = rho;
  }
  return ratios;
}

/// |a| to the digits that error estimates need: a long double's root takes several times as long.
double modulus(Complex a) {
  const auto re = static_cast<double>(a.re), im = static_cast<double>(a.im);
  return std::sqrt(re * re + im * im);
}

/// All that does not depend on the angle.
struct Coefficients {
  PartialWaves waves;
  double Qext = 0, Qsca = 0, Qabs = 0, Qback = 0, g = 0;
  double relative_error = 0; ///< of a_n and b_n, against the largest of them
};

Coefficients coefficients(real x, Complex m) {
  const auto count = static_cast<std::size_t>(x + 9 * std::cbrt(x) + 12);
  const auto outside = riccati_ratios({x, 0}, count + 1);
  const Complex z = x * m;
  const auto inside = riccati_ratios(z, count + 1);
  const Complex inverse_z = inverse(z);
  const double z_size = modulus(z), walk = std::sqrt(static_cast<double>(count));
  const Complex inverse_m = inverse(m);
  const double m_size = modulus(m), inverse_m_size = modulus(inverse_m);
  // 1/m^2 - 1 without the difference.
  const Complex contrast = Complex{1 - m.re, -m.im} * Complex{1 + m.re, m.im} * inverse_m * inverse_m;

  Coefficients result;
  result.waves.reserve(count);
  real sca = 0, abs_sum = 0, asymmetry = 0;
  double largest = 0, worst = 0;
  Complex back, previous_a, previous_b;
  const real cosine = std::cos(x), sine = std::sin(x);
  real chi_before = cosine, chi = cosine / x + sine; // chi_{n-1}, chi_n
  for (std::size_t index = 1; index <= count; ++index) {
    const real n = static_cast<real>(index);
    const real chi_next = (2 * n + 1) / x * chi - chi_before;
    const real rho_x = outside[index].re;
    const Complex rho = inside[index];
    const real psi = 1 / (chi_next - rho_x * chi);

    // R = D_n(mx)/m for a_n, m D_n(mx) for b_n, less (n+1)/x, with D_n = (n+1)/z - rho_n.
    const Complex R_a = ((n + 1) / x) * contrast - rho * inverse_m;
    const Complex R_b = Complex{} - m * rho;
    // The relative rounding that rho(mx) has picked up: its argument's, as a shift along rho' = 1 + rho^2 -
    // (2n+2) rho / z, and a random walk of the recurrence's steps.
    const Complex slope = Complex{1, 0} + rho * rho - (2 * n + 2) * rho * inverse_z;
    const double rho_error = 2 * modulus(rho) + modulus(slope) * (z_size / 2 + walk);
    // The same walk of psi and chi: against their common amplitude where they oscillate, their own beyond.
    const auto walked = [&](real value, real other) {
      return walk * (n < x ? modulus({value, other}) : std::abs(static_cast<double>(value)));
    };
    const real psi_next = psi * rho_x;
    const double psi_error = walked(psi, chi), chi_error = walked(chi, psi);
    const double psi_next_error = walked(psi_next, chi_next), chi_next_error = walked(chi_next, psi_next);
    const auto coefficient = [&](Complex R, double rho_factor) {
      const Complex N = psi * (R + Complex{rho_x, 0});
      const Complex M = chi * R + Complex{chi_next, 0};
      const Complex denominator = {N.re + M.im, N.im - M.re}; // N - i M
      const real inverse_size = 1 / norm(denominator);
      // Im(N conj M) = Im R (Wronskian 1), so that Re a = (|N|^2 - Im R) / |N - i M|^2 is a sum of positive
      // terms.
      const real absorbed = std::max<real>(-R.im, 0);
      const Complex value = {
          (norm(N) + absorbed) * inverse_size,
          (N.im * denominator.re - N.re * denominator.im) * inverse_size};
      sca += (2 * n + 1) * norm(N) * inverse_size;
      abs_sum += (2 * n + 1) * absorbed * inverse_size;
      // First-order effects on N / (N - i M): of R (the Wronskian makes it one term), and of psi and chi.
      const double R_size = modulus(R), R_error = 2 * R_size + rho_factor * rho_error;
      const double N_error = psi_error * R_size + psi_next_error,
                   M_error = chi_error * R_size + chi_next_error;
      largest = std::max(largest, modulus(value));
      worst = std::max(
          worst, (R_error + modulus(M) * N_error + modulus(N) * M_error) * static_cast<double>(inverse_size));
      return value;
    };
    const Complex a = coefficient(R_a, inverse_m_size), b = coefficient(R_b, m_size);

    const real weight = (2 * n + 1) / (n * (n + 1));
    const Complex sum = weight / 2 * (a + b), difference = weight / 2 * (a - b);
    result.waves.add(to_double(sum), to_double(difference));
    back = back + (index % 2 ? -(2 * n + 1) : 2 * n + 1) * (a - b);
    asymmetry += weight * (a.re * b.re + a.im * b.im);
    if (index > 1)
      asymmetry +=
          (n - 1) * (n + 1) / n *
          (previous_a.re * a.re + previous_a.im * a.im + previous_b.re * b.re + previous_b.im * b.im);
    previous_a = a;
    previous_b = b;
    chi_before = chi;
    chi = chi_next;
  }
  const real scale = 2 / (x * x);
  result.Qsca = static_cast<double>(scale * sca);
  result.Qabs = static_cast<double>(scale * abs_sum);
  result.Qext = static_cast<double>(scale * (sca + abs_sum));
  result.Qback = static_cast<double>(norm(back) / (x * x));
  result.g = static_cast<double>(2 * asymmetry / sca);
  result.relative_error = static_cast<double>(real_epsilon) / 2 * worst / largest;
  return result;
}

MieResult
solve(double x, std::complex<double> m, std::span<const double> theta, AngleUnit unit, int threads) {
  check_sphere(x, m);
  const std::vector<Angle> angles = fold_angles(theta, unit);
  const Coefficients c = coefficients(x, {m.real(), m.imag()});
  auto sums = std::move(sum_partial_waves({&c.waves, 1}, angles, threads)[0]);
  MieResult result;
  result.size_parameter = x;
  result.index = m;
  result.Qext = c.Qext;
  result.Qsca = c.Qsca;
  result.Qabs = c.Qabs;
  result.Qback = c.Qback;
  result.g = c.g;
  result.S1 = std::move(sums.S1);
  result.S2 = std::move(sums.S2);
  result.phase_function.reserve(angles.size());
  // Qabs follows the squared width of a resonance: twice the coefficient's error, and once more for the width
  // itself.
  result.error_estimate = 8 * epsilon + (m.imag() > 0 ? 4 : 1) * c.relative_error;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double first = std::norm(result.S1[i]), second = std::norm(result.S2[i]);
    result.phase_function.push_back((first + second) / (2 * std::numbers::pi * x * x * c.Qsca));
    // A grid's angle stands for its decimal; the estimate holds for the double as given, too.
    const double turn = std::abs(angles[i].theta_rest) * (std::numbers::pi / 180) * x;
    const double error = sums.rounding[i] + (c.relative_error + turn) * std::sqrt(sums.largest_partial[i]);
    result.error_estimate = std::max(result.error_estimate, error / std::sqrt(std::max(first, second)));
  }
  return result;
}

} // namespace

MieResult mie(double size_parameter, std::complex<double> index, std::span<const double> theta, int threads) {
  return solve(size_parameter, index, theta, AngleUnit::radian, threads);
}

MieResult mie_at_degrees(
    double size_parameter, std::complex<double> index, std::span<const double> theta_deg, int threads) {
  return solve(size_parameter, index, theta_deg, AngleUnit::degree, threads);
}

} // namespace scatter::exact
