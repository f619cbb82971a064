// Angles beyond 90 deg are mirrored, and an angle is summed together with its mirror image. See
// partial_wave_kernel.hpp and fourier_sum.cpp for the sums themselves; here they are prepared and shared out.

#include <scatter/exact/fourier_sum.hpp>
#include <scatter/exact/partial_wave_kernel.hpp>
#include <scatter/exact/partial_waves.hpp>
#include <scatter/exact/vector_clones.hpp>
#include <scatter/optics/errors.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <numbers>
#include <numeric>
#include <optional>
#include <sstream>
#include <system_error>
#include <thread>

namespace scatter::exact {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon() / 2;

constexpr long double pi = std::numbers::pi_v<long double>;
constexpr double per_degree = 1e6; ///< six decimal places

struct FoldedCosine {
  double t, t_rest;
};

FoldedCosine from_half_sine(long double half) {
  const long double t = 2 * half * half;
  const auto rounded = static_cast<double>(t);
  return {rounded, static_cast<double>(t - static_cast<long double>(rounded))};
}

/// Sines of the halves of an even grid's angles, from two short tables by the addition theorem, whose terms
/// are positive: a long double sine takes longer than a hundred partial waves.
class HalfSines {
public:
  /// Multiples of `step` up to half a right angle's double.
  HalfSines(long double step, std::size_t count) {
    while ((std::size_t{1} << 2 * bits_) < count) ++bits_;
    const std::size_t fine = std::size_t{1} << bits_;
    for (std::size_t i = 0; i < fine; ++i) fine_table_.push_back(at(static_cast<long double>(i) * step / 2));
    for (std::size_t i = 0; i < count; i += fine)
      coarse_table_.push_back(at(static_cast<long double>(i) * step / 2));
  }
  [[nodiscard]] long double operator()(std::size_t multiple) const {
    const auto &a = coarse_table_[multiple >> bits_],
               &b = fine_table_[multiple & ((std::size_t{1} << bits_) - 1)];
    return a.sine * b.cosine + a.cosine * b.sine;
  }

private:
  struct Pair {
    long double sine, cosine;
  };
  static Pair at(long double angle) { return {std::sin(angle), std::cos(angle)}; }
  std::size_t bits_ = 0; ///< of a multiple that the fine table takes
  std::vector<Pair> fine_table_, coarse_table_;
};

constexpr auto right_angle = static_cast<std::int32_t>(90 * per_degree);

/// The angles [deg] in millionths, if they are an even grid of decimals; no places otherwise.
struct DecimalGrid {
  std::vector<std::int32_t> places;
  std::int32_t unit = 0; ///< all places and the right angle are multiples of it
};

/// Whether all angles within 0..180 are doubles next to decimals with six places, which are written to
/// `places`.
SCATTER_VECTOR_CLONES
bool decimal_places(const double* degrees, std::size_t count, std::int32_t* places) {
  int others = 0;
  for (std::size_t i = 0; i < count; ++i) {
    places[i] = static_cast<std::int32_t>(degrees[i] * per_degree + 0.5);
    // A quotient of two exact numbers is the double next to it.
    others |= static_cast<double>(places[i]) / per_degree != degrees[i];
  }
  return others == 0;
}

/// Least and largest.
SCATTER_VECTOR_CLONES
std::pair<std::int32_t, std::int32_t> range_of(const std::int32_t* numbers, std::size_t count) {
  std::int32_t least = numbers[0], most = numbers[0];
  for (std::size_t i = 1; i < count; ++i) {
    least = std::min(least, numbers[i]);
    most = std::max(most, numbers[i]);
  }
  return {least, most};
}

/// What decimals have on top of the doubles next to them [deg].
SCATTER_VECTOR_CLONES
void decimal_rests(const double* degrees, const std::int32_t* places, std::size_t count, double* rests) {
  for (std::size_t i = 0; i < count; ++i) {
    const double scaled = degrees[i] * per_degree, scaled_rest = std::fma(degrees[i], per_degree, -scaled);
    rests[i] = ((static_cast<double>(places[i]) - scaled) - scaled_rest) / per_degree;
  }
}

DecimalGrid decimal_grid(std::span<const double> degrees) {
  if (degrees.size() < 3) return {};
  std::vector<std::int32_t> places(degrees.size());
  if (!decimal_places(degrees.data(), degrees.size(), places.data())) return {};
  const auto [first, most] = range_of(places.data(), places.size());
  const std::int32_t wide = most - first;
  const auto steps = static_cast<std::int64_t>(degrees.size()) - 1;
  const auto step = static_cast<std::int32_t>(wide / steps);
  if (step == 0 || step * steps != wide) return {};
  const std::int32_t unit = std::gcd(std::gcd(step, first), right_angle);
  // Most grids ascend.
  bool ascends = true;
  for (std::size_t i = 0; i < places.size(); ++i)
    ascends &= places[i] == first + static_cast<std::int32_t>(i) * step;
  if (ascends) return {std::move(places), unit};
  std::vector<bool> seen(degrees.size());
  for (const std::int32_t place : places) {
    const std::int32_t index = (place - first) / step;
    if (index * step != place - first || seen[index]) return {};
    seen[index] = true;
  }
  return {std::move(places), unit};
}

/// 1 - cos of all multiples of `unit` up to the right angle, kept for the next call: averages ask for the
/// same angles thousands of times.
std::shared_ptr<const std::vector<FoldedCosine>> folded_cosines(std::int32_t unit) {
  struct Kept {
    std::int32_t unit = 0;
    std::shared_ptr<const std::vector<FoldedCosine>> values;
  };
  constexpr std::size_t most_kept = 100'000;
  static std::mutex mutex;
  static Kept kept;
  {
    const std::lock_guard lock(mutex);
    if (kept.unit == unit) return kept.values;
  }
  const auto count = static_cast<std::size_t>(right_angle / unit) + 1;
  const long double radians = pi / (2 * static_cast<long double>(right_angle));
  const HalfSines half_sine(static_cast<long double>(unit) * radians, count);
  std::vector<FoldedCosine> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = from_half_sine(half_sine(i));
  auto result = std::make_shared<const std::vector<FoldedCosine>>(std::move(values));
  if (count > most_kept) return result;
  const std::lock_guard lock(mutex);
  kept = {unit, result};
  return result;
}

using kernel::Form;

constexpr double pairs_from = 0.0014, steps_from = 0.5; ///< t at 3 deg, at 60 deg
constexpr std::size_t form_count = 3;

Form form_at(double t) {
  return t < pairs_from ? Form::axis : t < steps_from ? Form::pairs : Form::steps;
}

// One instance of the loops per instruction set, chosen when they are called. Batches of 1, 3 or 6 rows.
constexpr std::size_t most_rows = 6;
using Sum = void (*)(
    Form, std::size_t rows, const kernel::Recurrence&, std::span<const double* const>, const kernel::Points&);

template <Form form, std::size_t width, std::size_t rows, std::size_t parts>
[[gnu::always_inline]] inline void sum_rows(
    const kernel::Recurrence& recurrence, std::span<const double* const> weights,
    const kernel::Points& points) {
  constexpr std::size_t group = rows == 1 ? 1 : form == Form::axis && parts == 2 ? rows / 3 : 3;
  // 32 registers.
  if constexpr (form != Form::axis && parts == 4 && rows > 1)
    if (weights.size() == 1) {
      kernel::sum_one_set<form, width, rows, 3>(recurrence, weights[0], points);
      return;
    }
  kernel::sum_points<form, width, rows, group, parts>(recurrence, weights, points);
}

template <std::size_t width, std::size_t parts>
[[gnu::always_inline]] inline void sum_form(
    Form form, std::size_t rows, const kernel::Recurrence& recurrence, std::span<const double* const> weights,
    const kernel::Points& points) {
  const auto with_rows = [&]<Form chosen>() __attribute__((always_inline)) {
    if (rows == 1)
      sum_rows<chosen, width, 1, parts>(recurrence, weights, points);
    else if (rows == 3)
      sum_rows<chosen, width, 3, parts>(recurrence, weights, points);
    else
      sum_rows<chosen, width, most_rows, parts>(recurrence, weights, points);
  };
  if (form == Form::axis)
    with_rows.template operator()<Form::axis>();
  else if (form == Form::pairs)
    with_rows.template operator()<Form::pairs>();
  else
    with_rows.template operator()<Form::steps>();
}

#if defined(__x86_64__) && defined(__GNUC__)
#define SCATTER_X86_VECTORS 1
// 32 registers hold the sums of three rows, 16 those of S1 or S2 alone.
__attribute__((target("avx512f,avx512dq,fma"))) void sum_avx512(
    Form form, std::size_t rows, const kernel::Recurrence& recurrence, std::span<const double* const> weights,
    const kernel::Points& points) {
  sum_form<8, 4>(form, rows, recurrence, weights, points);
}
__attribute__((target("avx2,fma"))) void sum_avx2(
    Form form, std::size_t rows, const kernel::Recurrence& recurrence, std::span<const double* const> weights,
    const kernel::Points& points) {
  sum_form<4, 2>(form, rows, recurrence, weights, points);
}
#else
#define SCATTER_X86_VECTORS 0
#endif
void sum_plain(
    Form form, std::size_t rows, const kernel::Recurrence& recurrence, std::span<const double* const> weights,
    const kernel::Points& points) {
  sum_form<2, 2>(form, rows, recurrence, weights, points);
}

Sum sum_of(const VectorUnit& unit) {
#if SCATTER_X86_VECTORS
  if (unit.width == 8) return sum_avx512;
  if (unit.width == 4) return sum_avx2;
#endif
  (void)unit;
  return sum_plain;
}

/// What depends on n alone; index 0 is n = 1, and 0 for those that start at n = 0.
struct Tables {
  explicit Tables(std::size_t count);

