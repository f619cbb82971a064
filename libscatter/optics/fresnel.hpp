#pragma once

#include <complex>

/// Fresnel's coefficients at a plane interface, for amplitudes and for energy.
///
/// Conventions: time factor exp(-i omega t), so that an index n + ik with k > 0 absorbs, and the signs of
/// Bohren & Huffman (1983), section 2.7: s (perpendicular) is measured along the same direction in all three
/// waves; p (parallel) of the reflected and the transmitted wave is measured along the direction whose
/// component in the interface is that of the incident wave's. At normal incidence both reflections are then
/// (1 - m) / (1 + m). A ray tracer that carries the right-handed frame (p, s, direction) instead has p
/// reversed on reflection: it takes -r_parallel.
namespace scatter {

/// Ratios of complex electric amplitudes to the incident one, and the refracted direction.
struct FresnelCoefficients {
  std::complex<double> r_perpendicular, r_parallel; ///< reflected / incident
  std::complex<double> t_perpendicular, t_parallel; ///< transmitted / incident
  std::complex<double> cos_transmitted; ///< cosine of the refracted angle; complex beyond total reflection
};

/// relative_index m: index behind the interface over the index before it; any finite m but 0 (m < 1 reflects
/// totally beyond the critical angle, k < 0 occurs when light leaves an absorbing medium). cos_incidence:
/// cosine of the angle from the normal, 0 (grazing) .. 1; complex for an inhomogeneous wave inside an
/// absorber. Of the two roots of cos_transmitted the one that travels or decays away from the interface is
/// taken: Re(m cos) + Im(m cos) >= 0. Accuracy: relative 1e-14, also at grazing incidence, for m -> 1 and at
/// Brewster's angle, where the usual differences cancel; at the critical angle itself the coefficients are as
/// ill-conditioned as the square root of the rounding of m. Throws InputError when an argument is not finite,
/// m = 0, or a real cosine is outside [0, 1]. Source: Bohren & Huffman (1983), eqs. 2.67-2.70, numerators
/// factored.
[[nodiscard]] FresnelCoefficients
fresnel(std::complex<double> relative_index, std::complex<double> cos_incidence);

/// Shares of the incident power per unit area of the interface.
struct FresnelEnergy {
  double reflectivity_perpendicular = 0, reflectivity_parallel = 0;
  double transmissivity_perpendicular = 0, transmissivity_parallel = 0;
};

/// The incident medium does not absorb: cos_incidence is real, 0..1, and reflectivity + transmissivity = 1
/// for every m (with k > 0 the transmitted share is what enters the absorber). At grazing incidence
/// everything is reflected. Throws like fresnel().
[[nodiscard]] FresnelEnergy fresnel_energy(std::complex<double> relative_index, double cos_incidence);

} // namespace scatter
