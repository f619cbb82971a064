// Rays with phasors through one drop, RAY_LANES at a time. Needs surface.cl and fresnel.cl.
//
// Frame: z along the sunlight, x towards the side of the drop that points most downward, y completes it; lengths in
// units of a, the radius of the equal-volume sphere. Time factor exp(-i omega t).
//
// The build defines ABSORBING for complex m, CURVATURE for exact focal lines (needs curvature.cl), UNIFORM with it for
// coefficients that hold through grazing incidence (needs grazing.cl), and BEYOND with that for the light that tunnels in
// and out beside the rim.

// Rays below this cosine are traced with twice the digits.
#define GRAZING 0.05

#ifdef UNIFORM
#define WEAK_ABSORPTION 1e-3 // beyond this k the coefficients of the plane surface serve
#define SIZE_PARAMETER double ka,
#else
#define SIZE_PARAMETER
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
#ifdef BEYOND
  mask tunnels; // it was reflected totally, and leaves along the surface
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

// The Jones matrix of a ray that has just come in, from the (p, s) vectors of the light outside.
FORCE_INLINE void transmit(const fresnel* f, vector3 in_p, vector3 s, ray_state* ray) {
  ray->px.re = f->t_p.re * in_p.x;
  ray->px.im = f->t_p.im * in_p.x;
  ray->py.re = f->t_p.re * in_p.y;
  ray->py.im = f->t_p.im * in_p.y;
  ray->sx.re = f->t_s.re * s.x;
  ray->sx.im = f->t_s.im * s.x;
  ray->sy.re = f->t_s.re * s.y;
  ray->sy.im = f->t_s.im * s.y;
}

// Order 0: the ray at (u, v) of the incident plane meets the drop, sends off a reflected ray and goes on inside.
FORCE_INLINE void enter(
    constant const double* surface, double n, double k, double attenuation, SIZE_PARAMETER real u, real v, int steps,
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
  fresnel f = fresnel_coefficients(n, k, out_cos, complex_sqrt(in_cos2), 0, n * inside / outside);
#else
  fresnel f = fresnel_entering(n, outside, inside);
#endif
#ifdef CURVATURE
  const surface_patch bent = bent_surface(surface, p, normal);
#endif
#ifdef UNIFORM
  if (k < WEAK_ABSORPTION)
    f = curved_fresnel(surface + SURFACE_EDGE, n, ka / incidence_curvature(surface, &bent, d),
                       sqrt(fma(-outside, outside, 1.0)), outside * outside, inside, 0);
#endif
  // Reflected.
  const vector3 reflected = along3(d, 2.0 * outside, normal);
  const vector3 impact = {p.x, p.y, (real)(0.0)};
  const real side = p.x * p.x + p.y * p.y;
  const complex_real px = {f.r_p.re * in_p.x, f.r_p.im * in_p.x}, py = {f.r_p.re * in_p.y, f.r_p.im * in_p.y};
  const complex_real sx = {f.r_s.re * s.x, f.r_s.im * s.x}, sy = {f.r_s.re * s.y, f.r_s.im * s.y};
  leave(p, reflected, s, px, py, sx, sy, p.z, (real)(0.0), side, valid, impact, out);
#ifdef CURVATURE
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
#ifdef BEYOND
  out->tunnels = (mask)(0);
#endif
  // Refracted.
  ray->p = p;
  ray->s = s;
  transmit(&f, in_p, s, ray);
  ray->path = p.z;
  ray->side = side;
  ray->axis_crossings = 0.0;
  ray->alive = valid;
}

