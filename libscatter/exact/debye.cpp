// Method. Outside the sphere psi and chi of x, inside h1 = psi - i chi and h2 = psi + i chi of z = m x. With
//   D[f, g] = alpha f'(x) g(z) - beta f(x) g'(z),   alpha, beta = m, 1 for a_n and 1, m for b_n,
// the surface's coefficients (Hovenac & Lock 1992) are R22 = -D[h2,h2] / D[h1,h2], R11 = -D[h1,h1] / D[h1,h2]
// and, by the Wronskians, T21 T12 = -4 m / D[h1,h2]^2. Differences that would cancel are taken in advance:
//   p = 0:      1/2 (1 - R22) = D[psi,h2] / D[h1,h2], which decays like a_n beyond the edge;
//   p >= 1:     2 m R11^(p-1) / D[h1,h2]^2;
//   after P:    m R11^P / (D[h1,h2] D[h1,psi]), from 1 - R11 = 2 D[h1,psi] / D[h1,h2];
//   all:        D[psi,psi] / D[h1,psi], Mie's own form.
// With f'_n = (n+1)/x f_n - f_{n+1} and the ratios L = g_{n+1} / g_n, D[f,g] = -alpha g (f R + f_{n+1}),
// where R = (n+1)/x (1/m^2 - 1) - L/m for a_n and -m L for b_n: two real functions outside, which stay in
// range, and ratios inside, where h1 and psi are kept as a number times a power of 2 that may be anything.
//
// Functions inside: h1 by upward recurrence (it dominates upwards for Im z >= 0), psi from the downward ratio
// and the Wronskian, h2 = 2 psi - h1, which does not cancel as |h2| >= |h1|.
//
// Where a ray of order p never comes, S_p is what remains when partial waves 1e15 times larger cancel.
// Coefficients are therefore computed in 32 digits, and angles where the sum in double is not sure of ten
// digits, eleven of the whole, are summed again.

#include <scatter/exact/debye.hpp>
#include <scatter/exact/extended_complex.hpp>
#include <scatter/exact/extended_partial_waves.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;
/// Estimated errors above which an amplitude is summed again: of orders, and of the whole up to x = 5000,
/// where Mie's own sum is as good.
constexpr double sure = 5e-11, sure_of_whole = 5e-12, whole_size = 5000;

/// What a sum is held to.
struct Need {
  double enough = sure;          ///< estimated error that an amplitude may have without being summed again
  double floor_of_whole = 1e-12; ///< orders far below the whole need no ten digits of their own
};
constexpr Need visible{1e-7, 1};

constexpr int most_orders = 1000;
constexpr double smallest_index = 1e-6; ///< keeps powers of it, and functions of small spheres, in range
// Late orders are a few resonant partial waves: the roundings of their pi_n do not average out as those of
// many do.
constexpr int last_of_many_waves = 8;
constexpr double few_waves = 3;
constexpr std::size_t batch = 8; ///< orders held in memory at a time

using Complex = ExtendedComplex;

/// f_{n+1} / f_n of psi, n = 0 .. count-1, by downward recurrence, which starts where the start's error has
/// decayed below 1e-40 at n = count and at n = |z|.
template <typename Number, typename Inverse>
std::vector<Number> psi_ratios(const Number& z, double size, std::size_t count, const Inverse& one_over) {
  const auto start =
      static_cast<std::size_t>(std::max(size, static_cast<double>(count)) + 14 * std::cbrt(size) + 60);
  const Number inverse_z = one_over(z);
  std::vector<Number> ratios(count);
  Number ratio = one_over(times(inverse_z, static_cast<double>(2 * start + 3)));
  for (std::size_t n = start; n >= 1; --n) {
    ratio = one_over(times(inverse_z, static_cast<double>(2 * n + 1)) - ratio);
    if (n <= count) ratios[n - 1] = ratio;
  }
  return ratios;
}

/// What one partial wave of one polarisation gives to every order.
struct Wave {
  Complex first, second; ///< p = 0 and p = 1
  Complex reflection;    ///< R11: from each order p >= 1 to the next
  Complex after_first;   ///< all orders after p = 0; times R11^P after P
  Complex whole;         ///< a_n or b_n
};

struct Coefficients {
  std::vector<Wave> a, b;
  double error = 0; ///< relative to the largest coefficient, of p = 0; p + 1 times that for other orders
  double whole_error = 0; ///< of `whole` and `after_first`: larger on resonances
};

