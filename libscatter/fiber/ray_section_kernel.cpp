// Trigonometry is done away with: gamma is carried as t = tan(gamma / 2), gamma_t by its sine h / eta' and
// W = eta' cos gamma_t. TRT needs the roots of u(gamma) = 4 gamma_t - 2 gamma = +-|phi|. With V half the
// angle between u and its maximum, q = sqrt(sin V), negative on the rising side, is smooth and nearly
// straight in t across the maximum, where u itself turns round: Newton's method on q converges in a few
// steps from a straight line, also beside the caustic. Directions that have such roots are gathered first, so
// that every vector is full of them; most directions have none.

#include <scatter/exact/vector_clones.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/fiber/ray_section_kernel.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <numbers>
#include <stdexcept>

namespace scatter::fiber {
namespace {

#define SCATTER_FIBER_INLINE [[gnu::always_inline]] inline

constexpr std::size_t block = 256; ///< directions at a time: all lists stay in the first cache
constexpr std::size_t chunk = 64;  ///< problems at a time
constexpr std::size_t lanes = 8;   ///< of the widest vectors
constexpr std::size_t most_roots = 3 * block + 2 * lanes + 1; ///< one to write to in vain
constexpr int few_steps = 6, many_steps = 12;

/// exp(x) for x <= 0, relative 3e-16; below -708: 0.
SCATTER_FIBER_INLINE double exp_of_negative(double x) {
  constexpr double shift = 6755399441055744.0; // 1.5 2^52: adding it rounds to an integer, in the low bits
  constexpr double log2_e = 1.4426950408889634074, ln2_high = 0x1.62e42feep-1,
                   ln2_low = 0x1.a39ef35793c76p-33;
  const double clamped = x < -708 ? -708 : x;
  const double shifted = clamped * log2_e + shift, n = shifted - shift;
  const double r = (clamped - n * ln2_high) - n * ln2_low;
  // Taylor to r^13 / 13!, |r| <= 0.347
  double p = 1.0 / 6227020800;
  p = p * r + 1.0 / 479001600;
  p = p * r + 1.0 / 39916800;
  p = p * r + 1.0 / 3628800;
  p = p * r + 1.0 / 362880;
  p = p * r + 1.0 / 40320;
  p = p * r + 1.0 / 5040;
  p = p * r + 1.0 / 720;
  p = p * r + 1.0 / 120;
  p = p * r + 1.0 / 24;
  p = p * r + 1.0 / 6;
  p = p * r + 0.5;
  p = p * r + 1;
  p = p * r + 1;
  const auto scale = std::bit_cast<double>((std::bit_cast<std::uint64_t>(shifted) + 1023) << 52);
  return x < -708 ? 0 : p * scale;
}

struct Reflection {
  double reflected, through; ///< means over both polarisations; their sum is 1
};

SCATTER_FIBER_INLINE Reflection fresnel_mean(double eta2, double c) {
  const double w = std::sqrt(eta2 - 1 + c * c), s = c + w, p = eta2 * c + w;
  const double is = 1 / s, ip = 1 / p;
  const double Ts = 4 * c * w * is * is, Tp = 4 * eta2 * c * w * ip * ip;
  const double rs = (eta2 - 1) * is * is, rp = (eta2 - 1) * (1 - (eta2 + 1) * c * c) * ip * ip;
  return {0.5 * (rs * rs + rp * rp), 0.5 * (Ts + Tp)};
}

/// Of one inclination.
struct Bravais {
  double excess, square, index; ///< eta'^2 - 1, eta'^2, eta'
};

SCATTER_FIBER_INLINE Bravais bravais(double eta2, double cos_d) {
  const double excess = (eta2 - 1) / (cos_d * cos_d);
  return {excess, 1 + excess, std::sqrt(1 + excess)};
}

struct Problems {
  std::uint32_t direction[most_roots];
  double cos_d[most_roots];
  double sine[most_roots], cosine[most_roots]; ///< of half the turn wanted, -pi/2 .. pi/2
  double side[most_roots];                     ///< -1 rising, +1 falling
  double t[most_roots];                        ///< the root: tan(gamma / 2)
};

/// The turn's maximum; without one (eta' >= 2) the axis, where the turn is 0.
struct Top {
  double t, sine, cosine; ///< tan(gamma_c / 2); of u_c / 2
};

SCATTER_FIBER_INLINE Top top_of(const Bravais& b) {
  // 2 cos gamma = W at the maximum
  const double cos2 = std::min(b.excess * (1.0 / 3), 1.0), cos_g = std::sqrt(cos2);
  const double sin_g = std::sqrt(std::max((3 - b.excess) * (1.0 / 3), 0.0));
  const double W = 2 * cos_g, inverse = 1 / std::min(b.square, 4.0);
  const double sin_2t = 2 * sin_g * W * inverse, cos_2t = (W - sin_g) * (W + sin_g) * inverse;
  return {sin_g / (1 + cos_g), sin_2t * cos_g - cos_2t * sin_g, cos_2t * cos_g + sin_2t * sin_g};
}

/// What the steps of some problems need.
struct Search {
  double excess[chunk], inverse_square[chunk], top_sine[chunk], top_cosine[chunk];
  double sine[chunk], cosine[chunk]; ///< of half the turn wanted
  double q[chunk];                   ///< sqrt(sin V) there
  double bent[chunk];                ///< 1: step in q, 0: in u, which has no maximum
  double low[chunk], high[chunk], t[chunk];
};

SCATTER_VECTOR_CLONES
void begin(double eta2, std::size_t count, const Problems& p, std::size_t from, Search& s) {
  for (std::size_t i = 0; i < count; ++i) {
    const Bravais b = bravais(eta2, p.cos_d[from + i]);
    const Top top = top_of(b);
    const double side = p.side[from + i], sine = p.sine[from + i], cosine = p.cosine[from + i];
    const double inverse_square = 1 / b.square;
    const double goal = std::max(top.sine * cosine - top.cosine * sine, 0.0); // sin V
    const double rim_sine = 2 * inverse_square - 1, rim_cosine = 2 * std::sqrt(b.excess) * inverse_square;
    const double at_rim = top.sine * rim_cosine - top.cosine * rim_sine;
    const double end = side > 0 ? at_rim : top.sine, end_t = side > 0 ? 1.0 : 0.0;
    const double bent = b.excess < 3 ? 1.0 : 0.0;
    const double share = std::min(goal / std::max(end, 1e-300), 1.0), root = std::sqrt(share);
    s.t[i] = top.t + (end_t - top.t) * (bent > 0 ? root : share);
    s.excess[i] = b.excess;
    s.inverse_square[i] = inverse_square;
    s.top_sine[i] = top.sine;
    s.top_cosine[i] = top.cosine;
    s.sine[i] = sine;
    s.cosine[i] = cosine;
    s.q[i] = std::sqrt(goal);
    s.bent[i] = bent;
    s.low[i] = side > 0 ? top.t : 0.0;
    s.high[i] = side > 0 ? 1.0 : top.t;
  }
}

SCATTER_VECTOR_CLONES
void improve(std::size_t count, Search& s, int steps) {
  for (int step = 0; step < steps; ++step)
    for (std::size_t i = 0; i < count; ++i) {
      const double t = s.t[i], inverse = 1 / (1 + t * t), inverse_square = s.inverse_square[i];
      const double sin_g = 2 * t * inverse, cos_g = (1 - t) * (1 + t) * inverse;
      const double W = std::sqrt(s.excess[i] + cos_g * cos_g);
      const double sin_2t = 2 * sin_g * W * inverse_square,
                   cos_2t = (W - sin_g) * (W + sin_g) * inverse_square;
      const double sin_u = sin_2t * cos_g - cos_2t * sin_g, cos_u = cos_2t * cos_g + sin_2t * sin_g;
      // The sine of half the angle by which the turn misses, as one difference.
      const double miss = sin_u * s.cosine[i] - cos_u * s.sine[i];
      const double q = std::sqrt(std::max(s.top_sine[i] * cos_u - s.top_cosine[i] * sin_u, 0.0));
      const double curved = 2 * q / (q + s.q[i] + 1e-300), aim = 1 + s.bent[i] * (curved - 1);
      const double slope = (2 * cos_g - W) * 2 * inverse; // W d(u/2) / dt
      const double step_size = miss * W * aim / (slope == 0 ? 1e300 : slope);
      const double next = t - step_size;
      s.t[i] = std::min(std::max(next, s.low[i]), s.high[i]);
    }
}

/// The roots of problems first..last-1, whole vectors.
void solve(double eta2, std::size_t first, std::size_t last, Problems& p, int steps) {
  Search search;
  for (std::size_t from = first; from < last; from += chunk) {
    const std::size_t n = std::min(chunk, last - from);
    begin(eta2, n, p, from, search);
    improve(n, search, steps);
    std::copy_n(search.t, n, p.t + from);
  }
}

/// N_2 = amplitude exp(-sigma_a path), summed over the roots by the caller.
struct Lit {
  double amplitude[most_roots], path[most_roots];
};

SCATTER_VECTOR_CLONES
void light(double eta2, std::size_t count, const Problems& p, Lit& lit) {
  const double eta = std::sqrt(eta2);
  for (std::size_t i = 0; i < count; ++i) {
    const double cos_d = p.cos_d[i];
    const Bravais b = bravais(eta2, cos_d);
    const double t = p.t[i], inverse = 1 / (1 + t * t), cos_g = (1 - t) * (1 + t) * inverse;
    const double W = std::sqrt(b.excess + cos_g * cos_g);
    const Reflection f = fresnel_mean(eta2, cos_d * cos_g);
    // 2 cos gamma - W without cancellation; the floor keeps the caustic finite
    const double gap = std::abs(3 * cos_g * cos_g - b.excess) / (2 * cos_g + W);
    lit.amplitude[i] = f.through * f.through * f.reflected * cos_g * W / (4 * std::max(gap, 1e-30));
    const double cos_t = std::sqrt(eta2 - 1 + cos_d * cos_d) / eta;
    lit.path[i] = 4 * W / (b.index * cos_t);
  }
}

SCATTER_VECTOR_CLONES
void absorb(std::size_t count, double sigma_a, const double* amplitude, const double* path, double* value) {
  for (std::size_t i = 0; i < count; ++i) value[i] = amplitude[i] * exp_of_negative(-sigma_a * path[i]);
}

/// R and TT, and which TRT rays there are: bit 1 rising, 2 falling, 4 falling on the other side.
SCATTER_VECTOR_CLONES
void closed_forms(
    double eta2, std::size_t count, const double* cos_d, const double* sine, const double* cosine,
    double* __restrict R, double* __restrict TT, double* __restrict path, double* __restrict rays,
    double* __restrict hard) {
  const double eta = std::sqrt(eta2);
  for (std::size_t i = 0; i < count; ++i) {
    const double S = sine[i], C = cosine[i], c = cos_d[i];
    const Bravais b = bravais(eta2, c);
    R[i] = fresnel_mean(eta2, c * C).reflected * C * 0.25;
    // Half the deflection has the cosine S and the sine C.
    const double x = b.index * S - 1, D = std::sqrt(x * x + b.square * C * C);
    const double cos_g = std::max(x, 0.0) / D, W = b.index * (b.index - S) / D;
    const Reflection f = fresnel_mean(eta2, c * cos_g);
    TT[i] = f.through * f.through * cos_g * W / (4 * (W - cos_g));
    path[i] = 2 * W / (b.index * (std::sqrt(eta2 - 1 + c * c) / eta));
    const Top top = top_of(b);
    const double rim = 2 / b.square - 1; // sin(u/2) at the rim
    const double rising = b.excess < 3 ? 1.0 : 0.0, below = S <= top.sine ? rising : 0.0;
    const double both = S >= rim ? 3.0 : 1.0, other = -S >= rim ? 4.0 : 0.0;
    rays[i] = below * both + other;
    // Where the maximum is all but gone the turn is a cubic: more steps.
    hard[i] = std::abs(b.excess - 3) < 0.3 ? 1.0 : 0.0;
  }
}

SCATTER_VECTOR_CLONES
void clenshaw(
    const double* coefficient, std::size_t terms, std::size_t count, const double* x, double* value) {
  constexpr std::size_t width = 32;
  for (std::size_t from = 0; from < count; from += width) {
    const std::size_t n = std::min(width, count - from);
    double twice[width] = {}, last[width] = {}, before[width] = {};
    std::copy_n(x + from, n, twice);
    for (std::size_t i = 0; i < width; ++i) twice[i] = 4 * std::sqrt(twice[i]) - 2;
    for (std::size_t k = terms - 1; k > 0; --k)
      for (std::size_t i = 0; i < width; ++i) {
        const double next = twice[i] * last[i] - before[i] + coefficient[k];
        before[i] = last[i];
        last[i] = next;
      }
    for (std::size_t i = 0; i < width; ++i) last[i] = 0.5 * twice[i] * last[i] - before[i] + coefficient[0];
    std::copy_n(last, n, value + from);
  }
}

} // namespace

void ray_lobes(
    double eta, std::span<const double> sigma_a, const RayLobeDirections& directions, std::span<double> N) {
  const std::size_t count = directions.cos_theta_d.size(), colours = sigma_a.size();
  if (directions.sin_half_phi.size() != count || directions.cos_half_phi.size() != count ||
      N.size() != 3 * colours * count)
    throw std::invalid_argument("ray_lobes: lists of directions and of results do not match");
  // Every loop runs over whole vectors, filled up where data end: a result then comes from the same
  // instructions whatever stands beside it.
  const double eta2 = eta * eta;
  Problems problems;
  Lit lit;
  double c[block], S[block], C[block], R[block], TT[block], path[block], rays[block], hard[block];
  double value[most_roots];
  for (std::size_t from = 0; from < count; from += block) {
    const std::size_t n = std::min(block, count - from);
    std::copy_n(&directions.cos_theta_d[from], n, c);
    std::copy_n(&directions.sin_half_phi[from], n, S);
    std::copy_n(&directions.cos_half_phi[from], n, C);
    std::fill(c + n, c + block, 1.0);
    std::fill(S + n, S + block, 1.0);
    std::fill(C + n, C + block, 0.0);
    closed_forms(eta2, block, c, S, C, R, TT, path, rays, hard);
    std::size_t roots = 0;
    // Without branches, which nothing would predict: what is not wanted is overwritten.
    const auto gather = [&](std::size_t i, double cos_d, double sine, double cosine, double side,
                            bool wanted) {
      problems.direction[roots] = static_cast<std::uint32_t>(i);
      problems.cos_d[roots] = cos_d;
      problems.sine[roots] = sine;
      problems.cosine[roots] = cosine;
      problems.side[roots] = side;
      roots += wanted ? 1 : 0;
    };
    const auto gather_all = [&](double hardness) {
      for (std::size_t i = 0; i < n; ++i) {
        const int which = hard[i] == hardness ? static_cast<int>(rays[i]) : 0;
        gather(i, c[i], S[i], C[i], -1, (which & 1) != 0);
        gather(i, c[i], S[i], C[i], 1, (which & 2) != 0);
        gather(i, c[i], -S[i], C[i], 1, (which & 4) != 0);
      }
      while (roots % lanes != 0) gather(block, 1, 0, 1, 1, true);
    };
    gather_all(0);
    const std::size_t easy = roots;
    gather_all(1);
    solve(eta2, 0, easy, problems, few_steps);
    solve(eta2, easy, roots, problems, many_steps);
    light(eta2, roots, problems, lit);
    for (std::size_t colour = 0; colour < colours; ++colour) {
      const auto out = [&](std::size_t order) { return &N[(order * colours + colour) * count + from]; };
      std::copy_n(R, n, out(0));
      absorb(block, sigma_a[colour], TT, path, value);
      std::copy_n(value, n, out(1));
      absorb(roots, sigma_a[colour], lit.amplitude, lit.path, value);
      double TRT[block + 1] = {}; // the last is for what filled up
      for (std::size_t k = 0; k < roots; ++k) TRT[problems.direction[k]] += value[k];
      std::copy_n(TRT, n, out(2));
    }
  }
}

ResidualEnergy::ResidualEnergy(double eta, double sigma_a, int first_order) {
  const RaySection section(eta, sigma_a);
  if (first_order < 1) throw InputError("a residual begins at order 1 or later");
  for (std::size_t count = 16;; count *= 2) {
    std::vector<double> value(count);
    for (std::size_t k = 0; k < count; ++k) {
      const double x =
          std::cos(std::numbers::pi * (static_cast<double>(k) + 0.5) / static_cast<double>(count));
      const double root = (x + 1) / 2;
      value[k] = section.residual_energy(first_order, std::acos(root * root));
    }
    coefficient_.assign(count, 0.0);
    for (std::size_t j = 0; j < count; ++j) {
      for (std::size_t k = 0; k < count; ++k)
        coefficient_[j] += value[k] * std::cos(
                                          std::numbers::pi * static_cast<double>(j) *
                                          (static_cast<double>(k) + 0.5) / static_cast<double>(count));
      coefficient_[j] *= (j == 0 ? 1.0 : 2.0) / static_cast<double>(count);
    }
    double tail = 0;
    for (std::size_t j = count - count / 8; j < count; ++j) tail = std::max(tail, std::abs(coefficient_[j]));
    if (tail < 1e-15 || count >= 1024) break;
  }
  while (coefficient_.size() > 2 && std::abs(coefficient_.back()) < 2e-15) coefficient_.pop_back();
}

void ResidualEnergy::evaluate(std::span<const double> cos_theta_d, std::span<double> energy) const {
  if (energy.size() != cos_theta_d.size())
    throw std::invalid_argument("ResidualEnergy: lists of cosines and of energies do not match");
  clenshaw(coefficient_.data(), coefficient_.size(), cos_theta_d.size(), cos_theta_d.data(), energy.data());
}

} // namespace scatter::fiber
