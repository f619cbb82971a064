#pragma once

#include <scatter/phase/request_errors.hpp>

#include <string>

/// The cheapest settings that reach a tolerance.
namespace scatter::phase {

/// What a choice of settings is expected to cost.
struct Prediction {
  double error = 0;                   ///< as Request::tolerance
  double seconds = 0;                 ///< wall time of run() with the errors at hand and the kernels compiled
  double starting_seconds = 0;        ///< what the first request of a process takes more
  double judging_seconds = 0;         ///< wall time that the errors took: measured, not predicted
  double judging_seconds_to_come = 0; ///< of wavelengths that were not looked at yet
};

/// Predicts a request for rays from its settings as they stand. The error is what RequestErrors finds by
/// trial. The time is a count of rays, patches, directions and windows times what each took
/// where it was measured (two cores at 2.5 GHz with AVX-512): a guide within a factor of 3 there (8 below 0.1
/// s); kernels that the driver has not compiled yet take 10 to 30 s more.
[[nodiscard]] Prediction predict(const Request& request, RequestErrors& errors);

/// Whether the diffraction integral serves drops this small: order 0 needs a size parameter of
/// wavefront::smallest_size_with_shadow.
[[nodiscard]] bool integral_fits(const Request& request);

/// What was chosen, and why.
struct Choice {
  Request request; ///< tolerance met, open settings chosen
  Prediction expected;
  std::string explanation; ///< lines of text: what was considered, with error and time
};

/// For a drop that needs rays: the cheapest of filters, orders 0..last and numbers of rays whose error,
/// guessed and then tried, is within request.tolerance. Throws InputError with the best that is possible when
/// none is, saying how it is reached.
[[nodiscard]] Choice choose_settings(const Request& request, RequestErrors& errors);

} // namespace scatter::phase
