// Complex numbers of sixteen lanes, and Fresnel's coefficients for plane waves at a plane surface. Needs vector.cl.
//
// The build defines ABSORBING for complex m.

typedef struct {
  real re, im;
} complex_real;

FORCE_INLINE complex_real times(complex_real a, complex_real b) {
  complex_real c = {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
  return c;
}

// Fresnel amplitude coefficients, energy-normalised: |r|^2 + |t|^2 = 1 for a real index, whichever side.
// Fields are referred to p = s x d before and after, with s common to all three rays (Born & Wolf, section 1.5.2).
typedef struct {
  complex_real r_s, r_p, t_s, t_p;
} fresnel;

#ifdef ABSORBING
FORCE_INLINE complex_real complex_sqrt(complex_real a) {
  const real magnitude = sqrt(a.re * a.re + a.im * a.im);
  const real re = sqrt(fmax(0.5 * (magnitude + a.re), 0.0)), im = sqrt(fmax(0.5 * (magnitude - a.re), 0.0));
  complex_real root = {re, copysign(im, a.im)};
  return root;
}
FORCE_INLINE complex_real divide(complex_real a, complex_real b) {
  const real scale = 1.0 / (b.re * b.re + b.im * b.im);
  complex_real c = {(a.re * b.re + a.im * b.im) * scale, (a.im * b.re - a.re * b.im) * scale};
  return c;
}
FORCE_INLINE complex_real minus(complex_real a, complex_real b) {
  complex_real c = {a.re - b.re, a.im - b.im};
  return c;
}
FORCE_INLINE complex_real plus(complex_real a, complex_real b) {
  complex_real c = {a.re + b.re, a.im + b.im};
  return c;
}
// cos_outside is complex beyond the critical angle; the transmitted coefficients carry sqrt of the ratio of the
// normal energy flux, with the real parts of m and of the angles.
FORCE_INLINE fresnel fresnel_coefficients(
    double n, double k, complex_real outside, complex_real inside, int leaving, real flux_ratio) {
  const complex_real m = {n, k};
  const complex_real m_in = times(m, inside), m_out = times(m, outside);
  fresnel f;
  const complex_real s_sum = plus(outside, m_in), p_sum = plus(m_out, inside);
  if (leaving) {
    f.r_s = divide(minus(m_in, outside), s_sum);
    f.r_p = divide(minus(inside, m_out), p_sum);
  } else {
    f.r_s = divide(minus(outside, m_in), s_sum);
    f.r_p = divide(minus(m_out, inside), p_sum);
  }
  const real root = sqrt(flux_ratio);
  const complex_real from = leaving ? m_in : outside, from_p = leaving ? m_in : outside;
  complex_real twice = {2.0 * root * from.re, 2.0 * root * from.im};
  complex_real twice_p = {2.0 * root * from_p.re, 2.0 * root * from_p.im};
  f.t_s = divide(twice, s_sum);
  f.t_p = divide(twice_p, p_sum);
  return f;
}
#else
FORCE_INLINE complex_real real_ratio(real a, real b) {
  complex_real c = {a / b, 0.0};
  return c;
}
// Outside -> inside, real index n; cosines of the angles of incidence and refraction.
FORCE_INLINE fresnel fresnel_entering(double n, real outside, real inside) {
  const real s = outside + n * inside, p = n * outside + inside, both = 1.0 / (s * p);
  const real s_sum = p * both, p_sum = s * both;
  const real t = 2.0 * sqrt(n * outside * inside);
  fresnel f;
  f.r_s.re = (outside - n * inside) * s_sum;
  f.r_p.re = (n * outside - inside) * p_sum;
  f.t_s.re = t * s_sum;
  f.t_p.re = t * p_sum;
  f.r_s.im = f.r_p.im = f.t_s.im = f.t_p.im = 0.0;
  return f;
}
// Inside -> outside. cosine2: squared cosine of the angle outside, below 0 in total reflection, where the cosine
// outside is +i sqrt(-cosine2) (the field decays outwards).
FORCE_INLINE fresnel fresnel_leaving(double n, real inside, real cosine2, real* outside) {
  const mask total = cosine2 < 0.0;
  const real q = sqrt(fabs(cosine2));
  *outside = select(q, (real)(0.0), total);
  const real a = n * inside, b = n * q;
  const real s = select(a + q, a * a + q * q, total), p = select(inside + b, inside * inside + b * b, total);
  const real both = 1.0 / (s * p), inverse_s = p * both, inverse_p = s * both;
  fresnel f;
  // Total: (a - iq)/(a + iq) = ((a^2 - q^2) - 2iaq) / (a^2 + q^2).
  f.r_s.re = select(a - q, a * a - q * q, total) * inverse_s;
  f.r_s.im = select((real)(0.0), -2.0 * a * q, total) * inverse_s;
  f.r_p.re = select(inside - b, inside * inside - b * b, total) * inverse_p;
  f.r_p.im = select((real)(0.0), -2.0 * inside * b, total) * inverse_p;
  const real t = 2.0 * sqrt(a * *outside);
  f.t_s.re = t * inverse_s;
  f.t_p.re = t * inverse_p;
  f.t_s.im = f.t_p.im = 0.0;
  return f;
}
#endif
