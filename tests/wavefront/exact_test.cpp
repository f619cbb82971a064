#include "support.hpp"
#include <scatter/exact/mie.hpp>

/// Rays against Lorenz-Mie where rays should do: away from bows, edges and the axis.
namespace {

using namespace support;

TEST(RaysAgainstLorenzMie, ComplexAmplitudesOfASphereAgreeInMagnitudeAndPhase) {
  const double radius = 0.4e-3;
  for (const double wavelength : {450e-9, 650e-9}) {
    const Light light{wavelength, 1.335};
    Tracing tracing;
    tracing.shape = drop::sphere(radius);
    tracing.rays = 6000;
    tracing.orders.clear();
    for (int p = 0; p <= 12; ++p) tracing.orders.push_back(p);
    Wanted wanted;
    // Regions with two or three strong rays; no order up to 12 has its bow within 2 deg of them.
    wanted.theta_deg.clear();
    for (const double from : {24.0, 34.0, 59.0})
      for (int i = 0; i < 200; ++i) wanted.theta_deg.push_back(from + 0.01 * i);
    wanted.phi_deg = {0};
    wanted.amplitudes = true;
    const FarField field = far_field(tracing, light, wanted);
    const auto exact = exact::mie_at_degrees(2 * pi * radius / wavelength, light.index, wanted.theta_deg);
    for (std::size_t region = 0; region < 3; ++region) {
      double off1 = 0, off2 = 0, all1 = 0, all2 = 0;
      for (std::size_t t = 200 * region; t < 200 * (region + 1); ++t) {
        off1 += std::norm(field.amplitude[t].S1 - exact.S1[t]);
        off2 += std::norm(field.amplitude[t].S2 - exact.S2[t]);
        all1 += std::norm(exact.S1[t]);
        all2 += std::norm(exact.S2[t]);
      }
      // A phase that is off by a quarter turn or a wrong sign would give 1.4 or 2.
      EXPECT_LT(std::sqrt(off1 / all1), 0.04) << "S1 from " << wanted.theta_deg[200 * region] << " deg";
      EXPECT_LT(std::sqrt(off2 / all2), 0.04) << "S2 from " << wanted.theta_deg[200 * region] << " deg";
      std::printf("rms error of S1 %.4f, S2 %.4f\n", std::sqrt(off1 / all1), std::sqrt(off2 / all2));
    }
  }
}

TEST(RaysAgainstLorenzMie, AbsorbingSpheresAgreeToo) {
  const double radius = 0.4e-3, wavelength = 650e-9;
  const Light light{wavelength, {1.331, 5e-5}};
  Tracing tracing;
  tracing.shape = drop::sphere(radius);
  tracing.rays = 4000;
  Wanted wanted;
  wanted.theta_deg = range(30, 32, 0.01);
  wanted.phi_deg = {0};
  const FarField field = far_field(tracing, light, wanted);
  const double x = 2 * pi * radius / wavelength;
  const auto exact = exact::mie_at_degrees(x, light.index, wanted.theta_deg);
  double rays = 0, series = 0;
  for (std::size_t t = 0; t < wanted.theta_deg.size(); ++t) {
    rays += field.phase_function[t] * field.scattering_cross_section;
    series += exact.phase_function[t] * exact.Qsca * pi * radius * radius;
  }
  EXPECT_NEAR(rays / series, 1, 0.03);
  EXPECT_NEAR(field.extinction_cross_section / (pi * radius * radius) / exact.Qext, 1, 5e-4);
  EXPECT_NEAR(
      field.scattering_cross_section / (pi * radius * radius) / exact.Qsca, 1, 3 * std::pow(x, -2.0 / 3));
  EXPECT_LT(exact.Qsca / exact.Qext, 0.8) << "the sphere absorbs";
}

} // namespace
