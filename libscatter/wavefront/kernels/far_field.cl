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

// A symmetric kernel over neighbouring rows: weights[0] in the middle, up to weights[reach] on both sides, sum 1. Rows
// come in stretches first..end-1 of equal spacing; a kernel that would leave its stretch ends there and is normalised
// again.
FORCE_INLINE double16 smooth_matrix(global const double* from, int row, int first, int end, global const double* weights,
                                    int reach) {
  double16 sum = weights[0] * vload16(row, from);
  double norm = weights[0];
  for (int k = 1; k <= reach; ++k) {
    if (row - k >= first) {
      sum += weights[k] * vload16(row - k, from);
      norm += weights[k];
    }
    if (row + k < end) {
      sum += weights[k] * vload16(row + k, from);
      norm += weights[k];
    }
  }
  return sum / norm;
}
FORCE_INLINE double smooth_row(global const double* from, int row, int first, int end, global const double* weights,
                               int reach) {
  double sum = weights[0] * from[row], norm = weights[0];
  for (int k = 1; k <= reach; ++k) {
    if (row - k >= first) {
      sum += weights[k] * from[row - k];
      norm += weights[k];
    }
    if (row + k < end) {
      sum += weights[k] * from[row + k];
      norm += weights[k];
    }
  }
  return sum / norm;
}
// Rows row..row+7 of one stretch.
FORCE_INLINE double8 smooth_rows(global const double* from, int row, int first, int end, global const double* weights,
                                 int reach) {
  if (row - reach >= first && row + 7 + reach < end) {
    double8 sum = weights[0] * vload8(0, from + row);
    for (int k = 1; k <= reach; ++k) sum += weights[k] * (vload8(0, from + row - k) + vload8(0, from + row + k));
    return sum;
  }
  double some[8];
  for (int lane = 0; lane < 8; ++lane) some[lane] = smooth_row(from, row + lane, first, end, weights, reach);
  return vload8(0, some);
}

// One window of the Gaussian filter: the bow's edge at theta in this column, the width of its kernel, and where the
// kernel's weights are.
typedef struct {
  double theta, sigma;
  int weights, reach;
} edge_t;

// How much of a row is taken from the smoothed table: all within one sigma of the edge, nothing beyond three. Wider
// windows wash out the first supernumeraries and let the secondary bow reach under the primary.
FORCE_INLINE double window(double distance) {
  const double f = clamp((3.0 - distance) * 0.5, 0.0, 1.0);
  return f * f * (3.0 - 2.0 * f);
}
FORCE_INLINE double8 window8(double8 distance) {
  const double8 f = clamp((3.0 - distance) * 0.5, 0.0, 1.0);
  return f * f * (3.0 - 2.0 * f);
}

// Gaussian smoothing of sharp edges. Where windows overlap, their shares add up to one.
kernel void smooth_edges(global const double* in, global double* out, int rows, int elements, global const double* theta,
                         global const int* stretch_first, global const int* stretch_end, global const edge_t* edges,
                         int edges_per_column, global const double* weights) {
  const size_t column = get_global_id(0);
  global const double* from = in + column * rows * elements;
  global double* to = out + column * rows * elements;
  global const edge_t* edge = edges + column * edges_per_column;
  for (int row = 0; row < rows;) {
    const int first = stretch_first[row], end = stretch_end[row];
    if (elements == 1 && row + 8 <= end) {
      const double8 at = vload8(0, theta + row), plain = vload8(0, from + row);
      double8 total = 0.0, taken = 0.0;
      for (int w = 0; w < edges_per_column; ++w) {
        if (!(edge[w].sigma > 0.0)) continue;
        const double8 share = window8(fabs(at - edge[w].theta) / edge[w].sigma);
        if (!any(share > 0.0)) continue;
        total += share;
        taken += share * smooth_rows(from, row, first, end, weights + edge[w].weights, edge[w].reach);
      }
      vstore8(fmax(1.0 - total, 0.0) * plain + taken / fmax(total, 1.0), 0, to + row);
      row += 8;
      continue;
    }
    double total = 0.0, taken = 0.0;
    double16 taken_matrix = 0.0;
    for (int w = 0; w < edges_per_column; ++w) {
      const double share = edge[w].sigma > 0.0 ? window(fabs(theta[row] - edge[w].theta) / edge[w].sigma) : 0.0;
      if (share == 0.0) continue;
      total += share;
      if (elements == 1) taken += share * smooth_row(from, row, first, end, weights + edge[w].weights, edge[w].reach);
      else taken_matrix += share * smooth_matrix(from, row, first, end, weights + edge[w].weights, edge[w].reach);
    }
    const double keep = fmax(1.0 - total, 0.0), scale = 1.0 / fmax(total, 1.0);
    if (elements == 1) to[row] = keep * from[row] + scale * taken;
    else vstore16(keep * vload16(row, from) + scale * taken_matrix, row, to);
    ++row;
  }
}

