// The drop's surface: where a line meets it, and its normal there. Needs vector.cl and double_double.cl.
//
// The build defines SURFACE_DEGREE (cosine series as a polynomial) or SURFACE_SPHEROID.

// Layout of the surface's parameters; kept in step with surface_parameters() in ray_grid.cpp.
#define SURFACE_AXIS 0       // 3: unit vector straight down
#define SURFACE_HULL 3       // 3: 1/A^2 and 1/B^2 of an ellipsoid that holds the drop, its centre along the axis
#define SURFACE_SHAPE 6      // polynomial coefficients in cos(theta), or 1/A^2 and 1/B^2 of the spheroid

// Polar curve R(c) and dR/dc at c = cos(angle from straight down).
#ifdef SURFACE_SPHEROID
FORCE_INLINE void polar_curve(constant const double* surface, real c, real* radius, real* slope) {
  const double across = surface[SURFACE_SHAPE], along = surface[SURFACE_SHAPE + 1];
  const real r = 1.0 / sqrt(across + (along - across) * c * c);
  *radius = r;
  *slope = (across - along) * c * r * r * r;
}
#else
FORCE_INLINE void polar_curve(constant const double* surface, real c, real* radius, real* slope) {
  real r = surface[SURFACE_SHAPE + SURFACE_DEGREE], s = 0.0;
  for (int n = SURFACE_DEGREE - 1; n >= 0; --n) {
    s = s * c + r;
    r = r * c + surface[SURFACE_SHAPE + n];
  }
  *radius = r;
  *slope = s;
}
#endif

FORCE_INLINE vector3 surface_axis(constant const double* surface) {
  vector3 axis = {surface[SURFACE_AXIS], surface[SURFACE_AXIS + 1], surface[SURFACE_AXIS + 2]};
  return axis;
}

// True when Newton's next step is the last that changes a digit: convergence is quadratic, and slower by the slope.
// Never so for NaN, which is what a ray that misses ends as.
FORCE_INLINE mask converged(real gap, real slope) { return fabs(gap) < 1e-8 * slope * slope + 1e-13; }

// Newton's iteration for |P| = R along P = start + t d. For a convex drop the gauge |P|/R is convex along the line,
// so from outside the steps close in without ever passing the root. misfit: |P|^2 - R^2 at the end; rise: how fast
// |P|/R grows along the ray there (negative where it enters).
FORCE_INLINE void meet_surface(
    constant const double* surface, vector3 start, vector3 d, int steps, real* t, real* misfit, real* rise) {
  const vector3 axis = surface_axis(surface);
  const real axis_d = dot3(axis, d), axis_start = dot3(axis, start), start_d = dot3(start, d);
  real gap = 0.0, slope_along = 0.0;
  for (int step = 0; step < steps; ++step) {
    const vector3 p = along3(start, *t, d);
    const real r = sqrt(dot3(p, p)), inverse_r = 1.0 / r;
    const real c = (axis_start + *t * axis_d) * inverse_r;
    real radius, slope;
    polar_curve(surface, c, &radius, &slope);
    // r^2 - R^2 in fused steps: r - R itself would lose the digits that grazing rays, divided by a small slope, need.
    gap = fma(p.x, p.x, fma(p.y, p.y, fma(p.z, p.z, -radius * radius)));
    slope_along = (start_d + *t) * inverse_r * (radius + c * slope) - slope * axis_d;
    *t -= radius * gap / ((r + radius) * slope_along);
    if (!any(!converged(gap, slope_along))) break;
  }
  *misfit = gap;
  *rise = slope_along;
}

// Outward unit normal at a point of the surface.
FORCE_INLINE vector3 surface_normal(constant const double* surface, vector3 p) {
  const vector3 axis = surface_axis(surface);
  const real inverse_r = 1.0 / sqrt(dot3(p, p));
  const vector3 radial = scale3(inverse_r, p);
  const real c = dot3(axis, radial);
  real radius, slope;
  polar_curve(surface, c, &radius, &slope);
  const real a = radius + c * slope;
  vector3 n = {a * radial.x - slope * axis.x, a * radial.y - slope * axis.y, a * radial.z - slope * axis.z};
  return unit3(n);
}

