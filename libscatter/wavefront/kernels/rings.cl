// Rays of one order on rings around the light, each ring of one angle of incidence on a sphere, as functions of the
// impact azimuth psi. Needs outline.cl, job.cl and trace.cl, built with CURVATURE, UNIFORM and BEYOND.

#define RING_FIELDS 16

// Of a ray that came in at `place`, an angle alpha, u, v = outline(psi) sin(alpha) (cos psi, sin psi), or a height above
// the outline, psi and order:
//   0      azimuth of the direction less psi, [-pi, pi)
//   1      scattering angle theta
//   2      optical path between planes through the origin
//   3      momentum along theta: dr/dtheta . p
//   4      incident area^2 D / (d azimuth / d psi)^2, D the determinant of (momentum, azimuth) by the impact point: the
//          root of its size times d place is a ray's weight
//   5..12  energy-normalised Jones matrix, from (x, y) to (theta, phi): the order of store_jones()
//   13     focal lines to infinity; -1 for a ray that did not get through, -2 for one that tunnels out
//   14     d azimuth / d psi
//   15     like 4, of theta in place of the momentum
FORCE_INLINE void ring_ray(constant double* surface, constant job_t* job, constant double* outline, int outline_terms,
                           double place, int beyond, real psi, int order, real* fields) {
  const double two_pi = 6.28318530717958647692, ka = 0.5 * two_pi * job->wave;
  real cosine, rho, rho_psi;
  const real sine = sincos(psi, &cosine);
  outline_value(outline, outline_terms, cosine, sine, &rho, &rho_psi);
  ray_state ray;
  exit_ray left;
  vector3 impact;
  real area, measure, u_psi, v_psi;
  if (beyond) {
    const real height = place;
    real z, z_psi;
    outline_value(outline + outline_terms, outline_terms, cosine, sine, &z, &z_psi);
    const vector3 p = {rho * cosine, rho * sine, z};
    const vector3 p_psi = {rho_psi * cosine - rho * sine, rho_psi * sine + rho * cosine, z_psi};
    impact = p;
    impact.z = 0.0;
    enter_beyond(surface, job->n, ka, p, p_psi, height, &ray, &left);
    // Derivatives are by height and azimuth here.
    measure = sqrt(rho * rho + rho_psi * rho_psi) * (1.0 + height);
    u_psi = 0.0;
    v_psi = 1.0;
  } else {
    real cos_alpha;
    const real sin_alpha = sincos((real)(place), &cos_alpha);
    const vector3 at = {rho * sin_alpha * cosine, rho * sin_alpha * sine, (real)(0.0)};
    impact = at;
    const int steps = any(sin_alpha > 0.8) ? job->rim_steps : job->interior_steps;
    enter(surface, job->n, job->k, job->attenuation, ka, at.x, at.y, steps, &ray, &left);
    area = rho * rho * sin_alpha * cos_alpha;
    measure = area * area;
    u_psi = sin_alpha * (rho_psi * cosine - rho * sine);
    v_psi = sin_alpha * (rho_psi * sine + rho * cosine);
  }
  for (int p = 1; p <= order; ++p)
    bounce(surface, job->n, job->k, job->attenuation, ka, impact, job->interior_steps, &ray, &left);
  const vector3 d = left.d;
  const real sin_theta = sqrt(d.x * d.x + d.y * d.y), inverse_sine = 1.0 / fmax(sin_theta, 1e-12);
  const real cos_phi = d.x * inverse_sine, sin_phi = d.y * inverse_sine;
  const vector3 theta_hat = {d.z * cos_phi, d.z * sin_phi, -sin_theta};
  const vector3 phi_hat = {-sin_phi, cos_phi, (real)(0.0)};
  const real along_d = dot3(left.p, d), along_phi = dot3(left.p, phi_hat);
#define CHANGES(q, p_q, d_q)                                                                                  \
  const real theta##q = dot3(d_q, theta_hat), phi##q = dot3(d_q, phi_hat) * inverse_sine;                     \
  const real X##q = dot3(p_q, theta_hat) - along_d * theta##q + d.z * along_phi * phi##q;
  CHANGES(_u, left.spread.p_u, left.spread.d_u)
  CHANGES(_v, left.spread.p_v, left.spread.d_v)
#undef CHANGES
  const real D = X_u * phi_v - X_v * phi_u, turn = theta_u * phi_v - theta_v * phi_u;
  const real phi_psi = phi_u * u_psi + phi_v * v_psi;
  const real foci = left.foci + foci_ahead(area_along(d, &left.spread)), scale = measure / (phi_psi * phi_psi);
  const real turned = atan2(d.y, d.x) - psi;
  vector3 f1, f2;
  transverse_basis(d, &f1, &f2);
  const real cc = dot3(f1, theta_hat), ss = dot3(f1, phi_hat);
  fields[0] = turned - two_pi * rint(turned / two_pi);
  fields[1] = atan2(sin_theta, d.z);
  fields[2] = left.path;
  fields[3] = dot3(left.p, theta_hat);
  fields[4] = scale * D;
  fields[5] = cc * left.e1x.re - ss * left.e2x.re;
  fields[6] = ss * left.e1x.re + cc * left.e2x.re;
  fields[7] = cc * left.e1y.re - ss * left.e2y.re;
  fields[8] = ss * left.e1y.re + cc * left.e2y.re;
  fields[9] = cc * left.e1x.im - ss * left.e2x.im;
  fields[10] = ss * left.e1x.im + cc * left.e2x.im;
  fields[11] = cc * left.e1y.im - ss * left.e2y.im;
  fields[12] = ss * left.e1y.im + cc * left.e2y.im;
  fields[13] = select((real)(-1.0), select(foci, (real)(-2.0), left.tunnels), left.valid > 0.5);
  fields[14] = phi_psi;
  fields[15] = scale * turn;
}

