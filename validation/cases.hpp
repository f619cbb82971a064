#pragma once

#include "curves.hpp"
#include "report.hpp"

#include <string>
#include <string_view>
#include <vector>

/// The validation cases: what is computed, against what it is held, and what came out.
namespace scatter::validation {

/// What the user may change. Cases that repeat a published figure or number keep its drop and its light, and
/// say so.
struct Settings {
  std::vector<double> radius_m;     ///< of the sphere case, increasing
  std::vector<double> wavelength_m; ///< of the sphere case and of colours
  IndexSource index;
  int rays = 3000;
  std::vector<int> orders{0, 1, 2, 3};
  int threads = 0;
  bool quick = false; ///< a reduced version of every case, for tests
};

/// radius 0.1, 0.2, 0.4, 0.5, 1.0 mm, 380:700:10 nm; quick: 0.1 and 0.4 mm, three wavelengths, 1000 rays.
[[nodiscard]] Settings standard_settings(bool quick);

struct Case {
  std::string_view name, description;
  CaseReport (*run)(const Settings&, const Progress&);
};

/// In the order in which they are run and shown.
[[nodiscard]] const std::vector<Case>& cases();

/// Spheres by rays against Lorenz-Mie per radius, wavelength and region of scattering angle, with wall times;
/// convergence with the number of rays. Also makes patches-accuracy.csv, which is tables/accuracy/patches.csv
/// when the settings are the standard ones.
[[nodiscard]] CaseReport run_sphere(const Settings& settings, const Progress& progress);
/// Figure 3.12 of the dissertation: geometric optics, interference, the Gaussian filter, Lorenz-Mie; 0.4 mm.
[[nodiscard]] CaseReport run_figure_3_12(const Settings& settings, const Progress& progress);
/// Figure 3.7 of the dissertation: the bows of a 0.1 mm sphere and their colours in polarised light.
[[nodiscard]] CaseReport run_figure_3_7(const Settings& settings, const Progress& progress);
/// Energy of every order of a deformed drop: integral over directions against what the rays carried.
[[nodiscard]] CaseReport run_energy(const Settings& settings, const Progress& progress);
/// Geometric bow angles of spheres, spheroids and raindrops against published ones.
[[nodiscard]] CaseReport run_bow_angles(const Settings& settings, const Progress& progress);
/// The diffraction integral on spheres traced as any drop: complex amplitudes of orders against Debye's
/// terms, the whole phase function against Lorenz-Mie beside patches with and without the Gaussian filter.
/// Also makes integral-accuracy.csv, which is tables/accuracy/integral.csv when the settings are the standard
/// ones.
[[nodiscard]] CaseReport run_integral(const Settings& settings, const Progress& progress);
/// Consistency of falling drops, which have no exact theory: convergence with rays, independence of the
/// integral's windows, reciprocity, the umbilic focus of spheroids, Chester, Friedman and Ursell's uniform
/// formula at the top of the bow, the twinned bow. Of the settings index, threads and quick count.
[[nodiscard]] CaseReport run_drops(const Settings& settings, const Progress& progress);
/// Error against wall time of both bows of spheres by patches with and without filter, the integral and
/// Lorenz-Mie at several settings, 650 nm; the time of a falling drop at all azimuths. Of the settings index,
/// threads and quick count.
[[nodiscard]] CaseReport run_pareto(const Settings& settings, const Progress& progress);
/// The error_estimate of tables against the true error, on spheres: radius, method, orders, rays, index and
/// region of scattering angle. Of the settings threads and quick count.
[[nodiscard]] CaseReport run_estimate(const Settings& settings, const Progress& progress);
/// Drops and rays at which tracers fail: every case has an expected answer or a documented limit. Of the
/// settings index, threads and quick count.
[[nodiscard]] CaseReport run_hard_cases(const Settings& settings, const Progress& progress);
/// The exact references themselves: hard spheres, Debye series and cylinders against arbitrary precision,
/// with error, error estimate and time; Airy's and the Debye series' bows against published maxima. Of the
/// settings only threads and quick count.
[[nodiscard]] CaseReport run_exact(const Settings& settings, const Progress& progress);
/// Dual scattering of hair against random walks among parallel and tangled strands, with the times of both.
/// Of the settings only threads and quick count.
[[nodiscard]] CaseReport run_fiber_dual(const Settings& settings, const Progress& progress);
/// R, TT and TRT of rays in silk and hair against Debye's terms of the exact cylinder by fibre radius,
/// averaged over azimuth; forward diffraction. Of the settings only quick counts.
[[nodiscard]] CaseReport run_fiber_waves(const Settings& settings, const Progress& progress);

} // namespace scatter::validation
