// Cloth::eval for eight pairs of directions per work-item; weave_kernel.cpp says what is computed.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

// Calls would pass vectors through memory.
#define FORCE_INLINE static inline __attribute__((always_inline))

#define LANES 8
typedef double8 real;

// acos(1 - q)^2 for 0 <= q <= 1; the polynomial of lane_math.hpp.
FORCE_INLINE real arc_squared(real q) {
  const real q2 = q * q, q4 = q2 * q2, q8 = q4 * q4;
  const real a = fma(q, (real)0.333333333333282, (real)2.0) +
                 q2 * fma(q, (real)0.028571428281146307, (real)0.08888888889502397);
  const real b = fma(q, (real)0.003847894241024964, (real)0.010158737392892294) +
                 q2 * fma(q, (real)0.0006139002339487316, (real)0.0015233862260891284);
  const real c = fma(q, (real)-3.660638043319457e-05, (real)0.00029911862942596476) +
                 q2 * fma(q, (real)-0.0008858891738586373, (real)0.0004673594277794059);
  const real d = fma(q, (real)-0.0018565469501516333, (real)0.0015026173389976688) +
                 q2 * fma(q, (real)-0.0011604728347193714, (real)0.0017296726274879507);
  const real e = fma(q, (real)-0.00015266200803959538, (real)0.0005362465522457653) +
                 q2 * 2.069444019768993e-05;
  return q * (fma(q4, b, a) + q8 * (fma(q4, d, c) + q8 * e));
}

// Down to 2^-700: products with it stay clear of denormal numbers.
FORCE_INLINE real power_of_two(real x) { return exp2(fmax(x, -700.0)); }

// (1 - u) a b + u min(a, b)
FORCE_INLINE real blend(real u, real a, real b) {
  const real product = a * b;
  return product + u * (fmin(a, b) - product);
}

// One component of eight vectors that lie one after the other; the last one stands in for those beyond.
FORCE_INLINE real component(__global const double *vectors, ulong first, ulong last, int axis) {
  double lanes[LANES];
#pragma unroll
  for (int l = 0; l < LANES; ++l) lanes[l] = vectors[3 * min(first + l, last) + axis];
  return vload8(0, lanes);
}

