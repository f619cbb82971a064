#pragma once

#include <vector>

/// Where the bows of a sphere and their supernumeraries lie: by Airy's theory and in the Debye series.
namespace scatter::validation {

/// Scattering angle of Descartes' ray that crosses a sphere of real index p times, 2 <= p, 1 < index < p
/// [deg].
[[nodiscard]] double geometric_bow_deg(double index, int p);

/// Curvature h of the deflection at the bow: rays that meet the sphere b radii away from Descartes' ray leave
/// h b^2 radians away from the bow. Van de Hulst (1957), 13.23: (p^2 - 1)^2 / p^2 sqrt((p^2 - n^2) / (n^2 -
/// 1)^3).
[[nodiscard]] double bow_curvature(double index, int p);

/// The k-th maximum of Airy's intensity, k = 1, 2, ..: zero -z of Ai'. In degrees from the geometric bow it
/// is z h^(1/3) x^(-2/3) radians on the lit side.
[[nodiscard]] double airy_maximum(int k);

/// Scattering angles of the first maxima of |S1|^2 (perpendicular polarisation) in the Debye term p, on the
/// lit side of the geometric bow, nearest first [deg]; to about 1e-6 of the distance from the bow. Throws
/// RunError if fewer are found between 0.3 and 5.4 of Airy's scale.
[[nodiscard]] std::vector<double>
debye_maxima_deg(double size_parameter, double index, int p, int count, int threads);

} // namespace scatter::validation
