#pragma once

#include <scatter/phase/request.hpp>
#include <scatter/table/files.hpp>

#include <functional>

namespace scatter::phase {

/// A checked request: the method is chosen, the memory is counted, nothing has been computed.
struct Plan {
  Request request;
  Method method = Method::patches;
  table::TableHeader header;
  double memory_bytes = 0;    ///< peak, estimated
  double available_bytes = 0; ///< what the machine has free
  std::string description;    ///< one line: method, rays, columns, passes
};

/// Checks the request and chooses how to do it. Throws InputError with one line: which option, what is wrong,
/// what would be right; also when the job would need more memory than there is, or there is no OpenCL device
/// with fp64.
[[nodiscard]] Plan plan(const Request& request);

/// Called from time to time with done in [0, 1].
using Progress = std::function<void(double done)>;

/// Computes the table, wavelength by wavelength, into the sink. Throws RunError if the device or the sink
/// fails.
void run(const Plan& plan, table::Sink& sink, const Progress& progress = {});

/// plan() and run() into memory.
[[nodiscard]] table::PhaseTable compute(const Request& request);

} // namespace scatter::phase