Coefficients coefficients(double x, std::complex<double> index) {
  const auto count = static_cast<std::size_t>(x + 12 * std::cbrt(x) + 12);
  const Complex m{number(index.real()), number(index.imag())};
  const Complex z = times(m, x); // exact: products of doubles
  const double z_size = std::abs(index) * x;
  const auto outside = psi_ratios(number(x), x, count + 1, [](const Extended& a) { return number(1) / a; });
  const auto inside = psi_ratios(z, z_size, count + 1, [](const Complex& a) {
    // psi_n = 0 to the last bit would be an accident of a real z: the next step brings the digits back.
    return abs(a) > 0 ? inverse(a) : Complex{number(1e60), {}};
  });
  const Complex inverse_m = inverse(m), inverse_z = inverse(z);
  const Extended inverse_x = number(1) / number(x);
  // 1/m^2 - 1 without the difference.
  const Complex one{number(1), {}};
  const Complex contrast = (one - m) * (one + m) * inverse_m * inverse_m;

  const auto outer = sine_cosine(number(x));
  Extended chi_before = outer.cosine, chi = outer.cosine * inverse_x + outer.sine; // chi_0, chi_1
  // h1_0 = -i exp(iz), h1_1 = h1_0 (1/z - i), as numbers times 2^exponent.
  const auto [decay, first_exponent] = exponential_of_minus(z.im);
  long exponent = first_exponent;
  const auto inner = sine_cosine(z.re);
  const Complex h_0 = decay * Complex{inner.sine, -inner.cosine};
  Complex h_before = h_0, h = h_0 * (inverse_z + Complex{{}, number(-1)});

  Coefficients result;
  result.a.reserve(count);
  result.b.reserve(count);
  double largest = 0, worst = 0;
  for (std::size_t k = 1; k <= count; ++k) {
    const double n = static_cast<double>(k);
    const Extended chi_next = times(inverse_x, 2 * n + 1) * chi - chi_before;
    const Extended psi = number(1) / (chi_next - outside[k] * chi), psi_next = outside[k] * psi;

    if (const double size = abs(h); !(size > 0x1p-40 && size < 0x1p40)) {
      const int shift = std::ilogb(size);
      h = scaled(h, std::ldexp(1, -shift));
      h_before = scaled(h_before, std::ldexp(1, -shift));
      exponent += shift;
    }
    const Complex h_next = times(inverse_z, 2 * n + 1) * h - h_before;
    // psi_n(z) = -i / (h_{n+1} - rho h_n), times 2^-exponent.
    const Complex denominator = inverse(h_next - inside[k] * h);
    const Complex psi_inside{denominator.im, -denominator.re};
    // The smaller of h1 and psi may vanish beside the other: all in units of 2^|exponent|.
    const double small =
        exponent > 500 || exponent < -500 ? 0 : std::ldexp(1, -2 * std::abs(static_cast<int>(exponent)));
    const double h_factor = exponent >= 0 ? 1 : small, psi_factor = exponent >= 0 ? small : 1;
    const Complex h1 = scaled(h, h_factor), h1_next = scaled(h_next, h_factor);
    const Complex psi_z = scaled(psi_inside, psi_factor);
    const Complex h2 = scaled(psi_z, 2) - h1, h2_next = scaled(inside[k] * psi_z, 2) - h1_next;
    const Complex inverse_h2 = inverse(h2);
    const Complex ratio_1 = h_next * inverse(h), ratio_2 = h2_next * inverse_h2, ratio_psi = inside[k];
    const Complex h1_over_h2 = h1 * inverse_h2;
    const Complex squared = scaled(inverse_h2 * inverse_h2, small); // 1 / h2^2
    const Complex crossed =
        scaled(inverse_h2 * inverse(psi_inside), exponent >= 0 ? 1 : small); // 1 / (h2 psi)

    const auto wave = [&](const Complex& R_1, const Complex& R_2, const Complex& R_psi,
                          const Complex& factor) {
      // N - i M = h1(x) R + h1_{n+1}(x), of which N is psi's part.
      const auto parts = [&](const Complex& R, Complex& N) {
        N = psi * R + Complex{psi_next, {}};
        const Complex M = chi * R + Complex{chi_next, {}};
        return Complex{N.re + M.im, N.im - M.re};
      };
      Complex N_1, N_2, N_psi;
      const Complex D_1 = parts(R_1, N_1), inverse_2 = inverse(parts(R_2, N_2));
      const Complex D_psi = parts(R_psi, N_psi), inverse_psi = inverse(D_psi);
      Wave one_wave;
      one_wave.first = N_2 * inverse_2;
      one_wave.second = scaled(factor * squared * inverse_2 * inverse_2, 2);
      one_wave.reflection = -(h1_over_h2 * D_1 * inverse_2);
      one_wave.after_first = factor * crossed * inverse_2 * inverse_psi;
      one_wave.whole = N_psi * inverse_psi;
      // Near a resonance N - i M is the small difference of its parts.
      const double size = abs(one_wave.whole), rest = abs(one_wave.after_first);
      const double parts_size = std::abs(chi.hi) * abs(R_psi) + std::abs(chi_next.hi);
      largest = std::max({largest, size, abs(one_wave.first), abs(one_wave.second)});
      worst = std::max(worst, std::max(size, rest) * parts_size * abs(inverse_psi));
      return one_wave;
    };
    const auto R_a = [&](const Complex& ratio) {
      return times(inverse_x, n + 1) * contrast - ratio * inverse_m;
    };
    const auto R_b = [&](const Complex& ratio) { return -(m * ratio); };
    // m / alpha^2: 1/m for a_n, m for b_n.
    result.a.push_back(wave(R_a(ratio_1), R_a(ratio_2), R_a(ratio_psi), inverse_m));
    result.b.push_back(wave(R_b(ratio_1), R_b(ratio_2), R_b(ratio_psi), m));

    chi_before = chi;
    chi = chi_next;
    h_before = h;
    h = h_next;
  }
  // The recurrences' roundings walk at random, as in mie.cpp.
  const double walk = extended_epsilon * (8 + std::sqrt(z_size + static_cast<double>(count)));
  result.error = walk;
  result.whole_error = walk * (1 + worst / largest);
  return result;
}

