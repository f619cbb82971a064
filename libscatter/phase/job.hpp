#pragma once

#include <scatter/phase/planner.hpp>
#include <scatter/phase/request.hpp>
#include <scatter/table/files.hpp>

#include <functional>
#include <memory>

namespace scatter::phase {

/// A checked request: the method is chosen, the memory is counted, nothing has been computed.
struct Plan {
  Request request; ///< with a tolerance: after plan() chose what was open
  Method method = Method::patches;
  table::TableHeader header;
  double memory_bytes = 0;    ///< peak, estimated
  double available_bytes = 0; ///< what the machine has free
  std::string description;    ///< one line: method, rays, columns, passes
  std::string reasons;        ///< with a tolerance: lines that say what was considered and why this
  /// Of patches: shared by the choice of settings, predict() and run(), whichever needs them first computes
  /// them.
  std::shared_ptr<RequestErrors> errors;
};

/// Checks the request and chooses how to do it: a sphere goes to Mie unless something is asked for
/// that only rays have, everything else to rays; with a tolerance also the filter, orders and rays that are
/// open. Throws InputError with one line: which option,
/// what is wrong, what would be right; also when the job would need more memory than there is, or there is no
/// OpenCL device with fp64.
[[nodiscard]] Plan plan(const Request& request);

/// What the plan will cost, see planner.hpp. Computes the errors if nothing has yet. Throws RunError if the
/// device fails.
[[nodiscard]] Prediction predict(const Plan& plan);

/// What a run came to.
struct Outcome {
  double error = 0;   ///< root mean square of the table's error estimates, relative
  double seconds = 0; ///< wall time of all but judging
  double judging_seconds =
      0; ///< wall time of the errors' estimate, whether plan(), predict() or run() made it
};

/// Called from time to time with done in [0, 1].
using Progress = std::function<void(double done)>;

/// Computes the table, wavelength by wavelength, into the sink. Throws RunError if the device or the sink
/// fails.
Outcome run(const Plan& plan, table::Sink& sink, const Progress& progress = {});

/// plan() and run() into memory.
[[nodiscard]] table::PhaseTable compute(const Request& request);

} // namespace scatter::phase