  std::size_t count;
  std::vector<double> e_weight, q_weight, minus_weight, plus_weight;
  // Index k is n = 2k + 1.
  std::vector<double> pairs_e_weight, pairs_q_weight;
  std::vector<double> pairs_below, pairs_above; ///< (n+1) / (2n-1) and n / (2n+3): shares of even n's weights
  std::vector<double> product;                  ///< n (n+1), by which pi_n = product q_n
  std::vector<double> below, above;             ///< n^2 / (2n+1) and (n+1)^2 / (2n+1), from n = 0 on
};

Tables::Tables(std::size_t size) : count(size) {
  const auto table = [&](std::vector<double>& values, std::size_t length, double first, auto value) {
    values.resize(length);
    for (std::size_t k = 0; k < length; ++k) values[k] = value(static_cast<double>(k) + first);
  };
  table(e_weight, count, 1, [](double n) { return (2 * n + 1) * n * (n + 1); });
  table(q_weight, count, 1, [](double n) { return -1 / (n * (n + 1) * (n + 2)); });
  const auto pairs_table = [&](std::vector<double>& values, auto value) {
    table(values, count / 2 + 2, 0.5, [&](double half) { return value(2 * half); });
  };
  pairs_table(pairs_e_weight, [](double n) { return (2 * n + 1) * n * (n + 1); });
  pairs_table(pairs_q_weight, [](double n) { return -(2 * n + 3) / (n * (n + 1) * (n + 2) * (n + 3)); });
  pairs_table(pairs_below, [](double n) { return (n + 1) / (2 * n - 1); });
  pairs_table(pairs_above, [](double n) { return n / (2 * n + 3); });
  table(minus_weight, count, 1, [](double n) { return n * n * (n + 1); });
  table(plus_weight, count, 1, [](double n) { return 2 * n * (n + 1); });
  table(product, count, 1, [](double n) { return n * (n + 1); });
  table(below, count + 2, 0, [](double n) { return n * n / (2 * n + 1); });
  table(above, count + 2, 0, [](double n) { return (n + 1) * (n + 1) / (2 * n + 1); });
}

/// Tables for `count` terms or more. Kept for the next call while they are small: averages ask for thousands
/// of spheres.
std::shared_ptr<const Tables> tables_for(std::size_t count) {
  constexpr std::size_t most_kept = 60000;
  if (count > most_kept) return std::make_shared<const Tables>(count);
  static std::mutex mutex;
  static std::shared_ptr<const Tables> kept;
  const std::lock_guard lock(mutex);
  if (!kept || kept->count < count)
    kept = std::make_shared<const Tables>(std::min(most_kept, std::max<std::size_t>(256, 2 * count)));
  return kept;
}

/// Weights of q_n = pi_n / (n (n+1)) alone: S1 = sum c1_n q_n, S2 = sum c2_n q_n, four numbers per n,
/// padded to `count`.
std::vector<double> weights_of_q(const PartialWaves& waves, std::size_t count, const Tables& tables) {
  // w a_n = plus + minus goes with pi_n in S1 and w b_n = plus - minus with tau_n = (n^2 pi_{n+1} - (n+1)^2
  // pi_{n-1}) / (2n+1); in S2 the other way round.
  struct Pair { // w a_n and w b_n
    kernel::VectorOf<2>::type a, b;
  };
  const double* const given = waves.weights().data();
  const std::size_t given_count = waves.count();
  const auto load = [&](std::size_t n, Pair& pair) {
    kernel::VectorOf<2>::type plus{}, minus{};
    if (n <= given_count) {
      __builtin_memcpy(&plus, given + 4 * (n - 1), sizeof plus);
      __builtin_memcpy(&minus, given + 4 * (n - 1) + 2, sizeof minus);
    }
    pair.a = plus + minus;
    pair.b = plus - minus;
  };
  std::vector<double> weights(4 * count);
  Pair before{}, own, after;
  load(1, own);
  for (std::size_t n = 1; n <= count; ++n) {
    load(n + 1, after);
    const double scale = tables.product[n - 1], below = scale * tables.below[n - 1],
                 above = scale * tables.above[n + 1];
    const auto first = scale * own.a + (below * before.b - above * after.b);
    const auto second = scale * own.b + (below * before.a - above * after.a);
    __builtin_memcpy(weights.data() + 4 * (n - 1), &first, sizeof first);
    __builtin_memcpy(weights.data() + 4 * (n - 1) + 2, &second, sizeof second);
    before = own;
    own = after;
  }
  return weights;
}

/// Sums over n of n^3 |w|^2, as each of four weights w has it, n = first + 1 on.
SCATTER_VECTOR_CLONES
double cubic_sum(const double* weights, std::size_t count) {
  using Eight = double __attribute__((vector_size(64)));
  Eight sum{}, n{1, 2, 3, 4, 5, 6, 7, 8};
  std::size_t k = 0;
  for (; k + 8 <= count; k += 8) {
    const Eight factor = n * (n + 1) / (2 * n + 1), cube = n * factor * factor;
    Eight weight[4], square{};
    __builtin_memcpy(weight, weights + 4 * k, sizeof weight);
    square += __builtin_shufflevector(cube, cube, 0, 0, 0, 0, 1, 1, 1, 1) * (weight[0] * weight[0]);
    square += __builtin_shufflevector(cube, cube, 2, 2, 2, 2, 3, 3, 3, 3) * (weight[1] * weight[1]);
    square += __builtin_shufflevector(cube, cube, 4, 4, 4, 4, 5, 5, 5, 5) * (weight[2] * weight[2]);
    square += __builtin_shufflevector(cube, cube, 6, 6, 6, 6, 7, 7, 7, 7) * (weight[3] * weight[3]);
    sum += square;
    n += 8;
  }
  double total = 0;
  for (std::size_t i = 0; i < 8; ++i) total += sum[i];
  for (; k < count; ++k) {
    const double order = static_cast<double>(k + 1), factor = order * (order + 1) / (2 * order + 1);
    for (std::size_t part = 0; part < 4; ++part) {
      const double weight = factor * weights[4 * k + part];
      total += order * weight * weight;
    }
  }
  return total;
}

/// Weights of odd n for Form::pairs, from those of all n, `count` of them: at odd n as they are, at n + 1
/// those that make cos(theta) times the sum over even n.
SCATTER_VECTOR_CLONES
void pairs_from_all(const double* all, std::size_t count, const Tables& tables, double* weights) {
  using Four = double __attribute__((vector_size(32)));
  Four below{}, own{}, above{};
  for (std::size_t k = 0; k < count + 2; k += 2) {
    own = above = Four{};
    if (k < count) {
      __builtin_memcpy(&own, all + 4 * k, sizeof own);
      __builtin_memcpy(&above, all + 4 * (k + 1), sizeof above);
    }
    const Four even = tables.pairs_below[k / 2] * below + tables.pairs_above[k / 2] * above;
    __builtin_memcpy(weights + 4 * k, &own, sizeof own);
    __builtin_memcpy(weights + 4 * (k + 1), &even, sizeof even);
    below = above;
  }
}

std::vector<double>
weights_of_pairs(const std::vector<double>& all, std::size_t count, const Tables& tables) {
  std::vector<double> weights(4 * (count + 2));
  pairs_from_all(all.data(), count, tables, weights.data());
  return weights;
}

/// sum n (|a_n|^2 + |b_n|^2)
double size_of_coefficients(const PartialWaves& waves) {
  return 2 * cubic_sum(waves.weights().data(), waves.count()); // |a + b|^2 + |a - b|^2 is twice the sum
}

/// An angle of the forward half and the angles of the list that it stands for.
struct Point {
  double t, t_rest;
  std::size_t first, last; ///< of the sorted list
};

/// A list of angles, sorted by t.
struct SortedAngles {
  std::vector<std::size_t> order; ///< indices of the angles
  std::vector<Point> points;      ///< without repetition
};

SortedAngles sorted_by_t(std::span<const Angle> angles) {
  // In the order of theta, which most lists have; so t ascends from the beginning and from the end.
  std::vector<std::size_t> by_theta;
  const auto less = [](const Angle& a, const Angle& b) { return a.theta < b.theta; };
  const bool ascends = std::is_sorted(angles.begin(), angles.end(), less);
  if (!ascends) {
    by_theta.resize(angles.size());
    std::iota(by_theta.begin(), by_theta.end(), std::size_t{0});
    std::sort(by_theta.begin(), by_theta.end(), [&](std::size_t i, std::size_t j) {
      return angles[i].theta != angles[j].theta ? angles[i].theta < angles[j].theta : i < j;
    });
  }
  const auto index = [&](std::size_t rank) { return ascends ? rank : by_theta[rank]; };
  SortedAngles sorted;
  sorted.order.resize(angles.size());
  sorted.points.resize(angles.size());
  std::size_t points = 0, first = 0, last = angles.size();
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const Angle &front = angles[index(first)], &back = angles[index(last - 1)];
    const bool take_front = !front.backward && (!back.backward || front.t < back.t ||
                                                (front.t == back.t && front.t_rest <= back.t_rest));
    const Angle& angle = take_front ? front : back;
    sorted.order[i] = take_front ? index(first++) : index(--last);
    if (points == 0 || sorted.points[points - 1].t != angle.t ||
        sorted.points[points - 1].t_rest != angle.t_rest)
      sorted.points[points++] = {angle.t, angle.t_rest, i, i};
    sorted.points[points - 1].last = i + 1;
  }
  sorted.points.resize(points);
  return sorted;
}