// Intensity next to an edge is |amplitude|^2 / sqrt(x). On the bright side lie rows first, first + side, .. at
// x = (place + k) step. The first `replaced` of them take that law's value; the very first is left out where `skip`: too
// close to the edge. The sum over rows then misses `mass` of the law, in units of one row. Empty where mass = 0.
typedef struct {
  double amplitude[8];
  double mass, step, place, turn;
  int first, side, skip, replaced;
} end_correction_t;

FORCE_INLINE double edge_law(double x, double turn) { return (1.0 + sin(turn * x * sqrt(x))) / sqrt(x); }

FORCE_INLINE double16 load_elements(global const double* table, int row, int elements) {
  return elements == 16 ? vload16(row, table) : (double16)(table[row]);
}
FORCE_INLINE void store_elements(double16 value, global double* table, int row, int elements) {
  if (elements == 16) vstore16(value, row, table);
  else table[row] = value.s0;
}

// Puts what rows miss at an edge onto the two rows around it, for filters to spread.
kernel void correct_ends(global double* table, int rows, int elements, global const double* sin_phi, double scale,
                         global const end_correction_t* corrections, int per_column) {
  const size_t column = get_global_id(0);
  global double* to = table + column * rows * elements;
  for (int n = 0; n < per_column; ++n) {
    global const end_correction_t* c = corrections + column * per_column + n;
    if (c->mass == 0.0) continue;
    const double16 peak = scale * uncoupled_matrix(
        mueller(c->amplitude[0], c->amplitude[1], c->amplitude[2], c->amplitude[3], c->amplitude[4],
                c->amplitude[5], c->amplitude[6], c->amplitude[7]), sin_phi[column]);
    const int dark = c->first - c->side;
    const double16 behind = load_elements(to, dark, elements);
    // Rows that look nothing like the law have met something else.
    double bright = 0.0, expected = 0.0;
    const int kept = max(c->replaced, c->skip);
    for (int k = kept; k < kept + 4; ++k) {
      bright += to[(c->first + k * c->side) * elements] - behind.s0;
      expected += peak.s0 * edge_law((c->place + k) * c->step, c->turn);
    }
    if (!(bright > 0.4 * expected && bright < 2.5 * expected)) continue;
    if (c->skip) store_elements(behind, to, c->first, elements);
    for (int k = c->skip; k < c->replaced; ++k)
      store_elements(behind + peak * edge_law((c->place + k) * c->step, c->turn), to, c->first + k * c->side, elements);
    const double16 mass = c->mass * peak, bright_row = load_elements(to, c->first, elements);
    store_elements(bright_row + (1.0 - c->place) * mass, to, c->first, elements);
    store_elements(behind + c->place * mass, to, dark, elements);
  }
}

// The same kernel for every row: the average over the sun's disc, across the scattering angle only.
kernel void average_disc(global const double* in, global double* out, int rows, int elements,
                         global const int* stretch_first, global const int* stretch_end, global const double* weights,
                         int reach) {
  const size_t column = get_global_id(0);
  global const double* from = in + column * rows * elements;
  global double* to = out + column * rows * elements;
  for (int row = 0; row < rows;) {
    const int first = stretch_first[row], end = stretch_end[row];
    if (elements == 1 && row + 8 <= end) {
      vstore8(smooth_rows(from, row, first, end, weights, reach), 0, to + row);
      row += 8;
      continue;
    }
    if (elements == 1) to[row] = smooth_row(from, row, first, end, weights, reach);
    else vstore16(smooth_matrix(from, row, first, end, weights, reach), row, to);
    ++row;
  }
}

// The same next to 0 and 180 deg, where every row has weights of its own: those of `width` rows from its first on.
kernel void average_disc_at_poles(global const double* in, global double* out, int rows, int elements,
                                  global const int* pole_row, global const int* first, int count,
                                  global const double* weights, int width) {
  const size_t column = get_global_id(0);
  global const double* from = in + column * rows * elements;
  global double* to = out + column * rows * elements;
  for (int i = 0; i < count; ++i)
    for (int e = 0; e < elements; ++e) {
      double sum = 0.0;
      for (int k = 0; k < width; ++k) sum += weights[i * width + k] * from[(size_t)(first[i] + k) * elements + e];
      to[(size_t)pole_row[i] * elements + e] = sum;
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
