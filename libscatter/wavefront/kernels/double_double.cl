// Numbers of twice the digits: unevaluated sums of two doubles, hi the nearest double. For rays that graze the rim of
// the drop, where cosines are roots of small differences. Relative error of each operation below 2^-100.
//
// Dekker (1971); Knuth, The Art of Computer Programming 2, section 4.2.2. No product here may be fused into a sum.
#pragma OPENCL FP_CONTRACT OFF

typedef struct {
  real hi, lo;
} real2;

typedef struct {
  real2 x, y, z;
} vector3_2;

FORCE_INLINE real2 widen(real a) {
  const real2 c = {a, (real)(0.0)};
  return c;
}
// |a| >= |b|, or a = 0.
FORCE_INLINE real2 quick_sum(real a, real b) {
  const real s = a + b;
  const real2 c = {s, b - (s - a)};
  return c;
}
FORCE_INLINE real2 exact_sum(real a, real b) {
  const real s = a + b, part = s - a;
  const real2 c = {s, (a - (s - part)) + (b - part)};
  return c;
}
FORCE_INLINE real2 exact_product(real a, real b) {
  const real p = a * b;
  const real2 c = {p, fma(a, b, -p)};
  return c;
}
FORCE_INLINE real2 add2(real2 a, real2 b) {
  const real2 s = exact_sum(a.hi, b.hi), rest = exact_sum(a.lo, b.lo);
  const real2 c = quick_sum(s.hi, s.lo + rest.hi);
  return quick_sum(c.hi, c.lo + rest.lo);
}
FORCE_INLINE real2 negative2(real2 a) {
  const real2 c = {-a.hi, -a.lo};
  return c;
}
FORCE_INLINE real2 subtract2(real2 a, real2 b) { return add2(a, negative2(b)); }
FORCE_INLINE real2 multiply2(real2 a, real2 b) {
  const real2 p = exact_product(a.hi, b.hi);
  return quick_sum(p.hi, p.lo + fma(a.hi, b.lo, a.lo * b.hi));
}
FORCE_INLINE real2 divide2(real2 a, real2 b) {
  const real q = a.hi / b.hi;
  const real2 rest = subtract2(a, multiply2(widen(q), b));
  return quick_sum(q, rest.hi / b.hi);
}
// Of a positive number.
FORCE_INLINE real2 root2(real2 a) {
  const real r = sqrt(a.hi);
  return quick_sum(r, (fma(-r, r, a.hi) + a.lo) / (2.0 * r));
}

FORCE_INLINE vector3_2 widen3(vector3 a, vector3 rest) {
  const vector3_2 c = {{a.x, rest.x}, {a.y, rest.y}, {a.z, rest.z}};
  return c;
}
FORCE_INLINE vector3 high3(vector3_2 a) {
  const vector3 c = {a.x.hi, a.y.hi, a.z.hi};
  return c;
}
FORCE_INLINE vector3 low3(vector3_2 a) {
  const vector3 c = {a.x.lo, a.y.lo, a.z.lo};
  return c;
}
FORCE_INLINE real2 dot3_2(vector3_2 a, vector3_2 b) {
  return add2(add2(multiply2(a.x, b.x), multiply2(a.y, b.y)), multiply2(a.z, b.z));
}
FORCE_INLINE vector3_2 scale3_2(real2 s, vector3_2 a) {
  const vector3_2 c = {multiply2(s, a.x), multiply2(s, a.y), multiply2(s, a.z)};
  return c;
}
FORCE_INLINE vector3_2 along3_2(vector3_2 p, real2 t, vector3_2 d) {
  const vector3_2 c = {add2(p.x, multiply2(t, d.x)), add2(p.y, multiply2(t, d.y)), add2(p.z, multiply2(t, d.z))};
  return c;
}

#pragma OPENCL FP_CONTRACT ON
