// Tiles of the ray grid: traced order by order, their patches laid over directions. Needs job.cl and trace.cl before it.
//
// A patch is the cell between four neighbouring rays: two spherical triangles that share the diagonal from (i, j) to
// (i+1, j+1). Every edge is a great circle whose sign at a direction is computed the same way by both neighbours, so
// that each direction of a sheet lies in exactly one triangle, whatever folds, twists, poles or seams it has.
//
// The build defines TILE (cells across a tile), CURVATURE where focal lines are counted ray by ray.

#define TILE_RAYS (TILE + 1)
#define TILE_PADDED ((TILE_RAYS * TILE_RAYS + RAY_LANES - 1) / RAY_LANES * RAY_LANES)

// Scratch of one work-item, in doubles: the rays inside the drop, then what left it at this order.
#ifdef CURVATURE
#define STATE_FIELDS 40
#define EXIT_FIELDS 8
#else
#define STATE_FIELDS 27
#define EXIT_FIELDS 7
#endif
#define SCRATCH_EXIT (STATE_FIELDS * TILE_PADDED)
#define SCRATCH_JONES (SCRATCH_EXIT + EXIT_FIELDS * TILE_PADDED)
#define SCRATCH_PLANES (SCRATCH_JONES + 8 * TILE_PADDED) // the same Jones matrices, one plane per element
#define SCRATCH_DOUBLES (SCRATCH_PLANES + 8 * TILE_PADDED)
enum { EXIT_X, EXIT_Y, EXIT_Z, EXIT_PHASE, EXIT_ROW, EXIT_COLUMN, EXIT_ENERGY, EXIT_FOCI };

#define NOWHERE 1e300 // column of a ray that did not leave

typedef struct {
  int i, j;         // first ray
  int cells_i, cells_j;
  int flags;
} tile_t;
#define TILE_RIM 1    // near the rim: Newton's iteration needs more steps, and rays may graze
#define TILE_DIRECT 2 // its mirror image is traced too (or is itself): no reflection in the symmetry plane

// Angle of the point (x, y), y >= 0, in [0, pi] to 2e-8: Abramowitz & Stegun 4.4.49. ratio: the smaller of |x| and y
// over the larger.
FORCE_INLINE real quick_angle(real y, real x, real ratio) {
  const real q2 = ratio * ratio;
  real s = 0.0028662257;
  s = s * q2 - 0.0161657367;
  s = s * q2 + 0.0429096138;
  s = s * q2 - 0.0752896400;
  s = s * q2 + 0.1065626393;
  s = s * q2 - 0.1420889944;
  s = s * q2 + 0.1999355085;
  s = s * q2 - 0.3333314528;
  real angle = ratio + ratio * q2 * s;
  angle = select(angle, 1.5707963267948966 - angle, y > fabs(x));
  return select(angle, 3.141592653589793 - angle, x < 0.0);
}

// Scattering angle and absolute azimuth of a direction, good enough to find candidates.
FORCE_INLINE void quick_direction(vector3 d, real* theta, real* phi) {
  const real x = fabs(d.x), y = fabs(d.y), z = fabs(d.z), rho = sqrt(x * x + y * y);
  const real theta_big = fmax(rho, z), phi_big = fmax(fmax(x, y), 1e-100);
  const real inverse = 1.0 / (theta_big * phi_big);
  *theta = quick_angle(rho, d.z, fmin(rho, z) * inverse * phi_big);
  *phi = quick_angle(y, d.x, fmin(x, y) * inverse * theta_big);
}

// Rays graze in rim tiles only; elsewhere the rests are 0 and not kept.
FORCE_INLINE void load_state(global const double* scratch, int at, int rim, ray_state* ray) {
  global const double* field = scratch + at;
#define NEXT_FIELD(target) target = load_real(field); field += TILE_PADDED;
  NEXT_FIELD(ray->p.x) NEXT_FIELD(ray->p.y) NEXT_FIELD(ray->p.z)
  NEXT_FIELD(ray->d.x) NEXT_FIELD(ray->d.y) NEXT_FIELD(ray->d.z)
  NEXT_FIELD(ray->s.x) NEXT_FIELD(ray->s.y) NEXT_FIELD(ray->s.z)
  NEXT_FIELD(ray->px.re) NEXT_FIELD(ray->px.im) NEXT_FIELD(ray->py.re) NEXT_FIELD(ray->py.im)
  NEXT_FIELD(ray->sx.re) NEXT_FIELD(ray->sx.im) NEXT_FIELD(ray->sy.re) NEXT_FIELD(ray->sy.im)
  NEXT_FIELD(ray->path) NEXT_FIELD(ray->side) NEXT_FIELD(ray->axis_crossings) NEXT_FIELD(ray->alive)
#ifdef CURVATURE
  NEXT_FIELD(ray->spread.p_u.x) NEXT_FIELD(ray->spread.p_u.y) NEXT_FIELD(ray->spread.p_u.z)
  NEXT_FIELD(ray->spread.p_v.x) NEXT_FIELD(ray->spread.p_v.y) NEXT_FIELD(ray->spread.p_v.z)
  NEXT_FIELD(ray->spread.d_u.x) NEXT_FIELD(ray->spread.d_u.y) NEXT_FIELD(ray->spread.d_u.z)
  NEXT_FIELD(ray->spread.d_v.x) NEXT_FIELD(ray->spread.d_v.y) NEXT_FIELD(ray->spread.d_v.z)
  NEXT_FIELD(ray->foci)
#endif
  const vector3 zero = {(real)(0.0), (real)(0.0), (real)(0.0)};
  ray->p_rest = ray->d_rest = zero;
  if (rim) {
    NEXT_FIELD(ray->p_rest.x) NEXT_FIELD(ray->p_rest.y) NEXT_FIELD(ray->p_rest.z)
    NEXT_FIELD(ray->d_rest.x) NEXT_FIELD(ray->d_rest.y) NEXT_FIELD(ray->d_rest.z)
  }
#undef NEXT_FIELD
}

