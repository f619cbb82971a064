// Tiles of the ray grid: traced order by order, their patches laid over directions. Needs trace.cl before it.
//
// A patch is the cell between four neighbouring rays: two spherical triangles that share the diagonal from (i, j) to
// (i+1, j+1). Every edge is a great circle whose sign at a direction is computed the same way by both neighbours, so
// that each direction of a sheet lies in exactly one triangle, whatever folds, twists, poles or seams it has.
//
// The build defines TILE (cells across a tile).

#define TILE_RAYS (TILE + 1)
#define TILE_PADDED ((TILE_RAYS * TILE_RAYS + RAY_LANES - 1) / RAY_LANES * RAY_LANES)

// Scratch of one work-item, in doubles: the rays inside the drop, then what left it at this order.
#define STATE_FIELDS 21
#define EXIT_FIELDS 7
#define SCRATCH_EXIT (STATE_FIELDS * TILE_PADDED)
#define SCRATCH_JONES (SCRATCH_EXIT + EXIT_FIELDS * TILE_PADDED)
#define SCRATCH_DOUBLES (SCRATCH_JONES + 8 * TILE_PADDED)
enum { EXIT_X, EXIT_Y, EXIT_Z, EXIT_PHASE, EXIT_ROW, EXIT_COLUMN, EXIT_ENERGY };

#define NOWHERE 1e300 // column of a ray that did not leave

typedef struct {
  int i, j;         // first ray
  int cells_i, cells_j;
  int flags;
} tile_t;
#define TILE_RIM 1    // near the rim: Newton's iteration needs more steps
#define TILE_DIRECT 2 // its mirror image is traced too (or is itself): no reflection in the symmetry plane

typedef struct {
  double n, k;        // refractive index
  double wave;        // half-turns of phase per unit of optical path: 2 a / lambda
  double attenuation; // of the amplitude per unit of path inside: 2 pi k a / lambda
  double origin;      // u of ray 0; v likewise
  double step;        // between rays
  double row_origin, rows_per_radian; // where a direction falls in the table; only to find candidates
  double column_origin, columns_per_radian;
  double row_margin, column_margin;   // how far the quick angles may be off
  int rays;           // across the grid
  int last_order;
  int rows, columns;
  int focal_lines;    // 0: none, 1: the sign rule
  int interior_steps, rim_steps;
} job_t;

// Angle of the point (x, y), y >= 0, in [0, pi] to 2e-8: Abramowitz & Stegun 4.4.49.
inline real quick_angle(real y, real x) {
  const real a = fabs(x), big = fmax(a, y), small_ = fmin(a, y);
  const real q = small_ / fmax(big, 1e-300), q2 = q * q;
  real s = 0.0028662257;
  s = s * q2 - 0.0161657367;
  s = s * q2 + 0.0429096138;
  s = s * q2 - 0.0752896400;
  s = s * q2 + 0.1065626393;
  s = s * q2 - 0.1420889944;
  s = s * q2 + 0.1999355085;
  s = s * q2 - 0.3333314528;
  real angle = q + q * q2 * s;
  angle = select(angle, 1.5707963267948966 - angle, y > a);
  return select(angle, 3.141592653589793 - angle, x < 0.0);
}

inline void load_state(global const double* scratch, int at, ray_state* ray) {
  global const double* field = scratch + at;
#define NEXT_FIELD(target) target = load_real(field); field += TILE_PADDED;
  NEXT_FIELD(ray->p.x) NEXT_FIELD(ray->p.y) NEXT_FIELD(ray->p.z)
  NEXT_FIELD(ray->d.x) NEXT_FIELD(ray->d.y) NEXT_FIELD(ray->d.z)
  NEXT_FIELD(ray->s.x) NEXT_FIELD(ray->s.y) NEXT_FIELD(ray->s.z)
  NEXT_FIELD(ray->px.re) NEXT_FIELD(ray->px.im) NEXT_FIELD(ray->py.re) NEXT_FIELD(ray->py.im)
  NEXT_FIELD(ray->sx.re) NEXT_FIELD(ray->sx.im) NEXT_FIELD(ray->sy.re) NEXT_FIELD(ray->sy.im)
  NEXT_FIELD(ray->path) NEXT_FIELD(ray->side) NEXT_FIELD(ray->axis_crossings) NEXT_FIELD(ray->alive)
#undef NEXT_FIELD
}