#ifdef CURVATURE
// d2R/dc2 at c, from the radius and the slope there.
#ifdef SURFACE_SPHEROID
FORCE_INLINE real polar_curve_bend(constant const double* surface, real c, real radius, real slope) {
  const double across = surface[SURFACE_SHAPE], along = surface[SURFACE_SHAPE + 1];
  return (across - along) * radius * radius * (radius + 3.0 * c * slope);
}
#else
FORCE_INLINE real polar_curve_bend(constant const double* surface, real c, real radius, real slope) {
  real bend = 0.0;
  for (int n = SURFACE_DEGREE; n >= 2; --n) bend = bend * c + (n * (n - 1)) * surface[SURFACE_SHAPE + n];
  return bend;
}
#endif

// The surface about one of its points, to second order.
typedef struct {
  vector3 radial, normal;
  real inverse_r, c;
  real along_radial, slope, bend; // the normal is along_radial * radial - slope * axis, times inverse_length
  real inverse_length;
} surface_patch;

FORCE_INLINE surface_patch bent_surface(constant const double* surface, vector3 p, vector3 normal) {
  const vector3 axis = surface_axis(surface);
  surface_patch s;
  s.inverse_r = 1.0 / sqrt(dot3(p, p));
  s.radial = scale3(s.inverse_r, p);
  s.normal = normal;
  s.c = dot3(axis, s.radial);
  real radius;
  polar_curve(surface, s.c, &radius, &s.slope);
  s.bend = polar_curve_bend(surface, s.c, radius, s.slope);
  s.along_radial = radius + s.c * s.slope;
  const vector3 n = along3(scale3(s.along_radial, s.radial), -s.slope, axis);
  s.inverse_length = 1.0 / sqrt(dot3(n, n));
  return s;
}

// How the unit normal changes when the point moves by dp along the surface.
FORCE_INLINE vector3 normal_change(constant const double* surface, const surface_patch* s, vector3 dp) {
  const vector3 axis = surface_axis(surface);
  const real out = dot3(s->radial, dp);
  const vector3 turn = scale3(s->inverse_r, along3(dp, -out, s->radial)); // of the radial unit vector
  const real dc = dot3(axis, turn);
  const vector3 change = along3(
      along3(scale3((2.0 * s->slope + s->c * s->bend) * dc, s->radial), s->along_radial, turn), -s->bend * dc, axis);
  return scale3(s->inverse_length, along3(change, -dot3(s->normal, change), s->normal));
}
#endif

// The same surface with twice the digits.
FORCE_INLINE void polar_curve2(constant const double* surface, real2 c, real2* radius, real2* slope) {
#ifdef SURFACE_SPHEROID
  const real2 across = widen(surface[SURFACE_SHAPE]), along = widen(surface[SURFACE_SHAPE + 1]);
  const real2 difference = subtract2(along, across), one = widen((real)(1.0));
  const real2 r = divide2(one, root2(add2(across, multiply2(difference, multiply2(c, c)))));
  *radius = r;
  *slope = negative2(multiply2(multiply2(difference, c), multiply2(r, multiply2(r, r))));
#else
  real2 r = widen(surface[SURFACE_SHAPE + SURFACE_DEGREE]), s = widen((real)(0.0));
  for (int n = SURFACE_DEGREE - 1; n >= 0; --n) {
    s = add2(multiply2(s, c), r);
    r = add2(multiply2(r, c), widen(surface[SURFACE_SHAPE + n]));
  }
  *radius = r;
  *slope = s;
#endif
}

// Where the line start + t d meets the surface, from t and the rise there that meet_surface() found, and the normal.
FORCE_INLINE void meet_surface2(constant const double* surface, vector3_2 start, vector3_2 d, real t, real rise,
                                vector3_2* point, vector3_2* normal) {
  const vector3 axis_hi = surface_axis(surface), zero = {(real)(0.0), (real)(0.0), (real)(0.0)};
  const vector3_2 axis = widen3(axis_hi, zero);
  real2 length = widen(t);
  // The first round corrects the length, the second only looks at the surface where it then ends.
  for (int round = 0;; ++round) {
    const vector3_2 p = along3_2(start, length, d);
    const real2 squared = dot3_2(p, p), r = root2(squared), c = divide2(dot3_2(axis, p), r);
    real2 radius, slope;
    polar_curve2(surface, c, &radius, &slope);
    if (round == 0) {
      const real2 gap = subtract2(squared, multiply2(radius, radius));
      length = exact_sum(t, -0.5 * gap.hi / rise);
      continue;
    }
    const real2 radial = divide2(add2(radius, multiply2(c, slope)), r);
    const vector3_2 n = along3_2(scale3_2(radial, p), negative2(slope), axis);
    *point = p;
    *normal = scale3_2(divide2(widen((real)(1.0)), root2(dot3_2(n, n))), n);
    return;
  }
}