FORCE_INLINE void store_state(global double* scratch, int at, int rim, const ray_state* ray) {
  global double* field = scratch + at;
#define NEXT_FIELD(source) store_real(source, field); field += TILE_PADDED;
  NEXT_FIELD(ray->p.x) NEXT_FIELD(ray->p.y) NEXT_FIELD(ray->p.z)
  NEXT_FIELD(ray->d.x) NEXT_FIELD(ray->d.y) NEXT_FIELD(ray->d.z)
  NEXT_FIELD(ray->s.x) NEXT_FIELD(ray->s.y) NEXT_FIELD(ray->s.z)
  NEXT_FIELD(ray->px.re) NEXT_FIELD(ray->px.im) NEXT_FIELD(ray->py.re) NEXT_FIELD(ray->py.im)
  NEXT_FIELD(ray->sx.re) NEXT_FIELD(ray->sx.im) NEXT_FIELD(ray->sy.re) NEXT_FIELD(ray->sy.im)
  NEXT_FIELD(ray->path) NEXT_FIELD(ray->side) NEXT_FIELD(ray->axis_crossings) NEXT_FIELD(ray->alive)
#ifdef CURVATURE
  NEXT_FIELD(ray->spread.p_u.x) NEXT_FIELD(ray->spread.p_u.y) NEXT_FIELD(ray->spread.p_u.z)
  NEXT_FIELD(ray->spread.p_v.x) NEXT_FIELD(ray->spread.p_v.y) NEXT_FIELD(ray->spread.p_v.z)
  NEXT_FIELD(ray->spread.d_u.x) NEXT_FIELD(ray->spread.d_u.y) NEXT_FIELD(ray->spread.d_u.z)
  NEXT_FIELD(ray->spread.d_v.x) NEXT_FIELD(ray->spread.d_v.y) NEXT_FIELD(ray->spread.d_v.z)
  NEXT_FIELD(ray->foci)
#endif
  if (rim) {
    NEXT_FIELD(ray->p_rest.x) NEXT_FIELD(ray->p_rest.y) NEXT_FIELD(ray->p_rest.z)
    NEXT_FIELD(ray->d_rest.x) NEXT_FIELD(ray->d_rest.y) NEXT_FIELD(ray->d_rest.z)
  }
#undef NEXT_FIELD
}

// Eight rays' Jones matrices from one vector per element to one vector per ray.
FORCE_INLINE void store_jones(global double* out, double8 f0, double8 f1, double8 f2, double8 f3, double8 f4, double8 f5,
                        double8 f6, double8 f7) {
  const double8 a0 = (double8)(f0.s0, f1.s0, f0.s2, f1.s2, f0.s4, f1.s4, f0.s6, f1.s6);
  const double8 a1 = (double8)(f0.s1, f1.s1, f0.s3, f1.s3, f0.s5, f1.s5, f0.s7, f1.s7);
  const double8 a2 = (double8)(f2.s0, f3.s0, f2.s2, f3.s2, f2.s4, f3.s4, f2.s6, f3.s6);
  const double8 a3 = (double8)(f2.s1, f3.s1, f2.s3, f3.s3, f2.s5, f3.s5, f2.s7, f3.s7);
  const double8 a4 = (double8)(f4.s0, f5.s0, f4.s2, f5.s2, f4.s4, f5.s4, f4.s6, f5.s6);
  const double8 a5 = (double8)(f4.s1, f5.s1, f4.s3, f5.s3, f4.s5, f5.s5, f4.s7, f5.s7);
  const double8 a6 = (double8)(f6.s0, f7.s0, f6.s2, f7.s2, f6.s4, f7.s4, f6.s6, f7.s6);
  const double8 a7 = (double8)(f6.s1, f7.s1, f6.s3, f7.s3, f6.s5, f7.s5, f6.s7, f7.s7);
  vstore8((double8)(a0.s01, a2.s01, a4.s01, a6.s01), 0, out);
  vstore8((double8)(a1.s01, a3.s01, a5.s01, a7.s01), 1, out);
  vstore8((double8)(a0.s23, a2.s23, a4.s23, a6.s23), 2, out);
  vstore8((double8)(a1.s23, a3.s23, a5.s23, a7.s23), 3, out);
  vstore8((double8)(a0.s45, a2.s45, a4.s45, a6.s45), 4, out);
  vstore8((double8)(a1.s45, a3.s45, a5.s45, a7.s45), 5, out);
  vstore8((double8)(a0.s67, a2.s67, a4.s67, a6.s67), 6, out);
  vstore8((double8)(a1.s67, a3.s67, a5.s67, a7.s67), 7, out);
}

#ifdef UNIFORM
#define SIZE_OF(job) 3.14159265358979323846 * (job)->wave,
#else
#define SIZE_OF(job)
#endif

// Traces order p of every ray of the tile into the scratch.
void trace_tile(constant const double* surface, constant const job_t* job, tile_t tile, int p, global double* scratch) {
  const int rim = tile.flags & TILE_RIM, steps = rim ? job->rim_steps : job->interior_steps;
  const real lane = (real)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  for (int at = 0; at < TILE_PADDED; at += RAY_LANES) {
    const real index = (double)at + lane;
    const real row = floor((index + 0.5) * (1.0 / TILE_RAYS));
    const real i = index - row * TILE_RAYS + (double)tile.i, j = row + (double)tile.j;
    const real u = job->origin + i * job->step, v = job->origin + j * job->step;
    ray_state ray;
    exit_ray out;
    if (p == 0) {
      enter(surface, job->n, job->k, job->attenuation, SIZE_OF(job) u, v, steps, &ray, &out);
      const mask outside = (i > job->rays - 0.5) | (j > job->rays - 0.5);
      out.valid = select(out.valid, (real)(0.0), outside);
      ray.alive = out.valid;
    } else {
      load_state(scratch, at, rim, &ray);
      const vector3 impact = {u, v, (real)(0.0)};
      bounce(surface, job->n, job->k, job->attenuation, SIZE_OF(job) impact, job->interior_steps, &ray, &out);
    }
    if (p < job->last_order) store_state(scratch, at, rim, &ray);

    global double* field = scratch + SCRATCH_EXIT + at;
    const mask lost = out.valid < 0.5;
    store_real(out.d.x, field + EXIT_X * TILE_PADDED);
    store_real(out.d.y, field + EXIT_Y * TILE_PADDED);
    store_real(out.d.z, field + EXIT_Z * TILE_PADDED);
    const double focal = job->focal_lines ? 0.5 : 0.0;
    store_real(job->wave * out.path - focal * out.axis_crossings, field + EXIT_PHASE * TILE_PADDED);
#ifdef CURVATURE
    store_real(out.foci + foci_ahead(area_along(out.d, &out.spread)), field + EXIT_FOCI * TILE_PADDED);
#endif
    real theta, phi;
    quick_direction(out.d, &theta, &phi);
    store_real((theta - job->row_origin) * job->rows_per_radian, field + EXIT_ROW * TILE_PADDED);
    const real column = (phi - job->column_origin) * job->columns_per_radian;
    store_real(select(column, (real)(NOWHERE), lost), field + EXIT_COLUMN * TILE_PADDED);
    const real energy = 0.5 * (out.e1x.re * out.e1x.re + out.e1x.im * out.e1x.im + out.e2x.re * out.e2x.re +
                               out.e2x.im * out.e2x.im + out.e1y.re * out.e1y.re + out.e1y.im * out.e1y.im +
                               out.e2y.re * out.e2y.re + out.e2y.im * out.e2y.im);
    store_real(select(energy, (real)(0.0), lost), field + EXIT_ENERGY * TILE_PADDED);
    global double* plane = scratch + SCRATCH_PLANES + at;
    store_real(out.e1x.re, plane + 0 * TILE_PADDED);
    store_real(out.e2x.re, plane + 1 * TILE_PADDED);
    store_real(out.e1y.re, plane + 2 * TILE_PADDED);
    store_real(out.e2y.re, plane + 3 * TILE_PADDED);
    store_real(out.e1x.im, plane + 4 * TILE_PADDED);
    store_real(out.e2x.im, plane + 5 * TILE_PADDED);
    store_real(out.e1y.im, plane + 6 * TILE_PADDED);
    store_real(out.e2y.im, plane + 7 * TILE_PADDED);
    global double* jones = scratch + SCRATCH_JONES + 8 * at;
    store_jones(jones, out.e1x.re.lo, out.e2x.re.lo, out.e1y.re.lo, out.e2y.re.lo, out.e1x.im.lo, out.e2x.im.lo,
                out.e1y.im.lo, out.e2y.im.lo);
    store_jones(jones + 64, out.e1x.re.hi, out.e2x.re.hi, out.e1y.re.hi, out.e2y.re.hi, out.e1x.im.hi, out.e2x.im.hi,
                out.e1y.im.hi, out.e2y.im.hi);
  }
}

