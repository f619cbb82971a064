// Curvature of the wavefront along a ray, as the derivatives of the ray by its impact point (u, v): where it is and where
// it goes. Exact for any smooth surface; needs surface.cl, whose build must define CURVATURE.
//
// The area that a tube of rays has across itself after a flight s is spread_area(): a quadratic in s whose roots, both
// real, are the foci. Born & Wolf, section 4.6, in another guise: the quadratic is det(1 + s K), K the curvature matrix.

typedef struct {
  vector3 p_u, p_v; // of the point
  vector3 d_u, d_v; // of the direction
} ray_spread;

// d . ((p_u + s d_u) x (p_v + s d_v)) = at0 + at1 s + at2 s^2; at2 is the signed solid angle per du dv.
typedef struct {
  real at0, at1, at2;
} tube_area;

FORCE_INLINE tube_area area_along(vector3 d, const ray_spread* r) {
  tube_area a;
  a.at0 = dot3(d, cross3(r->p_u, r->p_v));
  a.at1 = dot3(d, cross3(r->d_u, r->p_v)) + dot3(d, cross3(r->p_u, r->d_v));
  a.at2 = dot3(d, cross3(r->d_u, r->d_v));
  return a;
}

// Foci passed within 0 < s < t. Both roots are real, so that two lie inside when the ends have one sign and the vertex
// between them lies towards the other.
FORCE_INLINE real foci_within(tube_area a, real t) {
  const real end = a.at0 + t * (a.at1 + t * a.at2), vertex = -a.at1 / (2.0 * a.at2);
  const mask one = (a.at0 < 0.0) != (end < 0.0);
  const mask two = (vertex > 0.0) & (vertex < t) & ((a.at2 < 0.0) == (a.at0 < 0.0));
  return select(select((real)(0.0), (real)(2.0), two), (real)(1.0), one);
}
// The same for s > 0 without end.
FORCE_INLINE real foci_ahead(tube_area a) {
  const mask one = (a.at0 < 0.0) != (a.at2 < 0.0);
  const mask two = (a.at1 < 0.0) != (a.at2 < 0.0);
  return select(select((real)(0.0), (real)(2.0), two), (real)(1.0), one);
}

// From the plane wave (p_u, p_v across d) to the surface, or on from one point of it to the next after a flight t.
FORCE_INLINE void fly(ray_spread* r, vector3 d, real t, vector3 normal) {
  const real scale = 1.0 / dot3(d, normal);
  r->p_u = along3(r->p_u, t, r->d_u);
  r->p_v = along3(r->p_v, t, r->d_v);
  r->p_u = along3(r->p_u, -dot3(normal, r->p_u) * scale, d);
  r->p_v = along3(r->p_v, -dot3(normal, r->p_v) * scale, d);
}

// d' = ratio d + bend N with bend = cosine' - ratio cosine, cosines measured along N, which points to either side:
// refraction (ratio of the indices, old over new) keeps the cosine's sign, reflection (ratio 1) turns it.
FORCE_INLINE void turn_directions(ray_spread* r, vector3 d, const vector3 normal, vector3 n_u, vector3 n_v, real ratio,
                                  real cosine, real new_cosine) {
  const real bend = new_cosine - ratio * cosine;
  // cosine'^2 = 1 - ratio^2 (1 - cosine^2)
  const real slope = ratio * (ratio * cosine / new_cosine - 1.0);
  const real c_u = dot3(r->d_u, normal) + dot3(d, n_u), c_v = dot3(r->d_v, normal) + dot3(d, n_v);
  r->d_u = along3(along3(scale3(ratio, r->d_u), slope * c_u, normal), bend, n_u);
  r->d_v = along3(along3(scale3(ratio, r->d_v), slope * c_v, normal), bend, n_v);
}
