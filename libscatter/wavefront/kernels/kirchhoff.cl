// The far field of one order around one direction as a sum over its rays, Fourier transformed to directions. Needs
// outline.cl, job.cl and trace.cl, built with CURVATURE, UNIFORM and BEYOND.
//
// Around the centre r0 of a window directions have coordinates rho, a longitude and a latitude. A ray that leaves in
// direction d = r(rho_d), with optical path L between planes through the origin, has the momentum X = dr/drho . p there,
// p any point on it: the far field's phase falls by k X per rho. With W(rho) = D longitude^2 / 2 + B(longitude) (latitude
// less the rim's)^2 / 2, X' = X - dW/drho at rho_d and A = det dX' / d(u, v),
//   S(r) = -k^2 / (2 pi) exp(-i k W(rho)) sum w sqrt|A| E exp(i k (L + W(rho_d) - X' . (rho - rho_d))) i^-mu du dv,
// E the energy-normalised Jones matrix over the fourth root of the metric at r, mu the focal lines to infinity less the
// negative eigenvalues of dX'/d(u, v)^T drho/d(u, v). Stationary phase gives back geometric optics wherever it holds, with
// all its focal lines; about a fold of directions A does not vanish, and the sum is Airy's. On a sphere, with theta and
// phi for coordinates, X is the angular momentum of the ray and the sum that of Debye's series over partial waves: it
// holds up to grazing rays, and beyond. A Kirchhoff integral over a plane differs from it by the coordinates, sines for angles.
//
// The sum goes through a grid of X' and an FFT: a non-uniform Fourier transform of type 3 (Lee & Greengard 2005,
// J. Comput. Phys. 206, 1) with Kaiser-Bessel kernels.

#define TAPS 6
#define TAP_DEGREE 12

// Rays across the drop in polar coordinates: u, v = outline(psi) sin(alpha) (cos psi, sin psi), even in both angles, alpha
// up to the rim, so that rays lie evenly in the angle of incidence. They come in cells of the coarse grid.
typedef struct {
  int alpha, azimuth; // first ray in units of the cell; the cells after the last alpha lie beyond the rim
  int index;          // mu of the rays beyond the rim and of those that tunnel out
  int unused;
} cell_t;

// 1 between full, 0 outside none; below and above.
typedef struct {
  double full[2], none[2];
} taper_t;

typedef struct {
  double r0[3], e1[3], e2[3];    // centre of the window and the axes of fields there
  double f0[3], f1[3], f2[3];    // rho is longitude (from f0 to f1) and latitude (towards f2) ..
  double latitude;               // .. less the centre's
  double shear;                  // D, of the longitude
  double bend[4], rim[4];        // B and the rim's latitude, by powers of the longitude
  taper_t taper[2];              // of longitude and latitude
  double centre[2];              // of X'
  double xi_per_length[2];       // grid phase per X'
  double points_per_xi[2];       // n / (2 pi)
  double tap_shape;              // of the Kaiser-Bessel kernel
  double modes_per_radian[2];    // rho to grid modes
  double alpha_step, psi_step;   // between rays
  double height_step;            // the same beyond the rim
  int points[2];                 // n, even
  int modes[2];                  // corrections reach from -modes to modes
  int alphas, azimuths, heights; // rays across a cell
  int rim_cell;                  // alpha of the cells beyond the rim
  int order;
  int outline_terms;
} window_t;

// From 1 at `full` to 0 at `none`, whichever is larger.
FORCE_INLINE real taper_end(real a, double full, double none) {
  const real s = clamp((a - full) / (none - full), 0.0, 1.0), s2 = s * s;
  return 1.0 - s2 * s2 * s * (126.0 - s * (420.0 - s * (540.0 - s * (315.0 - 70.0 * s))));
}
FORCE_INLINE real taper(real a, constant const taper_t* t) {
  return taper_end(a, t->full[0], t->none[0]) * taper_end(a, t->full[1], t->none[1]);
}

// 1 / transform of the Kaiser-Bessel kernel at xi, but for a constant factor.
FORCE_INLINE real inverse_transform(real xi, double tap_shape) {
  const real y = sqrt(tap_shape * tap_shape - xi * xi * (0.25 * TAPS * TAPS));
  return y / (exp(y) - exp(-y));
}