/// Points of one form that are summed together.
struct Batch {
  Form form;
  std::size_t first, count, rows;
};

} // namespace

std::vector<Angle> fold_angles(std::span<const double> angles, AngleUnit unit) {
  const bool degrees = unit == AngleUnit::degree;
  // The half turn in the unit of the angles, exactly or as near as a double comes.
  const double half_turn = degrees ? 180 : std::numbers::pi;
  for (const double angle : angles)
    if (!(angle >= 0 && angle <= half_turn)) {
      const char* const name = degrees ? "deg" : "rad";
      std::ostringstream message;
      message << "scattering angle " << angle << ' ' << name << " is outside 0.." << half_turn << ' ' << name;
      throw InputError(message.str());
    }
  std::vector<Angle> folded;
  if (const DecimalGrid grid = degrees ? decimal_grid(angles) : DecimalGrid{}; !grid.places.empty()) {
    // Exactly: each 1e-18 deg turns a partial wave of n = 5e4 by 1e-15.
    std::vector<double> rests(angles.size());
    decimal_rests(angles.data(), grid.places.data(), angles.size(), rests.data());
    const auto units = static_cast<std::size_t>(right_angle / grid.unit);
    // Tables are worth it where they are shorter than the list.
    const bool all = units < angles.size(),
               tables = 2 * std::sqrt(static_cast<double>(units)) < static_cast<double>(angles.size());
    const auto cosines = all ? folded_cosines(grid.unit) : nullptr;
    const long double radians = pi / (2 * static_cast<long double>(right_angle));
    const HalfSines half_sine(static_cast<long double>(grid.unit) * radians, tables && !all ? units + 1 : 1);
    const double per_unit = 1 / static_cast<double>(grid.unit);
    const FoldedCosine* const table = all ? cosines->data() : nullptr;
    folded.resize(angles.size());
    Angle* const to = folded.data();
    const std::int32_t* const places = grid.places.data();
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const std::int32_t place = places[i];
      const bool backward = place > right_angle;
      const std::int32_t forward = backward ? 2 * right_angle - place : place;
      const auto multiple = static_cast<std::size_t>(static_cast<std::int32_t>(forward * per_unit + 0.5));
      const FoldedCosine cosine =
          table
              ? table[multiple]
              : from_half_sine(
                    tables ? half_sine(multiple) : std::sin(static_cast<long double>(forward) * radians / 2));
      to[i] = {cosine.t, cosine.t_rest, angles[i], rests[i], place, unit, backward};
    }
    return folded;
  }
  folded.reserve(angles.size());
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const auto given = static_cast<long double>(angles[i]);
    const bool backward = angles[i] > half_turn / 2;
    const long double theta =
        degrees ? (backward ? 180 - given : given) * (pi / 180) : (backward ? pi - given : given);
    const auto [t, t_rest] = from_half_sine(std::sin(std::max<long double>(theta, 0) / 2));
    folded.push_back({t, t_rest, angles[i], 0, -1, unit, backward});
  }
  return folded;
}

