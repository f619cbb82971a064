#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
// Not clang, which refuses to pass vectors that the code around has no registers for, nor under sanitizers,
// whose checks in all these inlined functions take minutes to compile: there vectors have two lanes.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) &&     \
    !defined(__SANITIZE_THREAD__)
#define SCATTER_FIBER_X86_LANES 1
#include <immintrin.h>
#define SCATTER_FIBER_AVX512 __attribute__((target("avx512f,avx512dq,fma")))
#define SCATTER_FIBER_AVX2 __attribute__((target("avx2,fma")))
#else
#define SCATTER_FIBER_X86_LANES 0
#endif

#define SCATTER_LANE [[gnu::always_inline]] inline

/// Internal to scatter::fiber: several doubles at once, and functions of them without branches or calls.
///
/// Written once and compiled for every width of vectors; each operation, fused multiply-adds too, stands
/// where it is written, so that a lane's result is the same bits in whichever place it is computed. Functions
/// are templates over Lanes and Two: a pair of vectors hides the time that one alone would wait for each
/// operation.
namespace scatter::fiber::lane {

template <std::size_t count>
struct VectorsOf {
  typedef double Doubles __attribute__((vector_size(8 * count)));
  typedef long long Integers __attribute__((vector_size(8 * count))); // the intrinsics' own type
  /// The same in memory, at any alignment.
  typedef double Stored __attribute__((vector_size(8 * count), aligned(8), may_alias));
};

#if SCATTER_FIBER_X86_LANES
// Inlined in the end, where the instructions fit, but not yet in what is inlined around them: hence not
// always_inline, and -Wno-psabi for the files that use them.
namespace x86 {
/// Those without a mask are defined by way of a vector that is not initialised, of which GCC 12 warns.
inline constexpr __mmask8 all_lanes = 0xff;

SCATTER_FIBER_AVX512 inline __m512d all_of_eight(double a) {
  return _mm512_set1_pd(a);
}
SCATTER_FIBER_AVX2 inline __m256d all_of_four(double a) {
  return _mm256_set1_pd(a);
}

SCATTER_FIBER_AVX512 inline __m512d multiply_add(__m512d a, __m512d b, __m512d c) {
  return _mm512_fmadd_pd(a, b, c);
}
SCATTER_FIBER_AVX512 inline __m512d multiply_subtract(__m512d a, __m512d b, __m512d c) {
  return _mm512_fmsub_pd(a, b, c);
}
SCATTER_FIBER_AVX512 inline __m512d subtract_product(__m512d c, __m512d a, __m512d b) {
  return _mm512_fnmadd_pd(a, b, c);
}
SCATTER_FIBER_AVX512 inline __m512d larger(__m512d a, __m512d b) {
  return _mm512_maskz_max_pd(all_lanes, a, b);
}
SCATTER_FIBER_AVX512 inline __m512d smaller(__m512d a, __m512d b) {
  return _mm512_maskz_min_pd(all_lanes, a, b);
}
SCATTER_FIBER_AVX512 inline __mmask8 less(__m512d a, __m512d b) {
  return _mm512_cmp_pd_mask(a, b, _CMP_LT_OQ);
}
SCATTER_FIBER_AVX512 inline __mmask8 less_or_equal(__m512d a, __m512d b) {
  return _mm512_cmp_pd_mask(a, b, _CMP_LE_OQ);
}
SCATTER_FIBER_AVX512 inline __m512d select(__mmask8 mask, __m512d a, __m512d b) {
  return _mm512_mask_blend_pd(mask, b, a);
}
/// Both to 2^-14.
SCATTER_FIBER_AVX512 inline __m512d rough_inverse(__m512d a) {
  return _mm512_maskz_rcp14_pd(all_lanes, a);
}
SCATTER_FIBER_AVX512 inline __m512d rough_inverse_root(__m512d a) {
  return _mm512_maskz_rsqrt14_pd(all_lanes, a);
}
/// 2^(j/16)
alignas(64) inline constexpr double powers_of_sixteenths[16] = {
    1.0,
    1.0442737824274138,
    1.0905077326652577,
    1.1387886347566916,
    1.189207115002721,
    1.241857812073484,
    1.2968395546510096,
    1.3542555469368927,
    1.4142135623730951,
    1.4768261459394993,
    1.5422108254079407,
    1.6104903319492543,
    1.681792830507429,
    1.7562521603732995,
    1.8340080864093424,
    1.9152065613971474};
/// 2^(n - floor n) for n = shifted - 1.5 2^48, a number of sixteenths.
SCATTER_FIBER_AVX512 inline __m512d power_of_sixteenths(__m512d shifted) {
  return _mm512_permutex2var_pd(
      _mm512_load_pd(powers_of_sixteenths), _mm512_castpd_si512(shifted),
      _mm512_load_pd(powers_of_sixteenths + 8));
}
/// a 2^(floor n)
SCATTER_FIBER_AVX512 inline __m512d scaled_by_floor(__m512d a, __m512d n) {
  return _mm512_maskz_scalef_pd(all_lanes, a, n);
}

SCATTER_FIBER_AVX2 inline __m256d multiply_add(__m256d a, __m256d b, __m256d c) {
  return _mm256_fmadd_pd(a, b, c);
}
SCATTER_FIBER_AVX2 inline __m256d multiply_subtract(__m256d a, __m256d b, __m256d c) {
  return _mm256_fmsub_pd(a, b, c);
}
SCATTER_FIBER_AVX2 inline __m256d subtract_product(__m256d c, __m256d a, __m256d b) {
  return _mm256_fnmadd_pd(a, b, c);
}
SCATTER_FIBER_AVX2 inline __m256d larger(__m256d a, __m256d b) {
  return _mm256_max_pd(a, b);
}
SCATTER_FIBER_AVX2 inline __m256d smaller(__m256d a, __m256d b) {
  return _mm256_min_pd(a, b);
}
SCATTER_FIBER_AVX2 inline std::uint32_t bits(__m256i mask) {
  return static_cast<std::uint32_t>(_mm256_movemask_pd(_mm256_castsi256_pd(mask)));
}
} // namespace x86
#endif

/// Which lanes; on AVX-512 one bit each, elsewhere vectors of 0 and -1.
template <std::size_t count>
struct MaskOf {
  typename VectorsOf<count>::Integers m;
};
#if SCATTER_FIBER_X86_LANES
template <>
struct MaskOf<8> {
  __mmask8 m;
};
#endif

template <std::size_t count>
struct Lanes {
  using Doubles = typename VectorsOf<count>::Doubles;
  using Integers = typename VectorsOf<count>::Integers;
  using Stored = typename VectorsOf<count>::Stored;
  using Mask = MaskOf<count>;
  static constexpr std::size_t width = count;
  /// Of count 8: there are instructions for rough inverses and their roots, and divisions take long.
  static constexpr bool has_rough = SCATTER_FIBER_X86_LANES && count == 8;
  static constexpr bool has_fused = SCATTER_FIBER_X86_LANES && count >= 4;

