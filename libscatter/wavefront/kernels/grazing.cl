// Reflection and refraction at a curved surface, uniformly through grazing incidence and a little beyond it. Needs
// curvature.cl and fresnel.cl; real refractive index n.
//
// On a sphere of size parameter x the partial wave of order nu = x s meets the surface with the logarithmic derivative
// xi'/xi of its Riccati-Hankel function in place of the plane wave's i cos(alpha), s = sin(alpha), and with its phase in
// place of that of the ray (Hovenac & Lock 1992, J. Opt. Soc. Am. A 9, 781; Nussenzveig 1992, Diffraction Effects in
// Semiclassical Scattering, chapter 7). Outside, both come from Olver's uniform approximation by Airy functions of tau,
// which is below 0 for rays that hit (DLMF 10.20.4); inside, where rays never graze, from Debye's with its first
// correction (DLMF 10.19.6). A drop's surface counts as the sphere of its curvature in the plane of incidence.

#ifdef UNIFORM
// ln g and the phase of Ai - i Bi as Chebyshev series over -EDGE_REACH <= tau <= EDGE_REACH, g = 1 / (pi (Ai^2 +
// Bi^2)): EDGE_TERMS coefficients each of ln g, its derivative, the phase; they stand behind the surface's parameters.
typedef struct {
  real log_g, log_g_slope, phase;
} airy_edge;

FORCE_INLINE airy_edge edge_series(constant const double* series, real tau) {
  const real z = clamp(tau * (1.0 / EDGE_REACH), -1.0, 1.0), twice = 2.0 * z;
  real a1 = 0.0, a2 = 0.0, b1 = 0.0, b2 = 0.0, c1 = 0.0, c2 = 0.0;
  for (int n = EDGE_TERMS - 1; n >= 1; --n) {
    const real a = series[n] + twice * a1 - a2, b = series[EDGE_TERMS + n] + twice * b1 - b2,
               c = series[2 * EDGE_TERMS + n] + twice * c1 - c2;
    a2 = a1;
    a1 = a;
    b2 = b1;
    b1 = b;
    c2 = c1;
    c1 = c;
  }
  const airy_edge e = {series[0] + z * a1 - a2, series[EDGE_TERMS] + z * b1 - b2, series[2 * EDGE_TERMS] + z * c1 - c2};
  return e;
}

// The logarithmic derivative of xi outside, re + i im, and the phase that xi has beyond the ray's.
typedef struct {
  real re, im, phase;
} outside_wave;

// x: size parameter of the local sphere; c2 = 1 - s^2, below 0 beyond grazing.
FORCE_INLINE outside_wave uniform_outside(constant const double* series, real x, real s, real c2) {
  const real c = sqrt(fabs(c2));
  const mask beyond = c2 < 0.0;
  const real ray_phase = c - s * asin(fmin(c, 1.0)), decay = s * log(s + c) - c;
  const real part = select(ray_phase, decay, beyond), size = cbrt(2.25 * x * x * part * part);
  const real tau = select(-size, size, beyond);
  outside_wave w;
  // Far from grazing: Debye's approximation with its first correction.
  const real cosine = fmax(c, 1e-3);
  w.re = -s * s / (2.0 * x * cosine * cosine);
  w.im = cosine * (1.0 - 5.0 / (32.0 * tau * tau * tau));
  w.phase = -(1.0 + 5.0 / 3.0 * s * s / (cosine * cosine)) / (8.0 * x * cosine);
  const mask near = tau > -EDGE_REACH;
  if (!any(near)) return w;
  const airy_edge edge = edge_series(series, tau);
  const mask at_rim = fabs(tau) < 0.02;
  const real scale = select(c / sqrt(fabs(tau)), cbrt(2.0 / x), at_rim);
  // d ln(scale) / dx at constant nu; tends to about -1 / (3 x) at the rim.
  const real scale_slope =
      select(s * s / (x * c2) + scale / (2.0 * tau), -1.0 / (3.0 * x), fabs(tau) < 0.3);
  w.im = select(w.im, scale * exp(edge.log_g), near);
  w.re = select(w.re, 0.5 * (scale * edge.log_g_slope - scale_slope), near);
  w.phase = select(w.phase, edge.phase - select(x * ray_phase, (real)(0.0), beyond), near);
  return w;
}

// exp(i a) of a small angle.
FORCE_INLINE complex_real phasor(real a) {
  complex_real c;
  c.im = sincos(a, &c.re);
  return c;
}
FORCE_INLINE complex_real quotient(real re, real im, complex_real b) {
  const real scale = 1.0 / (b.re * b.re + b.im * b.im);
  const complex_real c = {(re * b.re + im * b.im) * scale, (im * b.re - re * b.im) * scale};
  return c;
}

// Energy-normalised coefficients like fresnel_entering() and fresnel_leaving(), with the phases of both waves beyond
// their rays': x outside, s = sin of the angle there (over 1 beyond grazing), c2 = 1 - s^2, inside: cosine.
FORCE_INLINE fresnel curved_fresnel(
    constant const double* series, double n, real x, real s, real c2, real inside, int leaving) {
  const outside_wave w = uniform_outside(series, x, s, c2);
  const real sine = s / n, tangent2 = sine * sine / (inside * inside);
  const real inner = tangent2 / (2.0 * n * x); // -Re of the logarithmic derivative inside
  const real delta_s = -w.re - n * inner, delta_p = -n * w.re - inner;
  const complex_real sum_s = {w.im + n * inside, delta_s}, sum_p = {n * w.im + inside, delta_p};
  const real t = 2.0 * sqrt(n * w.im * inside);
  const real inner_phase = -(1.0 + 5.0 / 3.0 * tangent2) / (8.0 * n * x * inside);
  const complex_real reflected = phasor(leaving ? 2.0 * inner_phase : -2.0 * w.phase);
  const complex_real transmitted = phasor(inner_phase - w.phase);
  const real sign = leaving ? -1.0 : 1.0;
  fresnel f;
  f.r_s = times(reflected, quotient(sign * (w.im - n * inside), -delta_s, sum_s));
  f.r_p = times(reflected, quotient(sign * (n * w.im - inside), -delta_p, sum_p));
  f.t_s = times(transmitted, quotient(t, (real)(0.0), sum_s));
  f.t_p = times(transmitted, quotient(t, (real)(0.0), sum_p));
  return f;
}

// Normal curvature of the surface in the plane of incidence, from the ray's direction.
FORCE_INLINE real incidence_curvature(constant const double* surface, const surface_patch* bent, vector3 d) {
  vector3 t = along3(d, -dot3(d, bent->normal), bent->normal);
  const real length2 = dot3(t, t);
  const real curvature = dot3(t, normal_change(surface, bent, t)) / length2;
  // At normal incidence any direction will do: the correction is next to nothing.
  return select(fmax(curvature, 0.05), (real)(1.0), !(length2 > 1e-12));
}
#endif