std::vector<std::vector<std::size_t>> blocks_of_one_half(std::span<const Angle> angles, std::size_t size) {
  std::vector<std::vector<std::size_t>> blocks;
  for (const bool backward : {false, true}) {
    bool open = false;
    for (std::size_t i = 0; i < angles.size(); ++i) {
      if (angles[i].backward != backward) continue;
      if (!open) blocks.emplace_back();
      blocks.back().push_back(i);
      open = blocks.back().size() < size;
    }
  }
  return blocks;
}

namespace {

std::vector<AngleSums> empty_sums(std::size_t sets, std::size_t angles) {
  std::vector<AngleSums> sums(sets);
  for (auto& sum : sums) {
    sum.S1.resize(angles);
    sum.S2.resize(angles);
    sum.largest_partial.resize(angles);
    sum.rounding.resize(angles);
  }
  return sums;
}

/// Square of what partial sums come to at an angle: n^2 pi_n^2 sin(theta)^2 and tau_n^2 are n^3 / (pi
/// sin(theta)) on average, and partial sums come to about half the root of the sum of all squares.
double typical_partial(double size, double sine) {
  return size * 0.5 / (sine * std::numbers::pi);
}

/// What kernel::Points takes of t, or of y = t (2 - t).
SCATTER_VECTOR_CLONES
void prepare(
    Form form, std::size_t count, const double* t, const double* t_rest, double* variable, double* nearby,
    double* share) {
  const double one = form == Form::pairs ? 1 : 0;
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) {
    // Exactly: y is between 3/2 t and 2t.
    const double twice = (1 + one) * t[i], factor = -one * t[i];
    variable[i] = std::fma(factor, t[i], twice);
    const double rest = std::fma(factor, t[i], twice - variable[i]) + (1 + one) * (1 + factor) * t_rest[i];
    nearby[i] = variable[i] * (1 + std::copysign(2 * epsilon, rest)); // one place away or two
    const double gap = nearby[i] - variable[i];
    share[i] = gap == 0 ? 0 : rest / gap;
  }
}

