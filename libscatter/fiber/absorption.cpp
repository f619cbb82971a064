#include <scatter/fiber/absorption.hpp>
#include <scatter/fiber/quadrature.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/fresnel.hpp>
#include <scatter/optics/units.hpp>

#include <fmt/format.h>

#include <cmath>
#include <limits>

namespace scatter::fiber {
namespace {

/// What leaves a round fibre of light at right angles: all orders, integral over h = sin gamma of
/// F + (1-F)^2 T / (1 - F T). Infinite absorption leaves F.
double scattered_share(double eta, double sigma_a) {
  using Sum = std::array<double, 1>;
  const auto at = [&](double gamma) {
    const FresnelEnergy fresnel = fresnel_energy(eta, std::cos(gamma));
    const double F = 0.5 * (fresnel.reflectivity_perpendicular + fresnel.reflectivity_parallel);
    const double t = std::sin(gamma) / eta;
    const double T = std::exp(-2 * sigma_a * std::sqrt(1 - t * t));
    return Sum{(F + (1 - F) * (1 - F) * T / (1 - F * T)) * std::cos(gamma)};
  };
  constexpr double grazing = pi / 2 - 1e-12;
  return integrate<Sum>(at, 0, pi / 4, 1e-14)[0] + integrate<Sum>(at, pi / 4, grazing, 1e-14)[0];
}

} // namespace

Rgb absorption_from_melanin(double eumelanin, double pheomelanin) {
  for (const auto& [name, value] : {std::pair{"eumelanin", eumelanin}, {"pheomelanin", pheomelanin}})
    if (!(value >= 0 && std::isfinite(value)))
      throw InputError(fmt::format("{}: a concentration of {} is not 0 or more", name, value));
  constexpr Rgb eumelanin_absorption{0.419, 0.697, 1.37}, pheomelanin_absorption{0.187, 0.4, 1.05};
  Rgb sigma_a{};
  for (std::size_t c = 0; c < 3; ++c)
    sigma_a[c] = eumelanin * eumelanin_absorption[c] + pheomelanin * pheomelanin_absorption[c];
  return sigma_a;
}

Rgb absorption_from_colour(const Rgb& colour, double b) {
  if (!(b >= 0 && b <= 1)) throw InputError(fmt::format("azimuthal_roughness: {} is not between 0 and 1", b));
  const double scale = 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
  Rgb sigma_a{};
  for (std::size_t c = 0; c < 3; ++c) {
    if (!(colour[c] > 0 && colour[c] < 1))
      throw InputError(fmt::format("colour: {} is not between 0 and 1, both excluded", colour[c]));
    const double root = std::log(colour[c]) / scale;
    sigma_a[c] = root * root;
  }
  return sigma_a;
}

Rgb absorption_from_single_scattering(const Rgb& share, double eta) {
  if (!(eta > 1 && eta <= 10)) throw InputError(fmt::format("eta: {} is not above 1 (and at most 10)", eta));
  const double least = scattered_share(eta, std::numeric_limits<double>::infinity());
  Rgb found{};
  for (std::size_t c = 0; c < 3; ++c) {
    if (!(share[c] > least && share[c] <= 1))
      throw InputError(fmt::format(
          "share: {} is not between what the surface alone reflects, {:.6g}, and 1", share[c], least));
    if (share[c] == 1) continue;
    double low = 0, high = 1;
    while (scattered_share(eta, high) > share[c] && high < 1e6) {
      low = high;
      high *= 2;
    }
    for (int step = 0; step < 100 && high - low > 1e-13 * high; ++step) {
      const double middle = 0.5 * (low + high);
      (scattered_share(eta, middle) > share[c] ? low : high) = middle;
    }
    found[c] = 0.5 * (low + high);
  }
  return found;
}

} // namespace scatter::fiber