FORCE_INLINE vector3 constant3(constant const double* a) {
  const vector3 c = {(real)(a[0]), (real)(a[1]), (real)(a[2])};
  return c;
}

// Coefficients by powers, and the first two derivatives.
#define CUBIC(name, c, x)                                    \
  const real name = c[0] + x * (c[1] + x * (c[2] + x * c[3])); \
  const real name##_1 = c[1] + x * (2.0 * c[2] + x * (3.0 * c[3])), name##_11 = 2.0 * c[2] + x * (6.0 * c[3]);

// The grid must be zero; [y][x][8], parts as in store_jones(). outline: cosine series of the radius and of z over the
// azimuth. lost counts rays that fell outside the grid or are not numbers: none should.
kernel void spread_rays(constant double* surface, constant job_t* job, constant window_t* window,
                        constant double* outline, constant double* tap_polynomials, global const cell_t* cells, int count,
                        global double* grid, global int* lost) {
  const vector3 r0 = constant3(window->r0), e1 = constant3(window->e1), e2 = constant3(window->e2);
  const vector3 f0 = constant3(window->f0), pole = constant3(window->f2), quarter = constant3(window->f1);
  const real lane_number = (real)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const double ka = 3.14159265358979323846 * job->wave;
  for (int c = 0; c < count; ++c) {
    const cell_t cell = cells[c];
    const int beyond = cell.alpha == window->rim_cell;
    const int in_cell = (beyond ? window->heights : window->alphas) * window->azimuths;
    for (int ray_number = 0; ray_number < in_cell; ray_number += RAY_LANES) {
      const real number = ray_number + lane_number, i = floor((number + 0.5) / window->azimuths);
      const real j = number - i * window->azimuths;
      const real psi = (cell.azimuth * window->azimuths + j + 0.5) * window->psi_step;
      real cosine, rho, rho_psi, weight;
      const real sine = sincos(psi, &cosine);
      outline_value(outline, window->outline_terms, cosine, sine, &rho, &rho_psi);
      ray_state ray;
      exit_ray out;
      vector3 impact;
      if (beyond) {
        const real height = (i + 0.5) * window->height_step;
        real z, z_psi;
        outline_value(outline + window->outline_terms, window->outline_terms, cosine, sine, &z, &z_psi);
        const vector3 p = {rho * cosine, rho * sine, z};
        const vector3 p_psi = {rho_psi * cosine - rho * sine, rho_psi * sine + rho * cosine, z_psi};
        impact = p;
        impact.z = 0.0;
        enter_beyond(surface, job->n, ka, p, p_psi, height, &ray, &out);
        // Incident area per height and azimuth; sqrt|A| takes its own from the derivatives.
        weight = sqrt(sqrt(rho * rho + rho_psi * rho_psi) * (1.0 + height)) * (window->height_step * window->psi_step);
      } else {
        const real alpha = (cell.alpha * window->alphas + i + 0.5) * window->alpha_step;
        real cos_alpha;
        const real sin_alpha = sincos(alpha, &cos_alpha);
        const vector3 at = {rho * sin_alpha * cosine, rho * sin_alpha * sine, (real)(0.0)};
        impact = at;
        const int steps = any(sin_alpha > 0.8) ? job->rim_steps : job->interior_steps;
        enter(surface, job->n, job->k, job->attenuation, ka, at.x, at.y, steps, &ray, &out);
        weight = rho * rho * sin_alpha * cos_alpha * (window->alpha_step * window->psi_step);
      }
      for (int p = 1; p <= window->order; ++p)
        bounce(surface, job->n, job->k, job->attenuation, ka, impact, job->interior_steps, &ray, &out);
      const vector3 d = out.d;
      // Where it goes, in the window's coordinates, and their tangents there.
      const real towards = dot3(d, r0), ahead = dot3(d, f0), east = dot3(d, quarter), sin_2 = dot3(d, pole);
      const real cos_2 = sqrt(fmax(ahead * ahead + east * east, 1e-12)), inverse_2 = 1.0 / cos_2;
      const real cos_1 = ahead * inverse_2, sin_1 = east * inverse_2;
      const real rho_1 = atan2(east, ahead), rho_2 = asin(clamp(sin_2, -1.0, 1.0)) - window->latitude;
      weight *= taper(rho_1, &window->taper[0]) * taper(rho_2, &window->taper[1]);
      const mask useless = (out.valid < 0.5) | !(weight > 0.0) | (number > in_cell - 0.5) | (towards < -0.9);
      if (all(useless)) continue;
      const vector3 middle_1 = along3(scale3(cos_1, f0), sin_1, quarter);
      const vector3 side = along3(scale3(-sin_1, f0), cos_1, quarter);
      const vector3 t1 = scale3(cos_2, side), t2 = along3(scale3(cos_2, pole), -sin_2, middle_1);
      // Beyond the taper, where rays have no weight, cubics are not followed.
      const real within = clamp(rho_1, window->taper[0].none[0], window->taper[0].none[1]);
      CUBIC(B, window->bend, within)
      CUBIC(rim, window->rim, within)
      const real off = rho_2 - rim, W = 0.5 * (window->shear * rho_1 * rho_1 + B * off * off);
      const real W_1 = window->shear * rho_1 + off * (0.5 * off * B_1 - B * rim_1), W_2 = B * off;
      const real W_11 =
          window->shear + off * (0.5 * off * B_11 - 2.0 * B_1 * rim_1 - B * rim_11) + B * rim_1 * rim_1;
      const real W_12 = B_1 * off - B * rim_1, W_22 = B;
      const real X1 = dot3(out.p, t1) - W_1, X2 = dot3(out.p, t2) - W_2;
      const real along_d = dot3(out.p, d), along_middle = dot3(out.p, middle_1), along_side = dot3(out.p, side);
#define MOMENTUM_CHANGE(q, p_q, d_q)                                                                          \
  const real rho_1##q = dot3(d_q, t1) * inverse_2 * inverse_2, rho_2##q = dot3(d_q, t2);                      \
  const real X1##q =                                                                                          \
      dot3(p_q, t1) - (cos_2 * along_middle + W_11) * rho_1##q - (sin_2 * along_side + W_12) * rho_2##q;      \
  const real X2##q = dot3(p_q, t2) - (sin_2 * along_side + W_12) * rho_1##q - (along_d + W_22) * rho_2##q;
      MOMENTUM_CHANGE(_u, out.spread.p_u, out.spread.d_u)
      MOMENTUM_CHANGE(_v, out.spread.p_v, out.spread.d_v)
#undef MOMENTUM_CHANGE
      const real A = X1_u * X2_v - X1_v * X2_u;
      weight *= sqrt(fabs(A));
      const mask opposed = (A < 0.0) != (rho_1_u * rho_2_v - rho_1_v * rho_2_u < 0.0);
      const real trace = X1_u * rho_1_u + X2_u * rho_2_u + X1_v * rho_1_v + X2_v * rho_2_v;
      const real negative =
          select(select((real)(0.0), (real)(2.0), trace < 0.0), (real)(1.0), opposed);
      const real foci = out.foci + foci_ahead(area_along(d, &out.spread));
      const real index = beyond ? (real)(cell.index) : select(foci - negative, (real)(cell.index), out.tunnels);
      const real x = X1 - window->centre[0], y = X2 - window->centre[1];
      const real xi_x = x * window->xi_per_length[0], xi_y = y * window->xi_per_length[1];
      weight *= inverse_transform(xi_x, window->tap_shape) * inverse_transform(xi_y, window->tap_shape);
      weight = select(weight, (real)(0.0), useless);
      const real length = out.path + W + X1 * rho_1 + X2 * rho_2;
      const real half_turns = job->wave * length - 0.5 * index;
      const real turns = half_turns - 2.0 * rint(0.5 * half_turns);
      const real phase_c = weight * cospi(turns), phase_s = weight * sinpi(turns);
      // The Jones matrix taken over to the window's axes by the smallest turn from d to r0.
      vector3 f1, f2;
      transverse_basis(d, &f1, &f2);
      const vector3 middle = scale3(1.0 / (1.0 + towards), along3(d, (real)(1.0), r0));
      f1 = along3(f1, -dot3(f1, r0), middle);
      const real cc = dot3(f1, e1), ss = dot3(f1, e2);
#define TURNED(name, part1, part2) \
  const real name##1 = cc * part1 - ss * part2, name##2 = ss * part1 + cc * part2;
      TURNED(xr, out.e1x.re, out.e2x.re)
      TURNED(xi, out.e1x.im, out.e2x.im)
      TURNED(yr, out.e1y.re, out.e2y.re)
      TURNED(yi, out.e1y.im, out.e2y.im)
#undef TURNED
      double parts[8][RAY_LANES];
#define STORE_PART(index, re, im)                                           \
  store_real(phase_c * re - phase_s * im, parts[index]);                    \
  store_real(phase_c * im + phase_s * re, parts[index + 4]);
      STORE_PART(0, xr1, xi1)
      STORE_PART(1, xr2, xi2)
      STORE_PART(2, yr1, yi1)
      STORE_PART(3, yr2, yi2)
#undef STORE_PART
      // Taps of both directions.
      const real at_x = xi_x * window->points_per_xi[0] + (0.5 * window->points[0] - 0.5 * TAPS);
      const real at_y = xi_y * window->points_per_xi[1] + (0.5 * window->points[1] - 0.5 * TAPS);
      const real first_x = ceil(at_x), first_y = ceil(at_y);
      const real z_x = 2.0 * (first_x - at_x) - 1.0, z_y = 2.0 * (first_y - at_y) - 1.0;
      double taps_x[TAPS][RAY_LANES], taps_y[TAPS][RAY_LANES];
      for (int tap = 0; tap < TAPS; ++tap) {
        real tap_x = tap_polynomials[tap * (TAP_DEGREE + 1) + TAP_DEGREE], tap_y = tap_x;
        for (int n = TAP_DEGREE - 1; n >= 0; --n) {
          tap_x = tap_x * z_x + tap_polynomials[tap * (TAP_DEGREE + 1) + n];
          tap_y = tap_y * z_y + tap_polynomials[tap * (TAP_DEGREE + 1) + n];
        }
        store_real(tap_x, taps_x[tap]);
        store_real(tap_y, taps_y[tap]);
      }
      double weights[RAY_LANES], starts_x[RAY_LANES], starts_y[RAY_LANES];
      store_real(weight, weights);
      store_real(first_x, starts_x);
      store_real(first_y, starts_y);
      for (int lane = 0; lane < RAY_LANES; ++lane) {
        if (weights[lane] == 0.0) continue;
        double finite = weights[lane];
        for (int part = 0; part < 8; ++part) finite += parts[part][lane];
        if (!(fabs(finite) < 1e300 && fabs(starts_x[lane]) < 1e9 && fabs(starts_y[lane]) < 1e9)) {
          ++lost[0];
          continue;
        }
        const int column = (int)starts_x[lane], row = (int)starts_y[lane];
        if (!(column >= 0 && row >= 0 && column + TAPS <= window->points[0] && row + TAPS <= window->points[1])) {
          ++lost[0];
          continue;
        }
        const double8 value = (double8)(
            parts[0][lane], parts[1][lane], parts[2][lane], parts[3][lane], parts[4][lane], parts[5][lane],
            parts[6][lane], parts[7][lane]);
        for (int j = 0; j < TAPS; ++j) {
          const double8 share = value * taps_y[j][lane];
          global double* to = grid + 8 * ((size_t)(row + j) * window->points[0] + column);
          for (int i = 0; i < TAPS; ++i) vstore8(vload8(i, to) + share * taps_x[i][lane], i, to);
        }
      }
    }
  }
}

