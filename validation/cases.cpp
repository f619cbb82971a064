#include "cases.hpp"

namespace scatter::validation {

Settings standard_settings(bool quick) {
  Settings settings;
  settings.quick = quick;
  settings.radius_m =
      quick ? std::vector<double>{0.1e-3, 0.4e-3} : std::vector<double>{0.1e-3, 0.2e-3, 0.4e-3, 0.5e-3, 1e-3};
  if (quick)
    settings.wavelength_m = {450e-9, 550e-9, 650e-9};
  else
    for (int nm = 380; nm <= 700; nm += 10) settings.wavelength_m.push_back(nm / 1e9);
  settings.rays = quick ? 1000 : 3000;
  return settings;
}

const std::vector<Case>& cases() {
  static const std::vector<Case> all{
      {"sphere", "spheres by rays against Lorenz-Mie, per radius, wavelength and region, with times",
       run_sphere},
      {"figure-3.12", "0.4 mm sphere: geometric optics, interference, Gaussian filter, Lorenz-Mie",
       run_figure_3_12},
      {"figure-3.7", "0.1 mm sphere: the bows and their colours in polarised light", run_figure_3_7},
      {"energy", "energy of every order of a falling drop: over directions and in the rays", run_energy},
      {"bow-angles", "geometric bow angles of spheres, spheroids and raindrops against published ones",
       run_bow_angles},
      {"integral",
       "the diffraction integral on spheres: orders against Debye's terms, their sum against Lorenz-Mie",
       run_integral},
      {"drops",
       "falling drops: rays, windows, reciprocity, the umbilic focus, a second uniform method, the twinned "
       "bow",
       run_drops},
      {"pareto", "error against time of every method: the bows of spheres, and the time of a falling drop",
       run_pareto},
      {"estimate", "error_estimate of tables against their true error, on spheres of all kinds",
       run_estimate},
      {"hard-cases", "hard cases of drops: each with its expected answer or its documented limit",
       run_hard_cases},
      {"exact", "exact spheres, Debye series and cylinders at their hard cases against arbitrary precision",
       run_exact},
      {"fiber-dual", "dual scattering of hair against random walks among strands, with times",
       run_fiber_dual},
      {"fiber-waves", "the lobes of rays in fibres against the exact cylinder, by radius", run_fiber_waves},
  };
  return all;
}

} // namespace scatter::validation