typedef struct {
  double8 x, y, z;
} point8;

FORCE_INLINE double8 inner8(point8 a, point8 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
FORCE_INLINE point8 difference8(point8 a, point8 b) {
  const point8 c = {a.x - b.x, a.y - b.y, a.z - b.z};
  return c;
}
// Normal of the great circle a -> b, without the cancellation of a x b for close points.
FORCE_INLINE point8 edge_normal(point8 a, point8 b) {
  const point8 d = difference8(b, a);
  const point8 n = {a.y * d.z - a.z * d.y, a.z * d.x - a.x * d.z, a.x * d.y - a.y * d.x};
  return n;
}

// Solid angle of the triangle from its triple product (Van Oosterom & Strackee 1983).
FORCE_INLINE double8 solid_angle(double8 triple, point8 a, point8 b, point8 c) {
  const double8 below = 1.0 + inner8(a, b) + inner8(b, c) + inner8(c, a), above = fabs(triple);
  const double8 t = above / below, t2 = t * t;
  const double8 small_ = 2.0 * t * (1.0 - t2 * (1.0 / 3.0 - t2 * (0.2 - t2 * (1.0 / 7.0 - t2 * (1.0 / 9.0)))));
  const long8 large = !((below > 0.0) & (t < 0.02));
  return any(large) ? select(small_, 2.0 * atan2(above, below), large) : small_;
}

// Patches of the eight cells i..i+7 of a row. Corners: 0 = (i, j), 1 = (i+1, j), 2 = (i+1, j+1), 3 = (i, j+1); the
// triangles are 012 and 023. Normals of the edges 0->1, 1->2, 3->2, 0->3 and 0->2, then the patch's sqrt(a/s) for both
// triangles with the sign of their turn (+ counter-clockwise, 0 drops the triangle), then what their phases have beside
// the paths.
enum {
  PATCH_BOTTOM = 0, PATCH_RIGHT = 3, PATCH_TOP = 6, PATCH_LEFT = 9, PATCH_DIAGONAL = 12,
  PATCH_FIRST = 15, PATCH_SECOND, PATCH_FIRST_PHASE, PATCH_SECOND_PHASE, PATCH_FIELDS
};

FORCE_INLINE point8 corners8(global const double* scratch, int at) {
  global const double* field = scratch + SCRATCH_EXIT + at;
  const point8 d = {vload8(0, field + EXIT_X * TILE_PADDED), vload8(0, field + EXIT_Y * TILE_PADDED),
                    vload8(0, field + EXIT_Z * TILE_PADDED)};
  return d;
}

// What linear interpolation of the Jones matrix takes from a patch's intensity wherever it turns from ray to ray, as a
// factor to give it back: the corners' mean of |J|^2 over the mean, over both triangles by their shares, of
// |interpolated J|^2. That mean is a sixth of the sum over corners and sides of Re(J_a . J_b*).
FORCE_INLINE double8 energy_kept(global const double* scratch, int at, double8 first_weight, double8 second_weight) {
  double8 E0 = 0.0, E1 = 0.0, E2 = 0.0, E3 = 0.0, sides1 = 0.0, sides2 = 0.0;
  for (int element = 0; element < 8; ++element) {
    global const double* plane = scratch + SCRATCH_PLANES + element * TILE_PADDED + at;
    const double8 j0 = vload8(0, plane), j1 = vload8(0, plane + 1);
    const double8 j2 = vload8(0, plane + TILE_RAYS + 1), j3 = vload8(0, plane + TILE_RAYS), j02 = j0 * j2;
    E0 += j0 * j0;
    E1 += j1 * j1;
    E2 += j2 * j2;
    E3 += j3 * j3;
    sides1 += j1 * (j0 + j2) + j02;
    sides2 += j3 * (j0 + j2) + j02;
  }
  const double8 first = first_weight * (E0 + E1 + E2 + sides1), second = second_weight * (E0 + E2 + E3 + sides2);
  const double8 factor = 1.5 * (E0 + E1 + E2 + E3) * (first_weight + second_weight) / (first + second);
  // Corners in different hemispheres have different bases; a patch without light needs no factor.
  global const double* z = scratch + SCRATCH_EXIT + EXIT_Z * TILE_PADDED + at;
  const long8 below0 = vload8(0, z) < 0.0, below1 = vload8(0, z + 1) < 0.0, below2 = vload8(0, z + TILE_RAYS + 1) < 0.0,
              below3 = vload8(0, z + TILE_RAYS) < 0.0;
  const long8 one_basis = (below0 == below1) & (below0 == below2) & (below0 == below3);
  return select((double8)(1.0), clamp(factor, 0.25, 4.0), one_basis & (factor > 0.0));
}

#ifdef CURVATURE
// Focal lines of a triangle with the corners a, b, c of a cell whose fourth corner is `other`. Where they differ a
// caustic crosses the cell, and the triangle's turn tells the side: the solid angle changes its sign at every focal line
// and every reflection. odd: whether the turn asks for an odd number.
FORCE_INLINE double8 triangle_foci(double8 a, double8 b, double8 c, double8 other, long8 odd) {
  const double8 none = 1e9, wanted = select((double8)(0.0), (double8)(1.0), odd);
#define FITTING(f) select(none, f, f - 2.0 * floor(0.5 * f) == wanted)
  const double8 own = fmin(fmin(FITTING(a), FITTING(b)), FITTING(c));
  const double8 fitting = select(own, FITTING(other), own == none);
#undef FITTING
  const long8 agree = (a == b) & (a == c) & (a == other);
  return select(fitting, fmin(fmin(a, b), c), agree | (fitting == none));
}
#endif

FORCE_INLINE void make_patches(
    constant const job_t* job, tile_t tile, int p, global const double* scratch, int i, int j, int stride, double* out) {
  const int at = j * TILE_RAYS + i;
  const point8 d0 = corners8(scratch, at), d1 = corners8(scratch, at + 1);
  const point8 d2 = corners8(scratch, at + TILE_RAYS + 1), d3 = corners8(scratch, at + TILE_RAYS);
  const point8 bottom = edge_normal(d0, d1), diagonal = edge_normal(d0, d2);
#define STORE_NORMAL(name, value)                       \
  {                                                     \
    const point8 n = value;                             \
    vstore8(n.x, 0, out + (name + 0) * stride);         \
    vstore8(n.y, 0, out + (name + 1) * stride);         \
    vstore8(n.z, 0, out + (name + 2) * stride);         \
  }
  STORE_NORMAL(PATCH_BOTTOM, bottom)
  STORE_NORMAL(PATCH_RIGHT, edge_normal(d1, d2))
  STORE_NORMAL(PATCH_TOP, edge_normal(d3, d2))
  STORE_NORMAL(PATCH_LEFT, edge_normal(d0, d3))
  STORE_NORMAL(PATCH_DIAGONAL, diagonal)
#undef STORE_NORMAL
  // Triple products from differences: exact signs down to the rounding of the corners.
  const double8 first = inner8(bottom, difference8(d2, d0)), second = inner8(diagonal, difference8(d3, d0));
  const double8 first_area = solid_angle(first, d0, d1, d2), second_area = solid_angle(second, d0, d2, d3);
  const double cell = job->step * job->step;
  // Both triangles share the patch's density, also where it folds: a sliver of its own would get half of the energy.
  const double8 share = energy_kept(scratch, at, first_area, second_area) * cell / (first_area + second_area);
  // A patch without area holds no direction.
  const double8 factor = select(sqrt(share), (double8)(0.0), !(share < 1e300));
  const double8 first_factor = select(factor, (double8)(0.0), !(first_area > 0.0));
  const double8 second_factor = select(factor, (double8)(0.0), !(second_area > 0.0));
  vstore8(select(-first_factor, first_factor, first >= 0.0), 0, out + PATCH_FIRST * stride);
  vstore8(select(-second_factor, second_factor, second >= 0.0), 0, out + PATCH_SECOND * stride);

  // -pi/2 from S = -i k r E, and another -pi/2 per focal line.
#ifdef CURVATURE
  global const double* foci = scratch + SCRATCH_EXIT + EXIT_FOCI * TILE_PADDED + at;
  const double8 f0 = vload8(0, foci), f1 = vload8(0, foci + 1);
  const double8 f2 = vload8(0, foci + TILE_RAYS + 1), f3 = vload8(0, foci + TILE_RAYS);
  // A positive turn has an even number of focal lines and reflections together; there are p - 1 inside, or the one.
  const long8 reflects_oddly = (long8)(p % 2 == 0 ? -1 : 0);
  const double8 first_foci = triangle_foci(f0, f1, f2, f3, reflects_oddly ^ (first < 0.0));
  const double8 second_foci = triangle_foci(f0, f2, f3, f1, reflects_oddly ^ (second < 0.0));
  vstore8(-0.5 - 0.5 * first_foci, 0, out + PATCH_FIRST_PHASE * stride);
  vstore8(-0.5 - 0.5 * second_foci, 0, out + PATCH_SECOND_PHASE * stride);
#else
  // By rule: p - 1 inside the drop, one more where the deflection grows with the impact parameter, and those on the
  // axis that the rays carry already.
  double8 phase = -0.5;
  if (job->focal_lines) {
    const double8 lane = (double8)(0, 1, 2, 3, 4, 5, 6, 7);
    const double8 u = job->origin + job->step * (tile.i + i + 0.5 + lane);
    const double v = job->origin + job->step * (tile.j + j + 0.5);
    const double8 zu = d1.z + d2.z - d0.z - d3.z, zv = d2.z + d3.z - d0.z - d1.z;
    const double8 towards_axis = -((d0.x + d1.x + d2.x + d3.x) * u + (d0.y + d1.y + d2.y + d3.y) * v);
    // d(theta)/db has the sign of -dz/db; the deflection counts as positive towards the axis.
    const long8 grows = towards_axis * -(u * zu + v * zv) > 0.0;
    phase -= select((double8)(0.5 * (p - 1)), (double8)(0.5 * p), grows);
  }
  vstore8(phase, 0, out + PATCH_FIRST_PHASE * stride);
  vstore8(phase, 0, out + PATCH_SECOND_PHASE * stride);
#endif
}

// The basis of one hemisphere taken over into the other's at the azimuth of (x, y): they differ by a turn of 2 phi.
FORCE_INLINE double8 other_hemisphere(double8 jones, double x, double y, int from_upper) {
  const double rho2 = fmax(x * x + y * y, 1e-300);
  const double c = (y * y - x * x) / rho2, s = (from_upper ? -2.0 : 2.0) * x * y / rho2;
  // (e1, e2) -> (c e1 + s e2, -s e1 + c e2), for both incident polarisations and both parts.
  return c * jones + s * (double8)(1, -1, 1, -1, 1, -1, 1, -1) * jones.s10325476;
}

// Jones matrices of a cell's corners, all in the basis of one hemisphere.
typedef struct {
  double8 corner[4];
  int hemisphere; // 0 upper, 1 lower
} patch_jones;

FORCE_INLINE patch_jones load_jones(global const double* scratch, int at) {
  const int corner_at[4] = {at, at + 1, at + TILE_RAYS + 1, at + TILE_RAYS};
  global const double* z = scratch + SCRATCH_EXIT + EXIT_Z * TILE_PADDED;
  patch_jones jones;
  const int lower = (z[corner_at[0]] < 0.0) + (z[corner_at[1]] < 0.0) + (z[corner_at[2]] < 0.0) + (z[corner_at[3]] < 0.0);
  jones.hemisphere = lower == 4;
  for (int c = 0; c < 4; ++c) jones.corner[c] = vload8(corner_at[c], scratch + SCRATCH_JONES);
  if (lower != 0 && lower != 4) {
    // Across the equator: the corners below it are taken over into the upper basis.
    for (int c = 0; c < 4; ++c)
      if (z[corner_at[c]] < 0.0)
        jones.corner[c] = other_hemisphere(jones.corner[c], z[corner_at[c] - 2 * TILE_PADDED], z[corner_at[c] - TILE_PADDED], 0);
  }
  return jones;
}

// sin and cos of pi times x: reduction to half a turn is exact, then Taylor to below an ulp of 1, without any choice
// between lanes.
FORCE_INLINE double8 sin_cos_half_turns(double8 x, double8* cosine) {
  const double8 k = rint(x), y = (x - k) * 3.14159265358979323846, y2 = y * y;
  const double8 sign = 1.0 - 2.0 * (k - 2.0 * floor(0.5 * k));
  double8 s = -3.868170170630684e-23, c = -8.896791392450574e-22;
  s = s * y2 + 1.9572941063391263e-20;
  c = c * y2 + 4.110317623312165e-19;
  s = s * y2 - 8.22063524662433e-18;
  c = c * y2 - 1.5619206968586225e-16;
  s = s * y2 + 2.8114572543455206e-15;
  c = c * y2 + 4.779477332387385e-14;
  s = s * y2 - 7.647163731819816e-13;
  c = c * y2 - 1.1470745597729725e-11;
  s = s * y2 + 1.6059043836821613e-10;
  c = c * y2 + 2.08767569878681e-09;
  s = s * y2 - 2.505210838544172e-08;
  c = c * y2 - 2.755731922398589e-07;
  s = s * y2 + 2.7557319223985893e-06;
  c = c * y2 + 2.48015873015873e-05;
  s = s * y2 - 0.0001984126984126984;
  c = c * y2 - 0.001388888888888889;
  s = s * y2 + 0.008333333333333333;
  c = c * y2 + 0.041666666666666664;
  s = s * y2 - 0.16666666666666666;
  c = c * y2 - 0.5;
  *cosine = (c * y2 + 1.0) * sign;
  return (s * y2 * y + y) * sign;
}

typedef struct {
  double8 weight[4];
  double8 sine, cosine; // of the phase, times the amplitude factor
  long8 held;           // lanes that lie in the patch
} column_hits;

// Which of eight directions (sin_theta, cos_theta) at azimuth (cos_phi, sin_phi) the patch holds, and with what
// weights and phasor. patch: the fields of one cell, `stride` apart; corner_phase: half-turns; pass 0 looks into both
// triangles, or into the first alone where the patch is folded, and pass 1 then into the second.
FORCE_INLINE int hits_in_column(const double* patch, int stride, const double* corner_phase, int pass, double cos_phi,
                          double sin_phi, double8 sin_theta, double8 cos_theta, column_hits* hits) {
  const double first_factor = patch[PATCH_FIRST * stride], second_factor = patch[PATCH_SECOND * stride];
  const int folded = first_factor * second_factor < 0.0;
  const long use_first = first_factor != 0.0 && (!folded || pass == 0) ? -1 : 0;
  const long use_second = second_factor != 0.0 && (!folded || pass == 1) ? -1 : 0;
#define EDGE(name)                                                                             \
  ((patch[name * stride] * cos_phi + patch[(name + 1) * stride] * sin_phi) * sin_theta +       \
   patch[(name + 2) * stride] * cos_theta)
  const double8 diagonal = EDGE(PATCH_DIAGONAL), bottom = EDGE(PATCH_BOTTOM), right = EDGE(PATCH_RIGHT),
                top = EDGE(PATCH_TOP), left = EDGE(PATCH_LEFT);
#undef EDGE
  const long8 on_left = diagonal >= 0.0;
  const long8 first_in = first_factor > 0.0 ? (bottom >= 0.0) & (right >= 0.0) & ~on_left
                                            : ~((bottom >= 0.0) | (right >= 0.0)) & on_left;
  const long8 second_in = second_factor > 0.0 ? on_left & ~((top >= 0.0) | (left >= 0.0))
                                              : ~on_left & (top >= 0.0) & (left >= 0.0);
  const long8 in_second = second_in & use_second, held = (first_in & use_first) | in_second;
  hits->held = held;
  if (!any(held)) return 0;
  // Barycentric weights of the direction in its triangle.
  const double8 weight0 = select(right, -top, in_second), weight1 = select(-diagonal, (double8)(0.0), in_second);
  const double8 weight2 = select(bottom, -left, in_second), weight3 = select((double8)(0.0), diagonal, in_second);
  const double8 scale = 1.0 / (weight0 + weight1 + weight2 + weight3);
  hits->weight[0] = weight0 * scale;
  hits->weight[1] = weight1 * scale;
  hits->weight[2] = weight2 * scale;
  hits->weight[3] = weight3 * scale;
  const double8 phase = hits->weight[0] * corner_phase[0] + hits->weight[1] * corner_phase[1] +
                        hits->weight[2] * corner_phase[2] + hits->weight[3] * corner_phase[3] +
                        select((double8)(patch[PATCH_FIRST_PHASE * stride]),
                               (double8)(patch[PATCH_SECOND_PHASE * stride]), in_second);
  double8 cosine;
  const double8 sine = sin_cos_half_turns(phase, &cosine);
  const double8 factor = select((double8)(fabs(first_factor)), (double8)(fabs(second_factor)), in_second);
  hits->sine = sine * factor;
  hits->cosine = cosine * factor;
  return 1;
}

// The Jones matrix of one lane, in the basis of the direction's hemisphere (lower where cos_theta < 0). mirror = -1
// takes the image in the symmetry plane.
FORCE_INLINE double8 hit_amplitude(const patch_jones* jones, double w0, double w1, double w2, double w3, double sine,
                             double cosine, double cos_theta, double cos_phi, double sin_phi, int mirror) {
  const double8 j = w0 * jones->corner[0] + w1 * jones->corner[1] + w2 * jones->corner[2] + w3 * jones->corner[3];
  const double8 turned = (double8)(-j.s4, -j.s5, -j.s6, -j.s7, j.s0, j.s1, j.s2, j.s3);
  double8 amplitude = cosine * j + sine * turned;
  if ((cos_theta < 0.0) != jones->hemisphere)
    amplitude = other_hemisphere(amplitude, cos_phi, sin_phi, !jones->hemisphere);
  return mirror < 0 ? amplitude * (double8)(1, -1, -1, 1, 1, -1, -1, 1) : amplitude;
}

FORCE_INLINE void load_phases(global const double* scratch, int at, double* phase) {
  global const double* from = scratch + SCRATCH_EXIT + EXIT_PHASE * TILE_PADDED + at;
  phase[0] = from[0];
  phase[1] = from[1];
  phase[2] = from[TILE_RAYS + 1];
  phase[3] = from[TILE_RAYS];
}

#ifdef INTENSITIES
#define ACCUMULATOR 16
// Adds the Mueller matrix of one patch, in the scattering plane of the direction (no interference between patches).
FORCE_INLINE void accumulate(global double* sum, double8 j, double cos_phi, double sin_phi, int hemisphere) {
  const double h = hemisphere ? -1.0 : 1.0;
  // Field along (theta, phi) for incident x and y; then incident parallel and perpendicular.
#define PART(o, e1, e2) const double o##_theta = h * cos_phi * e1 + sin_phi * e2, o##_phi = h * cos_phi * e2 - sin_phi * e1;
  PART(xr, j.s0, j.s1) PART(yr, j.s2, j.s3) PART(xi, j.s4, j.s5) PART(yi, j.s6, j.s7)
#undef PART
  const double S2r = xr_theta * cos_phi + yr_theta * sin_phi, S2i = xi_theta * cos_phi + yi_theta * sin_phi;
  const double S3r = xr_theta * sin_phi - yr_theta * cos_phi, S3i = xi_theta * sin_phi - yi_theta * cos_phi;
  const double S4r = -(xr_phi * cos_phi + yr_phi * sin_phi), S4i = -(xi_phi * cos_phi + yi_phi * sin_phi);
  const double S1r = -(xr_phi * sin_phi - yr_phi * cos_phi), S1i = -(xi_phi * sin_phi - yi_phi * cos_phi);
  const double16 m = mueller(S1r, S1i, S2r, S2i, S3r, S3i, S4r, S4i);
  vstore16(vload16(0, sum) + m, 0, sum);
}
#else
#define ACCUMULATOR 8
FORCE_INLINE void accumulate(global double* sum, double8 j, double cos_phi, double sin_phi, int hemisphere) {
  vstore8(vload8(0, sum) + j, 0, sum);
}
#endif

// Where eight neighbouring cells may hold directions: columns and rows, in the table's units, margins included; lo > hi
// where they hold none.
typedef struct {
  double8 column_lo, column_hi, row_lo, row_hi;
  long8 above, below; // the cell reaches into y >= 0, into y < 0
  double8 bend;       // how far its edges may stray, in rows, from straight lines between the corners' columns and rows
  long8 plain;        // that is so: no pole, no seam, not too wide
} cell_bounds;

#define FAR_AWAY 1e30

FORCE_INLINE cell_bounds bound_cells(constant const job_t* job, global const double* scratch, int at) {
  global const double* field = scratch + SCRATCH_EXIT + at;
#define CORNERS(name, lo, hi)                                                                  \
  double8 lo, hi;                                                                              \
  {                                                                                            \
    global const double* f = field + name * TILE_PADDED;                                       \
    const double8 a = vload8(0, f), b = vload8(0, f + 1), c = vload8(0, f + TILE_RAYS), d = vload8(0, f + TILE_RAYS + 1); \
    lo = fmin(fmin(a, b), fmin(c, d));                                                         \
    hi = fmax(fmax(a, b), fmax(c, d));                                                         \
  }
  CORNERS(EXIT_COLUMN, column_lo, column_hi)
  CORNERS(EXIT_ROW, row_lo, row_hi)
  CORNERS(EXIT_X, x_lo, x_hi)
  CORNERS(EXIT_Y, y_lo, y_hi)
  CORNERS(EXIT_Z, z_lo, z_hi)
#undef CORNERS
  const double width = 1.0 / job->columns_per_radian;
  const double8 phi_lo = column_lo * width + job->column_origin, phi_hi = column_hi * width + job->column_origin;
  const long8 lost = column_hi > 0.5 * NOWHERE;
  const long8 across = (y_lo < 0.0) & (y_hi >= 0.0), front = across & (x_lo > 0.0), back = across & (x_hi < 0.0);
  const long8 around = across & ~(front | back); // may hold a pole
  double8 spread = phi_hi - phi_lo;
  spread = select(spread, 2.0 * phi_hi, front);
  spread = select(spread, 2.0 * (3.1415927 - phi_lo), back);
  const long8 wide = around | (spread > 0.5);
  // A great circle rises above the row of its ends by at most (spread/2)^2/2 sin(theta) cos(theta).
  const double8 rise = (0.13 * spread * spread) * job->rows_per_radian + job->row_margin;
  cell_bounds b;
  b.column_lo = select(column_lo - job->column_margin, (double8)(-FAR_AWAY), front | around);
  b.column_hi = select(column_hi + job->column_margin, (double8)(FAR_AWAY), back | around);
  b.row_lo = select(row_lo - rise, (double8)(-FAR_AWAY), wide & (z_hi >= 0.0));
  b.row_hi = select(row_hi + rise, (double8)(FAR_AWAY), wide & (z_lo < 0.0));
  b.row_lo = select(b.row_lo, row_lo - job->row_margin, wide & (z_hi < 0.0));
  b.row_hi = select(b.row_hi, row_hi + job->row_margin, wide & (z_lo >= 0.0));
  b.column_lo = select(b.column_lo, (double8)(FAR_AWAY), lost);
  b.column_hi = select(b.column_hi, (double8)(-FAR_AWAY), lost);
  b.above = y_hi >= 0.0;
  b.below = y_lo < 0.0;
  // Along a great circle theta'' = sin cos + 2 cot theta'^2, primes by phi: the chord errs by spread^2/8 times that.
  const double8 tall = (row_hi - row_lo) / job->rows_per_radian;
  const double8 theta_lo = row_lo / job->rows_per_radian + job->row_origin;
  const double8 from_pole = fmin(theta_lo, 3.1415926 - theta_lo - tall);
  b.plain = !(across | wide | (from_pole < 0.01));
  b.bend = rise + 0.27 * tall * tall / from_pole * job->rows_per_radian;
  return b;
}

// Energy that order p of this tile's complete patches carries, per unit of incident irradiance.
double tile_energy(constant const job_t* job, tile_t tile, global const double* scratch) {
  global const double* energy = scratch + SCRATCH_EXIT + EXIT_ENERGY * TILE_PADDED;
  global const double* column = scratch + SCRATCH_EXIT + EXIT_COLUMN * TILE_PADDED;
  double sum = 0.0;
  for (int j = 0; j < tile.cells_j; ++j)
    for (int i = 0; i < tile.cells_i; ++i) {
      const int at = j * TILE_RAYS + i;
      const double worst = fmax(fmax(column[at], column[at + 1]), fmax(column[at + TILE_RAYS], column[at + TILE_RAYS + 1]));
      if (worst < 0.5 * NOWHERE) sum += energy[at] + energy[at + 1] + energy[at + TILE_RAYS] + energy[at + TILE_RAYS + 1];
    }
  return 0.25 * sum * job->step * job->step;
}

#ifdef __has_builtin
#if __has_builtin(__builtin_prefetch)
#define PREFETCH_ROWS                                                                               \
  {                                                                                                 \
    global double* from = sums + ((size_t)span.column * job->rows + span.row0) * ACCUMULATOR;            \
    for (int n = min(span.row1 - span.row0, 15); n >= 0; --n, from += ACCUMULATOR)                  \
      __builtin_prefetch((const void*)(size_t)from, 1, 3);                                                  \
  }
#endif
#endif
#ifndef PREFETCH_ROWS
#define PREFETCH_ROWS
#endif

// With BLENDED, patches keep but a share of an order at each direction, kept[order][column][row]; the diffraction
// integral has the rest.
#ifdef BLENDED
#define KEPT(column, row) * kept[(size_t)(column) * job->rows + (row)]
#define KEPT_ARGUMENT , global const float* kept_shares
#define KEPT_OF_ORDER(p) (kept_shares + (size_t)(p) * job->columns * job->rows)
#else
#define KEPT(column, row)
#define KEPT_ARGUMENT
#define KEPT_OF_ORDER(p) 0
#endif

// Rows row0..row1 of one column that a cell may hold.
typedef struct {
  int cell, column, row0, row1, mirror;
} span_t;
#define SPANS 128

// Adds what the cell sends into the rows of its span. sines and cosines of the rows are padded with zeros beyond the
// last row: a zero vector lies in no patch.
FORCE_INLINE void lay_span(constant const job_t* job, span_t span, const double* patches, global const double* scratch,
                     int cells_at, global const double* sin_theta, global const double* cos_theta,
                     global const double* cos_phi, global const double* sin_phi, global const float* kept,
                     global double* sums) {
  const double* patch = patches + span.cell;
  const int at = cells_at + span.cell;
  double phase[4];
  load_phases(scratch, at, phase);
  const patch_jones jones = load_jones(scratch, at);
  const double c = cos_phi[span.column], s = span.mirror * sin_phi[span.column];
  global double* column_sums = sums + (size_t)span.column * job->rows * ACCUMULATOR;
  const int passes = patch[PATCH_FIRST * TILE] * patch[PATCH_SECOND * TILE] < 0.0 ? 2 : 1;
  for (int pass = 0; pass < passes; ++pass)
    for (int row = span.row0; row <= span.row1; row += 8) {
      column_hits hits;
      const double8 ct = vload8(0, cos_theta + row);
      if (!hits_in_column(patch, TILE, phase, pass, c, s, vload8(0, sin_theta + row), ct, &hits)) continue;
      double w[4][8], sine[8], cosine[8];
      long held[8];
      for (int corner = 0; corner < 4; ++corner) vstore8(hits.weight[corner], 0, w[corner]);
      vstore8(hits.sine, 0, sine);
      vstore8(hits.cosine, 0, cosine);
      vstore8(hits.held, 0, held);
      const int lanes = min(8, span.row1 - row + 1);
      for (int lane = 0; lane < lanes; ++lane) {
        if (!held[lane]) continue;
        const double cos_theta_here = cos_theta[row + lane];
        const double8 j = hit_amplitude(&jones, w[0][lane], w[1][lane], w[2][lane], w[3][lane], sine[lane], cosine[lane],
                                        cos_theta_here, c, s, span.mirror) KEPT(span.column, row + lane);
        accumulate(column_sums + (size_t)(row + lane) * ACCUMULATOR, j, c, span.mirror * s, cos_theta_here < 0.0);
      }
    }
}

// Tiles first..last-1 into one table of sums [column][row][ACCUMULATOR]. One work-item: the order of the additions is
// the order of the tiles, whatever runs beside it.
kernel void raster_tiles(
    constant double* surface, constant job_t* job, global const tile_t* tiles, int first, int last,
    global const int* wanted, global const double* sin_theta, global const double* cos_theta,
    global const double* cos_phi, global const double* sin_phi, global double* scratch, global double* sums,
    global double* energy KEPT_ARGUMENT) {
  double patches[PATCH_FIELDS * TILE];
  span_t spans[SPANS];
  for (int t = first; t < last; ++t) {
    const tile_t tile = tiles[t];
    for (int p = 0; p <= job->last_order; ++p) {
      trace_tile(surface, job, tile, p, scratch);
      energy[t * (job->last_order + 1) + p] = tile_energy(job, tile, scratch);
      if (!wanted[p]) continue;
      for (int j = 0; j < tile.cells_j; ++j) {
        const int cells_at = j * TILE_RAYS;
        int count = 0;
#define LAY_SPANS                                                                                                \
  for (int n = 0; n < count; ++n)                                                                                \
    lay_span(job, spans[n], patches, scratch, cells_at, sin_theta, cos_theta, cos_phi, sin_phi, KEPT_OF_ORDER(p), \
             sums);                                                                                             \
  count = 0;
        for (int i = 0; i < tile.cells_i; i += 8) {
          const cell_bounds b = bound_cells(job, scratch, cells_at + i);
          const double8 c0 = fmax(ceil(b.column_lo), 0.0), c1 = fmin(floor(b.column_hi), job->columns - 1.0);
          const double8 r0 = fmax(ceil(b.row_lo), 0.0), r1 = fmin(floor(b.row_hi), job->rows - 1.0);
          const long8 reflected = tile.flags & TILE_DIRECT ? (long8)(0) : b.below;
          const long8 some = (c0 <= c1) & (r0 <= r1) & (b.above | reflected);
          if (!any(some)) continue;
          make_patches(job, tile, p, scratch, i, j, TILE, patches + i);
          // Column by column of all eight cells; where an edge crosses the column, linear between the corners.
          global const double* field = scratch + SCRATCH_EXIT + cells_at + i;
#define CORNER(name, offset) vload8(0, field + name * TILE_PADDED + offset)
          const double8 ca = CORNER(EXIT_COLUMN, 0), cb = CORNER(EXIT_COLUMN, 1);
          const double8 cc = CORNER(EXIT_COLUMN, TILE_RAYS + 1), cd = CORNER(EXIT_COLUMN, TILE_RAYS);
          const double8 ra = CORNER(EXIT_ROW, 0), rb = CORNER(EXIT_ROW, 1);
          const double8 rc = CORNER(EXIT_ROW, TILE_RAYS + 1), rd = CORNER(EXIT_ROW, TILE_RAYS);
#undef CORNER
          const double8 ab = (rb - ra) / (cb - ca), bc = (rc - rb) / (cc - cb);
          const double8 cd_slope = (rd - rc) / (cd - cc), da = (ra - rd) / (ca - cd), ac = (rc - ra) / (cc - ca);
          long above[8], mirrored[8];
          vstore8(b.above, 0, above);
          vstore8(reflected, 0, mirrored);
          const int lanes = min(8, tile.cells_i - i);
          for (double8 column = c0;; column += 1.0) {
            const long8 active = some & (column <= c1);
            if (!any(active)) break;
            double8 lo = FAR_AWAY, hi = -FAR_AWAY;
#define CROSS(c_from, r_from, c_to, slope)                                  \
  {                                                                         \
    const long8 crosses = (c_from <= column) ^ (c_to <= column);            \
    const double8 row = r_from + (column - c_from) * slope;                 \
    lo = select(lo, fmin(lo, row), crosses);                                \
    hi = select(hi, fmax(hi, row), crosses);                                \
  }
            CROSS(ca, ra, cb, ab) CROSS(cb, rb, cc, bc) CROSS(cc, rc, cd, cd_slope) CROSS(cd, rd, ca, da)
            CROSS(ca, ra, cc, ac) // bounds the patch where it folds
#undef CROSS
            const long8 spanned = b.plain & (lo <= hi);
            const double8 from = select(r0, fmax(r0, ceil(lo - b.bend)), spanned);
            const double8 to = select(r1, fmin(r1, floor(hi + b.bend)), spanned);
            int columns[8], first_row[8], last_row[8];
            long hold[8];
            vstore8(convert_int8(column), 0, columns);
            vstore8(convert_int8(from), 0, first_row);
            vstore8(convert_int8(to), 0, last_row);
            vstore8(active & (from <= to), 0, hold);
            for (int lane = 0; lane < lanes; ++lane) {
              if (!hold[lane]) continue;
              span_t span = {i + lane, columns[lane], first_row[lane], last_row[lane], 1};
              // The sums are far larger than any cache: ask for the rows while the other spans are worked off.
              PREFETCH_ROWS
              if (above[lane]) spans[count++] = span;
              span.mirror = -1;
              if (mirrored[lane]) spans[count++] = span;
              if (count > SPANS - 2) {
                LAY_SPANS
              }
            }
          }
        }
        LAY_SPANS
      }
    }
  }
}

// Boxes around the outgoing directions of every tile and order, [tile][order][6], lo > hi where nothing left the drop;
// the work-items share the tiles out, each with its own scratch.
kernel void bound_tiles(constant double* surface, constant job_t* job, global const tile_t* tiles, int count,
                        global double* scratch, global double* boxes, global double* energy) {
  global double* own = scratch + (size_t)get_global_id(0) * SCRATCH_DOUBLES;
  for (int t = get_global_id(0); t < count; t += get_global_size(0)) {
    const tile_t tile = tiles[t];
    for (int p = 0; p <= job->last_order; ++p) {
      trace_tile(surface, job, tile, p, own);
      energy[t * (job->last_order + 1) + p] = tile_energy(job, tile, own);
      double lo[3] = {4, 4, 4}, hi[3] = {-4, -4, -4};
      for (int j = 0; j <= tile.cells_j; ++j)
        for (int i = 0; i <= tile.cells_i; ++i) {
          global const double* field = own + SCRATCH_EXIT + j * TILE_RAYS + i;
          if (field[EXIT_COLUMN * TILE_PADDED] > 0.5 * NOWHERE) continue;
          for (int axis = 0; axis < 3; ++axis) {
            lo[axis] = fmin(lo[axis], field[axis * TILE_PADDED]);
            hi[axis] = fmax(hi[axis], field[axis * TILE_PADDED]);
          }
        }
      global double* box = boxes + ((size_t)t * (job->last_order + 1) + p) * 6;
      for (int axis = 0; axis < 3; ++axis) {
        box[axis] = lo[axis];
        box[3 + axis] = hi[axis];
      }
    }
  }
}

// One direction that a tile's order may hold; in units of radians for the quick angles.
typedef struct {
  int order, direction, mirror, unused;
} candidate_t;

// Amplitudes of tile by tile: candidates first[t]..first[t+1]-1 belong to tile tiles[t], sorted by order; out holds
// ACCUMULATOR doubles per candidate. job->rows_per_radian and columns_per_radian are 1 and the origins 0.
kernel void evaluate_candidates(
    constant double* surface, constant job_t* job, global const tile_t* tiles, global const int* first, int count,
    global const candidate_t* candidates, global const double* directions, global double* scratch, global double* out) {
  global double* own = scratch + (size_t)get_global_id(0) * SCRATCH_DOUBLES;
  double patches[PATCH_FIELDS * 8];
  for (int t = get_global_id(0); t < count; t += get_global_size(0)) {
    const tile_t tile = tiles[t];
    int next = first[t];
    const int end = first[t + 1];
    for (int p = 0; p <= job->last_order && next < end; ++p) {
      trace_tile(surface, job, tile, p, own);
      for (; next < end && candidates[next].order == p; ++next) {
        const candidate_t candidate = candidates[next];
        // theta, phi, sin_theta, cos_theta, cos_phi, sin_phi
        global const double* direction = directions + 6 * (size_t)candidate.direction;
        global double* sum = out + (size_t)next * ACCUMULATOR;
        for (int c = 0; c < ACCUMULATOR; ++c) sum[c] = 0.0;
        const double theta = direction[0], phi = direction[1];
        const double8 sin_theta = (double8)(direction[2], 0, 0, 0, 0, 0, 0, 0);
        const double8 cos_theta = (double8)(direction[3], 0, 0, 0, 0, 0, 0, 0);
        for (int j = 0; j < tile.cells_j; ++j)
          for (int i = 0; i < tile.cells_i; i += 8) {
            const cell_bounds b = bound_cells(job, own, j * TILE_RAYS + i);
            const long8 some = (b.column_lo <= phi) & (phi <= b.column_hi) & (b.row_lo <= theta) & (theta <= b.row_hi);
            if (!any(some)) continue;
            make_patches(job, tile, p, own, i, j, 8, patches);
            long hold[8];
            vstore8(some & (candidate.mirror > 0 ? b.above : b.below), 0, hold);
            const int lanes = min(8, tile.cells_i - i);
            for (int lane = 0; lane < lanes; ++lane) {
              if (!hold[lane]) continue;
              const int at = j * TILE_RAYS + i + lane;
              double phase[4];
              load_phases(own, at, phase);
              const patch_jones jones = load_jones(own, at);
              const double s = candidate.mirror * direction[5];
              for (int pass = 0; pass < 2; ++pass) {
                column_hits hits;
                if (pass == 1 && !(patches[PATCH_FIRST * 8 + lane] * patches[PATCH_SECOND * 8 + lane] < 0.0)) break;
                if (!hits_in_column(patches + lane, 8, phase, pass, direction[4], s, sin_theta, cos_theta, &hits) ||
                    !hits.held.s0)
                  continue;
                accumulate(sum,
                           hit_amplitude(&jones, hits.weight[0].s0, hits.weight[1].s0, hits.weight[2].s0,
                                         hits.weight[3].s0, hits.sine.s0, hits.cosine.s0, direction[3], direction[4], s,
                                         candidate.mirror),
                           direction[4], direction[5], direction[3] < 0.0);
              }
            }
          }
      }
    }
  }
}
