#include <scatter/optics/errors.hpp>
#include <scatter/optics/fresnel.hpp>

#include <cmath>
#include <sstream>

namespace scatter {
namespace {

using complex = std::complex<double>;

void check(complex m, complex c) {
  std::ostringstream message;
  if (!std::isfinite(m.real()) || !std::isfinite(m.imag()) || m == 0.0)
    message << "relative index " << m << " is not possible: use a finite number other than 0";
  else if (
      !std::isfinite(c.real()) || !std::isfinite(c.imag()) ||
      (c.imag() == 0 && !(c.real() >= 0 && c.real() <= 1)))
    message << "cosine of incidence " << c << " is not possible: use 0..1";
  else
    return;
  throw InputError(message.str());
}

/// m cos_transmitted = sqrt(m^2 - sin^2), as sqrt((m^2 - 1) + cos^2): nothing cancels when m is near 1.
complex outward_root(complex contrast, complex c) {
  const complex root = std::sqrt(contrast + c * c);
  return root.real() + root.imag() >= 0 ? root : -root;
}

} // namespace

FresnelCoefficients fresnel(complex m, complex c) {
  check(m, c);
  if (m == 1.0) return {0, 0, 1, 1, c}; // the same medium; also where both cosines vanish
  const complex contrast = (m - 1.0) * (m + 1.0);
  const complex w = outward_root(contrast, c);
  const complex perpendicular = c + w, parallel = w + m * m * c;
  // c - w and w - m^2 c, multiplied out with their sums: both numerators are products without cancellation.
  return {
      -contrast / (perpendicular * perpendicular),
      contrast * (1.0 - (contrast + 2.0) * c * c) / (parallel * parallel), 2.0 * c / perpendicular,
      2.0 * m * c / parallel, w / m};
}

FresnelEnergy fresnel_energy(complex m, double c) {
  const auto amplitude = fresnel(m, complex(c));
  FresnelEnergy energy;
  energy.reflectivity_perpendicular = std::norm(amplitude.r_perpendicular);
  energy.reflectivity_parallel = std::norm(amplitude.r_parallel);
  if (m == 1.0) {
    energy.transmissivity_perpendicular = energy.transmissivity_parallel = 1;
    return energy;
  }
  if (c == 0) return energy;
  // Normal component of the Poynting vector behind over before the interface.
  energy.transmissivity_perpendicular =
      std::norm(amplitude.t_perpendicular) * (m * amplitude.cos_transmitted).real() / c;
  energy.transmissivity_parallel =
      std::norm(amplitude.t_parallel) * (std::conj(m) * amplitude.cos_transmitted).real() / c;
  return energy;
}

} // namespace scatter
