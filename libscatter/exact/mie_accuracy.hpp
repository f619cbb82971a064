#pragma once

#include <scatter/exact/mie.hpp>

/// Internal to scatter::exact: Lorenz-Mie for those who need fewer digits than its users get.
namespace scatter::exact {

/// mie_at_degrees(), but amplitudes are summed again in 32 digits only where their estimated error is above
/// `enough`.
[[nodiscard]] MieResult mie_at_degrees_to(
    double enough, double size_parameter, std::complex<double> index, std::span<const double> theta_deg,
    int threads);

} // namespace scatter::exact
