// Method. The coefficients need one pass over the partial waves and set all the digits there are, so they are
// computed in long double (64-bit mantissa where there is one), each in the form that does not cancel:
//   - rho_n(z) = psi_{n+1}(z) / psi_n(z) by downward recurrence, started 10 |z|^(1/3) + 40 above |z|;
//   - chi_n(x) by upward recurrence, and psi_n(x) = 1 / (chi_{n+1} - rho_n chi_n) from the Wronskian, so that
//   nothing is
//     anchored on sin x or on any other number that may vanish;
//   - a_n = N / (N - i M) with N and M from differences of rho, and the absorbed share Re a_n - |a_n|^2 in
//   closed form.
// The sum over partial waves is done per angle in double, eight angles to a vector, with recurrences for the
// differences of pi_n in t = 1 - cos(theta), which keep their digits near the forward direction; angles
// beyond 90 deg are mirrored.

#include <scatter/exact/mie.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>
#include <system_error>
#include <thread>

// Clones of the inner loop for wider vectors, picked at start-up. Not under sanitizers, whose start-up comes
// later.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) &&     \
    !defined(__SANITIZE_THREAD__)
#define SCATTER_VECTOR_CLONES __attribute__((target_clones("avx512f", "fma", "default")))
#define SCATTER_HAS_FMA __builtin_cpu_supports("fma")
#else
#define SCATTER_VECTOR_CLONES
#ifdef FP_FAST_FMA
#define SCATTER_HAS_FMA true
#else
#define SCATTER_HAS_FMA false
#endif
#endif

