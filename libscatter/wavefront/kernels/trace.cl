// Rays with phasors through one drop, RAY_LANES at a time. Needs surface.cl.
//
// Frame: z along the sunlight, x towards the side of the drop that points most downward, y completes it; lengths in
// units of a, the radius of the equal-volume sphere. Time factor exp(-i omega t).
//
// The build defines ABSORBING for complex m, CURVATURE for exact focal lines (needs curvature.cl).

// Rays below this cosine are traced with twice the digits.
#define GRAZING 0.05

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

// A ray inside the drop, just after it left a point of the surface. The Jones matrix maps the incident (x, y) field to
// the (p, s) components here, p = s x d.
typedef struct {
  vector3 p, d, s;
  vector3 p_rest, d_rest; // what p and d lack, for rays that graze; else 0
  complex_real px, py, sx, sy;
  real path;          // optical path from the plane z = 0 before the drop
  real side;          // > 0 while the point lies on the side of the axis where the ray came in
  real axis_crossings; // how often the axis has been passed
  real alive;         // 1, or 0 for a ray that misses or was lost
#ifdef CURVATURE
  ray_spread spread;
  real foci; // passed so far
#endif
} ray_state;

// A ray that has left the drop.
typedef struct {
  vector3 d;
  complex_real e1x, e2x, e1y, e2y; // field in the basis of transverse_basis()
  real path;                       // between planes through the origin, across the incident and the outgoing ray
  real axis_crossings;
  real valid;
#ifdef CURVATURE
  vector3 p; // where it left
  ray_spread spread;
  real foci; // passed inside
#endif
} exit_ray;

// Right-handed basis across d without trigonometry and smooth in each hemisphere (d.z >= 0 and d.z < 0): for
// hemisphere = +1 the turn that takes z to d applied to x and y, for -1 the same about -z with y reversed.
FORCE_INLINE void transverse_basis(vector3 d, vector3* e1, vector3* e2) {
  const real h = select((real)(1.0), (real)(-1.0), d.z < 0.0);
  const real w = 1.0 / (1.0 + fabs(d.z)), xy = -d.x * d.y * w;
  e1->x = 1.0 - d.x * d.x * w;
  e1->y = xy;
  e1->z = -h * d.x;
  e2->x = h * xy;
  e2->y = h * (1.0 - d.y * d.y * w);
  e2->z = -d.y;
}

FORCE_INLINE void leave(
    vector3 point, vector3 d, vector3 s, complex_real px, complex_real py, complex_real sx,
    complex_real sy, real path, real axis_crossings, real side, real valid, vector3 impact, exit_ray* out) {
  vector3 e1, e2;
  transverse_basis(d, &e1, &e2);
  const vector3 p = cross3(s, d);
  const real c = dot3(p, e1), q = dot3(p, e2);
  out->d = d;
  out->e1x.re = px.re * c - sx.re * q;
  out->e1x.im = px.im * c - sx.im * q;
  out->e1y.re = py.re * c - sy.re * q;
  out->e1y.im = py.im * c - sy.im * q;
  out->e2x.re = px.re * q + sx.re * c;
  out->e2x.im = px.im * q + sx.im * c;
  out->e2y.re = py.re * q + sy.re * c;
  out->e2y.im = py.im * q + sy.im * c;
  out->path = path - dot3(point, d);
  const real exit_side = impact.x * d.x + impact.y * d.y;
  out->axis_crossings = axis_crossings + select((real)(0.0), (real)(1.0), exit_side * side < 0.0);
  out->valid = valid;
}

// s across the plane of incidence; any transverse vector serves at normal incidence, where s and p are alike.
FORCE_INLINE vector3 across_plane(vector3 d, vector3 n) {
  vector3 s = cross3(d, n);
  const real sine2 = dot3(s, s);
  const mask degenerate = sine2 < 1e-28;
  const mask lean = fabs(d.x) > 0.9;
  vector3 other = {select((real)(1.0), (real)(0.0), lean), select((real)(0.0), (real)(1.0), lean), (real)(0.0)};
  other = cross3(d, other);
  s.x = select(s.x, other.x, degenerate);
  s.y = select(s.y, other.y, degenerate);
  s.z = select(s.z, other.z, degenerate);
  // The cross product of nearly parallel vectors leans out of the transverse plane; take that out.
  s = unit3(s);
  return still_unit3(along3(s, -dot3(s, d), d));
}

