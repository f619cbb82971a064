// The drop's outline seen along the light. Needs vector.cl.

// A cosine series and its derivative (Clenshaw).
FORCE_INLINE void outline_value(constant double* series, int terms, real cosine, real sine, real* value, real* slope) {
  real b1 = 0.0, b2 = 0.0, c1 = 0.0, c2 = 0.0;
  for (int n = terms - 1; n >= 1; --n) {
    const real b = series[n] + 2.0 * cosine * b1 - b2, c = n * series[n] + 2.0 * cosine * c1 - c2;
    b2 = b1;
    b1 = b;
    c2 = c1;
    c1 = c;
  }
  *value = series[0] + cosine * b1 - b2;
  *slope = -sine * c1;
}