// Orders 1, 2, ...: across the drop, out by refraction, and on inside by reflection. impact: where the ray came in.
FORCE_INLINE void bounce(
    constant const double* surface, double n, double k, double attenuation, SIZE_PARAMETER vector3 impact, int steps,
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
  fresnel f = fresnel_coefficients(n, k, out_cos, in_cos, 1, outside / (n * fmax(inside, 1e-300)));
#else
  real outside;
  fresnel f = fresnel_leaving(n, inside, cosine2, &outside);
#endif
#ifdef CURVATURE
  const surface_patch bent = bent_surface(surface, p, normal);
#endif
#ifdef UNIFORM
  const real curvature = incidence_curvature(surface, &bent, d), sine_outside = sqrt(fmax(1.0 - cosine2, 0.0));
  if (k < WEAK_ABSORPTION)
    f = curved_fresnel(surface + SURFACE_EDGE, n, ka / curvature, sine_outside, cosine2, inside, 1);
#endif
  const real side = impact.x * p.x + impact.y * p.y;
  const real crossings = ray->axis_crossings + select((real)(0.0), (real)(1.0), side * ray->side < 0.0);
  // Refracted, out.
  const real bend = outside - n * inside;
  vector3 refracted = {n * d.x + bend * normal.x, n * d.y + bend * normal.y, n * d.z + bend * normal.z};
#ifdef BEYOND
  // A wave reflected in total tunnels out to a ray that grazes at some height above the surface.
  const mask beyond = cosine2 < 0.0;
  out->tunnels = beyond;
  const vector3 level = along3(d, -inside, normal);
  const real inverse_level = 1.0 / sqrt(fmax(dot3(level, level), 1e-300));
  const vector3 tangent = scale3(inverse_level, level);
  const real height = select((real)(0.0), (sine_outside - 1.0) / curvature, beyond);
  refracted = select3(still_unit3(refracted), tangent, beyond);
  const vector3 exit_point = along3(p, height, normal);
  const real valid = alive * select((real)(0.0), (real)(1.0), height * ka < 1e3);
#else
  refracted = still_unit3(refracted);
  const vector3 exit_point = p;
  const real valid = alive * select((real)(0.0), (real)(1.0), cosine2 > 0.0);
#endif
  leave(exit_point, refracted, s, times(f.t_p, px), times(f.t_p, py), times(f.t_s, sx), times(f.t_s, sy), path,
        crossings, side, valid, impact, out);
#ifdef CURVATURE
  ray_spread spread = ray->spread;
  const real foci = ray->foci + foci_within(area_along(d, &spread), t);
  fly(&spread, d, t, normal);
  const vector3 n_u = normal_change(surface, &bent, spread.p_u), n_v = normal_change(surface, &bent, spread.p_v);
  ray->spread = out->spread = spread;
  turn_directions(&out->spread, d, normal, n_u, n_v, (real)(n), inside, outside);
  turn_directions(&ray->spread, d, normal, n_u, n_v, (real)(1.0), inside, -inside);
#ifdef BEYOND
  const real c_u = dot3(spread.d_u, normal) + dot3(d, n_u), c_v = dot3(spread.d_v, normal) + dot3(d, n_v);
  const vector3 g_u = along3(along3(spread.d_u, -c_u, normal), -inside, n_u);
  const vector3 g_v = along3(along3(spread.d_v, -c_v, normal), -inside, n_v);
  const real l_u = dot3(tangent, g_u), l_v = dot3(tangent, g_v);
  out->spread.d_u = select3(out->spread.d_u, scale3(inverse_level, along3(g_u, -l_u, tangent)), beyond);
  out->spread.d_v = select3(out->spread.d_v, scale3(inverse_level, along3(g_v, -l_v, tangent)), beyond);
  const real climb = select((real)(0.0), n / curvature, beyond);
  out->spread.p_u = along3(along3(spread.p_u, height, n_u), climb * l_u, normal);
  out->spread.p_v = along3(along3(spread.p_v, height, n_v), climb * l_v, normal);
#endif
  out->p = exit_point;
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

#ifdef BEYOND
// Order 0 of light that passes the drop at a height above its outline and tunnels in: at the point where the surface's
// normal lies across the light. outline_point, its derivative by the azimuth; height >= 0. The derivatives in `spread`
// are by height and azimuth instead of u and v.
FORCE_INLINE void enter_beyond(
    constant const double* surface, double n, double ka, vector3 p, vector3 p_psi, real height, ray_state* ray,
    exit_ray* out) {
  const vector3 d = {(real)(0.0), (real)(0.0), (real)(1.0)}, zero = {(real)(0.0), (real)(0.0), (real)(0.0)};
  const vector3 normal = surface_normal(surface, p);
  const surface_patch bent = bent_surface(surface, p, normal);
  const real curvature = incidence_curvature(surface, &bent, d), sine = 1.0 + curvature * height;
  const real c2 = -curvature * height * (2.0 + curvature * height), inside = sqrt(fmax(1.0 - sine * sine / (n * n), 1e-4));
  // An index next to 1 has no angle of refraction for rays far beyond the rim.
  const real valid = select((real)(0.0), (real)(1.0), sine < 0.99995 * n);
  const fresnel f = curved_fresnel(surface + SURFACE_EDGE, n, ka / curvature, sine, c2, inside, 0);
  const vector3 s = across_plane(d, normal), in_p = cross3(s, d);
  const vector3 impact = {p.x, p.y, (real)(0.0)};
  const real side = p.x * p.x + p.y * p.y;
  const complex_real px = {f.r_p.re * in_p.x, f.r_p.im * in_p.x}, py = {f.r_p.re * in_p.y, f.r_p.im * in_p.y};
  const complex_real sx = {f.r_s.re * s.x, f.r_s.im * s.x}, sy = {f.r_s.re * s.y, f.r_s.im * s.y};
  const vector3 above = along3(p, height, normal);
  leave(above, d, s, px, py, sx, sy, p.z, (real)(0.0), side, valid, impact, out);
  const vector3 n_psi = normal_change(surface, &bent, p_psi);
  const vector3 tangent = {d.x / n * sine, d.y / n * sine, d.z / n * sine};
  ray->p = p;
  ray->d = along3(tangent, -inside, normal);
  ray->p_rest = ray->d_rest = zero;
  ray->s = s;
  transmit(&f, in_p, s, ray);
  ray->path = p.z;
  ray->side = side;
  ray->axis_crossings = 0.0;
  ray->alive = valid;
  ray->foci = out->foci = 0.0;
  ray->spread.p_u = zero;
  ray->spread.p_v = p_psi;
  ray->spread.d_u = scale3(curvature, along3(scale3((real)(1.0 / n), d), sine / (n * n * inside), normal));
  ray->spread.d_v = scale3(-inside, n_psi);
  out->p = above;
  out->spread.p_u = normal;
  out->spread.p_v = along3(p_psi, height, n_psi);
  out->spread.d_u = out->spread.d_v = zero;
  out->tunnels = (mask)(0);
}
#endif
