#include <scatter/exact/mie.hpp>
#include <scatter/exact/sun_disc.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/methods.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <vector>

namespace scatter::phase {

namespace {

/// A sphere's Mueller matrix in units of the phase function, per angle.
struct SphereMatrices {
  std::vector<double> s11, s12, s33, s34;
};

SphereMatrices matrices(const exact::MieResult& mie, double norm) {
  SphereMatrices made;
  for (std::size_t i = 0; i < mie.S1.size(); ++i) {
    const exact::MuellerElements elements = exact::mueller_elements(mie.S1[i], mie.S2[i]);
    made.s11.push_back(norm * elements.S11);
    made.s12.push_back(norm * elements.S12);
    made.s33.push_back(norm * elements.S33);
    made.s34.push_back(norm * elements.S34);
  }
  return made;
}

} // namespace

Outcome run_mie(const Plan& plan, table::Sink& sink, const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  ErrorSum sum;
  const Request& request = plan.request;
  const std::size_t azimuths = request.phi_deg.size();
  sink.begin(plan.header);
  for (std::size_t w = 0; w < request.wavelength_m.size(); ++w) {
    const double radius = request.shape.radius_m, x = 2 * pi * radius / request.wavelength_m[w];
    std::optional<exact::SunDisc> disc;
    if (request.sun_disc_deg > 0)
      disc.emplace(request.theta_deg, request.sun_disc_deg, exact::SunDisc::level_for(x), true);
    const exact::MieResult mie = exact::mie_at_degrees(
        x, plan.header.index[w], disc ? disc->grid_deg() : request.theta_deg, request.threads);

    table::Slab slab;
    const SphereMatrices sharp = matrices(mie, 1 / (x * x * mie.Qsca * pi));
    for (std::size_t t = 0; t < request.theta_deg.size(); ++t) {
      const auto mean = [&](const std::vector<double>& values) {
        return disc ? disc->mean(t, values) : values[t];
      };
      const double s11 = mean(sharp.s11);
      double error = 2 * mie.error_estimate;
      // The rule is of twelfth order: from half as many points the mean is some 4000 times worse.
      if (disc) error += std::abs(s11 - disc->coarse_mean(t, sharp.s11)) / (1000 * s11);
      slab.error_estimate.push_back(error);
      slab.phase_function.insert(slab.phase_function.end(), azimuths, s11);
      if (!request.matrix) continue;
      const double s12 = mean(sharp.s12), s33 = mean(sharp.s33), s34 = mean(sharp.s34);
      for (std::size_t f = 0; f < azimuths; ++f)
        slab.phase_matrix.insert(
            slab.phase_matrix.end(), {s11, s12, 0, 0, s12, s11, 0, 0, 0, 0, s33, s34, 0, 0, -s34, s33});
    }
    if (request.amplitudes) {
      // Of the direction itself, not of the disc.
      const exact::MieResult here =
          disc ? exact::mie_at_degrees(x, plan.header.index[w], request.theta_deg, request.threads) : mie;
      for (std::size_t t = 0; t < request.theta_deg.size(); ++t)
        slab.amplitude.insert(
            slab.amplitude.end(), azimuths, table::Amplitude{here.S1[t], here.S2[t], 0.0, 0.0});
    }
    const double geometric = pi * radius * radius;
    slab.scattering_cross_section = geometric * mie.Qsca;
    slab.extinction_cross_section = geometric * mie.Qext;
    sum.add(slab.error_estimate);
    sink.write(w, slab);
    if (progress) progress(static_cast<double>(w + 1) / static_cast<double>(request.wavelength_m.size()));
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  sink.finish(seconds);
  return {sum.root_mean_square(), seconds, 0};
}

} // namespace scatter::phase
