#pragma once

#include <scatter/phase/accuracy.hpp>
#include <scatter/phase/job.hpp>

/// The two ways to compute a table, behind plan() and run().
namespace scatter::phase {

/// Collects what becomes an Outcome.
class ErrorSum {
public:
  void add(std::span<const double> errors);
  [[nodiscard]] double root_mean_square() const;

private:
  double squares_ = 0;
  std::size_t count_ = 0;
};

/// The index that a request asks for at one wavelength, with its switches applied.
[[nodiscard]] std::complex<double> index_at(const Request& request, double wavelength_m);

[[nodiscard]] wavefront::Tracing tracing_of(const Request& request);
[[nodiscard]] wavefront::Wanted wanted_of(const Request& request);

Outcome run_patches(const Plan& plan, table::Sink& sink, const Progress& progress);
Outcome run_mie(const Plan& plan, table::Sink& sink, const Progress& progress);

} // namespace scatter::phase
