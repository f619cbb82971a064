#pragma once

#include <array>
#include <cmath>
#include <cstddef>

/// Adaptive quadrature of several functions of one variable at a time, and interpolation.
namespace scatter::fiber {

/// Abscissas and weights of Gauss and Legendre's rule of 20 points on -1..1, the positive half (Abramowitz &
/// Stegun, table 25.4).
inline constexpr std::array<double, 10> legendre_x{
    0.076526521133497333755, 0.227785851141645078080, 0.373706088715419560673, 0.510867001950827098004,
    0.636053680726515025453, 0.746331906460150792614, 0.839116971822218823395, 0.912234428251325905868,
    0.963971927277913791268, 0.993128599185094924786};
inline constexpr std::array<double, 10> legendre_w{
    0.152753387130725850698, 0.149172986472603746788, 0.142096109318382051329, 0.131688638449176626898,
    0.118194531961518417312, 0.101930119817240435037, 0.083276741576704748725, 0.062672048334109063570,
    0.040601429800386941331, 0.017614007139152118312};

/// Value: a std::array of doubles, or a type with the same size() and [].
template <typename Value, typename Function>
Value gauss_legendre(const Function& f, double a, double b) {
  Value sum{};
  const double middle = 0.5 * (a + b), half = 0.5 * (b - a);
  for (std::size_t i = 0; i < legendre_x.size(); ++i)
    for (const double sign : {-1.0, 1.0}) {
      const Value value = f(middle + sign * half * legendre_x[i]);
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += half * legendre_w[i] * value[k];
    }
  return sum;
}

namespace detail {
template <typename Value, typename Function>
Value refine(const Function& f, double a, double b, const Value& whole, double tolerance, int depth) {
  const double middle = 0.5 * (a + b);
  const Value left = gauss_legendre<Value>(f, a, middle), right = gauss_legendre<Value>(f, middle, b);
  Value sum{};
  double error = 0;
  for (std::size_t k = 0; k < sum.size(); ++k) {
    sum[k] = left[k] + right[k];
    error = std::fmax(error, std::abs(sum[k] - whole[k]));
  }
  if (error <= tolerance || depth == 0) return sum;
  const Value fine_left = refine(f, a, middle, left, 0.5 * tolerance, depth - 1);
  const Value fine_right = refine(f, middle, b, right, 0.5 * tolerance, depth - 1);
  for (std::size_t k = 0; k < sum.size(); ++k) sum[k] = fine_left[k] + fine_right[k];
  return sum;
}
} // namespace detail

/// Integral of f over a..b, halved until halves and whole agree within the absolute tolerance, at most
/// `depth` times.
template <typename Value, typename Function>
Value integrate(const Function& f, double a, double b, double tolerance, int depth = 12) {
  if (!(b > a)) return Value{};
  return detail::refine(f, a, b, gauss_legendre<Value>(f, a, b), tolerance, depth);
}

/// Lagrange's weights of the values at 0, 1, .. 5 for their interpolation at x.
inline std::array<double, 6> six_point_weights(double x) {
  std::array<double, 6> weights{};
  for (int i = 0; i < 6; ++i) {
    double weight = 1;
    for (int j = 0; j < 6; ++j)
      if (j != i) weight *= (x - j) / (i - j);
    weights[static_cast<std::size_t>(i)] = weight;
  }
  return weights;
}

} // namespace scatter::fiber