/// A set of coefficients as weights for the sums.
class Set {
public:
  /// sum_factor: how much more than that of many partial waves the sum's rounding is.
  explicit Set(double relative_error, double sum_factor = 1)
      : relative_error_(relative_error), sum_factor_(sum_factor) {}

  /// The next n's coefficients.
  void add(const Complex& a, const Complex& b) {
    const double n = static_cast<double>(exact_.waves.size() + 1);
    const Extended half_weight = number((2 * n + 1) / 2) / number(n * (n + 1));
    const Complex plus = half_weight * (a + b), minus = half_weight * (a - b);
    exact_.waves.push_back({plus.re, plus.im, minus.re, minus.im});
    rounded_.add({plus.re.hi, plus.im.hi}, {minus.re.hi, minus.im.hi});
  }
  [[nodiscard]] const ExtendedWaves& exact() const { return exact_; }
  [[nodiscard]] PartialWaves take_rounded() { return std::move(rounded_); }
  /// Absolute, for a largest partial sum of `size`, where the sum alone has `rounding`.
  [[nodiscard]] double error(double size, double rounding) const {
    return sum_factor_ * rounding + relative_error_ * size;
  }

private:
  ExtendedWaves exact_;
  PartialWaves rounded_;
  double relative_error_ = 0, sum_factor_ = 1;
};

double larger(const DebyeTerm& term, std::size_t i) {
  return std::max(std::abs(term.S1[i]), std::abs(term.S2[i]));
}

/// Sums sets over all angles, first in double, then in 32 digits where that was not sure. whole: nothing
/// while it is itself what is summed.
std::vector<DebyeTerm>
sum(std::span<Set> sets, std::span<const Angle> angles, const DebyeTerm* whole, Need need, int threads) {
  std::vector<PartialWaves> rounded;
  for (auto& set : sets) rounded.push_back(set.take_rounded());
  auto sums = sum_partial_waves(rounded, angles, threads);
  const std::size_t count = rounded[0].count();
  const double fine = extended_epsilon * (12 + 8 * std::sqrt(static_cast<double>(count)));

  std::vector<DebyeTerm> terms(sets.size());
  const auto scale = [&](std::size_t set, std::size_t i) {
    return std::max(larger(terms[set], i), whole ? need.floor_of_whole * larger(*whole, i) : 0);
  };
  const auto size = [&](std::size_t set, std::size_t i) { return std::sqrt(sums[set].largest_partial[i]); };
  const auto estimate = [&](std::size_t set, std::size_t i, double rounding) {
    return size(set, i) > 0 ? sets[set].error(size(set, i), rounding) / scale(set, i) : 0;
  };
  std::vector<bool> unsure(angles.size());
  std::vector<std::vector<bool>> unsure_of(sets.size(), unsure);
  for (std::size_t set = 0; set < sets.size(); ++set) {
    terms[set].S1 = std::move(sums[set].S1);
    terms[set].S2 = std::move(sums[set].S2);
    for (std::size_t i = 0; i < angles.size(); ++i)
      // "Not surely below": a term that is zero to the last bit is unsure too.
      if (!(estimate(set, i, sums[set].rounding[i]) <= need.enough)) unsure[i] = unsure_of[set][i] = true;
  }
  std::vector<Angle> again;
  std::vector<std::size_t> place;
  for (std::size_t i = 0; i < angles.size(); ++i)
    if (unsure[i]) {
      again.push_back(angles[i]);
      place.push_back(i);
    }
  std::vector<const ExtendedWaves*> exact;
  for (const auto& set : sets) exact.push_back(&set.exact());
  const auto better = sum_partial_waves(exact, again, threads);
  for (std::size_t set = 0; set < sets.size(); ++set) {
    for (std::size_t k = 0; k < place.size(); ++k)
      if (unsure_of[set][place[k]]) {
        terms[set].S1[place[k]] = better[set].S1[k];
        terms[set].S2[place[k]] = better[set].S2[k];
      }
    terms[set].error_estimate = 8 * epsilon;
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const double error = unsure_of[set][i] ? 4 * epsilon + estimate(set, i, fine * size(set, i))
                                             : estimate(set, i, sums[set].rounding[i]);
      terms[set].error_estimate = std::max(terms[set].error_estimate, error);
    }
  }
  return terms;
}

