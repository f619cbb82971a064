// From sums over patches, [column][row][ACCUMULATOR], to what people asked for. Needs mueller.cl; one work-item per
// column or block of rows.

FORCE_INLINE double16 amplitude_matrix(double8 j, double cos_phi, double sin_phi, double h) {
  // As in accumulate() of tile.cl: the field along (theta, phi) for incident x and y, then the scattering plane.
#define PART(o, e1, e2) const double o##_theta = h * cos_phi * e1 + sin_phi * e2, o##_phi = h * cos_phi * e2 - sin_phi * e1;
  PART(xr, j.s0, j.s1) PART(yr, j.s2, j.s3) PART(xi, j.s4, j.s5) PART(yi, j.s6, j.s7)
#undef PART
  return (double16)(
      -(xr_phi * sin_phi - yr_phi * cos_phi), -(xi_phi * sin_phi - yi_phi * cos_phi),
      xr_theta * cos_phi + yr_theta * sin_phi, xi_theta * cos_phi + yi_theta * sin_phi,
      xr_theta * sin_phi - yr_theta * cos_phi, xi_theta * sin_phi - yi_theta * cos_phi,
      -(xr_phi * cos_phi + yr_phi * sin_phi), -(xi_phi * cos_phi + yi_phi * sin_phi), 0, 0, 0, 0, 0, 0, 0, 0);
}

// In the symmetry plane, and anywhere about an axisymmetric drop, nothing couples the two polarisations. The cells'
// diagonals have no mirror images, so that the sums keep a trace of it: take it out.
FORCE_INLINE double8 uncoupled(double8 j, double sin_phi) {
  return sin_phi == 0.0 ? j * (double8)(1, 0, 0, 1, 1, 0, 0, 1) : j;
}
FORCE_INLINE double16 uncoupled_matrix(double16 m, double sin_phi) {
  return sin_phi == 0.0 ? m * (double16)(1, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 1, 1) : m;
}

kernel void add_sums(global double* to, global const double* from, ulong per_column) {
  const size_t start = get_global_id(0) * per_column;
  for (size_t i = 0; i < per_column; ++i) to[start + i] += from[start + i];
}

kernel void clear_sums(global double* sums, ulong per_column) {
  const size_t start = get_global_id(0) * per_column;
  for (size_t i = 0; i < per_column; ++i) sums[start + i] = 0.0;
}

// S11 and, with elements = 16, the whole Mueller matrix: out[column][row][elements]. The sums are left at zero, for the
// next wavelength.
kernel void sums_to_intensity(global double* sums, global const double* cos_theta, global const double* cos_phi,
                              global const double* sin_phi, int rows, int elements, double scale, global double* out) {
  const size_t column = get_global_id(0);
  for (int row = 0; row < rows; ++row) {
    const size_t at = column * rows + row;
#ifdef INTENSITIES
    const double16 m = scale * uncoupled_matrix(vload16(at, sums), sin_phi[column]);
    vstore16((double16)(0.0), at, sums);
    if (elements == 16) vstore16(m, at, out);
    else out[at] = m.s0;
#else
    const double8 j = uncoupled(vload8(at, sums), sin_phi[column]);
    vstore8((double8)(0.0), at, sums);
    if (elements == 16) {
      const double16 s = amplitude_matrix(j, cos_phi[column], sin_phi[column], cos_theta[row] < 0.0 ? -1.0 : 1.0);
      vstore16(scale * mueller(s.s0, s.s1, s.s2, s.s3, s.s4, s.s5, s.s6, s.s7), at, out);
    } else {
      const double8 squared = j * j;
      const double4 half_sum = squared.lo + squared.hi;
      out[at] = 0.5 * scale * (half_sum.s0 + half_sum.s1 + half_sum.s2 + half_sum.s3);
    }
#endif
  }
}

// S1, S2, S3, S4 as pairs: out[column][row][8].
kernel void sums_to_amplitude(global const double* sums, global const double* cos_theta, global const double* cos_phi,
                              global const double* sin_phi, int rows, double scale, global double* out) {
#ifndef INTENSITIES
  const size_t column = get_global_id(0);
  for (int row = 0; row < rows; ++row) {
    const size_t at = column * rows + row;
    const double16 s = amplitude_matrix(
        uncoupled(vload8(at, sums), sin_phi[column]), cos_phi[column], sin_phi[column],
        cos_theta[row] < 0.0 ? -1.0 : 1.0);
    vstore8(scale * s.lo, at, out);
  }
#endif
}

// One window of the Gaussian filter: the bow's edge at theta in this column, the width of the kernel there.
typedef struct {
  double theta, sigma;
} edge_t;