  Doubles v;

  SCATTER_LANE static Lanes all(double a) {
#if SCATTER_FIBER_X86_LANES
    if constexpr (count == 8)
      return {x86::all_of_eight(a)};
    else if constexpr (count == 4)
      return {x86::all_of_four(a)};
    else
#endif
      return {Doubles{} + a};
  }
  SCATTER_LANE static Lanes load(const double* from) { return {*reinterpret_cast<const Stored*>(from)}; }
  SCATTER_LANE void store(double* to) const { *reinterpret_cast<Stored*>(to) = v; }

  SCATTER_LANE friend Lanes operator+(const Lanes& a, const Lanes& b) { return {a.v + b.v}; }
  SCATTER_LANE friend Lanes operator-(const Lanes& a, const Lanes& b) { return {a.v - b.v}; }
  SCATTER_LANE friend Lanes operator*(const Lanes& a, const Lanes& b) { return {a.v * b.v}; }
  SCATTER_LANE friend Lanes operator/(const Lanes& a, const Lanes& b) { return {a.v / b.v}; }
  SCATTER_LANE friend Lanes operator-(const Lanes& a) { return {-a.v}; }
#if SCATTER_FIBER_X86_LANES
#define SCATTER_FIBER_ON_X86(condition, result)                                                              \
  if constexpr (condition)                                                                                   \
    return {result};                                                                                         \
  else
#else
#define SCATTER_FIBER_ON_X86(condition, result)
#endif
  /// a b + c
  SCATTER_LANE friend Lanes multiply_add(const Lanes& a, const Lanes& b, const Lanes& c) {
    SCATTER_FIBER_ON_X86(has_fused, x86::multiply_add(a.v, b.v, c.v))
    return {a.v * b.v + c.v};
  }
  /// a b - c
  SCATTER_LANE friend Lanes multiply_subtract(const Lanes& a, const Lanes& b, const Lanes& c) {
    SCATTER_FIBER_ON_X86(has_fused, x86::multiply_subtract(a.v, b.v, c.v))
    return {a.v * b.v - c.v};
  }
  /// c - a b
  SCATTER_LANE friend Lanes subtract_product(const Lanes& c, const Lanes& a, const Lanes& b) {
    SCATTER_FIBER_ON_X86(has_fused, x86::subtract_product(c.v, a.v, b.v))
    return {c.v - a.v * b.v};
  }
  SCATTER_LANE friend Lanes larger(const Lanes& a, const Lanes& b) {
    SCATTER_FIBER_ON_X86(has_fused, x86::larger(a.v, b.v))
    return {a.v > b.v ? a.v : b.v};
  }
  SCATTER_LANE friend Lanes smaller(const Lanes& a, const Lanes& b) {
    SCATTER_FIBER_ON_X86(has_fused, x86::smaller(a.v, b.v))
    return {a.v < b.v ? a.v : b.v};
  }
  SCATTER_LANE friend Mask less(const Lanes& a, const Lanes& b) {
    SCATTER_FIBER_ON_X86(count == 8, x86::less(a.v, b.v))
    return {a.v < b.v};
  }
  SCATTER_LANE friend Mask less_or_equal(const Lanes& a, const Lanes& b) {
    SCATTER_FIBER_ON_X86(count == 8, x86::less_or_equal(a.v, b.v))
    return {a.v <= b.v};
  }
  SCATTER_LANE friend Lanes select(const Mask& mask, const Lanes& a, const Lanes& b) {
    SCATTER_FIBER_ON_X86(count == 8, x86::select(mask.m, a.v, b.v))
    return {mask.m ? a.v : b.v};
  }
  /// Bit k is lane k.
  SCATTER_LANE static std::uint32_t bits(const Mask& mask) {
    SCATTER_FIBER_ON_X86(count == 8, mask.m)
    SCATTER_FIBER_ON_X86(count == 4, x86::bits(mask.m)) {
      std::uint32_t found = 0;
      for (std::size_t k = 0; k < count; ++k) found |= (mask.m[k] != 0 ? 1U : 0U) << k;
      return found;
    }
  }
  /// 1 / a: to 2^-14 where there is has_rough, in full elsewhere.
  SCATTER_LANE friend Lanes rough_inverse(const Lanes& a) {
    SCATTER_FIBER_ON_X86(has_rough, x86::rough_inverse(a.v))
    return {1 / a.v};
  }
  /// 1 / sqrt(a): to 2^-14 where there is has_rough, to 3.5 % elsewhere.
  SCATTER_LANE friend Lanes rough_inverse_root(const Lanes& a) {
    SCATTER_FIBER_ON_X86(has_rough, x86::rough_inverse_root(a.v))
    return {reinterpret_cast<Doubles>(INT64_C(0x5fe6eb50c7b537a9) - (reinterpret_cast<Integers>(a.v) >> 1))};
  }
  /// 2^(n - floor n) for n = shifted - 1.5 2^48, a number of sixteenths; where there is has_rough.
  SCATTER_LANE friend Lanes power_of_sixteenths(const Lanes& shifted) {
    SCATTER_FIBER_ON_X86(has_rough, x86::power_of_sixteenths(shifted.v))
    return shifted;
  }
  /// a 2^(floor n); where there is has_rough.
  SCATTER_LANE friend Lanes scaled_by_floor(const Lanes& a, const Lanes& n) {
    SCATTER_FIBER_ON_X86(has_rough, x86::scaled_by_floor(a.v, n.v))
    return a * n;
  }
#undef SCATTER_FIBER_ON_X86
  /// a^(1/3) to 3 %, a positive and normal: a third of the exponent and of the mantissa as if it were its
  /// log.
  SCATTER_LANE friend Lanes rough_cube_root(const Lanes& a) {
    constexpr double two_52 = 0x1p52, bits_of_one = 1072693248; // the upper 32 of them
    const auto upper = reinterpret_cast<Doubles>(
        (reinterpret_cast<Integers>(a.v) >> 32) | reinterpret_cast<Integers>(Doubles{} + two_52));
    const Doubles third = (upper - two_52) * (1.0 / 3) + (bits_of_one * (2.0 / 3) + two_52);
    return {reinterpret_cast<Doubles>(reinterpret_cast<Integers>(third) << 32) * 0.972};
  }
  /// a 2^n for n = shifted - 1.5 2^52, a and the result normal.
  SCATTER_LANE friend Lanes scaled(const Lanes& a, const Lanes& shifted) {
    return {reinterpret_cast<Doubles>(
        reinterpret_cast<Integers>(a.v) + (reinterpret_cast<Integers>(shifted.v) << 52))};
  }
};

/// Two of them, or of pairs, side by side.
template <class Half>
struct Two {
  static constexpr std::size_t width = 2 * Half::width;
  static constexpr bool has_rough = Half::has_rough;

