#pragma once

#include <vector>

/// Airy functions at grazing incidence, as the kernels take them.
namespace scatter::wavefront {

inline constexpr int edge_reach = 8; ///< EDGE_REACH in kernels/grazing.cl: the series hold for |tau| up to it
inline constexpr int edge_terms = 48; ///< EDGE_TERMS

/// Airy functions and their derivatives, real argument, |tau| <= 40. Relative accuracy 1e-12 away from zeros.
struct Airy {
  double Ai = 0, Bi = 0, Ai_slope = 0, Bi_slope = 0;
};
[[nodiscard]] Airy airy(double tau);

struct AiryEdge {
  double log_g = 0; ///< g = 1 / (pi (Ai^2 + Bi^2))
  double phase =
      0; ///< arg(Ai - i Bi) + pi / 4, continuous and 0 on average far below 0 but for 2/3 (-tau)^(3/2)
};
/// For |tau| <= 8. Accuracy 1e-13.
[[nodiscard]] AiryEdge airy_edge(double tau);

/// Chebyshev coefficients over |tau| <= 8: of ln g, its derivative by tau, the phase; edge_terms each. They
/// give them back to 3e-6, the derivative to 3e-4 at the ends and 1e-5 within 6.
[[nodiscard]] const std::vector<double>& airy_edge_series();

} // namespace scatter::wavefront
