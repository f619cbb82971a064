#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

/// Internal to scatter::exact: the inner loops of the sum over partial waves, for vectors of any width.
///
/// One pass serves an angle and its mirror image pi - theta, as pi_n(pi - theta) = (-1)^(n+1) pi_n and
/// tau_n(pi - theta) = (-1)^n tau_n: t = 1 - cos(theta) is within 0..1. Terms are taken in stretches: first
/// the functions of a stretch are computed for some rows of vectors and stored (they stay in the nearest
/// cache), then they are multiplied with the weights of each set. So neither the recurrence's latency nor the
/// number of registers holds up the multiplications, and sets share the functions.
///
/// One set alone, where there are registers for the sums of three rows, is summed without storing.
///
/// Count, for one n and one vector of angles with their mirror images: 4 multiply-adds for the sums and 3
/// operations of the recurrence (e takes two, q one), of Form::pairs 1.5. That is 0.084 and 0.066 ns per
/// angle and n for two units of eight doubles at 2.6 GHz; 0.105 and 0.082 are reached. Bare loops of
/// multiply-adds with as many loads do not get beyond 80 % of a peak measured without loads.
///
/// Every lane does the same operations whatever its neighbours hold and however many rows there are.
namespace scatter::exact::kernel {

#define SCATTER_KERNEL [[gnu::always_inline]] inline

/// Most terms per stretch.
constexpr std::size_t longest_stretch = 32;

/// How pi_n and tau_n are brought about and added up; each form has the range of t in which it is both
/// accurate and the cheapest.
enum class Form {
  /// Near the axis. q_n = pi_n / (n (n+1)) and e_n by first-order steps, which keep their digits down to t =
  /// 0: e_{n+1} = e_n + (2n+1) n (n+1) t q_n, q_{n+1} = q_n - e_{n+1} / (n (n+1) (n+2)). From them pi_n -
  /// tau_n = e_n + n^2 (n+1) t q_n and pi_n + tau_n, with weights of their own.
  axis,
  /// As `steps`, but with odd n alone, two at a time: y = sin(theta)^2 in t's place, e_{n+2} = e_n +
  /// (2n+1) n (n+1) y q_n, q_{n+2} = q_n - (2n+3) / (n (n+1) (n+2) (n+3)) e_{n+2}. The sum over even n is
  /// left to the weights, by cos(theta) q_n = ((n+2) q_{n+1} + (n-1) q_{n-1}) / (2n+1). Loses
  /// 1 / cos(theta), and saves every other step.
  pairs,
  /// The same steps as axis, but tau_n is left to the weights: tau_n = (n^2 pi_{n+1} - (n+1)^2 pi_{n-1}) /
  /// (2n+1).
  /// Loses 1 / sin(theta) to the difference.
  steps
};

/// What a form's recurrence needs, index 0 is n = 1; for `pairs`, 1 is n = 3.
struct Recurrence {
  const double* e_weight = nullptr; ///< (2n+1) n (n+1)
  const double* q_weight = nullptr; ///< -1 / (n (n+1) (n+2)), or -(2n+3) / (n (n+1) (n+2) (n+3)) for `pairs`
  const double* minus_weight = nullptr; ///< n^2 (n+1); for `axis`
  const double* plus_weight = nullptr;  ///< 2n (n+1); for `axis`
  std::size_t count = 0;                ///< even; n, odd or not
  std::size_t stretch = 2;              ///< even, so that a place within a stretch tells the parity of n
};

/// Input and output for some points. Sums of set s, component c in 0..7 and point i stand at
/// sums[(8 s + c) points + i]: for Form::axis, components 0..3 are (S1 + S2) / 2 and (S1 - S2) / 2 of theta,
/// real and imaginary parts, 4..7 those of pi - theta. Otherwise 0..3 are S1 and S2 summed over odd n, 4..7
/// over even n, for Form::pairs times cos(theta).
struct Points {
  const double* t = nullptr;      ///< or y, for Form::pairs
  const double* nearby = nullptr; ///< a double close by, on the other side of the true value
  const double* share = nullptr;  ///< how much of the way to `nearby` the true value is, 0..1/2
  double* sums = nullptr;
  /// [set][side][point]: max over the course of the sum of (|S1|^2 + |S2|^2) / 2 or more; side 0 is theta, 1
  /// is pi - theta.
  double* largest = nullptr;
};

template <std::size_t width>
struct VectorOf {
  typedef double type __attribute__((vector_size(width * sizeof(double))));
};

/// Adds a stretch of terms to one set's sums: `rows` rows from the first on, `parts` components each.
/// stored[(term * all_rows + row) * functions + f].
template <Form form, class Lanes, std::size_t all_rows, std::size_t rows, std::size_t parts>
SCATTER_KERNEL void accumulate(
    const Lanes* stored, std::size_t first_row, std::size_t first_part, const double* weights,
    std::size_t terms, Lanes (*sums)[all_rows]) {
  constexpr std::size_t functions = form == Form::axis ? 2 : 1;
  Lanes even[rows][parts], odd[rows][parts];
#pragma GCC unroll 8
  for (std::size_t r = 0; r < rows; ++r)
#pragma GCC unroll 8
    for (std::size_t c = 0; c < parts; ++c) {
      even[r][c] = sums[first_part + c][first_row + r];
      odd[r][c] = sums[4 + first_part + c][first_row + r];
    }
  // Pointers that advance: places worked out from k would cost half as many instructions as the sums.
  constexpr std::size_t term_size = all_rows * functions, of_odd = form == Form::pairs ? 0 : term_size;
  const double* of_term = weights + first_part;
  const Lanes* of_even = stored + first_row * functions;
  for (const double* const end = of_term + 4 * terms; of_term < end;
       of_term += 8, of_even += of_odd + term_size) {
#pragma GCC unroll 2
    for (std::size_t parity = 0; parity < 2; ++parity) {
      const double* const weight = of_term + 4 * parity;
      const Lanes* const function = of_even + parity * of_odd;
#pragma GCC unroll 8
      for (std::size_t c = 0; c < parts; ++c) {
        const double w = weight[c];
#pragma GCC unroll 8
        for (std::size_t r = 0; r < rows; ++r) {
          if constexpr (form == Form::axis) {
            // Weights 0 and 1 go with pi_n + tau_n, 2 and 3 with pi_n - tau_n; beyond 90 deg the other way
            // round, with alternating sign.
            const bool minus = first_part + c >= 2;
            even[r][c] += w * function[2 * r + minus];
            if (parity == 0)
              odd[r][c] += w * function[2 * r + !minus];
            else
              odd[r][c] -= w * function[2 * r + !minus];
          } else if (parity == 0) {
            even[r][c] += w * function[r];
          } else {
            odd[r][c] += w * function[r];
          }
        }
      }
    }
  }
#pragma GCC unroll 8
  for (std::size_t r = 0; r < rows; ++r)
#pragma GCC unroll 8
    for (std::size_t c = 0; c < parts; ++c) {
      sums[first_part + c][first_row + r] = even[r][c];
      sums[4 + first_part + c][first_row + r] = odd[r][c];
    }
}

/// Sums all sets at width * rows points. `parts` components of `group` rows stay in registers at a time.
/// weights: one pointer per set, four per term, padded with zeros to recurrence.count.
template <Form form, std::size_t width, std::size_t rows, std::size_t group, std::size_t parts>
SCATTER_KERNEL void
sum_points(const Recurrence& recurrence, std::span<const double* const> weights, const Points& points) {
  using Lanes = typename VectorOf<width>::type;
  constexpr std::size_t functions = form == Form::axis ? 2 : 1;
  constexpr std::size_t most_sets = 8; // what the nearest cache holds beside the stretch

  Lanes nearest[rows], nearby[rows], share[rows];
  __builtin_memcpy(nearest, points.t, sizeof nearest);
  __builtin_memcpy(nearby, points.nearby, sizeof nearby);
  __builtin_memcpy(share, points.share, sizeof share);
  for (std::size_t first_set = 0; first_set < weights.size(); first_set += most_sets) {
    const std::size_t sets = std::min(most_sets, weights.size() - first_set);
    Lanes sums[most_sets][8][rows], largest[most_sets][2][rows];
    for (std::size_t s = 0; s < sets; ++s)
      for (std::size_t r = 0; r < rows; ++r) {
        for (std::size_t c = 0; c < 8; ++c) sums[s][c][r] = Lanes{};
        largest[s][0][r] = largest[s][1][r] = Lanes{};
      }
    Lanes q[rows], e[rows], owed[rows];
    for (std::size_t r = 0; r < rows; ++r) {
      q[r] = Lanes{} + 0.5;
      e[r] = owed[r] = Lanes{};
    }
    Lanes stored[longest_stretch * rows * functions];
    for (std::size_t first = 0; first < recurrence.count; first += recurrence.stretch) {
      const std::size_t terms = std::min(recurrence.stretch, recurrence.count - first);
      // t's own rounding would turn every partial wave the same way; it takes turns with its
      // neighbour so that on average both make the true value.
      Lanes t[rows], q_n[rows], e_n[rows];
#pragma GCC unroll 8
      for (std::size_t r = 0; r < rows; ++r) {
        owed[r] += share[r];
        t[r] = owed[r] >= 0.5 ? nearby[r] : nearest[r];
        owed[r] -= owed[r] >= 0.5 ? Lanes{} + 1 : Lanes{};
        q_n[r] = q[r];
        e_n[r] = e[r];
      }
      constexpr std::size_t together = form == Form::pairs ? 2 : 1; // n per step
      for (std::size_t k = 0; k < terms / together; ++k) {
        const double e_weight = recurrence.e_weight[first / together + k];
        const double q_weight = recurrence.q_weight[first / together + k];
#pragma GCC unroll 8
        for (std::size_t r = 0; r < rows; ++r) {
          if constexpr (form == Form::axis) {
            const Lanes minus = (recurrence.minus_weight[first + k] * t[r]) * q_n[r] + e_n[r];
            stored[(k * rows + r) * 2] = recurrence.plus_weight[first + k] * q_n[r] - minus;
            stored[(k * rows + r) * 2 + 1] = minus;
          } else {
            stored[k * rows + r] = q_n[r];
          }
          e_n[r] += (e_weight * t[r]) * q_n[r];
          q_n[r] += q_weight * e_n[r];
        }
      }
#pragma GCC unroll 8
      for (std::size_t r = 0; r < rows; ++r) {
        q[r] = q_n[r];
        e[r] = e_n[r];
      }
      for (std::size_t s = 0; s < sets; ++s) {
        const double* const w = weights[first_set + s] + 4 * first;
        for (std::size_t row = 0; row < rows; row += group)
          for (std::size_t part = 0; part < 4; part += parts)
            accumulate<form, Lanes, rows, group, parts>(stored, row, part, w, terms, sums[s]);
        // Otherwise the caller knows a bound that costs less.
        if constexpr (form != Form::axis) continue;
        for (std::size_t r = 0; r < rows; ++r) {
          Lanes low{}, high{};
#pragma GCC unroll 4
          for (std::size_t c = 0; c < 4; ++c) {
            low += sums[s][c][r] * sums[s][c][r];
            high += sums[s][c + 4][r] * sums[s][c + 4][r];
          }
          largest[s][0][r] = low > largest[s][0][r] ? low : largest[s][0][r];
          largest[s][1][r] = high > largest[s][1][r] ? high : largest[s][1][r];
        }
      }
    }
    constexpr std::size_t all = width * rows;
    for (std::size_t s = 0; s < sets; ++s) {
      __builtin_memcpy(points.sums + (first_set + s) * 8 * all, sums[s], sizeof sums[s]);
      __builtin_memcpy(points.largest + (first_set + s) * 2 * all, largest[s], sizeof largest[s]);
    }
  }
}

/// Some rows on their way through the sum of one set.
template <std::size_t width, std::size_t rows>
struct Course {
  typename VectorOf<width>::type nearest[rows], nearby[rows], share[rows], owed[rows], q[rows], e[rows],
      sums[2][4][rows];
};

/// Takes a course from the term number `first` to `last`, not Form::axis, where registers hold all of it.
template <Form form, std::size_t width, std::size_t rows>
SCATTER_KERNEL void advance(
    Course<width, rows>& course, const Recurrence& recurrence, const double* weights, std::size_t first,
    std::size_t last) {
  static_assert(form != Form::axis);
  using Lanes = typename VectorOf<width>::type;
  Lanes sums[2][4][rows], q[rows], e[rows];
  __builtin_memcpy(sums, course.sums, sizeof sums);
  __builtin_memcpy(q, course.q, sizeof q);
  __builtin_memcpy(e, course.e, sizeof e);
  constexpr std::size_t together = form == Form::pairs ? 2 : 1; // n per step
  const double *weight = weights + 4 * first, *e_weight = recurrence.e_weight + first / together,
               *q_weight = recurrence.q_weight + first / together;
  for (; first < last; first += recurrence.stretch) {
    const double* const end = weight + 4 * std::min(recurrence.stretch, last - first);
    Lanes t[rows];
#pragma GCC unroll 8
    for (std::size_t r = 0; r < rows; ++r) {
      course.owed[r] += course.share[r];
      t[r] = course.owed[r] >= 0.5 ? course.nearby[r] : course.nearest[r];
      course.owed[r] -= course.owed[r] >= 0.5 ? Lanes{} + 1 : Lanes{};
    }
    // The recurrence goes first: the next step waits for it, but not for the sums.
    for (; weight != end; weight += 8) {
      Lanes next[rows];
#pragma GCC unroll 2
      for (std::size_t parity = 0; parity < 2; ++parity) {
        if (form != Form::pairs || parity == 0) {
          const double to_e = *e_weight++, to_q = *q_weight++;
#pragma GCC unroll 8
          for (std::size_t r = 0; r < rows; ++r) {
            e[r] += (to_e * t[r]) * q[r];
            next[r] = q[r] + to_q * e[r];
          }
        }
#pragma GCC unroll 4
        for (std::size_t c = 0; c < 4; ++c) {
          const double w = weight[4 * parity + c];
#pragma GCC unroll 8
          for (std::size_t r = 0; r < rows; ++r) sums[parity][c][r] += w * q[r];
        }
        if (form == Form::pairs && parity == 0) continue;
#pragma GCC unroll 8
        for (std::size_t r = 0; r < rows; ++r) q[r] = next[r];
      }
    }
  }
  __builtin_memcpy(course.sums, sums, sizeof sums);
  __builtin_memcpy(course.q, q, sizeof q);
  __builtin_memcpy(course.e, e, sizeof e);
}

/// As sum_points, the same bits, for one set and not Form::axis: `group` rows at a time, which take turns
/// after some hundred terms, so that weights come from the nearest caches for all but the first.
template <Form form, std::size_t width, std::size_t rows, std::size_t group>
SCATTER_KERNEL void sum_one_set(const Recurrence& recurrence, const double* weights, const Points& points) {
  using Lanes = typename VectorOf<width>::type;
  constexpr std::size_t groups = rows / group, all = width * rows;
  const std::size_t turn = 16 * recurrence.stretch;
  Course<width, group> courses[groups];
  for (std::size_t g = 0; g < groups; ++g) {
    Course<width, group>& course = courses[g];
    __builtin_memcpy(course.nearest, points.t + g * group * width, sizeof course.nearest);
    __builtin_memcpy(course.nearby, points.nearby + g * group * width, sizeof course.nearby);
    __builtin_memcpy(course.share, points.share + g * group * width, sizeof course.share);
    for (std::size_t r = 0; r < group; ++r) {
      for (std::size_t c = 0; c < 4; ++c) course.sums[0][c][r] = course.sums[1][c][r] = Lanes{};
      course.q[r] = Lanes{} + 0.5;
      course.e[r] = course.owed[r] = Lanes{};
    }
  }
  for (std::size_t first = 0; first < recurrence.count; first += turn)
    for (auto& course : courses)
      advance<form>(course, recurrence, weights, first, std::min(first + turn, recurrence.count));
  for (std::size_t g = 0; g < groups; ++g)
    for (std::size_t c = 0; c < 8; ++c)
      __builtin_memcpy(
          points.sums + c * all + g * group * width, courses[g].sums[c / 4][c % 4],
          sizeof courses[g].sums[c / 4][c % 4]);
}

#undef SCATTER_KERNEL

} // namespace scatter::exact::kernel
