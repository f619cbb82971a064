#pragma once

#include <scatter/fiber/fiber_scattering.hpp>

/// From what hair is made of, or looks like, to its absorption per radius.
namespace scatter::fiber {

/// sigma_a per radius for red, green and blue, of hair with these concentrations of eumelanin (brown, black)
/// and pheomelanin (red): eumelanin (0.419, 0.697, 1.37), pheomelanin (0.187, 0.4, 1.05) per unit of
/// concentration, the figures of d'Eon et al. (2011). Eumelanin: 0.3 blond, 1.3 brown, 8 black. Throws
/// InputError unless both are finite and 0 or more.
[[nodiscard]] Rgb absorption_from_melanin(double eumelanin, double pheomelanin);

/// sigma_a per radius of hair that looks, after many scatterings, like this colour (each 0 < colour < 1,
/// linear): (ln colour / (5.969 - 0.215 b + 2.532 b^2 - 10.73 b^3 + 5.574 b^4 + 0.245 b^5))^2, a fit to
/// path-traced hair by Chiang et al. (2016), for eta = 1.55. b: their azimuthal roughness, 0..1.
/// A smooth section has 0. Throws InputError that names what is out of range.
[[nodiscard]] Rgb absorption_from_colour(const Rgb& colour, double azimuthal_roughness = 0);

/// sigma_a per radius of a smooth round fibre that scatters, once, this share of the light that falls on it
/// at right angles: all orders together. 0 < share <= 1, eta > 1, relative accuracy 1e-10 where the share is
/// below 1 - 1e-6. A share that even black fibre exceeds by its surface reflection alone is refused
/// (InputError): the message names the least.
[[nodiscard]] Rgb absorption_from_single_scattering(const Rgb& share, double eta = 1.55);

} // namespace scatter::fiber
