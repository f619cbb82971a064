#pragma once

#include <scatter/table/phase_table.hpp>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace scatter::table {

/// none; deflate (netCDF zlib 1 + shuffle, EXR ZIP); for EXR also piz and pxr24.
enum class Compression { none, deflate, piz, pxr24 };
/// How netCDF stores the big arrays. EXR is always single (it has no double).
enum class Precision { double_precision, single_precision };

struct FileOptions {
  Compression compression = Compression::none;
  Precision precision = Precision::double_precision;
};

/// "none", "deflate" (or "zip"), "piz", "pxr24"; throws InputError that lists them.
[[nodiscard]] Compression parse_compression(std::string_view text);

/// A sink that writes the format of the path's extension: .nc (netCDF-4, CF-1.10), .exr (OpenEXR, one part
/// per wavelength), .json, or "-" (JSON to standard output). Refuses at once, before any work: an unknown
/// extension, a folder that is not there or not writable, a table that does not fit the format or (as far as
/// can be told) the disk. Files are written beside (NAME.part-PID) and renamed in finish(); a sink destroyed
/// before that removes its part. A signal handler of the program may call remove_unfinished_files(). A
/// symbolic link is followed: what it points to is replaced, not the link. What each format holds stands at
/// the top of netcdf.cpp, exr.cpp and json.cpp. In short: netCDF holds everything; OpenEXR holds single
/// precision, no amplitudes, and of the matrix the first column (TableHeader::stokes when read back); JSON
/// holds everything, up to 2e7 numbers. A value that is not finite is never written: write() throws RunError
/// that names variable, wavelength and direction. Throws InputError on wrong requests, RunError when the disk
/// fails, is full or may not be written.
[[nodiscard]] std::unique_ptr<Sink>
make_file_sink(const std::string& path, const TableHeader& header, const FileOptions& options = {});

/// Keeps the table in memory. Checks slabs as the file sinks do.
class MemorySink final : public Sink {
public:
  void begin(const TableHeader& header) override;
  void write(std::size_t wavelength, const Slab& slab) override;
  void finish(double seconds) override;
  PhaseTable table;
};

/// Computes everything and keeps nothing (--output none).
class NullSink final : public Sink {
public:
  void begin(const TableHeader&) override {}
  void write(std::size_t, const Slab&) override {}
  void finish(double) override {}
};

/// What to read of one wavelength. Defaults: everything.
struct SlabPart {
  bool matrix = true;               ///< phase_matrix, or stokes
  bool amplitudes = true;           ///< amplitude and order_amplitude
  std::optional<std::size_t> phi{}; ///< only this azimuth: arrays come back with F = 1
};

/// A table on disk, read one wavelength at a time: a full one is larger than memory.
class Source {
public:
  virtual ~Source() = default;
  [[nodiscard]] virtual const TableHeader& header() const = 0;
  [[nodiscard]] virtual double seconds() const = 0; ///< wall time of the computation that made it
  /// Throws InputError if the file does not hold what its header promises, std::out_of_range on a wavelength
  /// or azimuth beyond the table's.
  [[nodiscard]] virtual Slab read(std::size_t wavelength, const SlabPart& part = {}) = 0;
};

/// Opens what make_file_sink wrote (.nc, .exr, .json). Throws InputError naming the file and what is wrong
/// with it.
[[nodiscard]] std::unique_ptr<Source> open_table(const std::filesystem::path& path);

/// Reads back a whole table into memory; throws as open_table() does.
[[nodiscard]] PhaseTable read_table(const std::filesystem::path& path);

/// Async-signal-safe: unlinks the part files that are open now.
void remove_unfinished_files() noexcept;

} // namespace scatter::table