DebyeResult solve(
    double x, std::complex<double> m, std::span<const int> asked, std::span<const double> theta,
    AngleUnit unit, int threads, DebyeDigits digits) {
  check_sphere(x, m);
  if (!(std::abs(m) >= smallest_index)) {
    std::ostringstream message;
    message << "index " << m.real() << '+' << m.imag()
            << "i is too small for the Debye series: use one of modulus 1e-6 or more";
    throw InputError(message.str());
  }
  std::vector<int> orders(asked.begin(), asked.end());
  std::sort(orders.begin(), orders.end());
  orders.erase(std::unique(orders.begin(), orders.end()), orders.end());
  if (orders.empty()) throw InputError("no Debye order is asked for; use some of 0..1000");
  for (const int p : orders)
    if (p < 0 || p > most_orders)
      throw InputError("Debye order " + std::to_string(p) + " is outside 0..1000");
  const std::vector<Angle> angles = fold_angles(theta, unit);

  const Coefficients c = coefficients(x, m);
  const std::size_t count = c.a.size();
  DebyeResult result;
  result.size_parameter = x;
  result.index = m;

  std::vector<Set> sets;
  sets.emplace_back(c.whole_error);
  for (std::size_t k = 0; k < count; ++k) sets[0].add(c.a[k].whole, c.b[k].whole);
  const bool every = digits == DebyeDigits::every;
  const Need need = every ? Need{} : visible;
  const Need of_whole = every && x <= whole_size ? Need{sure_of_whole} : need;
  result.whole = std::move(sum(sets, angles, nullptr, of_whole, threads)[0]);
  sets.clear();

  const auto flush = [&] {
    for (auto& term : sum(sets, angles, &result.whole, need, threads)) {
      result.orders.push_back({std::move(term), orders[result.orders.size()]});
    }
    sets.clear();
  };
  // R11^(p-1) for p >= 1, and the sum of all orders so far.
  const Complex one{number(1), {}};
  std::vector<Complex> power_a(count, one), power_b(count, one), sum_a(count), sum_b(count);
  for (int p = 0; p <= orders.back(); ++p) {
    const bool wanted = std::binary_search(orders.begin(), orders.end(), p);
    if (wanted) sets.emplace_back((p + 1) * c.error, p > last_of_many_waves ? few_waves : 1);
    for (std::size_t k = 0; k < count; ++k) {
      const auto term = [p](const Wave& wave, Complex& power) {
        if (p == 0) return wave.first;
        const Complex value = wave.second * power;
        power = power * wave.reflection;
        return value;
      };
      const Complex a = term(c.a[k], power_a[k]), b = term(c.b[k], power_b[k]);
      sum_a[k] = sum_a[k] + a;
      sum_b[k] = sum_b[k] + b;
      if (wanted) sets.back().add(a, b);
    }
    if (sets.size() == batch) flush();
  }
  if (!sets.empty()) flush();
  if (!every) return result;

  const int last = orders.back();
  sets.emplace_back((last + 1) * c.error);
  sets.emplace_back((last + 1) * c.error + c.whole_error, few_waves);
  for (std::size_t k = 0; k < count; ++k) {
    sets[0].add(sum_a[k], sum_b[k]);
    sets[1].add(c.a[k].after_first * power_a[k], c.b[k].after_first * power_b[k]);
  }
  auto rest = sum(sets, angles, &result.whole, need, threads);
  result.partial_sum = std::move(rest[0]);
  result.remainder = std::move(rest[1]);
  return result;
}

} // namespace

DebyeResult debye(
    double size_parameter, std::complex<double> index, std::span<const int> orders,
    std::span<const double> theta, int threads, DebyeDigits digits) {
  return solve(size_parameter, index, orders, theta, AngleUnit::radian, threads, digits);
}

DebyeResult debye_at_degrees(
    double size_parameter, std::complex<double> index, std::span<const int> orders,
    std::span<const double> theta_deg, int threads, DebyeDigits digits) {
  return solve(size_parameter, index, orders, theta_deg, AngleUnit::degree, threads, digits);
}

} // namespace scatter::exact