inline void store_state(global double* scratch, int at, const ray_state* ray) {
  global double* field = scratch + at;
#define NEXT_FIELD(source) store_real(source, field); field += TILE_PADDED;
  NEXT_FIELD(ray->p.x) NEXT_FIELD(ray->p.y) NEXT_FIELD(ray->p.z)
  NEXT_FIELD(ray->d.x) NEXT_FIELD(ray->d.y) NEXT_FIELD(ray->d.z)
  NEXT_FIELD(ray->s.x) NEXT_FIELD(ray->s.y) NEXT_FIELD(ray->s.z)
  NEXT_FIELD(ray->px.re) NEXT_FIELD(ray->px.im) NEXT_FIELD(ray->py.re) NEXT_FIELD(ray->py.im)
  NEXT_FIELD(ray->sx.re) NEXT_FIELD(ray->sx.im) NEXT_FIELD(ray->sy.re) NEXT_FIELD(ray->sy.im)
  NEXT_FIELD(ray->path) NEXT_FIELD(ray->side) NEXT_FIELD(ray->axis_crossings) NEXT_FIELD(ray->alive)
#undef NEXT_FIELD
}

// Eight rays' Jones matrices from one vector per element to one vector per ray.
inline void store_jones(global double* out, double8 f0, double8 f1, double8 f2, double8 f3, double8 f4, double8 f5,
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

// Traces order p of every ray of the tile into the scratch.
void trace_tile(constant const double* surface, constant const job_t* job, tile_t tile, int p, global double* scratch) {
  const int steps = tile.flags & TILE_RIM ? job->rim_steps : job->interior_steps;
  const real lane = (real)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  for (int at = 0; at < TILE_PADDED; at += RAY_LANES) {
    const real index = (double)at + lane;
    const real row = floor((index + 0.5) * (1.0 / TILE_RAYS));
    const real i = index - row * TILE_RAYS + (double)tile.i, j = row + (double)tile.j;
    const real u = job->origin + i * job->step, v = job->origin + j * job->step;
    ray_state ray;
    exit_ray out;
    if (p == 0) {
      enter(surface, job->n, job->k, job->attenuation, u, v, steps, &ray, &out);
      const mask outside = (i > job->rays - 0.5) | (j > job->rays - 0.5);
      out.valid = select(out.valid, (real)(0.0), outside);
      ray.alive = out.valid;
    } else {
      load_state(scratch, at, &ray);
      const vector3 impact = {u, v, (real)(0.0)};
      bounce(surface, job->n, job->k, job->attenuation, impact, job->interior_steps, &ray, &out);
    }
    if (p < job->last_order) store_state(scratch, at, &ray);

    global double* field = scratch + SCRATCH_EXIT + at;
    const mask lost = out.valid < 0.5;
    store_real(out.d.x, field + EXIT_X * TILE_PADDED);
    store_real(out.d.y, field + EXIT_Y * TILE_PADDED);
    store_real(out.d.z, field + EXIT_Z * TILE_PADDED);
    const double focal = job->focal_lines ? 0.5 : 0.0;
    store_real(job->wave * out.path - focal * out.axis_crossings, field + EXIT_PHASE * TILE_PADDED);
    const real theta = quick_angle(sqrt(out.d.x * out.d.x + out.d.y * out.d.y), out.d.z);
    const real phi = quick_angle(fabs(out.d.y), out.d.x);
    store_real((theta - job->row_origin) * job->rows_per_radian, field + EXIT_ROW * TILE_PADDED);
    const real column = (phi - job->column_origin) * job->columns_per_radian;
    store_real(select(column, (real)(NOWHERE), lost), field + EXIT_COLUMN * TILE_PADDED);
    const real energy = 0.5 * (out.e1x.re * out.e1x.re + out.e1x.im * out.e1x.im + out.e2x.re * out.e2x.re +
                               out.e2x.im * out.e2x.im + out.e1y.re * out.e1y.re + out.e1y.im * out.e1y.im +
                               out.e2y.re * out.e2y.re + out.e2y.im * out.e2y.im);
    store_real(select(energy, (real)(0.0), lost), field + EXIT_ENERGY * TILE_PADDED);
    global double* jones = scratch + SCRATCH_JONES + 8 * at;
    store_jones(jones, out.e1x.re.lo, out.e2x.re.lo, out.e1y.re.lo, out.e2y.re.lo, out.e1x.im.lo, out.e2x.im.lo,
                out.e1y.im.lo, out.e2y.im.lo);
    store_jones(jones + 64, out.e1x.re.hi, out.e2x.re.hi, out.e1y.re.hi, out.e2y.re.hi, out.e1x.im.hi, out.e2x.im.hi,
                out.e1y.im.hi, out.e2y.im.hi);
  }
}

typedef struct {
  double x, y, z;
} point3;

inline point3 difference(point3 a, point3 b) {
  const point3 c = {a.x - b.x, a.y - b.y, a.z - b.z};
  return c;
}
inline double inner(point3 a, point3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
// Normal of the great circle a -> b, without the cancellation of a x b for close points.
inline point3 edge_normal(point3 a, point3 b) {
  const point3 d = difference(b, a);
  const point3 n = {a.y * d.z - a.z * d.y, a.z * d.x - a.x * d.z, a.x * d.y - a.y * d.x};
  return n;
}

// A patch ready to be laid over directions. Corners: 0 = (i, j), 1 = (i+1, j), 2 = (i+1, j+1), 3 = (i, j+1).
typedef struct {
  point3 bottom, right, top, left, diagonal; // normals of 0->1, 1->2, 3->2, 0->3, 0->2
  double8 jones[2][4]; // per hemisphere of the direction, per corner; times the amplitude factor
  double phase[4];     // half-turns
  double phase_offset; // half-turns, the same for the whole patch
  double first_factor, second_factor; // sqrt(a/s) of the triangles 012 and 023; 0 drops the triangle
  int first_turn, second_turn;        // +1 counter-clockwise, -1 clockwise
  int folded;          // the triangles overlap: a direction may lie in both
} patch_t;

inline point3 corner(global const double* scratch, int at) {
  global const double* field = scratch + SCRATCH_EXIT + at;
  const point3 d = {field[EXIT_X * TILE_PADDED], field[EXIT_Y * TILE_PADDED], field[EXIT_Z * TILE_PADDED]};
  return d;
}

// Solid angle of the triangle from its triple product (Van Oosterom & Strackee 1983).
inline double solid_angle(double triple, point3 a, point3 b, point3 c) {
  const double below = 1.0 + inner(a, b) + inner(b, c) + inner(c, a);
  const double t = fabs(triple) / below;
  if (below > 0.0 && t < 0.02) {
    const double t2 = t * t;
    return 2.0 * t * (1.0 - t2 * (1.0 / 3.0 - t2 * (0.2 - t2 * (1.0 / 7.0 - t2 * (1.0 / 9.0)))));
  }
  return 2.0 * atan2(fabs(triple), below);
}

// The basis of a corner in one hemisphere taken over into the other's (they differ by a turn of 2 phi).
inline double8 other_hemisphere(double8 jones, point3 d, int from_upper) {
  const double rho2 = fmax(d.x * d.x + d.y * d.y, 1e-300);
  const double c = (d.y * d.y - d.x * d.x) / rho2, s = (from_upper ? -2.0 : 2.0) * d.x * d.y / rho2;
  // (e1, e2) -> (c e1 + s e2, -s e1 + c e2), for both incident polarisations and both parts.
  return c * jones + s * (double8)(1, -1, 1, -1, 1, -1, 1, -1) * jones.s10325476;
}

// Fills the patch at cell (i, j) of the tile. False when no direction can be in it.
inline int make_patch(
    constant const job_t* job, tile_t tile, int p, global const double* scratch, int i, int j, patch_t* patch) {
  const int at[4] = {j * TILE_RAYS + i, j * TILE_RAYS + i + 1, (j + 1) * TILE_RAYS + i + 1, (j + 1) * TILE_RAYS + i};
  point3 d[4];
  for (int c = 0; c < 4; ++c) d[c] = corner(scratch, at[c]);
  patch->bottom = edge_normal(d[0], d[1]);
  patch->right = edge_normal(d[1], d[2]);
  patch->top = edge_normal(d[3], d[2]);
  patch->left = edge_normal(d[0], d[3]);
  patch->diagonal = edge_normal(d[0], d[2]);
  // Triple products from differences: exact signs down to the rounding of the corners.
  const double first = inner(patch->bottom, difference(d[2], d[0]));
  const double second = inner(patch->diagonal, difference(d[3], d[0]));
  const double first_area = solid_angle(first, d[0], d[1], d[2]), second_area = solid_angle(second, d[0], d[2], d[3]);
  const double cell = job->step * job->step;
  patch->first_turn = first >= 0.0 ? 1 : -1;
  patch->second_turn = second >= 0.0 ? 1 : -1;
  patch->folded = patch->first_turn != patch->second_turn;
  if (patch->folded) {
    patch->first_factor = first_area > 0.0 ? sqrt(0.5 * cell / first_area) : 0.0;
    patch->second_factor = second_area > 0.0 ? sqrt(0.5 * cell / second_area) : 0.0;
  } else {
    const double area = first_area + second_area;
    patch->first_factor = patch->second_factor = area > 0.0 ? sqrt(cell / area) : 0.0;
  }
  if (patch->first_factor == 0.0 && patch->second_factor == 0.0) return 0;

  int upper = 0;
  for (int c = 0; c < 4; ++c) upper += d[c].z >= 0.0;
  for (int c = 0; c < 4; ++c) {
    const double8 jones = vload8(at[c], scratch + SCRATCH_JONES);
    if (upper == 4) patch->jones[0][c] = jones;
    else if (upper == 0) patch->jones[1][c] = jones;
    else {
      const int is_upper = d[c].z >= 0.0;
      const double8 turned = other_hemisphere(jones, d[c], is_upper);
      patch->jones[0][c] = is_upper ? jones : turned;
      patch->jones[1][c] = is_upper ? turned : jones;
    }
    patch->phase[c] = scratch[SCRATCH_EXIT + EXIT_PHASE * TILE_PADDED + at[c]];
  }
  // -pi/2 from S = -i k r E; with the focal-line rule another -pi/2 per focal line: p - 1 inside the drop, one more
  // where the deflection grows with the impact parameter, and those on the axis that the rays carry already.
  patch->phase_offset = -0.5;
  if (job->focal_lines) {
    const double u = job->origin + job->step * (tile.i + i + 0.5), v = job->origin + job->step * (tile.j + j + 0.5);
    const double zu = d[1].z + d[2].z - d[0].z - d[3].z, zv = d[2].z + d[3].z - d[0].z - d[1].z;
    const double towards_axis = -((d[0].x + d[1].x + d[2].x + d[3].x) * u + (d[0].y + d[1].y + d[2].y + d[3].y) * v);
    // d(theta)/db has the sign of -dz/db; the deflection counts as positive towards the axis.
    const int grows = towards_axis * -(u * zu + v * zv) > 0.0;
    patch->phase_offset -= 0.5 * (p - 1 + grows);
  }
  return 1;
}

// sin and cos of pi times x: reduction to an eighth of a turn is exact, then Taylor to below half an ulp.
inline double8 sin_cos_half_turns(double8 x, double8* cosine) {
  const double8 k = rint(x + x), y = (x - 0.5 * k) * 3.14159265358979323846, y2 = y * y;
  double8 s = -7.6471637318198164759e-13, c = -1.1470745597729724714e-11;
  s = s * y2 + 1.6059043836821614599e-10;
  c = c * y2 + 2.0876756987868098979e-9;
  s = s * y2 - 2.5052108385441718775e-8;
  c = c * y2 - 2.7557319223985890653e-7;
  s = s * y2 + 2.7557319223985890653e-6;
  c = c * y2 + 2.4801587301587301587e-5;
  s = s * y2 - 1.9841269841269841270e-4;
  c = c * y2 - 1.3888888888888888889e-3;
  s = s * y2 + 8.3333333333333333333e-3;
  c = c * y2 + 4.1666666666666666667e-2;
  s = s * y2 - 1.6666666666666666667e-1;
  c = c * y2 - 0.5;
  s = s * y2 * y + y;
  c = c * y2 + 1.0;
  const double8 quarter = k - 4.0 * floor(0.25 * k);
  const long8 odd = (quarter == 1.0) | (quarter == 3.0);
  const double8 sine = select(s, c, odd), cosine_ = select(c, s, odd);
  *cosine = select(cosine_, -cosine_, (quarter == 1.0) | (quarter == 2.0));
  return select(sine, -sine, quarter >= 2.0);
}

typedef struct {
  double8 weight[4];
  double8 sine, cosine; // of the phase, times the amplitude factor
  long8 held;           // lanes that lie in the patch
} column_hits;

// Which of eight directions (sin_theta, cos_theta) at azimuth (cos_phi, sin_phi) the patch holds, and with what
// weights and phasor. use_first, use_second: which triangles count.
inline int hits_in_column(const patch_t* patch, int use_first, int use_second, double cos_phi, double sin_phi,
                          double8 sin_theta, double8 cos_theta, column_hits* hits) {
#define EDGE(name) \
  ((patch->name.x * cos_phi + patch->name.y * sin_phi) * sin_theta + patch->name.z * cos_theta)
  const double8 diagonal = EDGE(diagonal), bottom = EDGE(bottom), right = EDGE(right), top = EDGE(top),
                left = EDGE(left);
#undef EDGE
  const long8 on_left = diagonal >= 0.0;
  const long8 first_in =
      patch->first_turn > 0 ? (bottom >= 0.0) & (right >= 0.0) & ~on_left : ~((bottom >= 0.0) | (right >= 0.0)) & on_left;
  const long8 second_in =
      patch->second_turn > 0 ? on_left & ~((top >= 0.0) | (left >= 0.0)) : ~on_left & (top >= 0.0) & (left >= 0.0);
  const long8 in_first = use_first ? first_in : (long8)(0), in_second = use_second ? second_in : (long8)(0);
  const long8 held = in_first | in_second;
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
  const double8 phase = hits->weight[0] * patch->phase[0] + hits->weight[1] * patch->phase[1] +
                        hits->weight[2] * patch->phase[2] + hits->weight[3] * patch->phase[3] + patch->phase_offset;
  double8 cosine;
  const double8 sine = sin_cos_half_turns(phase, &cosine);
  const double8 factor = select((double8)(patch->first_factor), (double8)(patch->second_factor), in_second);
  hits->sine = sine * factor;
  hits->cosine = cosine * factor;
  return 1;
}

// The Jones matrix of one lane. mirror = -1 takes the image in the symmetry plane.
inline double8 hit_amplitude(
    const patch_t* patch, int hemisphere, double w0, double w1, double w2, double w3, double sine, double cosine, int mirror) {
  const double8* jones = patch->jones[hemisphere];
  const double8 j = w0 * jones[0] + w1 * jones[1] + w2 * jones[2] + w3 * jones[3];
  const double8 turned = (double8)(-j.s4, -j.s5, -j.s6, -j.s7, j.s0, j.s1, j.s2, j.s3);
  const double8 amplitude = cosine * j + sine * turned;
  return mirror < 0 ? amplitude * (double8)(1, -1, -1, 1, 1, -1, -1, 1) : amplitude;
}

#ifdef INTENSITIES
#define ACCUMULATOR 16
// Adds the Mueller matrix of one patch, in the scattering plane of the direction (no interference between patches).
inline void accumulate(global double* sum, double8 j, double cos_phi, double sin_phi, int hemisphere) {
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
inline void accumulate(global double* sum, double8 j, double cos_phi, double sin_phi, int hemisphere) {
  vstore8(vload8(0, sum) + j, 0, sum);
}
#endif

// Lays one patch over columns c0..c1 and rows r0..r1 of the table. sines and cosines of the rows are padded with
// zeros to a multiple of 8 beyond the last row; a zero vector lies in no patch.
void lay_patch(const patch_t* patch, int c0, int c1, int r0, int r1, int mirror, int rows, global const double* sin_theta,
               global const double* cos_theta, global const double* cos_phi, global const double* sin_phi,
               global double* sums) {
  const int passes = patch->folded ? 2 : 1;
  for (int pass = 0; pass < passes; ++pass) {
    const int use_first = (!patch->folded || pass == 0) && patch->first_factor > 0.0;
    const int use_second = (!patch->folded || pass == 1) && patch->second_factor > 0.0;
    for (int column = c0; column <= c1; ++column) {
      const double c = cos_phi[column], s = mirror * sin_phi[column];
      global double* column_sums = sums + (size_t)column * rows * ACCUMULATOR;
      for (int row = r0; row <= r1; row += 8) {
        column_hits hits;
        const double8 ct = vload8(0, cos_theta + row);
        if (!hits_in_column(patch, use_first, use_second, c, s, vload8(0, sin_theta + row), ct, &hits)) continue;
        double w[4][8], sine[8], cosine[8], z[8];
        long held[8];
        for (int corner_ = 0; corner_ < 4; ++corner_) vstore8(hits.weight[corner_], 0, w[corner_]);
        vstore8(hits.sine, 0, sine);
        vstore8(hits.cosine, 0, cosine);
        vstore8(ct, 0, z);
        vstore8(hits.held, 0, held);
        const int lanes = min(8, r1 - row + 1);
        for (int lane = 0; lane < lanes; ++lane) {
          if (!held[lane]) continue;
          const int hemisphere = z[lane] < 0.0;
          const double8 j = hit_amplitude(
              patch, hemisphere, w[0][lane], w[1][lane], w[2][lane], w[3][lane], sine[lane], cosine[lane], mirror);
          accumulate(column_sums + (size_t)(row + lane) * ACCUMULATOR, j, c, mirror * s, hemisphere);
        }
      }
    }
  }
}

// Where eight neighbouring cells may hold directions: columns and rows, in the table's units, margins included; lo > hi
// where they hold none.
typedef struct {
  double8 column_lo, column_hi, row_lo, row_hi;
  long8 above, below; // the cell reaches into y >= 0, into y < 0
} cell_bounds;

#define FAR_AWAY 1e30

inline cell_bounds bound_cells(constant const job_t* job, global const double* scratch, int at) {
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

// Tiles first..last-1 into one table of sums [column][row][ACCUMULATOR]. One work-item: the order of the additions is
// the order of the tiles, whatever runs beside it.
kernel void raster_tiles(
    constant double* surface, constant job_t* job, global const tile_t* tiles, int first, int last,
    global const int* wanted, global const double* sin_theta, global const double* cos_theta,
    global const double* cos_phi, global const double* sin_phi, global double* scratch, global double* sums,
    global double* energy) {
  for (int t = first; t < last; ++t) {
    const tile_t tile = tiles[t];
    for (int p = 0; p <= job->last_order; ++p) {
      trace_tile(surface, job, tile, p, scratch);
      energy[t * (job->last_order + 1) + p] = tile_energy(job, tile, scratch);
      if (!wanted[p]) continue;
      for (int j = 0; j < tile.cells_j; ++j)
        for (int i = 0; i < tile.cells_i; i += 8) {
          const cell_bounds b = bound_cells(job, scratch, j * TILE_RAYS + i);
          const double8 c0 = fmax(ceil(b.column_lo), 0.0), c1 = fmin(floor(b.column_hi), job->columns - 1.0);
          const double8 r0 = fmax(ceil(b.row_lo), 0.0), r1 = fmin(floor(b.row_hi), job->rows - 1.0);
          const long8 some = (c0 <= c1) & (r0 <= r1);
          if (!any(some)) continue;
          double c0s[8], c1s[8], r0s[8], r1s[8];
          long hold[8], above[8], below[8];
          vstore8(c0, 0, c0s);
          vstore8(c1, 0, c1s);
          vstore8(r0, 0, r0s);
          vstore8(r1, 0, r1s);
          vstore8(some, 0, hold);
          vstore8(b.above, 0, above);
          vstore8(b.below, 0, below);
          const int lanes = min(8, tile.cells_i - i);
          for (int lane = 0; lane < lanes; ++lane) {
            if (!hold[lane]) continue;
            const int reflected = below[lane] && !(tile.flags & TILE_DIRECT);
            if (!above[lane] && !reflected) continue;
            patch_t patch;
            if (!make_patch(job, tile, p, scratch, i + lane, j, &patch)) continue;
            const int column0 = (int)c0s[lane], column1 = (int)c1s[lane], row0 = (int)r0s[lane], row1 = (int)r1s[lane];
            if (above[lane])
              lay_patch(&patch, column0, column1, row0, row1, 1, job->rows, sin_theta, cos_theta, cos_phi, sin_phi, sums);
            if (reflected)
              lay_patch(&patch, column0, column1, row0, row1, -1, job->rows, sin_theta, cos_theta, cos_phi, sin_phi, sums);
          }
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
            long hold[8], side[8];
            vstore8(some, 0, hold);
            vstore8(candidate.mirror > 0 ? b.above : b.below, 0, side);
            const int lanes = min(8, tile.cells_i - i);
            for (int lane = 0; lane < lanes; ++lane) {
              if (!hold[lane] || !side[lane]) continue;
              patch_t patch;
              if (!make_patch(job, tile, p, own, i + lane, j, &patch)) continue;
              for (int pass = 0; pass < (patch.folded ? 2 : 1); ++pass) {
                const int use_first = (!patch.folded || pass == 0) && patch.first_factor > 0.0;
                const int use_second = (!patch.folded || pass == 1) && patch.second_factor > 0.0;
                column_hits hits;
                if (!hits_in_column(&patch, use_first, use_second, direction[4], candidate.mirror * direction[5],
                                    sin_theta, cos_theta, &hits) ||
                    !hits.held.s0)
                  continue;
                const int hemisphere = direction[3] < 0.0;
                accumulate(sum,
                           hit_amplitude(&patch, hemisphere, hits.weight[0].s0, hits.weight[1].s0, hits.weight[2].s0,
                                         hits.weight[3].s0, hits.sine.s0, hits.cosine.s0, candidate.mirror),
                           direction[4], direction[5], hemisphere);
              }
            }
          }
      }
    }
  }
}

// Single rays for inspection: out[order][field][ray] with fields valid, direction (3), path, axis crossings and the
// eight numbers of the Jones matrix in the order of store_jones(). count is padded to RAY_LANES.
kernel void trace_rays(constant double* surface, constant job_t* job, global const double* u, global const double* v,
                       int count, global double* out) {
  for (int at = get_global_id(0) * RAY_LANES; at < count; at += get_global_size(0) * RAY_LANES) {
    const real ray_u = load_real(u + at), ray_v = load_real(v + at);
    const vector3 impact = {ray_u, ray_v, (real)(0.0)};
    ray_state ray;
    exit_ray left;
    for (int p = 0; p <= job->last_order; ++p) {
      if (p == 0) enter(surface, job->n, job->k, job->attenuation, ray_u, ray_v, job->rim_steps, &ray, &left);
      else bounce(surface, job->n, job->k, job->attenuation, impact, job->rim_steps, &ray, &left);
      global double* field = out + (size_t)p * 14 * count + at;
#define NEXT_FIELD(value) store_real(value, field); field += count;
      NEXT_FIELD(left.valid) NEXT_FIELD(left.d.x) NEXT_FIELD(left.d.y) NEXT_FIELD(left.d.z)
      NEXT_FIELD(left.path) NEXT_FIELD(left.axis_crossings)
      NEXT_FIELD(left.e1x.re) NEXT_FIELD(left.e2x.re) NEXT_FIELD(left.e1y.re) NEXT_FIELD(left.e2y.re)
      NEXT_FIELD(left.e1x.im) NEXT_FIELD(left.e2x.im) NEXT_FIELD(left.e1y.im) NEXT_FIELD(left.e2y.im)
#undef NEXT_FIELD
    }
  }
}