// Order 0: the ray at (u, v) of the incident plane meets the drop, sends off a reflected ray and goes on inside.
FORCE_INLINE void enter(
    constant const double* surface, double n, double k, double attenuation, real u, real v, int steps,
    ray_state* ray, exit_ray* out) {
  const vector3 axis = surface_axis(surface);
  const vector3 d = {(real)(0.0), (real)(0.0), (real)(1.0)};
  const vector3 start = {u, v, (real)(0.0)};
  // First guess: the near side of the ellipsoid that holds the drop.
  const double across = surface[SURFACE_HULL], along = surface[SURFACE_HULL + 1], centre = surface[SURFACE_HULL + 2];
  const vector3 q = {u - centre * axis.x, v - centre * axis.y, -centre * axis.z};
  const real q_axis = dot3(q, axis);
  const real dd = across + (along - across) * axis.z * axis.z;
  const real qd = across * q.z + (along - across) * q_axis * axis.z;
  const real qq = across * dot3(q, q) + (along - across) * q_axis * q_axis;
  const real discriminant = qd * qd - dd * (qq - 1.0);
  real t = (-qd - sqrt(fmax(discriminant, 0.0))) / dd;
  real misfit, rise;
  meet_surface(surface, start, d, steps, &t, &misfit, &rise);
  const mask hit = converged(misfit, rise) & (rise < 0.0) & (discriminant >= 0.0);
  t = select((real)(-1.0), t, hit);
  vector3 p = {select((real)(0.0), u, hit), select((real)(0.0), v, hit), t};
  const real valid = select((real)(0.0), (real)(1.0), hit);

  vector3 normal = surface_normal(surface, p);
  real outside = fmax(-dot3(d, normal), 0.0);
  real inside = sqrt(1.0 - fma(-outside, outside, 1.0) / (n * n));
  const real bend = (outside - n * inside) / n;
  const vector3 refracted = {d.x / n + bend * normal.x, d.y / n + bend * normal.y, d.z / n + bend * normal.z};
  const vector3 zero = {(real)(0.0), (real)(0.0), (real)(0.0)};
  ray->d = still_unit3(refracted);
  ray->p_rest = ray->d_rest = zero;
  const mask grazes = hit & (outside < GRAZING);
  if (any(grazes)) {
    vector3_2 point, exact_normal;
    const vector3_2 ray_in = widen3(d, zero);
    const vector3 foot = {p.x, p.y, (real)(0.0)};
    meet_surface2(surface, widen3(foot, zero), ray_in, t, rise, &point, &exact_normal);
    const real2 one = widen((real)(1.0)), index = widen((real)(n)), cosine_out = negative2(exact_normal.z);
    const real2 sine2 = divide2(subtract2(one, multiply2(cosine_out, cosine_out)), multiply2(index, index));
    const real2 cosine_in = root2(subtract2(one, sine2));
    const real2 bend2 = subtract2(divide2(cosine_out, index), cosine_in);
    const vector3_2 inward = along3_2(scale3_2(divide2(one, index), ray_in), bend2, exact_normal);
    p = select3(p, high3(point), grazes);
    ray->p_rest = select3(zero, low3(point), grazes);
    ray->d = select3(ray->d, high3(inward), grazes);
    ray->d_rest = select3(zero, low3(inward), grazes);
    normal = select3(normal, high3(exact_normal), grazes);
    outside = select(outside, cosine_out.hi, grazes);
    inside = select(inside, cosine_in.hi, grazes);
  }
  const vector3 s = across_plane(d, normal);
  const vector3 in_p = cross3(s, d);
#ifdef ABSORBING
  const complex_real out_cos = {outside, (real)(0.0)};
  const real sine2_out = fma(-outside, outside, 1.0);
  const double m2_re = n * n - k * k, m2_im = 2.0 * n * k, m4 = m2_re * m2_re + m2_im * m2_im;
  const complex_real in_cos2 = {1.0 - sine2_out * (m2_re / m4), sine2_out * (m2_im / m4)};
  const fresnel f = fresnel_coefficients(n, k, out_cos, complex_sqrt(in_cos2), 0, n * inside / outside);
#else
  const fresnel f = fresnel_entering(n, outside, inside);
#endif
  // Reflected.
  const vector3 reflected = along3(d, 2.0 * outside, normal);
  const vector3 impact = {p.x, p.y, (real)(0.0)};
  const real side = p.x * p.x + p.y * p.y;
  const complex_real px = {f.r_p.re * in_p.x, f.r_p.im * in_p.x}, py = {f.r_p.re * in_p.y, f.r_p.im * in_p.y};
  const complex_real sx = {f.r_s.re * s.x, f.r_s.im * s.x}, sy = {f.r_s.re * s.y, f.r_s.im * s.y};
  leave(p, reflected, s, px, py, sx, sy, p.z, (real)(0.0), side, valid, impact, out);
#ifdef CURVATURE
  const surface_patch bent = bent_surface(surface, p, normal);
  const vector3 east = {(real)(1.0), (real)(0.0), (real)(0.0)}, north = {(real)(0.0), (real)(1.0), (real)(0.0)};
  ray_spread spread = {east, north, zero, zero};
  fly(&spread, d, (real)(0.0), normal);
  const vector3 n_u = normal_change(surface, &bent, spread.p_u), n_v = normal_change(surface, &bent, spread.p_v);
  ray->spread = out->spread = spread;
  turn_directions(&out->spread, d, normal, n_u, n_v, (real)(1.0), -outside, outside);
  turn_directions(&ray->spread, d, normal, n_u, n_v, (real)(1.0 / n), -outside, -inside);
  out->p = p;
  out->foci = ray->foci = 0.0;
#endif
  // Refracted.
  ray->p = p;
  ray->s = s;
  ray->px.re = f.t_p.re * in_p.x;
  ray->px.im = f.t_p.im * in_p.x;
  ray->py.re = f.t_p.re * in_p.y;
  ray->py.im = f.t_p.im * in_p.y;
  ray->sx.re = f.t_s.re * s.x;
  ray->sx.im = f.t_s.im * s.x;
  ray->sy.re = f.t_s.re * s.y;
  ray->sy.im = f.t_s.im * s.y;
  ray->path = p.z;
  ray->side = side;
  ray->axis_crossings = 0.0;
  ray->alive = valid;
}