/// What becomes of a batch's sums, per point: real and imaginary parts of S1 and S2, largest_partial and
/// rounding, of theta and of pi - theta.
enum Finished : std::size_t { S1_re, S1_im, S2_re, S2_im, partial, rounding_error, finished_size };

/// How the error of a direct sum is judged.
struct Judgement {
  double size = 0;     ///< of the coefficients
  double rounding = 0; ///< sum_rounding
};

/// finished[(side * finished_size + what) * count + point].
SCATTER_VECTOR_CLONES
void finish(
    Form form, const kernel::Points& points, const double* t, std::size_t count, const Judgement& judgement,
    double* finished) {
  double* const forward = finished;
  double* const backward = finished + finished_size * count;
  const double* const low = points.sums;
  double* const high = points.sums + 4 * count;
  if (form == Form::axis) {
#pragma GCC ivdep
    for (std::size_t i = 0; i < 2 * count; ++i) {
      forward[i] = low[i] + low[i + 2 * count];
      forward[i + 2 * count] = low[i] - low[i + 2 * count];
      backward[i] = high[i] + high[i + 2 * count];
      backward[i + 2 * count] = high[i] - high[i + 2 * count];
    }
    for (std::size_t i = 0; i < count; ++i) {
      forward[partial * count + i] = points.largest[i];
      backward[partial * count + i] = points.largest[count + i];
    }
  } else {
    if (form == Form::pairs)
      for (std::size_t i = 0; i < count; ++i) {
        const double inverse = 1 / (1 - t[i]);
        for (std::size_t c = 0; c < 4; ++c) high[c * count + i] *= inverse;
      }
#pragma GCC ivdep
    for (std::size_t i = 0; i < 4 * count; ++i) {
      forward[i] = low[i] + high[i];
      backward[i] = low[i] - high[i];
    }
    const double four = 4 * epsilon / judgement.rounding, per_pi = std::numbers::inv_pi;
#pragma GCC ivdep
    for (std::size_t i = 0; i < count; ++i) {
      double square = 0;
      for (std::size_t c = 0; c < 4; ++c)
        square += low[c * count + i] * low[c * count + i] + high[c * count + i] * high[c * count + i];
      // The weights of pi_n are differences of coefficients, which may be much larger: pi_n^2 is n / (pi
      // sin(theta)^3), and 4 roundings.
      const double sine = std::sqrt(t[i] * (2 - t[i])), share = judgement.size * per_pi / sine;
      square += 0.5 * share + share * four * four / (sine * sine);
      forward[partial * count + i] = backward[partial * count + i] = square;
    }
  }
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) {
    forward[rounding_error * count + i] = judgement.rounding * std::sqrt(forward[partial * count + i]);
    backward[rounding_error * count + i] = judgement.rounding * std::sqrt(backward[partial * count + i]);
  }
}

