// Angles beyond 90 deg are mirrored, and an angle is summed together with its mirror image. See
// partial_wave_kernel.hpp and fourier_sum.cpp for the sums themselves; here they are prepared and shared out.

#include <scatter/exact/fourier_sum.hpp>
#include <scatter/exact/partial_wave_kernel.hpp>
#include <scatter/exact/partial_waves.hpp>
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
    while (fine_ * fine_ < count) fine_ *= 2;
    for (std::size_t i = 0; i < fine_; ++i) fine_table_.push_back(at(static_cast<long double>(i) * step / 2));
    for (std::size_t i = 0; i * fine_ < count; ++i)
      coarse_table_.push_back(at(static_cast<long double>(i * fine_) * step / 2));
  }
  [[nodiscard]] long double operator()(std::size_t multiple) const {
    const auto &a = coarse_table_[multiple / fine_], &b = fine_table_[multiple % fine_];
    return a.sine * b.cosine + a.cosine * b.sine;
  }

private:
  struct Pair {
    long double sine, cosine;
  };
  static Pair at(long double angle) { return {std::sin(angle), std::cos(angle)}; }
  std::size_t fine_ = 1;
  std::vector<Pair> fine_table_, coarse_table_;
};

constexpr auto right_angle = static_cast<std::int64_t>(90 * per_degree);

/// The angles [deg] in millionths, if they are an even grid of decimals; no places otherwise.
struct DecimalGrid {
  std::vector<std::int64_t> places;
  std::int64_t unit = 0; ///< all places and the right angle are multiples of it
};

DecimalGrid decimal_grid(std::span<const double> degrees) {
  if (degrees.size() < 3) return {};
  std::vector<std::int64_t> places;
  places.reserve(degrees.size());
  std::int64_t first = std::numeric_limits<std::int64_t>::max(), last = 0;
  for (const double angle : degrees) {
    const auto place = static_cast<std::int64_t>(angle * per_degree + 0.5);
    // A quotient of two exact numbers is the double next to it.
    if (static_cast<double>(place) / per_degree != angle) return {};
    first = std::min(first, place);
    last = std::max(last, place);
    places.push_back(place);
  }
  const auto steps = static_cast<std::int64_t>(degrees.size()) - 1;
  const std::int64_t step = (last - first) / steps;
  if (step == 0 || step * steps != last - first) return {};
  std::vector<bool> seen(degrees.size());
  for (const std::int64_t place : places) {
    const std::int64_t index = (place - first) / step;
    if (index * step != place - first || seen[index]) return {};
    seen[index] = true;
  }
  return {std::move(places), std::gcd(std::gcd(step, first), right_angle)};
}

using kernel::Form;

constexpr double steps_from = 0.0014; ///< t at 3 deg

Form form_at(double t) {
  return t < steps_from ? Form::axis : Form::steps;
}

// One instance of the loops per instruction set, chosen when they are called.
constexpr std::size_t most_rows = 6;
using Sum = void (*)(
    Form, std::size_t rows, const kernel::Recurrence&, std::span<const double* const>, const kernel::Points&);

template <std::size_t width, std::size_t parts>
[[gnu::always_inline]] inline void sum_form(
    Form form, std::size_t rows, const kernel::Recurrence& recurrence, std::span<const double* const> weights,
    const kernel::Points& points) {
  using kernel::sum_points;
  const bool one = rows == 1;
  if (form == Form::axis)
    one ? sum_points<Form::axis, width, 1, 1, parts>(recurrence, weights, points)
        : sum_points<Form::axis, width, most_rows, (parts == 4 ? 3 : 2), (parts == 4 ? 4 : 2)>(
              recurrence, weights, points);
  else
    one ? sum_points<Form::steps, width, 1, 1, parts>(recurrence, weights, points)
        : sum_points<Form::steps, width, most_rows, 3, parts>(recurrence, weights, points);
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
  std::vector<double> product;      ///< n (n+1), by which pi_n = product q_n
  std::vector<double> below, above; ///< n^2 / (2n+1) and (n+1)^2 / (2n+1), from n = 0 on
};

Tables::Tables(std::size_t size) : count(size) {
  const auto table = [&](std::vector<double>& values, std::size_t length, double first, auto value) {
    values.resize(length);
    for (std::size_t k = 0; k < length; ++k) values[k] = value(static_cast<double>(k) + first);
  };
  table(e_weight, count, 1, [](double n) { return (2 * n + 1) * n * (n + 1); });
  table(q_weight, count, 1, [](double n) { return -1 / (n * (n + 1) * (n + 2)); });
  table(minus_weight, count, 1, [](double n) { return n * n * (n + 1); });
  table(plus_weight, count, 1, [](double n) { return 2 * n * (n + 1); });
  table(product, count, 1, [](double n) { return n * (n + 1); });
  table(below, count + 2, 0, [](double n) { return n * n / (2 * n + 1); });
  table(above, count + 2, 0, [](double n) { return (n + 1) * (n + 1) / (2 * n + 1); });
}

