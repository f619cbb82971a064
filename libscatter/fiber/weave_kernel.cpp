#include <scatter/fiber/lane_math.hpp>
#include <scatter/fiber/weave_kernel.hpp>

#include <cstdint>

namespace scatter::fiber {
namespace {

using lane::absolute;
using lane::arc_squared;
using lane::inverse;
using lane::inverse_root;
using lane::power_of_two;
using lane::power_of_two_in_range;
using lane::ScaledArc;

/// Directions in the frame of a thread without offset, and what does not depend on the offset.
template <class T>
struct ThreadFrame {
  T z_i, z_r, t_i, t_r, y_i, y_r, square_y_i, square_y_r;
  T apart, nearer_i, nearer_r; ///< P = x_i x_r apart + min(x_i nearer_i, x_r nearer_r)
};

template <class T>
struct TangentSums {
  T surface, volume, seen;
};

/// A thread is plain when its volume lobe is twice as wide as the surface lobe, and that is no narrower than
/// this [2^-(rate theta_h^2)]: 4 deg. Then the surface lobe is the fourth power of the other, no lobe comes
/// near the smallest numbers, and 1 - cos theta_h may lose digits: what it has left is 2e-13 of a lobe.
constexpr double plain_surface_rate = 149;
/// Squared cosine of the inclinations to a plain thread's tangents, at least: 1 / cos^2 theta_d needs no
/// bound then, and no direction is along the thread.
constexpr double plain_square = 1e-8;

template <bool plain, class T>
SCATTER_LANE TangentSums<T>
sums_over_tangents(const ScaledArc& masking, const StrandConstants& strand, const ThreadFrame<T>& frame) {
  const T zero = T::all(0), one = T::all(1);
  const auto& [z_i, z_r, t_i, t_r, y_i, y_r, square_y_i, square_y_r, apart, nearer_i, nearer_r] = frame;
  const T index2 = T::all(strand.contrast + 1), contrast_16 = T::all(16 * strand.contrast);
  const T volume_height = T::all(strand.volume_height), isotropic = T::all(strand.isotropic);
  const T t_sum = t_i + t_r, z_sum = z_i + z_r;
  const ScaledArc volume_arc(-strand.volume_rate);
  TangentSums<T> sums{zero, zero, zero};
  for (std::size_t k = 0; k < strand.tangents; ++k) {
    const T c = T::all(strand.cos_offset[k]), s = T::all(strand.sin_offset[k]),
            share = T::all(strand.share[k]);
    // Components along the normal of the sample; what faces away is masked.
    const T x_i = larger(subtract_product(c * z_i, s, t_i), zero);
    const T x_r = larger(subtract_product(c * z_r, s, t_r), zero);
    const T seen = share * multiply_add(x_i * x_r, apart, smaller(x_i * nearer_i, x_r * nearer_r));
    sums.seen = sums.seen + seen;
    const T square_i = multiply_add(x_i, x_i, square_y_i), square_r = multiply_add(x_r, x_r, square_y_r);
    const auto [cosine_i, inverse_i] = root_and_inverse(square_i);
    const auto [cosine_r, inverse_r] = root_and_inverse(square_r);
    // Sums of sines and cosines are 2 cos theta_d times those of theta_h: no angle is needed.
    const T cosines = cosine_i + cosine_r, sines = multiply_add(c, t_sum, s * z_sum);
    const T sines2 = sines * sines;
    const auto [twice_cos_d, inverse_d] = root_and_inverse(multiply_add(cosines, cosines, sines2));
    // P cos theta_i / (2 cos theta_d)^2. Not along the thread.
    T base;
    if constexpr (plain)
      base = (seen * cosine_i) * (inverse_d * inverse_d);
    else
      base = select(less(T::all(1e-16), smaller(square_i, square_r)), seen * cosine_i, zero) *
             smaller(inverse_d * inverse_d, T::all(0.25e8));
    // Unit vectors across the thread; their sum has the length 2 cos(phi_d / 2).
    const T unit_i = x_i * inverse_i, unit_r = x_r * inverse_r;
    const T x = unit_i + unit_r, y = multiply_add(y_i, inverse_i, y_r * inverse_r);
    const T twice_cos_phi = root(multiply_add(x, x, multiply_add(y, y, T::all(1e-200))));
    const T together =
        power_of_two_in_range(arc_squared(masking, subtract_product(one, T::all(0.5), twice_cos_phi)));
    const T product = unit_i * unit_r;
    const T weight = base * multiply_add(together, smaller(unit_i, unit_r) - product, product);
    // Fresnel, unpolarised; the transmitted share without cancellation at grazing incidence. Of incidence
    // and refraction four times the cosines: quotients have no scale.
    const T incidence = twice_cos_phi * twice_cos_d;
    const T inside = root(multiply_add(incidence, incidence, contrast_16));
    const T sum_s = incidence + inside, sum_p = multiply_add(index2, incidence, inside);
    // One division for all quotients.
    const T both = sum_s * sum_p;
    T both_inverse, cosines_inverse, q; // q = 1 - cos theta_h
    if constexpr (plain) {
      const T all_inverse = inverse(both * cosines);
      both_inverse = all_inverse * cosines;
      cosines_inverse = all_inverse * both;
      q = subtract_product(one, cosines, inverse_d);
    } else {
      // 1 - cos theta_h = sines^2 / (2 cos theta_d (2 cos theta_d + cosines)).
      const T rise = twice_cos_d + cosines, others = cosines * rise, all_inverse = inverse(both * others);
      const T others_inverse = all_inverse * both;
      both_inverse = all_inverse * others;
      cosines_inverse = others_inverse * rise;
      q = (sines2 * inverse_d) * (others_inverse * cosines);
    }
    const T inverse_s = sum_p * both_inverse, inverse_p = sum_s * both_inverse;
    const T square_s = inverse_s * inverse_s, square_p = inverse_p * inverse_p;
    const T r_s = contrast_16 * square_s, r_p = multiply_subtract(index2, incidence, inside) * inverse_p;
    const T entering = (incidence * inside) * multiply_add(index2, square_p, square_s); // its half
    T surface, volume;
    if constexpr (plain) {
      volume = power_of_two_in_range(arc_squared(volume_arc, q));
      const T square = volume * volume;
      surface = square * square;
    } else {
      const T theta_h2 = arc_squared(q);
      surface = power_of_two(T::all(-strand.surface_rate) * theta_h2);
      volume = power_of_two(T::all(-strand.volume_rate) * theta_h2);
    }
    sums.surface =
        multiply_add(weight, (twice_cos_phi * surface) * multiply_add(r_s, r_s, r_p * r_p), sums.surface);
    sums.volume = multiply_add(
        weight, (entering * entering) * (multiply_add(volume_height, volume, isotropic) * cosines_inverse),
        sums.volume);
  }
  return sums;
}

/// Some directions of the block, from the first on, side by side.
template <class T>
SCATTER_LANE void evaluate(const WeaveConstants& weave, WeaveBlock& block, std::size_t first) {
  const auto light = [&](int axis) { return T::load(block.light[axis] + first); };
  const auto view = [&](int axis) { return T::load(block.view[axis] + first); };
  const T zero = T::all(0), one = T::all(1);
  const T z_i = light(2), z_r = view(2);
  T projected = T::all(weave.gap) * larger(z_r, zero);
  T value[3] = {zero, zero, zero};
  // For arcs whose cosine is given: the masking's u is 2^(-rate arc^2), 2^-940 at least.
  const ScaledArc masking(-weave.masking_rate);
  for (std::size_t j = 0; j < weave.count; ++j) {
    const StrandConstants& strand = weave.strands[j];
    const T along = T::all(strand.cos_direction), across = T::all(strand.sin_direction);
    ThreadFrame<T> frame;
    frame.z_i = z_i, frame.z_r = z_r;
    const T t_i = frame.t_i = multiply_add(light(0), along, light(1) * across);
    const T t_r = frame.t_r = multiply_add(view(0), along, view(1) * across);
    frame.y_i = subtract_product(light(0) * across, light(1), along);
    frame.y_r = subtract_product(view(0) * across, view(1), along);
    // A direction along a tangent divides by no zero.
    const T least = T::all(1e-32);
    frame.square_y_i = multiply_add(frame.y_i, frame.y_i, least);
    frame.square_y_r = multiply_add(frame.y_r, frame.y_r, least);
    {
      const T inverse_i = inverse_root(larger(multiply_add(t_i, t_i, z_i * z_i), T::all(1e-200)));
      const T inverse_r = inverse_root(larger(multiply_add(t_r, t_r, z_r * z_r), T::all(1e-200)));
      // The difference of the angles psi does not depend on the offset. |e_i + e_r| / 2 = cos(psi_d / 2).
      const T t = multiply_add(t_i, inverse_i, t_r * inverse_r),
              z = multiply_add(z_i, inverse_i, z_r * inverse_r);
      const T square = larger(multiply_add(t, t, z * z), T::all(1e-200));
      const T half_cosine = T::all(0.5) * (square * inverse_root(square));
      const T together = power_of_two_in_range(arc_squared(masking, larger(one - half_cosine, zero)));
      frame.apart = (one - together) * (inverse_i * inverse_r);
      frame.nearer_i = together * inverse_i;
      frame.nearer_r = together * inverse_r;
    }
    // cos theta to every tangent is no less than the root of these.
    const T least_cos = T::all(strand.least_cos_offset), largest_sin = T::all(strand.largest_sin_offset);
    const T least_x_i = larger(subtract_product(least_cos * z_i, largest_sin, absolute(t_i)), zero);
    const T least_x_r = larger(subtract_product(least_cos * z_r, largest_sin, absolute(t_r)), zero);
    const T least_square = smaller(
        multiply_add(least_x_i, least_x_i, frame.square_y_i),
        multiply_add(least_x_r, least_x_r, frame.square_y_r));
    // Which form a lane takes does not depend on the lanes beside it.
    const bool plain =
        strand.surface_rate == 4 * strand.volume_rate && strand.surface_rate <= plain_surface_rate;
    const auto clear = less(T::all(plain ? plain_square : 3), least_square);
    constexpr std::uint32_t every = 0xffffffffU >> (32 - T::width);
    const std::uint32_t found = T::bits(clear);
    TangentSums<T> sums{zero, zero, zero};
    if (found != 0) sums = sums_over_tangents<true>(masking, strand, frame);
    if (found != every) [[unlikely]] {
      const TangentSums<T> others = sums_over_tangents<false>(masking, strand, frame);
      sums = {
          select(clear, sums.surface, others.surface), select(clear, sums.volume, others.volume),
          select(clear, sums.seen, others.seen)};
    }
    const T coverage = T::all(strand.coverage);
    const T surface = T::all(strand.surface_height) * sums.surface; // twos: 4 / (2 2)
    const T volume = T::all(16) * sums.volume;
    projected = multiply_add(coverage, sums.seen, projected);
    for (int channel = 0; channel < 3; ++channel)
      value[channel] = multiply_add(
          coverage, multiply_add(T::all(strand.albedo[channel]), volume, surface), value[channel]);
  }
  const auto lit = less(zero, smaller(smaller(z_i, z_r), projected));
  const T scale = one / select(lit, projected, one);
  for (int channel = 0; channel < 3; ++channel)
    select(lit, value[channel] * scale, zero).store(block.value[channel] + first);
}

template <class T>
SCATTER_LANE void evaluate_all(const WeaveConstants& weave, WeaveBlock& block) {
  for (std::size_t first = 0; first < weave_lanes; first += T::width) evaluate<T>(weave, block, first);
}

using lane::Lanes;
using lane::Two;
#if SCATTER_FIBER_X86_LANES
SCATTER_FIBER_AVX512 void evaluate_on_avx512(const WeaveConstants& weave, WeaveBlock& block) {
  evaluate_all<Two<Two<Lanes<8>>>>(weave, block);
}
SCATTER_FIBER_AVX2 void evaluate_on_avx2(const WeaveConstants& weave, WeaveBlock& block) {
  evaluate_all<Two<Two<Lanes<4>>>>(weave, block);
}
#endif
void evaluate_plainly(const WeaveConstants& weave, WeaveBlock& block) {
  evaluate_all<Two<Two<Lanes<2>>>>(weave, block);
}

} // namespace

void evaluate_block(const WeaveConstants& weave, WeaveBlock& block, const exact::VectorUnit& unit) {
#if SCATTER_FIBER_X86_LANES
  if (unit.width == 8) return evaluate_on_avx512(weave, block);
  if (unit.width == 4) return evaluate_on_avx2(weave, block);
#endif
  (void)unit;
  evaluate_plainly(weave, block);
}

} // namespace scatter::fiber
