#include <scatter/exact/mie.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/methods.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace scatter::phase {

namespace {

/// Weights of a uniform disc's chords: Gauss-Chebyshev of the second kind, exact for polynomials to degree 2n
/// - 1.
struct DiscRule {
  std::vector<double> offset, weight; ///< in units of the disc's radius; weights add up to 1
  explicit DiscRule(int n) {
    for (int k = 1; k <= n; ++k) {
      const double angle = pi * k / (n + 1);
      offset.push_back(std::cos(angle));
      weight.push_back(2.0 / (n + 1) * std::sin(angle) * std::sin(angle));
    }
  }
};

/// Upper triangle of a sphere's Mueller matrix in units of the phase function: S11, S12, S33, S34.
struct SphereMatrix {
  double s11 = 0, s12 = 0, s33 = 0, s34 = 0;
};

} // namespace

Outcome run_mie(const Plan& plan, table::Sink& sink, const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  ErrorSum sum;
  const Request& request = plan.request;
  const std::size_t azimuths = request.phi_deg.size();
  sink.begin(plan.header);
  for (std::size_t w = 0; w < request.wavelength_m.size(); ++w) {
    const double radius = request.shape.radius_m, x = 2 * pi * radius / request.wavelength_m[w];
    // The disc's chord is sampled finer than the ripple, whose angular period is about pi / x.
    const double disc_radius = request.sun_disc_deg / 2 * radians_per_degree;
    const DiscRule disc(disc_radius > 0 ? std::max(16, static_cast<int>(std::ceil(3 * x * disc_radius))) : 1);
    const std::size_t nodes = disc_radius > 0 ? disc.offset.size() : 1;
    std::vector<double> theta; // of the disc's nodes
    for (const double wanted : request.theta_deg) {
      if (disc_radius == 0) break;
      for (std::size_t node = 0; node < nodes; ++node) {
        // Past a pole the direction comes back on the other side; a sphere's table is the same there.
        const double at = std::abs(wanted * radians_per_degree + disc_radius * disc.offset[node]);
        theta.push_back(std::min(at > pi ? 2 * pi - at : at, pi));
      }
    }
    // In degrees without a disc: even grids of those cost less.
    const exact::MieResult mie =
        disc_radius > 0 ? exact::mie(x, plan.header.index[w], theta, request.threads)
                        : exact::mie_at_degrees(x, plan.header.index[w], request.theta_deg, request.threads);

    table::Slab slab;
    const double norm = 1 / (x * x * mie.Qsca * pi);
    for (std::size_t t = 0; t < request.theta_deg.size(); ++t) {
      SphereMatrix mean;
      for (std::size_t node = 0; node < nodes; ++node) {
        const std::complex<double> S1 = mie.S1[t * nodes + node], S2 = mie.S2[t * nodes + node];
        const double weight = norm * (disc_radius > 0 ? disc.weight[node] : 1);
        const std::complex<double> cross = S1 * std::conj(S2);
        mean.s11 += weight * 0.5 * (std::norm(S2) + std::norm(S1));
        mean.s12 += weight * 0.5 * (std::norm(S2) - std::norm(S1));
        mean.s33 += weight * cross.real();
        mean.s34 -= weight * cross.imag();
      }
      slab.phase_function.insert(slab.phase_function.end(), azimuths, mean.s11);
      if (request.matrix)
        for (std::size_t f = 0; f < azimuths; ++f)
          slab.phase_matrix.insert(
              slab.phase_matrix.end(), {mean.s11, mean.s12, 0, 0, mean.s12, mean.s11, 0, 0, 0, 0, mean.s33,
                                        mean.s34, 0, 0, -mean.s34, mean.s33});
    }
    if (request.amplitudes) {
      // Of the direction itself, not of the disc.
      const exact::MieResult here =
          disc_radius > 0 ? exact::mie_at_degrees(x, plan.header.index[w], request.theta_deg, request.threads)
                          : mie;
      for (std::size_t t = 0; t < request.theta_deg.size(); ++t)
        slab.amplitude.insert(
            slab.amplitude.end(), azimuths, table::Amplitude{here.S1[t], here.S2[t], 0.0, 0.0});
    }
    const double geometric = pi * radius * radius;
    slab.scattering_cross_section = geometric * mie.Qsca;
    slab.extinction_cross_section = geometric * mie.Qext;
    slab.error_estimate.assign(request.theta_deg.size(), 2 * mie.error_estimate);
    sum.add(slab.error_estimate);
    sink.write(w, slab);
    if (progress) progress(static_cast<double>(w + 1) / static_cast<double>(request.wavelength_m.size()));
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  sink.finish(seconds);
  return {sum.root_mean_square(), seconds};
}

} // namespace scatter::phase
