// One wavelength's settings; layout of Job in ray_program.hpp.

typedef struct {
  double n, k;        // refractive index
  double wave;        // half-turns of phase per unit of optical path: 2 a / lambda
  double attenuation; // of the amplitude per unit of path inside: 2 pi k a / lambda
  double origin;      // u of ray 0; v likewise
  double step;        // between rays
  double row_origin, rows_per_radian; // where a direction falls in the table; only to find candidates
  double column_origin, columns_per_radian;
  double row_margin, column_margin;   // how far the quick angles may be off
  int rays;           // across the grid
  int last_order;
  int rows, columns;
  int focal_lines;    // 1: by the sign rule; 0: none, unless CURVATURE counts them
  int interior_steps, rim_steps;
} job_t;