// Gaussian smoothing of sharp edges: within 3 sigma of an edge the table is smoothed, beyond 5 sigma it is not, in
// between smoothly. rows come in segments of equal spacing; a kernel that would leave its segment ends at it.
kernel void smooth_edges(global const double* in, global double* out, int rows, int elements, global const double* theta,
                         global const int* segment_first, global const int* segment_end, global const double* spacing,
                         global const edge_t* edges, int edges_per_column) {
  const size_t column = get_global_id(0);
  global const double* from = in + column * rows * elements;
  global double* to = out + column * rows * elements;
  global const edge_t* edge = edges + column * edges_per_column;
  for (int row = 0; row < rows; ++row) {
    double total = 0.0, taken[16];
    for (int e = 0; e < elements; ++e) taken[e] = 0.0;
    for (int w = 0; w < edges_per_column; ++w) {
      const double sigma = edge[w].sigma;
      if (!(sigma > 0.0)) continue;
      const double distance = fabs(theta[row] - edge[w].theta) / sigma;
      if (distance >= 5.0) continue;
      const double f = clamp((5.0 - distance) * 0.5, 0.0, 1.0), blend = f * f * (3.0 - 2.0 * f);
      const double step = spacing[row] / sigma;
      const int reach = (int)(4.0 / step);
      const int first = max(segment_first[row], row - reach), end = min(segment_end[row], row + reach + 1);
      double norm = 0.0, sum[16];
      for (int e = 0; e < elements; ++e) sum[e] = 0.0;
      for (int r = first; r < end; ++r) {
        const double x = (r - row) * step, g = exp(-0.5 * x * x);
        norm += g;
        for (int e = 0; e < elements; ++e) sum[e] += g * from[(size_t)r * elements + e];
      }
      total += blend;
      for (int e = 0; e < elements; ++e) taken[e] += blend * sum[e] / norm;
    }
    // Where windows overlap, their shares add up to one.
    const double keep = total < 1.0 ? 1.0 - total : 0.0, share = total > 1.0 ? 1.0 / total : 1.0;
    for (int e = 0; e < elements; ++e)
      to[(size_t)row * elements + e] = keep * from[(size_t)row * elements + e] + share * taken[e];
  }
}

// Average over a disc of this radius, across the scattering angle only: chords of a uniform disc as weights.
kernel void average_disc(global const double* in, global double* out, int rows, int elements, double radius,
                         global const int* segment_first, global const int* segment_end, global const double* spacing) {
  const size_t column = get_global_id(0);
  global const double* from = in + column * rows * elements;
  global double* to = out + column * rows * elements;
  for (int row = 0; row < rows; ++row) {
    const double step = spacing[row] / radius;
    const int reach = (int)(1.0 / step);
    const int first = max(segment_first[row], row - reach), end = min(segment_end[row], row + reach + 1);
    double norm = 0.0, sum[16];
    for (int e = 0; e < elements; ++e) sum[e] = 0.0;
    for (int r = first; r < end; ++r) {
      const double x = (r - row) * step, chord = sqrt(fmax(1.0 - x * x, 0.0));
      norm += chord;
      for (int e = 0; e < elements; ++e) sum[e] += chord * from[(size_t)r * elements + e];
    }
    for (int e = 0; e < elements; ++e) to[(size_t)row * elements + e] = sum[e] / norm;
  }
}

// From folded columns to the wanted grid: out[t - first_row][f][elements]. source_column[f] is the column, or ~column for its
// mirror image, where elements with a set bit in odd_elements change their sign. Columns of another block are left
// alone.
kernel void unfold(global const double* in, int rows, int elements, global const int* row_of, int first_row, int count,
                   global const int* source_column, int azimuths, int first_column, int end_column, uint odd_elements,
                   global double* out) {
  const int block = 16;
  const int t0 = get_global_id(0) * block, t1 = min(t0 + block, count);
  for (int f = 0; f < azimuths; ++f) {
    const int source = source_column[f], column = source < 0 ? ~source : source;
    if (column < first_column || column >= end_column) continue;
    global const double* from = in + (size_t)(column - first_column) * rows * elements;
    const uint odd = source < 0 ? odd_elements : 0;
    for (int t = t0; t < t1; ++t) {
      global const double* value = from + (size_t)row_of[first_row + t] * elements;
      global double* target = out + ((size_t)t * azimuths + f) * elements;
      for (int e = 0; e < elements; ++e) target[e] = (odd >> e) & 1 ? -value[e] : value[e];
    }
  }
}
