#pragma once

#include <scatter/table/phase_table.hpp>

#include <filesystem>
#include <memory>
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

/// A sink that writes the format of the path's extension: .nc (netCDF-4, CF-1.10), .exr (OpenEXR, one part per
/// wavelength), .json, or "-" (JSON to standard output). Refuses at once, before any work: an unknown extension, a
/// folder that is not there or not writable, a table that does not fit the format or (as far as can be told) the disk.
/// Files are written beside (NAME.part-PID) and renamed in finish(); a sink destroyed before that removes its part.
/// A signal handler of the program may call remove_unfinished_files().
/// Throws InputError on wrong requests, RunError when the disk fails.
[[nodiscard]] std::unique_ptr<Sink> make_file_sink(const std::string& path, const TableHeader& header,
                                                   const FileOptions& options = {});

/// Keeps the table in memory.
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

/// Reads back what make_file_sink wrote (.nc, .exr, .json). Throws InputError naming file and what is wrong with it.
[[nodiscard]] PhaseTable read_table(const std::filesystem::path& path);

/// Async-signal-safe: unlinks the part files that are open now.
void remove_unfinished_files() noexcept;

} // namespace scatter::table
