// The far field of one order around one direction as a sum over rays: their wavefront where it meets a plane, Fourier
// transformed to directions. Needs tile.cl's job_t and trace.cl, built with CURVATURE.
//
// With X where the ray meets the plane r0 . X = distance, L its optical path there, A the area of the tube of rays per
// incident area du dv and mu the foci passed so far,
//   S(r) = -k^2 / (2 pi) sum w sqrt|A| E exp(i k (L - X . r)) exp(-i pi mu / 2) du dv,
// E the energy-normalised Jones matrix. Stationary phase gives back geometric optics, S = -i k sqrt(du dv / solid angle)
// E exp(i k l). The sum over rays goes through a grid of plane points and an FFT: a non-uniform Fourier transform of type
// 3 (Lee & Greengard 2005, J. Comput. Phys. 206, 1) with Kaiser-Bessel kernels.

#define TAPS 6
#define TAP_DEGREE 12

// Rays across the drop in polar coordinates: u, v = outline(psi) sin(alpha) (cos psi, sin psi), even in both angles, alpha
// up to the rim, so that rays lie evenly in the angle of incidence. They come in cells of the coarse grid.
typedef struct {
  int alpha, azimuth; // first ray in units of the cell
} cell_t;

typedef struct {
  double r0[3], e1[3], e2[3];    // centre of the window and the axes of the plane across it
  double distance;               // of the plane from the origin, along r0
  double inner[2], outer[2];     // |d . e|: the taper is 1 up to inner, 0 from outer on
  double centre[2];              // of the plane points, along e1 and e2
  double xi_per_length[2];       // grid phase per length on the plane
  double points_per_xi[2];       // n / (2 pi)
  double beta;                   // of the Kaiser-Bessel kernel
  double modes_per_cosine[2];    // direction cosines to grid modes
  double alpha_step, psi_step;   // between rays
  int points[2];                 // n, even
  int modes[2];                  // corrections reach from -modes to modes
  int alphas, azimuths;          // rays across a cell
  int order;
  int outline_terms;
} window_t;

FORCE_INLINE real taper(real a, double inner, double outer) {
  const real s = clamp((fabs(a) - inner) / (outer - inner), 0.0, 1.0), s2 = s * s;
  return 1.0 - s2 * s2 * s * (126.0 - s * (420.0 - s * (540.0 - s * (315.0 - 70.0 * s))));
}

// 1 / transform of the Kaiser-Bessel kernel at xi, but for a constant factor.
FORCE_INLINE real inverse_transform(real xi, double beta) {
  const real y = sqrt(beta * beta - xi * xi * (0.25 * TAPS * TAPS));
  return y / (exp(y) - exp(-y));
}

FORCE_INLINE vector3 constant3(constant const double* a) {
  const vector3 c = {(real)(a[0]), (real)(a[1]), (real)(a[2])};
  return c;
}