std::vector<AngleSums> sum_directly(
    std::span<const PartialWaves> sets, std::span<const Angle> angles, int threads, const VectorUnit& unit) {
  auto sums = empty_sums(sets.size(), angles.size());
  if (sets.empty() || angles.empty()) return sums;

  const SortedAngles sorted = sorted_by_t(angles);
  const auto& order = sorted.order;
  const auto& points = sorted.points;
  std::vector<Batch> batches;
  bool used[form_count] = {};
  for (std::size_t first = 0; first < points.size();) {
    const Form form = form_at(points[first].t);
    std::size_t last = first + 1;
    while (last < points.size() && last < first + most_rows * unit.width && form_at(points[last].t) == form)
      ++last;
    used[static_cast<std::size_t>(form)] = true;
    batches.push_back({form, first, last - first, most_rows});
    first = last;
  }
  // Those that are not full take no more rows than they need.
  double cost = 0;
  for (std::size_t i = 0; i < batches.size(); ++i) {
    const std::size_t rows = (batches[i].count + unit.width - 1) / unit.width;
    batches[i].rows = rows > 4 ? most_rows : rows > 1 ? 3 : 1;
    cost += static_cast<double>(batches[i].rows);
    const std::size_t places = batches[i].rows * unit.width;
    if (batches[i].count <= places) continue;
    const Batch rest{batches[i].form, batches[i].first + places, batches[i].count - places, 1};
    batches[i].count = places;
    batches.insert(batches.begin() + static_cast<std::ptrdiff_t>(i) + 1, rest);
  }

  // tau_N reaches to pi_{N+1}.
  const std::size_t count = (sets[0].count() + 2) / 2 * 2;
  const auto tables = tables_for(count);
  // Axis sums are looked at after each stretch.
  const std::size_t stretch = std::clamp<std::size_t>(count / 64 * 2, 4, kernel::longest_stretch);
  const kernel::Recurrence steps{
      tables->e_weight.data(),
      tables->q_weight.data(),
      tables->minus_weight.data(),
      tables->plus_weight.data(),
      count,
      stretch};
  const kernel::Recurrence pairs{
      tables->pairs_e_weight.data(), tables->pairs_q_weight.data(), nullptr, nullptr, count + 2, stretch};
  std::vector<std::vector<double>> weights[form_count];
  std::vector<const double*> weights_of[form_count];
  const auto is_used = [&](Form form) { return used[static_cast<std::size_t>(form)]; };
  const auto weights_for = [&](Form form) -> auto& {
    return weights[static_cast<std::size_t>(form)];
  };
  for (const auto& set : sets) {
    if (is_used(Form::axis)) {
      auto& of_axis = weights_for(Form::axis);
      of_axis.emplace_back(set.weights().begin(), set.weights().end());
      of_axis.back().resize(4 * count);
    }
    if (!is_used(Form::pairs) && !is_used(Form::steps)) continue;
    auto of_q = weights_of_q(set, count, *tables);
    if (is_used(Form::pairs)) weights_for(Form::pairs).push_back(weights_of_pairs(of_q, count, *tables));
    if (is_used(Form::steps)) weights_for(Form::steps).push_back(std::move(of_q));
  }
  std::vector<Judgement> judgements;
  for (const auto& set : sets) judgements.push_back({size_of_coefficients(set), sum_rounding(set.count())});
  for (std::size_t form = 0; form < form_count; ++form)
    for (const auto& weight : weights[form]) weights_of[form].push_back(weight.data());

  const Sum sum_batch = sum_of(unit);
  const auto work = [&](std::size_t item) {
    const Batch& batch = batches[item];
    const std::size_t lanes = batch.rows * unit.width;
    std::vector<double> memory((5 + 10 * sets.size() + 2 * finished_size) * lanes);
    double* const t = memory.data();
    double* const t_rest = t + lanes;
    double* const variable = t_rest + lanes;
    double* const nearby = variable + lanes;
    double* const share = nearby + lanes;
    double* const sum = share + lanes;
    double* const largest = sum + 8 * sets.size() * lanes;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      // A batch that is not full repeats a point.
      const Point& point = points[batch.first + std::min(lane, batch.count - 1)];
      t[lane] = point.t;
      t_rest[lane] = point.t_rest;
    }
    prepare(batch.form, lanes, t, t_rest, variable, nearby, share);
    const auto form = static_cast<std::size_t>(batch.form);
    sum_batch(
        batch.form, batch.rows, batch.form == Form::pairs ? pairs : steps, weights_of[form],
        {variable, nearby, share, sum, largest});
    double* const finished = largest + 2 * sets.size() * lanes;
    for (std::size_t set = 0; set < sets.size(); ++set) {
      const kernel::Points found{variable, nearby, share, sum + 8 * set * lanes, largest + 2 * set * lanes};
      finish(batch.form, found, t, lanes, judgements[set], finished);
      for (std::size_t lane = 0; lane < batch.count; ++lane) {
        const Point& point = points[batch.first + lane];
        for (std::size_t i = point.first; i < point.last; ++i) {
          const std::size_t angle = order[i];
          const double* const value = finished + (angles[angle].backward ? finished_size * lanes : 0) + lane;
          sums[set].S1[angle] = {value[S1_re * lanes], value[S1_im * lanes]};
          sums[set].S2[angle] = {value[S2_re * lanes], value[S2_im * lanes]};
          sums[set].largest_partial[angle] = value[partial * lanes];
          sums[set].rounding[angle] = value[rounding_error * lanes];
        }
      }
    }
  };
  in_parallel(batches.size(), cost * static_cast<double>(count * sets.size()), threads, work);
  return sums;
}

