// Single rays for inspection. Needs job.cl and trace.cl, built with CURVATURE; with UNIFORM and BEYOND rays that tunnel
// out count, too.

#define RAY_FIELDS 31
#ifdef UNIFORM
#define KA ka,
#else
#define KA
#endif

// out[order][field][ray] with the fields valid (2 where the ray tunnels out), direction (3), path, axis crossings, the
// eight numbers of the Jones matrix in the order of store_jones(), point (3), the derivatives of point and direction by
// u and v (3 each), foci passed inside, and on the way to infinity too. count is padded to RAY_LANES.
kernel void trace_rays(constant double* surface, constant job_t* job, global const double* u, global const double* v,
                       int count, global double* out) {
#ifdef UNIFORM
  const double ka = 3.14159265358979323846 * job->wave;
#endif
  for (int at = get_global_id(0) * RAY_LANES; at < count; at += get_global_size(0) * RAY_LANES) {
    const real ray_u = load_real(u + at), ray_v = load_real(v + at);
    const vector3 impact = {ray_u, ray_v, (real)(0.0)};
    ray_state ray;
    exit_ray left;
    for (int p = 0; p <= job->last_order; ++p) {
      if (p == 0) enter(surface, job->n, job->k, job->attenuation, KA ray_u, ray_v, job->rim_steps, &ray, &left);
      else bounce(surface, job->n, job->k, job->attenuation, KA impact, job->rim_steps, &ray, &left);
      real valid = left.valid;
#ifdef BEYOND
      valid = select(valid, (real)(2.0), left.tunnels & (valid > 0.5));
#endif
      global double* field = out + (size_t)p * RAY_FIELDS * count + at;
#define NEXT_FIELD(value) store_real(value, field); field += count;
#define NEXT_VECTOR(value) NEXT_FIELD(value.x) NEXT_FIELD(value.y) NEXT_FIELD(value.z)
      NEXT_FIELD(valid) NEXT_VECTOR(left.d)
      NEXT_FIELD(left.path) NEXT_FIELD(left.axis_crossings)
      NEXT_FIELD(left.e1x.re) NEXT_FIELD(left.e2x.re) NEXT_FIELD(left.e1y.re) NEXT_FIELD(left.e2y.re)
      NEXT_FIELD(left.e1x.im) NEXT_FIELD(left.e2x.im) NEXT_FIELD(left.e1y.im) NEXT_FIELD(left.e2y.im)
      NEXT_VECTOR(left.p)
      NEXT_VECTOR(left.spread.p_u) NEXT_VECTOR(left.spread.p_v)
      NEXT_VECTOR(left.spread.d_u) NEXT_VECTOR(left.spread.d_v)
      NEXT_FIELD(left.foci)
      NEXT_FIELD(left.foci + foci_ahead(area_along(left.d, &left.spread)))
#undef NEXT_VECTOR
#undef NEXT_FIELD
    }
  }
}
