// HairScattering::eval for eight pairs of directions per work-item. The method is that of ray_section_kernel.cpp,
// which says why; here every lane looks for every ray.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

// Calls would pass vectors through memory.
#define FORCE_INLINE static inline __attribute__((always_inline))

#define LANES 8
typedef double8 real;
typedef long8 mask;

// sin(x), 0 <= x <= pi/2: Taylor's series to x^21 / 21!
FORCE_INLINE real sine_of_first_quadrant(real x) {
  const real y = x * x, y2 = y * y, y4 = y2 * y2;
  const real a = (-1.0 / 6 + y * (1.0 / 120)) + y2 * (-1.0 / 5040 + y * (1.0 / 362880));
  const real b = (-1.0 / 39916800 + y * (1.0 / 6227020800)) +
                 y2 * (-1.0 / 1307674368000 + y * (1.0 / 355687428096000));
  const real c = -1.0 / 121645100408832000 + y * (1.0 / 51090942171709440000.0);
  return x + x * y * (a + y4 * (b + y4 * c));
}

FORCE_INLINE void fresnel_mean(double eta2, real c, real *reflected, real *through) {
  const real w = sqrt(eta2 - 1 + c * c), is = 1.0 / (c + w), ip = 1.0 / (eta2 * c + w);
  const real Ts = 4.0 * c * w * is * is, Tp = 4.0 * eta2 * c * w * ip * ip;
  const real rs = (eta2 - 1) * is * is, rp = (eta2 - 1) * (1.0 - (eta2 + 1) * c * c) * ip * ip;
  *reflected = 0.5 * (rs * rs + rp * rp);
  *through = 0.5 * (Ts + Tp);
}

// exp(x) for x <= 0; down to exp(-700), so that products stay clear of denormal numbers.
FORCE_INLINE real exp_of_negative(real x) { return exp(fmax(x, -700.0)); }

FORCE_INLINE real residual_energy(__global const double *coefficients, int terms, real cosine) {
  const real twice = 4.0 * sqrt(cosine) - 2.0;
  real last = 0.0, before = 0.0;
  for (int k = terms - 1; k > 0; --k) {
    const real next = twice * last - before + coefficients[k];
    before = last;
    last = next;
  }
  return 0.5 * twice * last - before + coefficients[0];
}

FORCE_INLINE real load(__global const double *values, ulong first, ulong last) {
  double lanes[LANES];
#pragma unroll
  for (int l = 0; l < LANES; ++l) lanes[l] = values[min(first + l, last)];
  return vload8(0, lanes);
}