/// Angles as multiples of 360 deg / steps.
struct CircleGrid {
  std::size_t steps = 0;
  std::vector<std::int32_t> places;
};

/// Divides all numbers by `unit`; false if one is no multiple. By multiplication: all are small enough.
SCATTER_VECTOR_CLONES
bool divide(const std::int32_t* numbers, std::size_t count, std::int32_t unit, std::int32_t* quotients) {
  const double per_unit = 1 / static_cast<double>(unit);
  int others = 0;
  for (std::size_t i = 0; i < count; ++i) {
    quotients[i] = static_cast<std::int32_t>(static_cast<double>(numbers[i]) * per_unit + 0.5);
    others |= quotients[i] * unit != numbers[i];
  }
  return others == 0;
}

std::optional<CircleGrid> circle_grid(std::span<const Angle> angles) {
  constexpr std::int32_t most_steps = 4'000'000;
  if (angles.empty()) return {};
  std::vector<std::int32_t> places(angles.size());
  std::int32_t least = 0;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    places[i] = angles[i].place;
    least = std::min(least, places[i]);
  }
  if (least < 0) return {};
  // The unit of most grids shows in the first three.
  std::int32_t unit = right_angle;
  for (std::size_t i = 0; i < std::min<std::size_t>(3, places.size()); ++i) unit = std::gcd(unit, places[i]);
  CircleGrid grid;
  grid.places.resize(angles.size());
  if (!divide(places.data(), places.size(), unit, grid.places.data())) {
    for (const std::int32_t place : places) unit = std::gcd(unit, place);
    divide(places.data(), places.size(), unit, grid.places.data());
  }
  if (4 * right_angle / unit > most_steps) return {};
  grid.steps = static_cast<std::size_t>(4 * right_angle / unit);
  return grid;
}

/// Cost [ns] of the direct sum of one set for angles of a grid with a sine below a limit, by the same measure
/// as FourierSplit's.
class DirectCost {
public:
  DirectCost(const CircleGrid& grid, double terms)
      : terms_(terms), steps_(static_cast<double>(grid.steps)), before_(grid.steps / 4 + 2) {
    const auto half = static_cast<std::int32_t>(grid.steps / 2);
    std::vector<char> taken(grid.steps / 4 + 1);
    for (const std::int32_t place : grid.places) taken[std::min(place, half - place)] = 1;
    for (std::size_t i = 0; i < taken.size(); ++i) before_[i + 1] = before_[i] + taken[i];
    axis_ = points_below(std::sqrt(pairs_from * (2 - pairs_from)));
  }
  [[nodiscard]] double below(double sine) const { return of(points_below(sine)); }
  [[nodiscard]] double all() const { return of(before_.back()); }

private:
  [[nodiscard]] double points_below(double sine) const {
    if (sine >= 1) return before_.back();
    const auto place = static_cast<std::size_t>(std::ceil(std::asin(sine) * steps_ / (2 * std::numbers::pi)));
    return before_[std::min(place, before_.size() - 1)];
  }
  [[nodiscard]] double of(double points) const {
    // Of an angle with its mirror image, if it has one.
    constexpr double term = 0.2, axis_term = 0.6, point = 35;
    const double axis = std::min(points, axis_);
    return (axis_term * axis + term * (points - axis)) * terms_ + point * points;
  }
  double terms_, steps_, axis_ = 0;
  std::vector<std::int32_t> before_; ///< points at smaller places of the first quadrant
};

/// Marks places where sums by FFT have more rounding than the direct sum's.
SCATTER_VECTOR_CLONES
void mark_worse(
    const double* rounding, const double* partial, double direct_rounding, std::size_t count, char* worse) {
  for (std::size_t i = 0; i < count; ++i)
    worse[i] = !(rounding[i] * rounding[i] <= direct_rounding * direct_rounding * partial[i]);
}

/// A handful of angles out of so fine a grid that a look at the whole circle costs more than their sum.
bool hopeless(const CircleGrid& grid, std::size_t count) {
  return grid.steps > grid.places.size() * (count / 50 + 1);
}

