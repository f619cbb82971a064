#include <scatter/optics/errors.hpp>
#include <scatter/table/checks.hpp>

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace scatter::table {
namespace {

void check_increasing(const std::vector<double>& values, const char* name) {
  if (values.empty()) throw InputError(fmt::format("the table has no {}; give at least one", name));
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) throw InputError(fmt::format("{} number {} is not finite", name, i + 1));
    if (i > 0 && !(values[i] > values[i - 1]))
      throw InputError(
          fmt::format("{} must increase, but {} deg follows {} deg", name, values[i], values[i - 1]));
  }
}

bool is_finite(double value) {
  return std::isfinite(value);
}
bool is_finite(const Amplitude& a) {
  return std::isfinite(a.S1.real()) && std::isfinite(a.S1.imag()) && std::isfinite(a.S2.real()) &&
         std::isfinite(a.S2.imag()) && std::isfinite(a.S3.real()) && std::isfinite(a.S3.imag()) &&
         std::isfinite(a.S4.real()) && std::isfinite(a.S4.imag());
}

struct SlabCheck {
  const TableHeader& header;
  std::size_t wavelength;

  /// values is [outer][T][F][inner].
  template <class T>
  void grid(const std::vector<T>& values, const char* name, std::size_t outer, std::size_t inner, bool wanted)
      const {
    const std::size_t rows = header.theta_deg.size(), columns = header.phi_deg.size();
    size(values.size(), name, wanted ? outer * rows * columns * inner : 0);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (is_finite(values[i])) continue;
      const std::size_t direction = i / inner % (rows * columns);
      throw RunError(fmt::format(
          "{} is not finite at wavelength {} nm, theta {} deg, phi {} deg; nothing is written", name,
          header.wavelength_m[wavelength] * 1e9, header.theta_deg[direction / columns],
          header.phi_deg[direction % columns]));
    }
  }
  /// values is [T], [P] or a single one.
  void list(
      const std::vector<double>& values, const char* name, std::size_t expected, const char* index,
      const std::vector<double>& at) const {
    size(values.size(), name, expected);
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(values[i]))
        throw RunError(fmt::format(
            "{} is not finite at wavelength {} nm{}; nothing is written", name,
            header.wavelength_m[wavelength] * 1e9, at.empty() ? "" : fmt::format(", {} {}", index, at[i])));
  }

private:
  void size(std::size_t found, const char* name, std::size_t expected) const {
    if (found != expected)
      throw std::logic_error(fmt::format(
          "slab {} has {} values of {}, its header asks for {}", wavelength, found, name, expected));
  }
};

} // namespace

void check_header(const TableHeader& header) {
  if (header.wavelength_m.empty()) throw InputError("the table has no wavelength; give at least one");
  for (const double wavelength : header.wavelength_m)
    if (!(wavelength > 0) || !std::isfinite(wavelength))
      throw InputError(fmt::format("wavelength {} m is not a positive length", wavelength));
  check_increasing(header.theta_deg, "theta");
  check_increasing(header.phi_deg, "phi");
  if (!header.index.empty() && header.index.size() != header.wavelength_m.size())
    throw InputError(fmt::format(
        "the table has {} refractive indices for {} wavelengths; give one each", header.index.size(),
        header.wavelength_m.size()));
  if (header.per_order && header.orders.empty())
    throw InputError("amplitudes per order are asked for, but the method has no orders");
  if (header.stokes && header.matrix)
    throw InputError("a table holds the phase matrix or its first column, not both");
}

void check_slab(const TableHeader& header, std::size_t wavelength, const Slab& slab) {
  if (wavelength >= header.wavelength_m.size())
    throw std::logic_error(
        fmt::format("slab {} of a table with {} wavelengths", wavelength, header.wavelength_m.size()));
  const SlabCheck check{header, wavelength};
  const std::size_t orders = header.orders.size();
  check.grid(slab.phase_function, "phase_function", 1, 1, true);
  check.grid(slab.phase_matrix, "phase_matrix", 1, 16, header.matrix);
  check.grid(slab.stokes, "stokes", 1, 3, header.stokes);
  check.grid(slab.amplitude, "amplitude", 1, 1, header.amplitudes);
  check.grid(slab.order_amplitude, "order_amplitude", orders, 1, header.per_order);
  check.list(slab.error_estimate, "error_estimate", header.theta_deg.size(), "theta (deg)", header.theta_deg);
  check.list(
      slab.order_energy, "order_energy", orders, "order",
      std::vector<double>(header.orders.begin(), header.orders.end()));
  check.list({slab.scattering_cross_section}, "scattering_cross_section", 1, "", {});
  check.list({slab.extinction_cross_section}, "extinction_cross_section", 1, "", {});
}

void CheckedSink::begin(const TableHeader& header) {
  if (state_ != State::created) throw std::logic_error("Sink::begin called twice, or after a failure");
  state_ = State::failed;
  check_header(header);
  header_ = header;
  start();
  state_ = State::writing;
}

void CheckedSink::write(std::size_t wavelength, const Slab& slab) {
  if (state_ != State::writing)
    throw std::logic_error("Sink::write before begin, after finish or after a failure");
  if (wavelength != written_)
    throw std::logic_error(fmt::format("slab {} written where slab {} was due", wavelength, written_));
  state_ = State::failed;
  check_slab(header_, wavelength, slab);
  put(wavelength, slab);
  ++written_;
  state_ = State::writing;
}

void CheckedSink::finish(double seconds) {
  if (state_ != State::writing) throw std::logic_error("Sink::finish before begin, twice or after a failure");
  if (written_ != header_.wavelength_m.size())
    throw std::logic_error(
        fmt::format("Sink::finish after {} of {} slabs", written_, header_.wavelength_m.size()));
  state_ = State::failed;
  complete(seconds);
  state_ = State::done;
}

} // namespace scatter::table