// Per lobe R, TT, TRT: shift, 1 / (2 width^2), height. residuals: `terms` coefficients per colour; none: terms 0.
__kernel void hair(
    ulong count, double eta, double sigma_red, double sigma_green, double sigma_blue, int terms,
    __global const double *lobes, __global const double *residuals, __global const double *theta_i,
    __global const double *theta_o, __global const double *phi, __global double *values) {
  const ulong first = (ulong)get_global_id(0) * LANES;
  if (first >= count) return;
  const double quarter = 1.5707963267948966, quarter_rest = 6.123233995736766e-17;
  const double eta2 = eta * eta;
  const double sigma[3] = {sigma_red, sigma_green, sigma_blue};

  const real i = clamp(load(theta_i, first, count - 1), -quarter, quarter);
  const real o = clamp(load(theta_o, first, count - 1), -quarter, quarter);
  const real around = load(phi, first, count - 1);
  const real theta_h = 0.5 * (i + o), theta_d = fmin(fabs(0.5 * (o - i)), LARGEST_THETA_D);
  const real c = sine_of_first_quadrant((quarter - theta_d) + quarter_rest);
  const real turns = rint(around * (0.25 / quarter));
  const real half_angle = fmin(0.5 * fabs((around - turns * (4 * quarter)) - turns * 2.4492935982947064e-16), quarter);
  const real S = sine_of_first_quadrant(half_angle), C = sine_of_first_quadrant((quarter - half_angle) + quarter_rest);

  const real excess = (eta2 - 1) / (c * c), square = 1.0 + excess, index = sqrt(square);
  const real cos_inside = sqrt(eta2 - 1 + c * c) / eta;
  real reflected, through;
  fresnel_mean(eta2, c * C, &reflected, &through);
  const real R = reflected * C * 0.25;

  // Straight through.
  const real x = index * S - 1.0, D = sqrt(x * x + square * C * C);
  const real cos_tt = fmax(x, 0.0) / D, W_tt = index * (index - S) / D;
  fresnel_mean(eta2, c * cos_tt, &reflected, &through);
  const real TT = through * through * cos_tt * W_tt / (4.0 * (W_tt - cos_tt));
  const real path_tt = 2.0 * W_tt / (index * cos_inside);

  // The turn's maximum.
  const real cos_top = sqrt(fmin(excess * (1.0 / 3), 1.0)), sin_top = sqrt(fmax((3.0 - excess) * (1.0 / 3), 0.0));
  const real W_top = 2.0 * cos_top, inverse_top = 1.0 / fmin(square, 4.0);
  const real sin_2t_top = 2.0 * sin_top * W_top * inverse_top,
             cos_2t_top = (W_top - sin_top) * (W_top + sin_top) * inverse_top;
  const real top_t = sin_top / (1.0 + cos_top), top_sine = sin_2t_top * cos_top - cos_2t_top * sin_top,
             top_cosine = cos_2t_top * cos_top + sin_2t_top * sin_top;
  const real inverse_square = 1.0 / square;
  const real rim_sine = 2.0 * inverse_square - 1.0, rim_cosine = 2.0 * sqrt(excess) * inverse_square;
  const mask bent = excess < 3.0;
  const int steps = any(fabs(excess - 3.0) < 0.3) ? 12 : 6;

  real TRT[3] = {0.0, 0.0, 0.0};
  // Rising, falling, falling on the other side.
  for (int branch = 0; branch < 3; ++branch) {
    const real sine = branch == 2 ? -S : S;
    const mask below = bent & (S <= top_sine);
    const mask lit = branch == 0 ? below : branch == 1 ? below & (S >= rim_sine) : -S >= rim_sine;
    if (!any(lit)) continue;
    const real goal = fmax(top_sine * C - top_cosine * sine, 0.0);
    const real end = branch > 0 ? top_sine * rim_cosine - top_cosine * rim_sine : top_sine;
    const real share = fmin(goal / fmax(end, 1e-300), 1.0), goal_root = sqrt(goal);
    const real end_t = branch > 0 ? 1.0 : 0.0;
    const real low = branch > 0 ? top_t : (real)0.0, high = branch > 0 ? (real)1.0 : top_t;
    real t = top_t + (end_t - top_t) * (bent ? sqrt(share) : share);
    for (int step = 0; step < steps; ++step) {
      const real inverse = 1.0 / (1.0 + t * t);
      const real sin_g = 2.0 * t * inverse, cos_g = (1.0 - t) * (1.0 + t) * inverse;
      const real W = sqrt(excess + cos_g * cos_g);
      const real sin_2t = 2.0 * sin_g * W * inverse_square, cos_2t = (W - sin_g) * (W + sin_g) * inverse_square;
      const real sin_u = sin_2t * cos_g - cos_2t * sin_g, cos_u = cos_2t * cos_g + sin_2t * sin_g;
      const real miss = sin_u * C - cos_u * sine;
      const real q = sqrt(fmax(top_sine * cos_u - top_cosine * sin_u, 0.0));
      const real aim = bent ? 2.0 * q / (q + goal_root + 1e-300) : (real)1.0;
      const real slope = (2.0 * cos_g - W) * 2.0 * inverse;
      t = fmin(fmax(t - miss * W * aim / (slope == 0.0 ? (real)1e300 : slope), low), high);
    }
    const real inverse = 1.0 / (1.0 + t * t), cos_g = (1.0 - t) * (1.0 + t) * inverse;
    const real W = sqrt(excess + cos_g * cos_g);
    fresnel_mean(eta2, c * cos_g, &reflected, &through);
    const real gap = fabs(3.0 * cos_g * cos_g - excess) / (2.0 * cos_g + W);
    const real amplitude = through * through * reflected * cos_g * W / (4.0 * fmax(gap, 1e-30));
    const real path = 4.0 * W / (index * cos_inside);
    for (int colour = 0; colour < 3; ++colour)
      TRT[colour] += lit ? amplitude * exp_of_negative(-sigma[colour] * path) : (real)0.0;
  }

  real M[3];
  for (int lobe = 0; lobe < 3; ++lobe) {
    const real away = theta_h - lobes[3 * lobe];
    M[lobe] = lobes[3 * lobe + 2] * exp_of_negative(-away * away * lobes[3 * lobe + 1]);
  }
  for (int colour = 0; colour < 3; ++colour) {
    const real E = terms > 0 ? residual_energy(residuals + colour * terms, terms, c) : (real)0.0;
    const real value = (M[0] * R + M[1] * TT * exp_of_negative(-sigma[colour] * path_tt) +
                        M[2] * (TRT[colour] + E * 0.15915494309189535)) /
                       (c * c);
    double lanes[LANES];
    vstore8(value, 0, lanes);
    for (int l = 0; l < LANES && first + l < count; ++l) values[colour * count + first + l] = lanes[l];
  }
}