// strands: STRAND_FIELDS numbers each; tangents: cosine and sine of the offset, share, of all strands in turn.
__kernel void cloth(
    ulong count, int strand_count, double gap, double masking_rate, __global const double *strands,
    __global const double *tangents, __global const double *lights, __global const double *views,
    __global double *values) {
  const ulong first = (ulong)get_global_id(0) * LANES;
  if (first >= count) return;
  const real light_x = component(lights, first, count - 1, 0), light_y = component(lights, first, count - 1, 1),
             light_z = component(lights, first, count - 1, 2);
  const real view_x = component(views, first, count - 1, 0), view_y = component(views, first, count - 1, 1),
             view_z = component(views, first, count - 1, 2);
  real projected = gap * fmax(view_z, 0.0), red = 0.0, green = 0.0, blue = 0.0;
  for (int j = 0; j < strand_count; ++j) {
    __global const double *strand = strands + STRAND_FIELDS * j;
    const double along = strand[0], across = strand[1], coverage = strand[2], contrast = strand[3];
    const double surface_height = 0.5 * strand[4], surface_rate = strand[5], volume_height = strand[6],
                 volume_rate = strand[7], isotropic = strand[8], index2 = contrast + 1;
    const int samples = (int)strand[12];
    const real t_i = light_x * along + light_y * across, y_i = light_x * across - light_y * along;
    const real t_r = view_x * along + view_y * across, y_r = view_x * across - view_y * along;
    const real inverse_ti = 1.0 / sqrt(fmax(t_i * t_i + light_z * light_z, 1e-200));
    const real inverse_tr = 1.0 / sqrt(fmax(t_r * t_r + view_z * view_z, 1e-200));
    const real sum_t = t_i * inverse_ti + t_r * inverse_tr, sum_z = light_z * inverse_ti + view_z * inverse_tr;
    const real half_psi = sqrt(0.25 * (sum_t * sum_t + sum_z * sum_z));
    const real together_psi = power_of_two(-masking_rate * arc_squared(clamp(1.0 - half_psi, 0.0, 1.0)));
    real surfaces = 0.0, volumes = 0.0, seen_sum = 0.0;
    for (int k = 0; k < samples; ++k) {
      const double c = tangents[0], s = tangents[1], share = tangents[2];
      tangents += 3;
      const real x_i = fmax(c * light_z - s * t_i, 0.0), x_r = fmax(c * view_z - s * t_r, 0.0);
      const real sin_i = c * t_i + s * light_z, sin_r = c * t_r + s * view_z;
      const real square_i = fmax(x_i * x_i + y_i * y_i, 1e-32), square_r = fmax(x_r * x_r + y_r * y_r, 1e-32);
      const real cos_i = sqrt(square_i), cos_r = sqrt(square_r);
      const real inverse_i = 1.0 / cos_i, inverse_r = 1.0 / cos_r;
      const real cosines = cos_i + cos_r, sines = sin_i + sin_r;
      const real twice_d = sqrt(cosines * cosines + sines * sines); // 2 cos theta_d
      const real inverse_d = 1.0 / twice_d;
      const real cos_h = cosines * inverse_d, sin_h = sines * inverse_d;
      const real theta_h2 = arc_squared(fmin(sin_h * sin_h / (1.0 + cos_h), 1.0));
      const real unit_i = x_i * inverse_i, unit_r = x_r * inverse_r;
      const real x = unit_i + unit_r, y = y_i * inverse_i + y_r * inverse_r;
      const real half_phi = fmin(0.5 * sqrt(x * x + y * y), 1.0);
      const real together_phi = power_of_two(-masking_rate * arc_squared(1.0 - half_phi));
      const real masked = blend(together_phi, unit_i, unit_r);
      const real seen = share * blend(together_psi, x_i * inverse_ti, x_r * inverse_tr);
      const real incidence = fmin(half_phi * 0.5 * twice_d, 1.0);
      const real inside = sqrt(contrast + incidence * incidence);
      const real a = 1.0 / (incidence + inside), b = 1.0 / (index2 * incidence + inside);
      const real r_s = contrast * a * a, r_p = (index2 * incidence - inside) * b;
      const real entering = 2.0 * incidence * inside * (a * a + index2 * b * b);
      const real spread = fmin(4.0 * inverse_d * inverse_d, 1e8);
      const real visible = fmin(square_i, square_r) > 1e-16 ? seen : (real)0.0;
      const real weight = visible * masked * cos_i * spread;
      surfaces += weight * (surface_height * power_of_two(-surface_rate * theta_h2)) *
                  (half_phi * (r_s * r_s + r_p * r_p));
      volumes += weight * (entering * entering) *
                 ((volume_height * power_of_two(-volume_rate * theta_h2) + isotropic) / cosines);
      seen_sum += seen;
    }
    projected += coverage * seen_sum;
    red += coverage * (surfaces + strand[9] * volumes);
    green += coverage * (surfaces + strand[10] * volumes);
    blue += coverage * (surfaces + strand[11] * volumes);
  }
  const long8 lit = (light_z > 0.0) & (view_z > 0.0) & (projected > 0.0);
  const real scale = lit ? 1.0 / projected : (real)0.0;
  double lanes[3][LANES];
  vstore8(red * scale, 0, lanes[0]);
  vstore8(green * scale, 0, lanes[1]);
  vstore8(blue * scale, 0, lanes[2]);
  for (int l = 0; l < LANES && first + l < count; ++l)
    for (int channel = 0; channel < 3; ++channel) values[3 * (first + l) + channel] = lanes[channel][l];
}