  struct Mask {
    typename Half::Mask first, second;
  };

  Half first, second;

  SCATTER_LANE static Two all(double a) { return {Half::all(a), Half::all(a)}; }
  SCATTER_LANE static Two load(const double* from) {
    return {Half::load(from), Half::load(from + Half::width)};
  }
  SCATTER_LANE void store(double* to) const {
    first.store(to);
    second.store(to + Half::width);
  }
  SCATTER_LANE friend Two operator+(const Two& a, const Two& b) {
    return {a.first + b.first, a.second + b.second};
  }
  SCATTER_LANE friend Two operator-(const Two& a, const Two& b) {
    return {a.first - b.first, a.second - b.second};
  }
  SCATTER_LANE friend Two operator*(const Two& a, const Two& b) {
    return {a.first * b.first, a.second * b.second};
  }
  SCATTER_LANE friend Two operator/(const Two& a, const Two& b) {
    return {a.first / b.first, a.second / b.second};
  }
  SCATTER_LANE friend Two operator-(const Two& a) { return {-a.first, -a.second}; }
  SCATTER_LANE friend Two multiply_add(const Two& a, const Two& b, const Two& c) {
    return {multiply_add(a.first, b.first, c.first), multiply_add(a.second, b.second, c.second)};
  }
  SCATTER_LANE friend Two multiply_subtract(const Two& a, const Two& b, const Two& c) {
    return {multiply_subtract(a.first, b.first, c.first), multiply_subtract(a.second, b.second, c.second)};
  }
  SCATTER_LANE friend Two subtract_product(const Two& c, const Two& a, const Two& b) {
    return {subtract_product(c.first, a.first, b.first), subtract_product(c.second, a.second, b.second)};
  }
  SCATTER_LANE friend Two larger(const Two& a, const Two& b) {
    return {larger(a.first, b.first), larger(a.second, b.second)};
  }
  SCATTER_LANE friend Two smaller(const Two& a, const Two& b) {
    return {smaller(a.first, b.first), smaller(a.second, b.second)};
  }
  SCATTER_LANE friend Mask less(const Two& a, const Two& b) {
    return {less(a.first, b.first), less(a.second, b.second)};
  }
  SCATTER_LANE friend Mask less_or_equal(const Two& a, const Two& b) {
    return {less_or_equal(a.first, b.first), less_or_equal(a.second, b.second)};
  }
  SCATTER_LANE friend Two select(const Mask& mask, const Two& a, const Two& b) {
    return {select(mask.first, a.first, b.first), select(mask.second, a.second, b.second)};
  }
  SCATTER_LANE static std::uint32_t bits(const Mask& mask) {
    return Half::bits(mask.first) | Half::bits(mask.second) << Half::width;
  }
  SCATTER_LANE friend Two rough_inverse(const Two& a) {
    return {rough_inverse(a.first), rough_inverse(a.second)};
  }
  SCATTER_LANE friend Two rough_inverse_root(const Two& a) {
    return {rough_inverse_root(a.first), rough_inverse_root(a.second)};
  }
  SCATTER_LANE friend Two rough_cube_root(const Two& a) {
    return {rough_cube_root(a.first), rough_cube_root(a.second)};
  }
  SCATTER_LANE friend Two power_of_sixteenths(const Two& shifted) {
    return {power_of_sixteenths(shifted.first), power_of_sixteenths(shifted.second)};
  }
  SCATTER_LANE friend Two scaled_by_floor(const Two& a, const Two& n) {
    return {scaled_by_floor(a.first, n.first), scaled_by_floor(a.second, n.second)};
  }
  SCATTER_LANE friend Two scaled(const Two& a, const Two& shifted) {
    return {scaled(a.first, shifted.first), scaled(a.second, shifted.second)};
  }
};

/// 1 / x to two roundings; x normal, as its inverse is.
template <class T>
SCATTER_LANE T inverse(const T& x) {
  if constexpr (!T::has_rough) return rough_inverse(x);
  const T y = rough_inverse(x), rest = subtract_product(T::all(1), x, y);
  // y / (1 - rest), the rest 2^-14
  return multiply_add(y, multiply_add(rest, multiply_add(rest, rest, rest), rest), y);
}

/// sqrt(x) to 1e-3 or better; x positive and normal.
template <class T>
SCATTER_LANE T quick_root(const T& x) {
  const T y = rough_inverse_root(x), guess = x * y;
  if constexpr (T::has_rough) return guess;
  return guess * subtract_product(T::all(1.5012972), T::all(0.5004203) * guess, y);
}

template <class T>
struct RootAndInverse {
  T root, inverse;
};

/// sqrt(x) and 1 / sqrt(x), relative error below 4e-16; x positive and normal. A guess, then series: on wide
/// vectors several times as fast as square root and division.
template <class T>
SCATTER_LANE RootAndInverse<T> root_and_inverse(const T& x) {
  T y = rough_inverse_root(x);
  if constexpr (!T::has_rough)
    // Newton's step with constants for the guess's error of -3.4 .. 3.4 %, which leaves 0.09 %.
    y = y * subtract_product(T::all(1.5012972), T::all(0.5004203) * (x * y), y);
  const T guess = x * y, rest = subtract_product(T::all(1), guess, y);
  T series = multiply_add(rest, T::all(0.3125), T::all(0.375));
  if constexpr (!T::has_rough)
    series = multiply_add(rest * rest, multiply_add(rest, T::all(0.24609375), T::all(0.2734375)), series);
  const T change = rest * multiply_add(rest, series, T::all(0.5));
  return {multiply_add(guess, change, guess), multiply_add(y, change, y)};
}
template <class T>
SCATTER_LANE T root(const T& x) {
  return root_and_inverse(x).root;
}
template <class T>
SCATTER_LANE T inverse_root(const T& x) {
  return root_and_inverse(x).inverse;
}

template <class T>
SCATTER_LANE T absolute(const T& x) {
  return larger(x, -x);
}

/// sum c[k] x^k, odd and even powers apart: two chains, which wait for themselves half as long.
template <std::size_t count, class T>
SCATTER_LANE T polynomial(const double (&c)[count], const T& x) {
  static_assert(count >= 4);
  const T square = x * x;
  constexpr std::size_t last = count - 1;
  T high = T::all(c[last]), low = T::all(c[last - 1]);
#pragma GCC unroll 32
  for (std::size_t k = 2; k + 1 < count; k += 2) {
    high = multiply_add(high, square, T::all(c[last - k]));
    low = multiply_add(low, square, T::all(c[last - k - 1]));
  }
  if constexpr (count % 2 == 0) return multiply_add(high, x, low);
  return multiply_add(multiply_add(high, x, low), x, T::all(c[0]));
}

/// 2^x, relative error below 4e-16, -1000 <= x <= 0.
template <class T>
SCATTER_LANE T power_of_two_in_range(const T& x) {
  if constexpr (T::has_rough) { // a table of sixteen fits into two registers
    static constexpr double c[] = {0.6931471805599457,   0.24022650695910075,   0.0555041086566393,
                                   0.009618129106919537, 0.0013333781576784268, 0.00015403723980749256};
    const T rounding = T::all(0x1.8p48); // its last bit is a sixteenth: adding it rounds to whole ones
    const T shifted = x + rounding, nearest = shifted - rounding, rest = x - nearest;
    const T power = power_of_sixteenths(shifted);
    return scaled_by_floor(multiply_add(power, rest * polynomial(c, rest), power), nearest);
  } else {
    static constexpr double c[] = {
        1,
        0.6931471805599453,
        0.2402265069591016,
        0.055504108664821625,
        0.009618129107587223,
        0.0013333558146406453,
        0.00015403530463766596,
        1.5252733841579287e-05,
        1.3215432514189648e-06,
        1.017805707615539e-07,
        7.074198158791346e-09,
        4.4558199665721414e-10};
    const T rounding = T::all(0x1.8p52); // its last bit is one
    const T shifted = x + rounding;
    return scaled(polynomial(c, x - (shifted - rounding)), shifted);
  }
}

/// The same for all x <= 0; below -700 2^-700: products with it stay clear of denormal numbers.
template <class T>
SCATTER_LANE T power_of_two(const T& x) {
  return power_of_two_in_range(larger(x, T::all(-700)));
}

/// acos(1 - q)^2 / q for 0 <= q <= 1 by powers of q, relative error below 4e-16: a Chebyshev interpolant,
/// computed with 50 digits.
inline constexpr double arc_squared_series[] = {
    1.9999999999999996,      0.3333333333336239,     0.08888888885771423,    0.028571429892690216,
    0.010158700722740374,    0.0038484014402954602,  0.001518746546455009,   0.0006435290163823803,
    0.0001621991187772483,   0.00043231604421005654, -0.0007406925707234721, 0.0014727050312996627,
    -0.0019887061600475688,  0.0020335817845567494,  -0.001478354195700397,  0.0007373475173037154,
    -0.00022509364339762017, 3.276753615926729e-05};

/// The series times a factor: then arc_squared() has the factor, too.
struct ScaledArc {
  double series[std::size(arc_squared_series)];
  explicit ScaledArc(double factor) {
    for (std::size_t k = 0; k < std::size(series); ++k) series[k] = factor * arc_squared_series[k];
  }
};

/// acos(1 - q)^2 for 0 <= q <= 1, relative error below 1e-15: smooth in q, so that no arc function and no
/// root are needed. A rounding below 0 is harmless.
template <class T>
SCATTER_LANE T arc_squared(const T& q) {
  return q * polynomial(arc_squared_series, q);
}
template <class T>
SCATTER_LANE T arc_squared(const ScaledArc& arc, const T& q) {
  return q * polynomial(arc.series, q);
}

} // namespace scatter::fiber::lane