// The grid must be zero; [y][x][8], parts as in store_jones(). lost counts rays that fell outside it: none should.
kernel void spread_rays(constant double* surface, constant job_t* job, constant window_t* window,
                        constant double* outline, constant double* tap_polynomials, global const cell_t* cells, int count,
                        global double* grid, global int* lost) {
  const vector3 r0 = constant3(window->r0), e1 = constant3(window->e1), e2 = constant3(window->e2);
  const real lane_number = (real)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const int in_cell = window->alphas * window->azimuths;
  for (int c = 0; c < count; ++c)
    for (int ray_number = 0; ray_number < in_cell; ray_number += RAY_LANES) {
      const real number = ray_number + lane_number, i = floor((number + 0.5) / window->azimuths);
      const real j = number - i * window->azimuths;
      const real alpha = (cells[c].alpha * window->alphas + i + 0.5) * window->alpha_step;
      const real psi = (cells[c].azimuth * window->azimuths + j + 0.5) * window->psi_step;
      real cos_alpha, cosine;
      const real sin_alpha = sincos(alpha, &cos_alpha), sine = sincos(psi, &cosine);
      // The outline is a cosine series (Clenshaw).
      real b1 = 0.0, b2 = 0.0;
      for (int n = window->outline_terms - 1; n >= 1; --n) {
        const real b = outline[n] + 2.0 * cosine * b1 - b2;
        b2 = b1;
        b1 = b;
      }
      const real rho = outline[0] + cosine * b1 - b2;
      const real u = rho * sin_alpha * cosine, v = rho * sin_alpha * sine;
      const int steps = any(sin_alpha > 0.8) ? job->rim_steps : job->interior_steps;
      const vector3 impact = {u, v, (real)(0.0)};
      ray_state ray;
      exit_ray out;
      enter(surface, job->n, job->k, job->attenuation, u, v, steps, &ray, &out);
      for (int p = 1; p <= window->order; ++p)
        bounce(surface, job->n, job->k, job->attenuation, impact, job->interior_steps, &ray, &out);
      const vector3 d = out.d;
      const real towards = dot3(d, r0);
      real weight = taper(dot3(d, e1), window->inner[0], window->outer[0]) *
                    taper(dot3(d, e2), window->inner[1], window->outer[1]);
      const mask useless = (towards < 0.2) | (out.valid < 0.5) | !(weight > 0.0) | (number > in_cell - 0.5);
      if (all(useless)) continue;
      // On to the plane, forward or back.
      const real flight = (window->distance - dot3(out.p, r0)) / towards;
      const vector3 X = along3(out.p, flight, d);
      tube_area area = area_along(d, &out.spread);
      const real tube = area.at0 + flight * (area.at1 + flight * area.at2);
      const mask back = flight < 0.0;
      area.at1 = select(area.at1, -area.at1, back);
      const real passed = foci_within(area, fabs(flight));
      const real foci = out.foci + select(passed, -passed, back);
      weight *= sqrt(fabs(tube)) * rho * rho * sin_alpha * cos_alpha * (window->alpha_step * window->psi_step);
      const real x = dot3(X, e1) - window->centre[0], y = dot3(X, e2) - window->centre[1];
      const real xi_x = x * window->xi_per_length[0], xi_y = y * window->xi_per_length[1];
      weight *= inverse_transform(xi_x, window->beta) * inverse_transform(xi_y, window->beta);
      weight = select(weight, (real)(0.0), useless);
      // out.path is between planes through the origin: path at the exit point less point . d.
      const real path = out.path + dot3(out.p, d) + flight;
      const real half_turns = job->wave * path - 0.5 * foci;
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
    const double towards = INNER(r, window->r0), cosine[2] = {INNER(r, window->e1), INNER(r, window->e2)};
    int start[2];
    double taps[2][TAPS];
    for (int axis = 0; axis < 2; ++axis) {
      const double at = cosine[axis] * window->modes_per_cosine[axis] - 0.5 * TAPS, first_mode = ceil(at);
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
    // exp(-i k (centre . r + distance r0 . r)), then the axes of the direction's hemisphere.
    const double half_turns =
        job->wave * (window->centre[0] * cosine[0] + window->centre[1] * cosine[1] + window->distance * towards);
    const double turns = half_turns - 2.0 * rint(0.5 * half_turns), c = cospi(turns), s = sinpi(turns);
    const double factor = -scale * target.weight;
    const double4 re = factor * (c * sum.lo + s * sum.hi), im = factor * (c * sum.hi - s * sum.lo);
    const double h = r[2] < 0.0 ? -1.0 : 1.0, w = 1.0 / (1.0 + fabs(r[2]));
    const double g1[3] = {1.0 - r[0] * r[0] * w, -r[0] * r[1] * w, -h * r[0]};
    // e1 turned from r0 to r, in the basis (g1, g2) with g2 = r x g1.
    const double along = cosine[0] / (1.0 + towards);
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
