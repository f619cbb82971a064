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

// Near the ray that turns by 2 asin(sine), on the side of the turn's maximum that is wanted.
FORCE_INLINE real near_maximum(
    real cos_top, real sin_top, real top_sine, real top_cosine, real rim_sine, real rim_cosine, real sine, real cosine,
    double side) {
  const real top = sin_top / (1.0 + cos_top);
  const real goal = fmax(top_sine * cosine - top_cosine * sine, 0.0);
  const real end = fmax(side > 0 ? top_sine * rim_cosine - top_cosine * rim_sine : top_sine, 1e-300);
  const real share = fmin(goal / end, 1.0);
  const real slope = 0.5 * side * (1.0 + top * top) * sqrt((8.0 / 3) * cos_top / sin_top * end);
  return top + slope * sqrt(share) + ((side > 0 ? 1.0 : 0.0) - top - slope) * share;
}

// The same for rays beyond the axis: y^3 + k y = 1 to some per cent, then a step of Newton's.
FORCE_INLINE real beyond_axis(real inverse_square, real rim_sine, real rim_cosine, real sine, real cosine) {
  const real tangent = fmax(sine / (1.0 + cosine), 1e-30), a = 1.0 - 2.0 * sqrt(inverse_square);
  const real b = fmax(-rim_sine / (1.0 + rim_cosine) - a, 1e-12);
  const real bits = convert_double8(as_long8(tangent / b) >> 32);
  const real third = 0.972 * as_double8(convert_long8(bits * (1.0 / 3) + 715128832.0) << 32);
  const real k = a * third / tangent, up = fmax(k, 0.0), down = fmax(-k, 0.0);
  const real bottom = 1.0 + up * (2.0 / 3 + 0.45 * up);
  const real y = k > 0.0 ? bottom / (1.0 + up * bottom) : sqrt(down + 1.0 / sqrt(1.0 + down));
  const real t = third * y, b2 = b * t * t;
  return (2.0 * b2 * t + tangent) / (3.0 * b2 + a);
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
  const real inverse_square = 1.0 / square, excess_root = sqrt(excess);
  const real cos_top = fmin(excess_root * 0.57735026918962576, 1.0), sin_top = sqrt(fmax(1.0 - cos_top * cos_top, 1e-30));
  const real top_sine = inverse_square * sin_top * sin_top * sin_top,
             top_cosine = inverse_square * cos_top * (3.0 + cos_top * cos_top);
  const real rim_sine = 2.0 * inverse_square - 1.0, rim_cosine = 2.0 * excess_root * inverse_square;

  real TRT[3] = {0.0, 0.0, 0.0};
  // Rising, falling, falling on the other side.
  for (int branch = 0; branch < 3; ++branch) {
    const real sine = branch == 2 ? -S : S;
    const double side = branch > 0 ? 1.0 : -1.0;
    const mask below = (excess < 3.0) & (S <= top_sine);
    const mask lit = branch == 0 ? below : branch == 1 ? below & (S >= rim_sine) : -S >= rim_sine;
    if (!any(lit)) continue;
    real t = branch < 2 ? near_maximum(cos_top, sin_top, top_sine, top_cosine, rim_sine, rim_cosine, S, C, side)
                        : beyond_axis(inverse_square, rim_sine, rim_cosine, S, C);
    t = clamp(t, 0.0, 1.0);
    for (int step = 0; step < 3; ++step) {
      const real more = 1.0 + t * t, turned = 1.0 / more;
      const real sin_g = 2.0 * t * turned, cos_g = (1.0 - t) * (1.0 + t) * turned;
      const real W = sqrt(excess + cos_g * cos_g), W_inverse = 1.0 / W;
      const real with_sine = sin_g * C + cos_g * sine, with_cosine = cos_g * C - sin_g * sine;
      const real miss = inverse_square * (2.0 * sin_g * W * with_cosine - (W - sin_g) * (W + sin_g) * with_sine);
      const real slope = 2.0 * cos_g * W_inverse - 1.0;
      const real bend = 4.0 * excess * sin_g * W_inverse * W_inverse * W_inverse;
      const real divisor = slope - side * sqrt(fmax(slope * slope + bend * miss, 0.0));
      const real half_change = fabs(divisor) < 1e-140 ? (real)0.0 : -miss / divisor;
      t = clamp(t + half_change * more * (1.0 + t * half_change), 0.0, 1.0);
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
