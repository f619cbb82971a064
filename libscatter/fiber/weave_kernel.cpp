#include <scatter/exact/vector_clones.hpp>
#include <scatter/fiber/lane_math.hpp>
#include <scatter/fiber/weave_kernel.hpp>

namespace scatter::fiber {
namespace {

using lane::arc_squared;
using lane::inverse_root;
using lane::larger;
using lane::power_of_two;
using lane::smaller;

/// (1 - u) a b + u min(a, b)
SCATTER_LANE double blend(double u, double a, double b) {
  const double product = a * b;
  return product + u * (smaller(a, b) - product);
}

/// Sums of one thread's tangents.
struct alignas(64) Sums {
  double surface[weave_lanes], volume[weave_lanes], projected[weave_lanes];
};

/// The directions in the frame of a thread without offset, and what does not depend on the offset.
struct alignas(64) InThread {
  double t_i[weave_lanes], z_i[weave_lanes], y_i[weave_lanes];
  double t_r[weave_lanes], z_r[weave_lanes], y_r[weave_lanes];
  double inverse_i[weave_lanes], inverse_r[weave_lanes], together[weave_lanes];
};

/// One sample of the tangent, between the passes.
struct alignas(64) InSample {
  double unit_i[weave_lanes], unit_r[weave_lanes], half2[weave_lanes], cosines[weave_lanes];
  double cos_h[weave_lanes], sin_h[weave_lanes], cos_d[weave_lanes], inverse_d[weave_lanes],
      weight[weave_lanes];
  double surface[weave_lanes], volume[weave_lanes];
};

} // namespace

SCATTER_INTEGER_VECTOR_CLONES
void evaluate_block(const WeaveConstants& weave, WeaveBlock& block) {
  alignas(64) double projected[weave_lanes], value[3][weave_lanes];
  for (std::size_t l = 0; l < weave_lanes; ++l) {
    projected[l] = weave.gap * larger(block.view[2][l], 0);
    value[0][l] = value[1][l] = value[2][l] = 0;
  }
  const double masking_rate = weave.masking_rate;
  for (std::size_t j = 0; j < weave.count; ++j) {
    const StrandConstants& strand = weave.strands[j];
    InThread in;
    Sums sums;
    InSample in_sample;
    const double along = strand.cos_direction, across = strand.sin_direction;
    for (std::size_t l = 0; l < weave_lanes; ++l) {
      in.t_i[l] = block.light[0][l] * along + block.light[1][l] * across;
      in.y_i[l] = block.light[0][l] * across - block.light[1][l] * along;
      in.z_i[l] = block.light[2][l];
      in.t_r[l] = block.view[0][l] * along + block.view[1][l] * across;
      in.y_r[l] = block.view[0][l] * across - block.view[1][l] * along;
      in.z_r[l] = block.view[2][l];
      in.inverse_i[l] = inverse_root(larger(in.t_i[l] * in.t_i[l] + in.z_i[l] * in.z_i[l], 1e-200));
      in.inverse_r[l] = inverse_root(larger(in.t_r[l] * in.t_r[l] + in.z_r[l] * in.z_r[l], 1e-200));
      // The difference of the angles psi does not depend on the offset. |e_i + e_r| / 2 = cos(psi_d / 2).
      const double t = in.t_i[l] * in.inverse_i[l] + in.t_r[l] * in.inverse_r[l];
      const double z = in.z_i[l] * in.inverse_i[l] + in.z_r[l] * in.inverse_r[l];
      const double square = larger(0.25 * (t * t + z * z), 1e-200);
      const double half_cosine = square * inverse_root(square);
      in.together[l] = power_of_two(-masking_rate * arc_squared(larger(1 - half_cosine, 0)));
      sums.surface[l] = sums.volume[l] = sums.projected[l] = 0;
    }
    const double contrast = strand.contrast, index2 = contrast + 1;
    const double half_surface_height = 0.5 * strand.surface_height, surface_rate = strand.surface_rate;
    const double volume_height = strand.volume_height, volume_rate = strand.volume_rate;
    const double isotropic = strand.isotropic;
    for (std::size_t k = 0; k < strand.tangents; ++k) {
      const double c = strand.cos_offset[k], s = strand.sin_offset[k], share = strand.share[k];
      // Three passes, so that several vectors are under way in each: one vector's operations alone wait for
      // each other most of the time.
      for (std::size_t l = 0; l < weave_lanes; ++l) {
        // Components along normal, binormal, tangent of the sample; what faces away is masked.
        const double x_i = larger(c * in.z_i[l] - s * in.t_i[l], 0);
        const double x_r = larger(c * in.z_r[l] - s * in.t_r[l], 0);
        const double y_i = in.y_i[l], y_r = in.y_r[l];
        const double sin_i = c * in.t_i[l] + s * in.z_i[l], sin_r = c * in.t_r[l] + s * in.z_r[l];
        const double square_i = larger(x_i * x_i + y_i * y_i, 1e-32);
        const double square_r = larger(x_r * x_r + y_r * y_r, 1e-32);
        const double inverse_i = inverse_root(square_i), inverse_r = inverse_root(square_r);
        const double cos_i = square_i * inverse_i, cos_r = square_r * inverse_r;
        // Unit vectors across the thread; half their sum has the length cos(phi_d / 2).
        const double unit_i = x_i * inverse_i, unit_r = x_r * inverse_r;
        const double x = unit_i + unit_r, y = y_i * inverse_i + y_r * inverse_r;
        in_sample.half2[l] = larger(0.25 * (x * x + y * y), 1e-200);
        in_sample.unit_i[l] = unit_i;
        in_sample.unit_r[l] = unit_r;
        // Sums of sines and cosines are 2 cos theta_d times those of theta_h: no angle is needed.
        const double cosines = cos_i + cos_r, sines = sin_i + sin_r;
        const double square_d = cosines * cosines + sines * sines; // 4 cos^2 theta_d
        const double inverse_d = inverse_root(square_d);
        in_sample.cosines[l] = cosines;
        in_sample.cos_h[l] = cosines * inverse_d;
        in_sample.sin_h[l] = sines * inverse_d;
        in_sample.inverse_d[l] = 2 * inverse_d;
        in_sample.cos_d[l] = 0.5 * square_d * inverse_d;
        const double seen = share * blend(in.together[l], x_i * in.inverse_i[l], x_r * in.inverse_r[l]);
        sums.projected[l] += seen;
        // Not along the thread.
        in_sample.weight[l] = (smaller(square_i, square_r) > 1e-16 ? seen : 0) * cos_i;
      }
      for (std::size_t l = 0; l < weave_lanes; ++l) {
        const double half2 = in_sample.half2[l];
        const double half_cosine = smaller(half2 * inverse_root(half2), 1);
        const double together = power_of_two(-masking_rate * arc_squared(1 - half_cosine));
        in_sample.weight[l] *= blend(together, in_sample.unit_i[l], in_sample.unit_r[l]);
        // Fresnel, unpolarised; the transmitted share without cancellation at grazing incidence.
        const double incidence = smaller(half_cosine * in_sample.cos_d[l], 1);
        const double inside2 = contrast + incidence * incidence;
        const double inside = inside2 * inverse_root(inside2);
        const double first = incidence + inside, second = index2 * incidence + inside;
        const double inverse = 1 / (first * second);
        const double first_inverse = second * inverse, second_inverse = first * inverse;
        const double r_s = contrast * first_inverse * first_inverse;
        const double r_p = (index2 * incidence - inside) * second_inverse;
        in_sample.surface[l] = half_cosine * (r_s * r_s + r_p * r_p);
        const double entering = 2 * incidence * inside *
                                (first_inverse * first_inverse + index2 * second_inverse * second_inverse);
        in_sample.volume[l] = entering * entering;
      }
      for (std::size_t l = 0; l < weave_lanes; ++l) {
        const double cos_h = in_sample.cos_h[l], sin_h = in_sample.sin_h[l];
        const double theta_h2 = arc_squared(smaller(sin_h * sin_h / (1 + cos_h), 1));
        const double surface = half_surface_height * power_of_two(-surface_rate * theta_h2);
        const double volume =
            (volume_height * power_of_two(-volume_rate * theta_h2) + isotropic) / in_sample.cosines[l];
        const double spread = smaller(in_sample.inverse_d[l] * in_sample.inverse_d[l], 1e8);
        const double weight = in_sample.weight[l] * spread;
        sums.surface[l] += weight * (in_sample.surface[l] * surface);
        sums.volume[l] += weight * (in_sample.volume[l] * volume);
      }
    }
    for (std::size_t l = 0; l < weave_lanes; ++l) {
      projected[l] += strand.coverage * sums.projected[l];
      for (int channel = 0; channel < 3; ++channel)
        value[channel][l] += strand.coverage * (sums.surface[l] + strand.albedo[channel] * sums.volume[l]);
    }
  }
  for (std::size_t l = 0; l < weave_lanes; ++l) {
    const bool lit = block.light[2][l] > 0 && block.view[2][l] > 0 && projected[l] > 0;
    const double scale = lit ? 1 / projected[l] : 0;
    for (int channel = 0; channel < 3; ++channel)
      block.value[channel][l] = lit ? value[channel][l] * scale : 0;
  }
}

} // namespace scatter::fiber
