#pragma once

#include <scatter/exact/double_double.hpp>

#include <cstddef>
// Not clang, which refuses to pass vectors that the code around has no registers for. Nor under sanitizers,
// whose checks in all these inlined functions take minutes to compile.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) &&     \
    !defined(__SANITIZE_THREAD__)
#define SCATTER_X86_LANES 1
#include <immintrin.h>
#else
#define SCATTER_X86_LANES 0
#endif

/// Internal to scatter::exact: several doubles at once, and pairs of them, for loops that are compiled once
/// per set of vector instructions. All results are the same bits whatever the instructions.
namespace scatter::exact {

template <std::size_t count>
struct VectorOfDoubles {
  typedef double type __attribute__((vector_size(8 * count)));
  /// The same in memory, at any alignment.
  typedef double stored __attribute__((vector_size(8 * count), aligned(8), may_alias));
};

/// What the code around is compiled for. Those with fused multiply-adds make exact products of them.
enum class Instructions { plain, avx2, avx512 };

template <Instructions instructions, std::size_t count>
struct DoubleLanes {
  using Vector = typename VectorOfDoubles<count>::type;
  using Stored = typename VectorOfDoubles<count>::stored;

  Vector v{};

  SCATTER_INLINE static DoubleLanes all(double a) { return {Vector{} + a}; }
  SCATTER_INLINE static DoubleLanes load(const double* from) {
    return {*reinterpret_cast<const Stored*>(from)};
  }
  SCATTER_INLINE void store(double* to) const { *reinterpret_cast<Stored*>(to) = v; }

  SCATTER_INLINE friend DoubleLanes operator+(const DoubleLanes& a, const DoubleLanes& b) {
    return {a.v + b.v};
  }
  SCATTER_INLINE friend DoubleLanes operator-(const DoubleLanes& a, const DoubleLanes& b) {
    return {a.v - b.v};
  }
  SCATTER_INLINE friend DoubleLanes operator-(const DoubleLanes& a) { return {-a.v}; }
  SCATTER_INLINE friend DoubleLanes operator*(const DoubleLanes& a, const DoubleLanes& b) {
    return {a.v * b.v};
  }
  SCATTER_INLINE friend DoubleLanes operator*(double a, const DoubleLanes& b) { return {a * b.v}; }
  SCATTER_INLINE friend DoubleLanes operator*(const DoubleLanes& a, double b) { return {a.v * b}; }
  SCATTER_INLINE friend DoubleLanes operator/(const DoubleLanes& a, const DoubleLanes& b) {
    return {a.v / b.v};
  }
  SCATTER_INLINE friend DoubleLanes max(const DoubleLanes& a, const DoubleLanes& b) {
    return {a.v > b.v ? a.v : b.v};
  }
  SCATTER_INLINE friend DoubleLanes abs(const DoubleLanes& a) { return {a.v < 0 ? -a.v : a.v}; }
};

#if SCATTER_X86_LANES
// a b - p with one rounding. Inlined in the end, where the instructions fit, but not yet in what is inlined
// around them: hence not always_inline, and a warning (-Wpsabi) of vectors that the code around has no
// registers for.
__attribute__((target("avx2,fma"))) inline __m256d rest_of_product(__m256d a, __m256d b, __m256d p) {
  return _mm256_fmsub_pd(a, b, p);
}
__attribute__((target("avx512f"))) inline __m512d rest_of_product(__m512d a, __m512d b, __m512d p) {
  return _mm512_fmsub_pd(a, b, p);
}

template <Instructions instructions, std::size_t count>
SCATTER_INLINE DoubleLanes<instructions, count> fused_rest(
    const DoubleLanes<instructions, count>& a, const DoubleLanes<instructions, count>& b,
    const DoubleLanes<instructions, count>& p) {
  if constexpr (instructions == Instructions::avx512 || count == 4) {
    return {rest_of_product(a.v, b.v, p.v)};
  } else { // two vectors, which compilers see
    DoubleLanes<instructions, count> rest;
    for (std::size_t i = 0; i < count; ++i) rest.v[i] = __builtin_fma(a.v[i], b.v[i], -p.v[i]);
    return rest;
  }
}
template <Instructions instructions, std::size_t count>
SCATTER_INLINE DoubleLanes<instructions, count>
fused_rest(const DoubleLanes<instructions, count>& a, double b, const DoubleLanes<instructions, count>& p) {
  return fused_rest(a, DoubleLanes<instructions, count>::all(b), p);
}

template <Instructions instructions, std::size_t count>
inline constexpr bool is_fused<DoubleLanes<instructions, count>> = instructions != Instructions::plain;
#endif

/// sum += weight f, where f_halves are f.hi's.
template <class Lanes>
SCATTER_INLINE void accumulate(
    DoubleDouble<Lanes>& sum, const DoubleDouble<double>& weight, const DoubleDouble<Lanes>& f,
    const DoubleDouble<Lanes>& f_halves) {
  DoubleDouble<Lanes> p;
  if constexpr (is_fused<Lanes>)
    p = twofold::product(f.hi, weight.hi);
  else
    p = twofold::product(f.hi, f_halves, weight.hi, twofold::halves(weight.hi));
  const auto added = twofold::sum(sum.hi, p.hi);
  sum = {added.hi, sum.lo + (added.lo + (p.lo + (f.lo * weight.hi + f.hi * weight.lo)))};
}

/// 1 / a, to within 2^-104.
template <Instructions instructions, std::size_t count>
SCATTER_INLINE DoubleDouble<DoubleLanes<instructions, count>>
inverse(const DoubleDouble<DoubleLanes<instructions, count>>& a) {
  using Lanes = DoubleLanes<instructions, count>;
  const auto one = Lanes::all(1);
  const auto first = one / a.hi;
  const auto p = twofold::product(first, a.hi);
  return twofold::ordered_sum<Lanes>(first, first * (((one - p.hi) - p.lo) - first * a.lo));
}

} // namespace scatter::exact