namespace scatter::exact {
namespace {

using real = long double;
constexpr real real_epsilon = std::numeric_limits<real>::epsilon();
constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;

/// Complex numbers without the special cases of std::complex for infinities, which cost more than the
/// arithmetic.
struct Complex {
  real re = 0, im = 0;
};
Complex operator+(Complex a, Complex b) {
  return {a.re + b.re, a.im + b.im};
}
Complex operator-(Complex a, Complex b) {
  return {a.re - b.re, a.im - b.im};
}
Complex operator*(Complex a, Complex b) {
  return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
Complex operator*(real a, Complex b) {
  return {a * b.re, a * b.im};
}
real norm(Complex a) {
  return a.re * a.re + a.im * a.im;
}
real abs(Complex a) {
  return std::hypot(a.re, a.im);
}
Complex inverse(Complex a) {
  const real scale = 1 / norm(a);
  return {a.re * scale, -a.im * scale};
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

/// Weights of pi_n + tau_n and pi_n - tau_n in S1 + S2 and S1 - S2; index 0 is n = 1.
struct Weights {
  std::vector<double> plus_re, plus_im, minus_re, minus_im;
  void add(Complex plus, Complex minus) {
    plus_re.push_back(static_cast<double>(plus.re));
    plus_im.push_back(static_cast<double>(plus.im));
    minus_re.push_back(static_cast<double>(minus.re));
    minus_im.push_back(static_cast<double>(minus.im));
  }
};

/// All that does not depend on the angle.
struct Coefficients {
  Weights forward, backward; ///< for theta up to 90 deg, and beyond with theta' = pi - theta
  double Qext = 0, Qsca = 0, Qabs = 0, Qback = 0, g = 0;
  double relative_error = 0; ///< of a_n and b_n, against the largest of them
};

Coefficients coefficients(real x, Complex m) {
  const auto count = static_cast<std::size_t>(x + 9 * std::cbrt(x) + 12);
  const auto outside = riccati_ratios({x, 0}, count + 1);
  const Complex z = x * m;
  const auto inside = riccati_ratios(z, count + 1);
  const Complex inverse_z = inverse(z);
  const real z_size = abs(z), walk = std::sqrt(static_cast<real>(count));
  const Complex inverse_m = inverse(m);
  // 1/m^2 - 1 without the difference.
  const Complex contrast = Complex{1 - m.re, -m.im} * Complex{1 + m.re, m.im} * inverse_m * inverse_m;

  Coefficients result;
  real sca = 0, abs_sum = 0, asymmetry = 0, largest = 0, worst = 0;
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
    const real rho_error = 2 * abs(rho) + abs(slope) * (z_size / 2 + walk);
    // The same walk of psi and chi: against their common amplitude where they oscillate, their own beyond.
    const auto walked = [&](real value, real other) {
      return walk * (n < x ? std::hypot(value, other) : std::abs(value));
    };
    const real psi_next = psi * rho_x;
    const real psi_error = walked(psi, chi), chi_error = walked(chi, psi);
    const real psi_next_error = walked(psi_next, chi_next), chi_next_error = walked(chi_next, psi_next);
    const auto coefficient = [&](Complex R, real rho_factor) {
      const Complex N = psi * (R + Complex{rho_x, 0});
      const Complex M = chi * R + Complex{chi_next, 0};
      const Complex denominator = {N.re + M.im, N.im - M.re}; // N - i M
      const real size = norm(denominator);
      // Im(N conj M) = Im R (Wronskian 1), so that Re a = (|N|^2 - Im R) / |N - i M|^2 is a sum of positive
      // terms.
      const real absorbed = std::max<real>(-R.im, 0);
      const Complex value = {
          (norm(N) + absorbed) / size, (N.im * denominator.re - N.re * denominator.im) / size};
      sca += (2 * n + 1) * norm(N) / size;
      abs_sum += (2 * n + 1) * absorbed / size;
      // First-order effects on N / (N - i M): of R (the Wronskian makes it one term), and of psi and chi.
      const real R_error = 2 * abs(R) + rho_factor * rho_error;
      const real N_error = psi_error * abs(R) + psi_next_error, M_error = chi_error * abs(R) + chi_next_error;
      largest = std::max(largest, abs(value));
      worst = std::max(worst, (R_error + abs(M) * N_error + abs(N) * M_error) / size);
      return value;
    };
    const Complex a = coefficient(R_a, abs(inverse_m)), b = coefficient(R_b, abs(m));

    const real weight = (2 * n + 1) / (n * (n + 1));
    const Complex sum = weight / 2 * (a + b), difference = weight / 2 * (a - b);
    result.forward.add(sum, difference);
    // pi_n(pi - theta) = (-1)^(n+1) pi_n(theta), tau_n(pi - theta) = (-1)^n tau_n(theta).
    const real sign = index % 2 ? 1 : -1;
    result.backward.add(sign * difference, sign * sum);
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
  result.relative_error = static_cast<double>(real_epsilon / 2 * worst / largest);
  return result;
}

/// One scattering angle, folded into the forward half: t = 1 - cos(theta') with theta' = min(theta, pi -
/// theta).
struct Angle {
  double t = 0, t_rest = 0; ///< t to twice the digits of a double
  bool backward = false;    ///< theta > 90 deg
  std::size_t index = 0;    ///< place in the caller's list
};

Angle fold(real theta, bool backward, std::size_t index) {
  const real half = std::sin(std::max<real>(theta, 0) / 2);
  const real t = 2 * half * half;
  Angle angle{static_cast<double>(t), 0, backward, index};
  angle.t_rest = static_cast<double>(t - static_cast<real>(angle.t));
  return angle;
}

using Lanes = double __attribute__((vector_size(64)));
constexpr std::size_t lanes = sizeof(Lanes) / sizeof(double);
constexpr std::size_t rows = 3; ///< vectors in flight: hides the latency of the recurrence
constexpr std::size_t block = lanes * rows;

/// Inputs and outputs of one block of angles.
struct Block {
  double t[block], t_rest[block];
  double S1_re[block], S1_im[block], S2_re[block], S2_im[block];
  double largest_partial[block]; ///< max over the sum's course of (|S1|^2 + |S2|^2) / 2
};

/// Sums over all partial waves; S2 comes out with the sign of the forward half.
SCATTER_VECTOR_CLONES
void sum_partial_waves(const Weights& weights, Block& io) {
  // With s = t pi_n: pi_n - tau_n = e_n + n s, e_{n+1} = e_n + (2n+1) s, pi_{n+1} = pi_n + (2 pi_n - e_{n+1})
  // / n; it follows from n pi_{n+1} = (2n+1) cos(theta) pi_n - (n+1) pi_{n-1}. All of it keeps its digits for
  // small t.
  Lanes pi[rows], e[rows], t[rows], t_rest[rows];
  Lanes plus_re[rows], plus_im[rows], minus_re[rows], minus_im[rows], largest[rows];
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t i = 0; i < lanes; ++i) {
      t[r][i] = io.t[r * lanes + i];
      t_rest[r][i] = io.t_rest[r * lanes + i];
    }
    pi[r] = Lanes{} + 1;
    e[r] = plus_re[r] = plus_im[r] = minus_re[r] = minus_im[r] = largest[r] = Lanes{};
  }
  const std::size_t count = weights.plus_re.size();
  const std::size_t stride = std::max<std::size_t>(1, count / 256);
  for (std::size_t first = 0; first < count; first += stride) {
    const std::size_t last = std::min(first + stride, count);
    for (std::size_t k = first; k < last; ++k) {
      const double n = static_cast<double>(k + 1), inverse_n = 1 / n;
      for (std::size_t r = 0; r < rows; ++r) {
        const Lanes s = t[r] * pi[r] + t_rest[r] * pi[r];
        const Lanes minus = e[r] + n * s;     // pi_n - tau_n
        const Lanes plus = 2 * pi[r] - minus; // pi_n + tau_n
        plus_re[r] += weights.plus_re[k] * plus;
        plus_im[r] += weights.plus_im[k] * plus;
        minus_re[r] += weights.minus_re[k] * minus;
        minus_im[r] += weights.minus_im[k] * minus;
        e[r] += (2 * n + 1) * s;
        pi[r] += inverse_n * (2 * pi[r] - e[r]);
      }
    }
    for (std::size_t r = 0; r < rows; ++r) {
      const Lanes partial = plus_re[r] * plus_re[r] + plus_im[r] * plus_im[r] + minus_re[r] * minus_re[r] +
                            minus_im[r] * minus_im[r];
      largest[r] = partial > largest[r] ? partial : largest[r];
    }
  }
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t i = 0; i < lanes; ++i) {
      io.S1_re[r * lanes + i] = plus_re[r][i] + minus_re[r][i];
      io.S1_im[r * lanes + i] = plus_im[r][i] + minus_im[r][i];
      io.S2_re[r * lanes + i] = plus_re[r][i] - minus_re[r][i];
      io.S2_im[r * lanes + i] = plus_im[r][i] - minus_im[r][i];
      io.largest_partial[r * lanes + i] = largest[r][i];
    }
}

/// Whether the compiler's a * b + c above rounds once.
bool sums_are_fused() {
  return SCATTER_HAS_FMA;
}

void check(double x, std::complex<double> m) {
  std::ostringstream message;
  message.precision(17);
  if (!(x >= 1e-6 && x <= 5e5))
    message << "size parameter " << x << " is outside 1e-6..5e5";
  else if (!std::isfinite(m.real()) || !std::isfinite(m.imag()) || m.real() <= 0 || m.imag() < 0)
    message << "index " << m.real() << (m.imag() < 0 ? "" : "+") << m.imag()
            << "i is not possible: use n + ik with n > 0 and k >= 0 (k > 0 absorbs)";
  else if (m == 1.0)
    message << "index 1 is no sphere: nothing is scattered; use an index relative to the surroundings other "
               "than 1";
  else if (std::abs(m) * x > 1e8)
    message << "index times size parameter is " << std::abs(m) * x << ", more than 1e8";
  else
    return;
  throw InputError(message.str());
}

MieResult solve(double x, std::complex<double> m, const std::vector<Angle>& angles, int threads) {
  const Coefficients c = coefficients(x, {m.real(), m.imag()});
  MieResult result;
  result.size_parameter = x;
  result.index = m;
  result.Qext = c.Qext;
  result.Qsca = c.Qsca;
  result.Qabs = c.Qabs;
  result.Qback = c.Qback;
  result.g = c.g;
  result.S1.resize(angles.size());
  result.S2.resize(angles.size());
  result.phase_function.resize(angles.size());

  // Blocks hold angles of one half only. A block that is not full repeats an angle: every lane does the same
  // arithmetic.
  std::vector<std::vector<Angle>> blocks;
  for (const bool backward : {false, true}) {
    bool open = false;
    for (const auto& angle : angles) {
      if (angle.backward != backward) continue;
      if (!open) blocks.emplace_back();
      blocks.back().push_back(angle);
      open = blocks.back().size() < block;
    }
  }
  const double count = static_cast<double>(c.forward.plus_re.size());
  // The roundings of the sum walk at random, the coefficients' may all go one way. Without fused multiply-add
  // t_rest is rounded away, and t's own rounding turns every partial wave the same way. The factors hold with
  // room to spare for everything that was compared with 60 digits.
  const double steps = 12 + 8 * std::sqrt(count) + (sums_are_fused() ? 0 : count / 2);
  const double rounding = steps * epsilon + c.relative_error;
  std::vector<double> error(blocks.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < blocks.size(); i = next++) {
      Block io;
      for (std::size_t lane = 0; lane < block; ++lane) {
        const auto& angle = blocks[i][std::min(lane, blocks[i].size() - 1)];
        io.t[lane] = angle.t;
        io.t_rest[lane] = angle.t_rest;
      }
      const bool backward = blocks[i][0].backward;
      sum_partial_waves(backward ? c.backward : c.forward, io);
      for (std::size_t lane = 0; lane < blocks[i].size(); ++lane) {
        const std::size_t index = blocks[i][lane].index;
        result.S1[index] = {io.S1_re[lane], io.S1_im[lane]};
        result.S2[index] = {io.S2_re[lane], io.S2_im[lane]};
        if (backward) result.S2[index] = -result.S2[index];
        const double first = std::norm(result.S1[index]), second = std::norm(result.S2[index]);
        result.phase_function[index] = (first + second) / (2 * std::numbers::pi * x * x * c.Qsca);
        error[i] =
            std::max(error[i], rounding * std::sqrt(io.largest_partial[lane] / std::max(first, second)));
      }
    }
  };
  std::size_t wanted = threads > 0 ? static_cast<std::size_t>(threads) : std::thread::hardware_concurrency();
  // A thread costs about as much as 1e5 partial waves of a block.
  wanted = std::min(
      {wanted, blocks.size(),
       static_cast<std::size_t>(count * static_cast<double>(blocks.size()) / 1e5) + 1});
  std::vector<std::thread> others;
  try {
    for (std::size_t i = 1; i < wanted; ++i) others.emplace_back(work);
  } catch (const std::system_error&) {
    // No more threads to be had: those that run, and this one, do the work.
  }
  work();
  for (auto& thread : others) thread.join();
  // Qabs follows the squared width of a resonance: twice the coefficient's error, and once more for the width
  // itself.
  result.error_estimate = 8 * epsilon + (m.imag() > 0 ? 4 : 1) * c.relative_error;
  for (const double e : error) result.error_estimate = std::max(result.error_estimate, e);
  return result;
}