std::vector<AngleSums> sum_by_fourier(
    std::span<const PartialWaves> sets, std::span<const Angle> angles, const CircleGrid& grid,
    const FourierSplit& split, int threads, const VectorUnit& unit) {
  auto sums = empty_sums(sets.size(), angles.size());
  const auto [least, most] = range_of(grid.places.data(), grid.places.size());
  bool consecutive = true;
  for (std::size_t i = 0; i < grid.places.size(); ++i)
    consecutive &= grid.places[i] == grid.places[0] + static_cast<std::int32_t>(i);
  const auto nearest = static_cast<std::int32_t>(std::ceil(
      std::asin(std::min(1.0, split.smallest_sine)) * static_cast<double>(grid.steps) /
      (2 * std::numbers::pi)));
  const std::int32_t first = std::max({least, nearest, 1}),
                     last = split.smallest_sine > 1
                                ? 0
                                : std::min(
                                      most, static_cast<std::int32_t>(grid.steps / 2) - std::max(nearest, 1));
  const std::size_t places = first <= last ? last - first + 1 : 0;
  // Lists that follow the places take what is found there as it is.
  std::vector<AngleSums> by_place;
  if (!consecutive) by_place = empty_sums(sets.size(), places);
  const std::size_t start = consecutive && places > 0 ? first - least : 0;
  std::vector<FourierSums> found;
  for (std::size_t set = 0; set < sets.size(); ++set) {
    AngleSums& to = consecutive ? sums[set] : by_place[set];
    found.push_back(
        {std::span(to.S1).subspan(start, places), std::span(to.S2).subspan(start, places),
         std::span(to.rounding).subspan(start, places), std::span(to.largest_partial).subspan(start, places),
         typical_partial(size_of_coefficients(sets[set]), 1)});
  }
  if (places > 0) fourier_sums(sets, split, first, last, found, threads);
  // Sets do not disturb each other: one that is better off directly at an angle leaves the others as they
  // are.
  std::vector<char> directly(angles.size());
  std::vector<std::vector<char>> directly_of(sets.size(), directly);
  const double rounding = sum_rounding(sets[0].count());
  for (std::size_t set = 0; set < sets.size(); ++set) {
    const FourierSums& from = found[set];
    std::vector<char> worse(places);
    mark_worse(from.rounding.data(), from.largest_partial.data(), rounding, places, worse.data());
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const std::int32_t place = grid.places[i];
      const std::size_t j = place - first;
      if (place < first || place > last || worse[j]) {
        directly[i] = directly_of[set][i] = true;
      } else if (!consecutive) {
        sums[set].S1[i] = from.S1[j];
        sums[set].S2[i] = from.S2[j];
        sums[set].rounding[i] = from.rounding[j];
        sums[set].largest_partial[i] = from.largest_partial[j];
      }
    }
  }
  std::vector<Angle> rest;
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < angles.size(); ++i)
    if (directly[i]) {
      rest.push_back(angles[i]);
      index.push_back(i);
    }
  const auto others = sum_directly(sets, rest, threads, unit);
  for (std::size_t set = 0; set < sets.size(); ++set)
    for (std::size_t i = 0; i < rest.size(); ++i) {
      if (!directly_of[set][index[i]]) continue;
      sums[set].S1[index[i]] = others[set].S1[i];
      sums[set].S2[index[i]] = others[set].S2[i];
      sums[set].largest_partial[index[i]] = others[set].largest_partial[i];
      sums[set].rounding[index[i]] = others[set].rounding[i];
    }
  return sums;
}

} // namespace

std::vector<AngleSums> sum_partial_waves(
    std::span<const PartialWaves> sets, std::span<const Angle> angles, int threads, const VectorUnit& unit,
    SumMethod method) {
  const bool asked = method == SumMethod::fourier;
  if (method != SumMethod::direct && !sets.empty()) {
    // By the costs of one set: what others there are changes no bits.
    const std::size_t count = sets[0].count();
    constexpr double worth_a_look = 3e5; // terms: 50 us
    const bool look = asked || static_cast<double>(count) * static_cast<double>(angles.size()) > worth_a_look;
    auto grid = look ? circle_grid(angles) : std::nullopt;
    if (grid && !asked && hopeless(*grid, count)) grid.reset();
    if (grid) {
      const DirectCost direct(*grid, static_cast<double>(count));
      const FourierSplit split =
          cheapest_split(count, grid->steps, [&](double sine) { return direct.below(sine); });
      if (asked || split.cost < 0.8 * direct.all())
        return sum_by_fourier(sets, angles, *grid, split, threads, unit);
    } else if (asked) {
      throw InputError("the angles are no even grid of decimals with at most 4e6 steps of the circle");
    }
  }
  return sum_directly(sets, angles, threads, unit);
}

double sum_rounding(std::size_t count) {
  // The roundings of the sum walk at random. The factors hold with room to spare for everything that was
  // compared with 60 digits.
  return (12 + 8 * std::sqrt(static_cast<double>(count))) * epsilon;
}

void in_parallel(std::size_t items, double cost, int threads, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  const auto share = [&] {
    for (std::size_t i = next++; i < items; i = next++) work(i);
  };
  std::size_t wanted = threads > 0 ? static_cast<std::size_t>(threads) : std::thread::hardware_concurrency();
  wanted = std::min({wanted, items, static_cast<std::size_t>(cost / 1e5) + 1});
  std::vector<std::thread> others;
  try {
    for (std::size_t i = 1; i < wanted; ++i) others.emplace_back(share);
  } catch (const std::system_error&) {
    // No more threads to be had: those that run, and this one, do the work.
  }
  share();
  for (auto& thread : others) thread.join();
}

void check_sphere(double x, std::complex<double> m) {
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

} // namespace scatter::exact
