#include <scatter/fiber/absorption.hpp>
#include <scatter/fiber/ray_section.hpp>
#include <scatter/optics/errors.hpp>

#include <fmt/format.h>

#include <cmath>

namespace scatter::fiber {
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
  const double least = RaySection(eta, 0).moments(0, 0).energy;
  const auto scattered_share = [&](double sigma_a) {
    return least + RaySection(eta, sigma_a).residual_energy(1, 0);
  };
  Rgb found{};
  for (std::size_t c = 0; c < 3; ++c) {
    if (!(share[c] > least && share[c] <= 1))
      throw InputError(fmt::format(
          "share: {} is not between what the surface alone reflects, {:.6g}, and 1", share[c], least));
    if (share[c] == 1) continue;
    double low = 0, high = 1;
    while (scattered_share(high) > share[c] && high < 1e6) {
      low = high;
      high *= 2;
    }
    for (int step = 0; step < 100 && high - low > 1e-13 * high; ++step) {
      const double middle = 0.5 * (low + high);
      (scattered_share(middle) > share[c] ? low : high) = middle;
    }
    found[c] = 0.5 * (low + high);
  }
  return found;
}

} // namespace scatter::fiber