/// half_turn: 180 deg in the unit of the angles, exactly or as near as a double comes.
template <typename ToRadians>
MieResult mie_of(
    double x, std::complex<double> m, std::span<const double> angles, double half_turn, const char* unit,
    int threads, ToRadians&& radians) {
  check(x, m);
  std::vector<Angle> folded;
  folded.reserve(angles.size());
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const double angle = angles[i];
    if (!(angle >= 0 && angle <= half_turn)) {
      std::ostringstream message;
      message << "scattering angle " << angle << ' ' << unit << " is outside 0.." << half_turn << ' ' << unit;
      throw InputError(message.str());
    }
    folded.push_back(radians(angle, i));
  }
  return solve(x, m, folded, threads);
}

} // namespace

MieResult mie(double size_parameter, std::complex<double> index, std::span<const double> theta, int threads) {
  constexpr real half_turn = std::numbers::pi_v<real>;
  return mie_of(
      size_parameter, index, theta, std::numbers::pi, "rad", threads, [](double angle, std::size_t i) {
        const bool backward = angle > std::numbers::pi / 2;
        return fold(backward ? half_turn - static_cast<real>(angle) : static_cast<real>(angle), backward, i);
      });
}

MieResult mie_at_degrees(
    double size_parameter, std::complex<double> index, std::span<const double> theta_deg, int threads) {
  constexpr real degree = std::numbers::pi_v<real> / 180;
  return mie_of(size_parameter, index, theta_deg, 180, "deg", threads, [](double angle, std::size_t i) {
    const bool backward = angle > 90;
    return fold((backward ? 180 - static_cast<real>(angle) : static_cast<real>(angle)) * degree, backward, i);
  });
}

} // namespace scatter::exact