/// Tables for `count` terms or more. Kept for the next call while they are small: averages ask for thousands
/// of spheres.
std::shared_ptr<const Tables> tables_for(std::size_t count) {
  constexpr std::size_t most_kept = 20000;
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

/// sum n (|a_n|^2 + |b_n|^2)
double size_of_coefficients(const PartialWaves& waves) {
  const auto weights = waves.weights();
  double size = 0;
  for (std::size_t k = 0; k < waves.count(); ++k) {
    const double n = static_cast<double>(k + 1), factor = n * (n + 1) / (2 * n + 1);
    double square = 0;
    for (std::size_t part = 0; part < 4; ++part) square += weights[4 * k + part] * weights[4 * k + part];
    size += 2 * n * factor * factor * square; // |a + b|^2 + |a - b|^2 is twice the sum
  }
  return size;
}

/// An angle of the forward half and the angles of the list that it stands for.
struct Point {
  double t, t_rest;
  std::size_t first, last; ///< of the sorted list
};

/// Indices of the angles, sorted by t.
std::vector<std::size_t> sorted_by_t(std::span<const Angle> angles) {
  const auto less = [&](std::size_t i, std::size_t j) {
    return angles[i].t != angles[j].t ? angles[i].t < angles[j].t : angles[i].t_rest < angles[j].t_rest;
  };
  std::vector<std::size_t> halves[2];
  for (std::size_t i = 0; i < angles.size(); ++i) halves[angles[i].backward].push_back(i);
  // Most lists ascend or descend: then this takes no sorting.
  for (auto& half : halves) {
    if (std::is_sorted(half.begin(), half.end(), less)) continue;
    std::reverse(half.begin(), half.end());
    if (!std::is_sorted(half.begin(), half.end(), less)) std::sort(half.begin(), half.end(), less);
  }
  std::vector<std::size_t> all(angles.size());
  std::merge(halves[0].begin(), halves[0].end(), halves[1].begin(), halves[1].end(), all.begin(), less);
  return all;
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
  folded.reserve(angles.size());
  const auto add = [&](std::size_t i, bool backward, long double half_sine, double rest, std::int64_t place) {
    const auto [t, t_rest] = from_half_sine(half_sine);
    folded.push_back({t, t_rest, backward, angles[i], rest, unit, place});
  };
  if (const DecimalGrid grid = degrees ? decimal_grid(angles) : DecimalGrid{}; !grid.places.empty()) {
    const auto units = static_cast<std::size_t>(right_angle / grid.unit);
    // Tables are worth it where they are shorter than the list.
    const bool tables = 2 * std::sqrt(static_cast<double>(units)) < static_cast<double>(angles.size());
    const long double radians = pi / (2 * static_cast<long double>(right_angle));
    const HalfSines half_sine(static_cast<long double>(grid.unit) * radians, tables ? units + 1 : 1);
    for (std::size_t i = 0; i < angles.size(); ++i) {
      const std::int64_t place = grid.places[i];
      const bool backward = place > right_angle;
      const std::int64_t forward = backward ? 2 * right_angle - place : place;
      // Exactly: each 1e-18 deg turns a partial wave of n = 5e4 by 1e-15.
      const double scaled = angles[i] * per_degree, scaled_rest = std::fma(angles[i], per_degree, -scaled);
      const double rest = ((static_cast<double>(place) - scaled) - scaled_rest) / per_degree;
      add(i, backward,
          tables ? half_sine(static_cast<std::size_t>(forward / grid.unit))
                 : std::sin(static_cast<long double>(forward) * radians / 2),
          rest, place);
    }
    return folded;
  }
  for (std::size_t i = 0; i < angles.size(); ++i) {
    const auto given = static_cast<long double>(angles[i]);
    const bool backward = angles[i] > half_turn / 2;
    const long double theta =
        degrees ? (backward ? 180 - given : given) * (pi / 180) : (backward ? pi - given : given);
    add(i, backward, std::sin(std::max<long double>(theta, 0) / 2), 0, -1);
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

double sine_of(const Angle& angle) {
  return std::sqrt(angle.t * (2 - angle.t));
}

std::vector<AngleSums> sum_directly(
    std::span<const PartialWaves> sets, std::span<const Angle> angles, int threads, const VectorUnit& unit) {
  auto sums = empty_sums(sets.size(), angles.size());
  if (sets.empty() || angles.empty()) return sums;

  const auto order = sorted_by_t(angles);
  std::vector<Point> points;
  std::vector<Batch> batches;
  bool used[2] = {};
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Angle& angle = angles[order[i]];
    if (i > 0 && angle.t == points.back().t && angle.t_rest == points.back().t_rest) {
      ++points.back().last;
      continue;
    }
    const Form form = form_at(angle.t);
    used[static_cast<int>(form)] = true;
    if (batches.empty() || batches.back().form != form || batches.back().count == most_rows * unit.width)
      batches.push_back({form, points.size(), 0, most_rows});
    points.push_back({angle.t, angle.t_rest, i, i + 1});
    ++batches.back().count;
  }
  double cost = 0;
  for (Batch& batch : batches) {
    if (batch.count <= unit.width) batch.rows = 1;
    cost += static_cast<double>(batch.rows);
  }

  // tau_N reaches to pi_{N+1}.
  const std::size_t count = (sets[0].count() + 2) / 2 * 2;
  const auto tables = tables_for(count);
  // Axis sums are looked at after each stretch.
  const std::size_t stretch = std::clamp<std::size_t>(count / 64 * 2, 4, kernel::longest_stretch);
  const kernel::Recurrence recurrence{
      tables->e_weight.data(),
      tables->q_weight.data(),
      tables->minus_weight.data(),
      tables->plus_weight.data(),

      count,
      stretch};
  std::vector<std::vector<double>> weights[2];
  std::vector<const double*> weights_of[2];
  for (const auto& set : sets) {
    if (used[0]) {
      weights[0].emplace_back(set.weights().begin(), set.weights().end());
      weights[0].back().resize(4 * count);
    }
    if (used[1]) weights[1].push_back(weights_of_q(set, count, *tables));
  }
  std::vector<double> sizes;
  for (const auto& set : sets) sizes.push_back(size_of_coefficients(set));
  const double rounding = sum_rounding(sets[0].count()), one_rounding = epsilon / rounding;
  for (std::size_t form = 0; form < 2; ++form)
    for (const auto& weight : weights[form]) weights_of[form].push_back(weight.data());

  const Sum sum_batch = sum_of(unit);
  const auto work = [&](std::size_t item) {
    const Batch& batch = batches[item];
    const std::size_t lanes = batch.rows * unit.width;
    std::vector<double> memory((3 + 10 * sets.size()) * lanes);
    double* const t = memory.data();
    double* const nearby = t + lanes;
    double* const share = nearby + lanes;
    double* const sum = share + lanes;
    double* const largest = sum + 8 * sets.size() * lanes;
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      // A batch that is not full repeats a point.
      const Point& point = points[batch.first + std::min(lane, batch.count - 1)];
      t[lane] = point.t;
      nearby[lane] = point.t * (1 + std::copysign(2 * epsilon, point.t_rest)); // one place away or two
      const double gap = nearby[lane] - point.t;
      share[lane] = gap == 0 ? 0 : point.t_rest / gap;
    }
    const auto form = static_cast<std::size_t>(batch.form);
    sum_batch(batch.form, batch.rows, recurrence, weights_of[form], {t, nearby, share, sum, largest});
    for (std::size_t set = 0; set < sets.size(); ++set)
      for (std::size_t lane = 0; lane < batch.count; ++lane) {
        double low[4], high[4];
        for (std::size_t c = 0; c < 4; ++c) {
          low[c] = sum[(8 * set + c) * lanes + lane];
          high[c] = sum[(8 * set + 4 + c) * lanes + lane];
        }
        const Point& point = points[batch.first + lane];
        for (std::size_t i = point.first; i < point.last; ++i) {
          const std::size_t angle = order[i];
          const bool backward = angles[angle].backward;
          double S[4];
          for (std::size_t c = 0; c < 4; ++c)
            if (batch.form == Form::axis) {
              const double* const half = backward ? high : low;
              S[c] = c < 2 ? half[c] + half[c + 2] : half[c - 2] - half[c];
            } else {
              S[c] = backward ? low[c] - high[c] : low[c] + high[c];
            }
          sums[set].S1[angle] = {S[0], S[1]};
          sums[set].S2[angle] = {S[2], S[3]};
          double partial = largest[(2 * set + backward) * lanes + lane];
          if (batch.form != Form::axis) {
            partial = 0;
            for (std::size_t c = 0; c < 4; ++c) partial += low[c] * low[c] + high[c] * high[c];
            // The weights of pi_n are differences of coefficients, which may be much larger: pi_n^2 is n /
            // (pi sin(theta)^3), and 4 roundings.
            const double sine = sine_of(angles[angle]), four = 4 * one_rounding;
            partial += typical_partial(sizes[set], sine) +
                       sizes[set] * four * four / (std::numbers::pi * sine * sine * sine);
          }
          sums[set].largest_partial[angle] = partial;
          sums[set].rounding[angle] = rounding * std::sqrt(partial);
        }
      }
  };
  in_parallel(batches.size(), cost * static_cast<double>(count * sets.size()), threads, work);
  return sums;
}

/// Angles as multiples of 360 deg / steps.
struct CircleGrid {
  std::size_t steps = 0;
  std::vector<std::size_t> places;
};

std::optional<CircleGrid> circle_grid(std::span<const Angle> angles) {
  constexpr std::int64_t most_steps = 4'000'000;
  std::int64_t unit = right_angle;
  for (const Angle& angle : angles) {
    if (angle.place < 0) return {};
    if (angle.place % unit != 0) unit = std::gcd(unit, angle.place);
  }
  if (angles.empty() || 4 * right_angle / unit > most_steps) return {};
  CircleGrid grid;
  grid.steps = static_cast<std::size_t>(4 * right_angle / unit);
  for (const Angle& angle : angles) grid.places.push_back(static_cast<std::size_t>(angle.place / unit));
  return grid;
}

/// Cost [ns] of the direct sum of one set for angles with a sine below a limit, by the same measure as
/// FourierSplit's.
class DirectCost {
public:
  DirectCost(std::span<const Angle> angles, double terms) : terms_(terms) {
    for (const std::size_t i : sorted_by_t(angles))
      if (t_.empty() || angles[i].t != t_.back()) t_.push_back(angles[i].t);
  }
  [[nodiscard]] double below(double sine) const {
    if (sine >= 1) return all();
    const double t = sine * sine / (1 + std::sqrt(1 - sine * sine));
    return of(static_cast<std::size_t>(std::lower_bound(t_.begin(), t_.end(), t) - t_.begin()));
  }
  [[nodiscard]] double all() const { return of(t_.size()); }

private:
  [[nodiscard]] double of(std::size_t points) const {
    constexpr double term_cost = 0.33; // of an angle with its mirror image, if it has one
    constexpr std::size_t batch = 48;
    return term_cost * terms_ * static_cast<double>((points + batch - 1) / batch * batch);
  }
  std::vector<double> t_;
  double terms_;
};

std::vector<AngleSums> sum_by_fourier(
    std::span<const PartialWaves> sets, std::span<const Angle> angles, const CircleGrid& grid,
    const FourierSplit& split, int threads, const VectorUnit& unit) {
  auto sums = empty_sums(sets.size(), angles.size());
  std::vector<bool> directly(angles.size());
  std::size_t first = grid.steps, last = 0;
  for (std::size_t i = 0; i < angles.size(); ++i) {
    directly[i] = !(sine_of(angles[i]) >= split.smallest_sine);
    if (directly[i]) continue;
    first = std::min(first, grid.places[i]);
    last = std::max(last, grid.places[i]);
  }
  // Sets do not disturb each other: one that is better off directly at an angle leaves the others as they
  // are.
  std::vector<std::vector<bool>> directly_of(sets.size(), directly);
  if (first <= last) {
    const auto found = fourier_sums(sets, split, first, last, threads);
    const double rounding = sum_rounding(sets[0].count());
    for (std::size_t set = 0; set < sets.size(); ++set) {
      const double size = size_of_coefficients(sets[set]);
      for (std::size_t i = 0; i < angles.size(); ++i) {
        if (directly_of[set][i]) continue;
        const std::size_t place = grid.places[i] - first;
        AngleSums& sum = sums[set];
        sum.S1[i] = found[set].S1[place];
        sum.S2[i] = found[set].S2[place];
        sum.rounding[i] = found[set].rounding[place];
        sum.largest_partial[i] =
            std::norm(sum.S1[i]) + std::norm(sum.S2[i]) + typical_partial(size, sine_of(angles[i]));
        if (!(sum.rounding[i] <= rounding * std::sqrt(sum.largest_partial[i])))
          directly[i] = directly_of[set][i] = true;
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
  const auto found = sum_directly(sets, rest, threads, unit);
  for (std::size_t set = 0; set < sets.size(); ++set)
    for (std::size_t i = 0; i < rest.size(); ++i) {
      if (!directly_of[set][index[i]]) continue;
      sums[set].S1[index[i]] = found[set].S1[i];
      sums[set].S2[index[i]] = found[set].S2[i];
      sums[set].largest_partial[index[i]] = found[set].largest_partial[i];
      sums[set].rounding[index[i]] = found[set].rounding[i];
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
    constexpr double worth_a_look = 3e6; // terms: half a millisecond
    const bool look = asked || static_cast<double>(count) * static_cast<double>(angles.size()) > worth_a_look;
    if (const auto grid = look ? circle_grid(angles) : std::nullopt) {
      const DirectCost direct(angles, static_cast<double>(count));
      const FourierSplit split =
          cheapest_split(count, grid->steps, [&](double sine) { return direct.below(sine); });
      if (asked || split.cost < 0.67 * direct.all())
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