// Orders 1, 2, ...: across the drop, out by refraction, and on inside by reflection. impact: where the ray came in.
FORCE_INLINE void bounce(
    constant const double* surface, double n, double k, double attenuation, vector3 impact, int steps,
    ray_state* ray, exit_ray* out) {
  const vector3 axis = surface_axis(surface);
  const vector3 d = ray->d;
  // First guess: the chord of the ellipsoid, of the hull's proportions, through the starting point.
  const double across = surface[SURFACE_HULL], along = surface[SURFACE_HULL + 1], centre = surface[SURFACE_HULL + 2];
  const vector3 q = along3(ray->p, (real)(-centre), axis);
  const real q_axis = dot3(q, axis), d_axis = dot3(d, axis);
  const real qd = across * dot3(q, d) + (along - across) * q_axis * d_axis;
  const real dd = across * dot3(d, d) + (along - across) * d_axis * d_axis;
  real t = fmax(-2.0 * qd / dd, 1e-3), misfit, rise;
  meet_surface(surface, ray->p, d, steps, &t, &misfit, &rise);
  const mask hit = converged(misfit, rise) & (rise > 0.0) & (t > 1e-9) & (ray->alive > 0.5);
  t = select((real)(1.0), t, hit);
  const real alive = select((real)(0.0), (real)(1.0), hit);
  vector3 p = along3(ray->p, t, d);
  // Where a ray was lost, any harmless point will do.
  p.x = select((real)(0.0), p.x, hit);
  p.y = select((real)(0.0), p.y, hit);
  p.z = select((real)(1.0), p.z, hit);

  vector3 normal = surface_normal(surface, p);
  real inside = clamp(dot3(d, normal), 0.0, 1.0);
  const vector3 sine_inside = cross3(d, normal);
  real cosine2 = 1.0 - dot3(sine_inside, sine_inside) * (n * n);
  vector3 onwards = still_unit3(along3(d, -2.0 * inside, normal));
  const vector3 zero = {(real)(0.0), (real)(0.0), (real)(0.0)};
  vector3 p_rest = zero, onwards_rest = zero;
  const mask grazes = hit & (fabs(cosine2) < GRAZING * GRAZING);
  if (any(grazes)) {
    vector3_2 point, exact_normal;
    const vector3_2 chord = widen3(d, ray->d_rest);
    meet_surface2(surface, widen3(ray->p, ray->p_rest), chord, t, rise, &point, &exact_normal);
    const real2 one = widen((real)(1.0)), index = widen((real)(n)), cosine_in = dot3_2(chord, exact_normal);
    const real2 sine2 = multiply2(subtract2(one, multiply2(cosine_in, cosine_in)), multiply2(index, index));
    const real2 twice = {-2.0 * cosine_in.hi, -2.0 * cosine_in.lo};
    const vector3_2 reflected = along3_2(chord, twice, exact_normal);
    p = select3(p, high3(point), grazes);
    p_rest = select3(zero, low3(point), grazes);
    onwards = select3(onwards, high3(reflected), grazes);
    onwards_rest = select3(zero, low3(reflected), grazes);
    normal = select3(normal, high3(exact_normal), grazes);
    inside = select(inside, cosine_in.hi, grazes);
    cosine2 = select(cosine2, subtract2(one, sine2).hi, grazes);
  }
  // Turn the Jones matrix into the new plane of incidence.
  const vector3 s = across_plane(d, normal);
  const vector3 old_p = cross3(ray->s, d);
  const real c = dot3(ray->s, s), turn = dot3(old_p, s);
  complex_real px = {ray->px.re * c - ray->sx.re * turn, ray->px.im * c - ray->sx.im * turn};
  complex_real py = {ray->py.re * c - ray->sy.re * turn, ray->py.im * c - ray->sy.im * turn};
  complex_real sx = {ray->sx.re * c + ray->px.re * turn, ray->sx.im * c + ray->px.im * turn};
  complex_real sy = {ray->sy.re * c + ray->py.re * turn, ray->sy.im * c + ray->py.im * turn};
  const real path = ray->path + n * t;
#ifdef ABSORBING
  const real decay = exp(-attenuation * t);
  px.re *= decay; px.im *= decay;
  py.re *= decay; py.im *= decay;
  sx.re *= decay; sx.im *= decay;
  sy.re *= decay; sy.im *= decay;
  // The tangential wave number is real, as it was outside: the wave in the absorber has a complex cosine, the one
  // outside a real one, or +i times what it decays by.
  const real sine2 = 1.0 - cosine2, evanescent = sqrt(fmax(-cosine2, 0.0));
  const real outside = sqrt(fmax(cosine2, 0.0));
  const double m2_re = n * n - k * k, m2_im = 2.0 * n * k, m4 = m2_re * m2_re + m2_im * m2_im;
  const complex_real in_cos2 = {1.0 - sine2 * (m2_re / m4), sine2 * (m2_im / m4)};
  const complex_real in_cos = complex_sqrt(in_cos2), out_cos = {outside, evanescent};
  const fresnel f = fresnel_coefficients(n, k, out_cos, in_cos, 1, outside / (n * fmax(inside, 1e-300)));
#else
  real outside;
  const fresnel f = fresnel_leaving(n, inside, cosine2, &outside);
#endif
  const real side = impact.x * p.x + impact.y * p.y;
  const real crossings = ray->axis_crossings + select((real)(0.0), (real)(1.0), side * ray->side < 0.0);
  // Refracted, out.
  const real bend = outside - n * inside;
  vector3 refracted = {n * d.x + bend * normal.x, n * d.y + bend * normal.y, n * d.z + bend * normal.z};
  refracted = still_unit3(refracted);
  const real valid = alive * select((real)(0.0), (real)(1.0), cosine2 > 0.0);
  leave(p, refracted, s, times(f.t_p, px), times(f.t_p, py), times(f.t_s, sx), times(f.t_s, sy), path, crossings,
        side, valid, impact, out);
#ifdef CURVATURE
  const surface_patch bent = bent_surface(surface, p, normal);
  ray_spread spread = ray->spread;
  const real foci = ray->foci + foci_within(area_along(d, &spread), t);
  fly(&spread, d, t, normal);
  const vector3 n_u = normal_change(surface, &bent, spread.p_u), n_v = normal_change(surface, &bent, spread.p_v);
  ray->spread = out->spread = spread;
  turn_directions(&out->spread, d, normal, n_u, n_v, (real)(n), inside, outside);
  turn_directions(&ray->spread, d, normal, n_u, n_v, (real)(1.0), inside, -inside);
  out->p = p;
  out->foci = ray->foci = foci;
#endif
  // Reflected, inside.
  ray->p = p;
  ray->d = onwards;
  ray->p_rest = p_rest;
  ray->d_rest = onwards_rest;
  ray->s = s;
  ray->px = times(f.r_p, px);
  ray->py = times(f.r_p, py);
  ray->sx = times(f.r_s, sx);
  ray->sy = times(f.r_s, sy);
  ray->path = path;
  ray->side = side;
  ray->axis_crossings = crossings;
  ray->alive = alive;
}
