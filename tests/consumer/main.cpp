// Uses the installed library as anyone would: an exact sphere, and a table of a real drop's phase function.
#include <scatter/drop/shape.hpp>
#include <scatter/exact/mie.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/refractive_index.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/job.hpp>

#include <cstdio>
#include <exception>
#include <vector>

int main() {
  try {
    const double right_angle[] = {scatter::pi / 2};
    const scatter::exact::MieResult sphere = scatter::exact::mie(10, {1.5, 0}, right_angle);
    std::printf("Mie, x = 10, m = 1.5: Qext %.9f, g %.9f\n", sphere.Qext, sphere.g);

    scatter::phase::Request request;
    request.shape = scatter::drop::beard_chuang(scatter::parse_length("0.5mm"));
    request.sun_elevation_deg = 20;
    request.wavelength_m = scatter::parse_lengths("650nm");
    request.index = scatter::parse_index_source("iapws");
    request.theta_deg = scatter::parse_angles_deg("130:150:1deg");
    request.phi_deg = {0};
    request.rays = 300;
    const scatter::table::PhaseTable table = scatter::phase::compute(request);
    double brightest = 0, at = 0;
    for (std::size_t t = 0; t < table.header.theta_deg.size(); ++t)
      if (table.slabs[0].phase_function[t] > brightest) {
        brightest = table.slabs[0].phase_function[t];
        at = table.header.theta_deg[t];
      }
    std::printf(
        "Drop of 0.5 mm: brightest between 130 and 150 deg at %.0f deg, %.4f per steradian\n", at, brightest);
    return 0;
  } catch (const scatter::InputError& error) {
    std::fprintf(stderr, "consumer: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "consumer: %s\n", error.what());
    return 1;
  }
}
