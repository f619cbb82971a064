#pragma once

#include <scatter/table/phase_table.hpp>

namespace scatter::table {

/// Throws InputError unless the header describes a table: wavelengths positive, angles finite and increasing,
/// lists not empty, an index for every wavelength or none, orders when amplitudes per order are promised.
void check_header(const TableHeader& header);

/// Throws std::logic_error if an array has not the size that the header asks for, RunError if a value is not
/// finite: the message names variable, wavelength, theta and phi.
void check_slab(const TableHeader& header, std::size_t wavelength, const Slab& slab);

/// The order of calls and the contents, checked once for all file formats: begin, write 0 .. W-1, finish.
/// After a failure the sink is dead and only its destructor may run.
class CheckedSink : public Sink {
public:
  void begin(const TableHeader& header) final;
  void write(std::size_t wavelength, const Slab& slab) final;
  void finish(double seconds) final;

protected:
  [[nodiscard]] const TableHeader& header() const { return header_; }
  virtual void start() = 0;
  virtual void put(std::size_t wavelength, const Slab& slab) = 0;
  virtual void complete(double seconds) = 0;

private:
  enum class State { created, writing, done, failed };
  State state_ = State::created;
  std::size_t written_ = 0;
  TableHeader header_;
};

} // namespace scatter::table