// Whole rings. places: angles before first_beyond, heights from there on. azimuths: of the whole turn, a multiple of
// RAY_LANES. out[ring][field][azimuth].
kernel void trace_rings(constant double* surface, constant job_t* job, constant double* outline, int outline_terms,
                        global const double* places, int rings, int first_beyond, int azimuths, int order,
                        global double* out) {
  const real lane_number = (real)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  for (int ring = get_global_id(0); ring < rings; ring += get_global_size(0))
    for (int first = 0; first < azimuths; first += RAY_LANES) {
      const real psi = (first + lane_number) * (6.28318530717958647692 / azimuths);
      real fields[RING_FIELDS];
      ring_ray(surface, job, outline, outline_terms, places[ring], ring >= first_beyond, psi, order, fields);
      global double* to = out + (size_t)ring * RING_FIELDS * azimuths + first;
      for (int f = 0; f < RING_FIELDS; ++f) store_real(fields[f], to + (size_t)f * azimuths);
    }
}

// Of each ring the ray whose direction has the azimuth phi[column]. low, high[ring][column]: impact azimuths between
// which it is, there the direction's azimuth less phi changes its sign. columns: a multiple of RAY_LANES.
// out[ring][field][column].
kernel void trace_meridians(constant double* surface, constant job_t* job, constant double* outline, int outline_terms,
                            global const double* places, int rings, int first_beyond, global const double* phi,
                            global const double* low, global const double* high, int columns, int order,
                            global double* out) {
  const double two_pi = 6.28318530717958647692;
  for (int ring = get_global_id(0); ring < rings; ring += get_global_size(0))
    for (int first = 0; first < columns; first += RAY_LANES) {
      const size_t at = (size_t)ring * columns + first;
      real from = load_real(low + at), to = load_real(high + at), psi = 0.5 * (from + to);
      const real wanted = load_real(phi + first);
      real fields[RING_FIELDS];
      for (int step = 0; step < 60; ++step) {
        ring_ray(surface, job, outline, outline_terms, places[ring], ring >= first_beyond, psi, order, fields);
        real away = psi + fields[0] - wanted;
        away -= two_pi * rint(away / two_pi);
        // Newton's step where it stays between the ends, else the middle: at grazing exit azimuths have kinks.
        const mask past = away > 0.0;
        to = select(to, psi, past);
        from = select(psi, from, past);
        const mask done = (fabs(away) < 1e-9) | (to - from < 1e-13);
        if (all(done)) break;
        const real next = psi - away / fields[14];
        psi = select(select(0.5 * (from + to), next, (next > from) & (next < to)), psi, done);
      }
      global double* result = out + (size_t)ring * RING_FIELDS * columns + first;
      for (int f = 0; f < RING_FIELDS; ++f) store_real(fields[f], result + (size_t)f * columns);
    }
}
