// Sixteen lanes side by side, and vectors in space of them.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

// Everything is one loop body to the compiler: calls would pass vectors through memory.
#define FORCE_INLINE static inline __attribute__((always_inline))

#define RAY_LANES 16
typedef double16 real;
typedef long16 mask;
#define load_real(array) vload16(0, array)
#define store_real(value, array) vstore16(value, 0, array)

typedef struct {
  real x, y, z;
} vector3;

FORCE_INLINE real dot3(vector3 a, vector3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
FORCE_INLINE vector3 cross3(vector3 a, vector3 b) {
  vector3 c = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  return c;
}
FORCE_INLINE vector3 scale3(real s, vector3 a) {
  vector3 c = {s * a.x, s * a.y, s * a.z};
  return c;
}
FORCE_INLINE vector3 along3(vector3 p, real t, vector3 d) {
  vector3 c = {p.x + t * d.x, p.y + t * d.y, p.z + t * d.z};
  return c;
}
FORCE_INLINE vector3 unit3(vector3 a) { return scale3(1.0 / sqrt(dot3(a, a)), a); }
// The same for a vector that is a unit vector but for rounding: one Newton step.
FORCE_INLINE vector3 still_unit3(vector3 a) { return scale3(1.5 - 0.5 * dot3(a, a), a); }

FORCE_INLINE vector3 select3(vector3 a, vector3 b, mask which) {
  const vector3 c = {select(a.x, b.x, which), select(a.y, b.y, which), select(a.z, b.z, which)};
  return c;
}