typedef struct {
  int column, row;
  double weight;
} target_t;

// Directions out of the transformed grid, times their weight, added to the table of sums. corrections: for each mode
// -modes..modes of either axis, the sign and transform that spreading brought in.
kernel void gather_directions(constant job_t* job, constant window_t* window, global const double* grid,
                              global const double* corrections_x, global const double* corrections_y,
                              constant double* tap_polynomials, global const target_t* targets, int first, int last,
                              global const double* sin_theta, global const double* cos_theta,
                              global const double* cos_phi, global const double* sin_phi, int rows, double scale,
                              global double* sums) {
  for (int t = first; t < last; ++t) {
    const target_t target = targets[t];
    const double st = sin_theta[target.row];
    const double r[3] = {st * cos_phi[target.column], st * sin_phi[target.column], cos_theta[target.row]};
#define INNER(a, b) ((a)[0] * (b)[0] + (a)[1] * (b)[1] + (a)[2] * (b)[2])
    const double towards = INNER(r, window->r0), east = INNER(r, window->e1);
    const double rho[2] = {
        atan2(INNER(r, window->f1), INNER(r, window->f0)), asin(clamp(INNER(r, window->f2), -1.0, 1.0)) - window->latitude};
    const double cosine_2 = sqrt(1.0 - clamp(INNER(r, window->f2), -1.0, 1.0) * INNER(r, window->f2));
    int start[2];
    double taps[2][TAPS];
    for (int axis = 0; axis < 2; ++axis) {
      const double at = rho[axis] * window->modes_per_radian[axis] - 0.5 * TAPS, first_mode = ceil(at);
      const double z = 2.0 * (first_mode - at) - 1.0;
      start[axis] = (int)first_mode;
      global const double* corrections = axis == 0 ? corrections_x : corrections_y;
      for (int tap = 0; tap < TAPS; ++tap) {
        double value = tap_polynomials[tap * (TAP_DEGREE + 1) + TAP_DEGREE];
        for (int n = TAP_DEGREE - 1; n >= 0; --n) value = value * z + tap_polynomials[tap * (TAP_DEGREE + 1) + n];
        taps[axis][tap] = value * corrections[start[axis] + tap + window->modes[axis]];
      }
    }
    double8 sum = 0.0;
    for (int j = 0; j < TAPS; ++j) {
      const int mode_y = start[1] + j, row = mode_y < 0 ? mode_y + window->points[1] : mode_y;
      for (int i = 0; i < TAPS; ++i) {
        const int mode_x = start[0] + i, column = mode_x < 0 ? mode_x + window->points[0] : mode_x;
        sum += taps[0][i] * taps[1][j] * vload8((size_t)row * window->points[0] + column, grid);
      }
    }
    // exp(-i k (centre . rho + W)), then the axes of the direction's hemisphere.
    const double B = window->bend[0] + rho[0] * (window->bend[1] + rho[0] * (window->bend[2] + rho[0] * window->bend[3]));
    const double off =
        rho[1] - (window->rim[0] + rho[0] * (window->rim[1] + rho[0] * (window->rim[2] + rho[0] * window->rim[3])));
    double half_turns = job->wave * 0.5 * (window->shear * rho[0] * rho[0] + B * off * off);
    for (int axis = 0; axis < 2; ++axis)
      half_turns += job->wave * rho[axis] * window->centre[axis];
    const double turns = half_turns - 2.0 * rint(0.5 * half_turns), c = cospi(turns), s = sinpi(turns);
    const double factor = -scale * target.weight / sqrt(cosine_2);
    const double4 re = factor * (c * sum.lo + s * sum.hi), im = factor * (c * sum.hi - s * sum.lo);
    const double h = r[2] < 0.0 ? -1.0 : 1.0, w = 1.0 / (1.0 + fabs(r[2]));
    const double g1[3] = {1.0 - r[0] * r[0] * w, -r[0] * r[1] * w, -h * r[0]};
    // e1 turned from r0 to r, in the basis (g1, g2) with g2 = r x g1.
    const double along = east / (1.0 + towards);
    const double turned[3] = {
        window->e1[0] - along * (r[0] + window->r0[0]), window->e1[1] - along * (r[1] + window->r0[1]),
        window->e1[2] - along * (r[2] + window->r0[2])};
    const double g2[3] = {r[1] * g1[2] - r[2] * g1[1], r[2] * g1[0] - r[0] * g1[2], r[0] * g1[1] - r[1] * g1[0]};
    const double cc = INNER(turned, g1), ss = INNER(turned, g2);
    const double4 re_turned = (double4)(cc * re.s0 - ss * re.s1, ss * re.s0 + cc * re.s1, cc * re.s2 - ss * re.s3,
                                        ss * re.s2 + cc * re.s3);
    const double4 im_turned = (double4)(cc * im.s0 - ss * im.s1, ss * im.s0 + cc * im.s1, cc * im.s2 - ss * im.s3,
                                        ss * im.s2 + cc * im.s3);
    const size_t at = (size_t)target.column * rows + target.row;
    vstore8(vload8(at, sums) + (double8)(re_turned, im_turned), at, sums);
#undef INNER
  }
}
