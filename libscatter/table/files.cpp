#include <scatter/optics/errors.hpp>
#include <scatter/table/atomic_file.hpp>
#include <scatter/table/checks.hpp>
#include <scatter/table/formats.hpp>

#include <fmt/format.h>

namespace scatter::table {
namespace {

enum class Format { netcdf, exr, json };

Format format_of(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension == ".nc") return Format::netcdf;
  if (extension == ".exr") return Format::exr;
  if (extension == ".json") return Format::json;
  throw InputError(fmt::format(
      "{}: the extension {} names no format; use .nc (netCDF), .exr (OpenEXR) or .json", path.string(),
      extension.empty() ? "(none)" : "'" + extension + "'"));
}

} // namespace

Compression parse_compression(std::string_view text) {
  if (text == "none") return Compression::none;
  if (text == "deflate" || text == "zip") return Compression::deflate;
  if (text == "piz") return Compression::piz;
  if (text == "pxr24") return Compression::pxr24;
  throw InputError(fmt::format("'{}' is not a compression; use none, deflate, piz or pxr24", text));
}

double count_numbers(const TableHeader& header) {
  const auto directions =
      static_cast<double>(header.theta_deg.size()) * static_cast<double>(header.phi_deg.size());
  const double per_direction = 1 + (header.matrix ? 16 : 0) + (header.stokes ? 3 : 0) +
                               (header.amplitudes ? 8 : 0) +
                               (header.per_order ? 8 * static_cast<double>(header.orders.size()) : 0);
  return static_cast<double>(header.wavelength_m.size()) *
         (directions * per_direction + static_cast<double>(header.theta_deg.size()));
}

void check_free_disk(const std::string& path, double bytes) {
  const double left = free_disk_bytes(path);
  if (bytes > left)
    throw RunError(fmt::format(
        "cannot write {}: the table needs {} but its disk has {} free", path, bytes_in_words(bytes),
        bytes_in_words(left)));
}

std::unique_ptr<Sink>
make_file_sink(const std::string& path, const TableHeader& header, const FileOptions& options) {
  if (header.stokes)
    throw InputError(fmt::format("{}: a table read from OpenEXR cannot be written again", path));
  check_header(header);
  if (path == "-") return make_json_sink(path, header, options);
  switch (format_of(path)) {
  case Format::netcdf:
    return make_netcdf_sink(path, header, options);
  case Format::exr:
    return make_exr_sink(path, header, options);
  case Format::json:
    return make_json_sink(path, header, options);
  }
  throw std::logic_error("unreachable format");
}

std::unique_ptr<Source> open_table(const std::filesystem::path& path) {
  const Format format = format_of(path);
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status))
    throw InputError(fmt::format("{}: there is no such file", path.string()));
  if (!std::filesystem::is_regular_file(status))
    throw InputError(fmt::format("{}: it is not a file", path.string()));
  switch (format) {
  case Format::netcdf:
    return open_netcdf(path);
  case Format::exr:
    return open_exr(path);
  case Format::json:
    return open_json(path);
  }
  throw std::logic_error("unreachable format");
}

PhaseTable read_table(const std::filesystem::path& path) {
  const std::unique_ptr<Source> source = open_table(path);
  PhaseTable table;
  table.header = source->header();
  table.seconds = source->seconds();
  for (std::size_t w = 0; w < table.header.wavelength_m.size(); ++w) table.slabs.push_back(source->read(w));
  return table;
}

void MemorySink::begin(const TableHeader& header) {
  check_header(header);
  table = {};
  table.header = header;
}

void MemorySink::write(std::size_t wavelength, const Slab& slab) {
  check_slab(table.header, wavelength, slab);
  if (wavelength != table.slabs.size())
    throw std::logic_error(
        fmt::format("slab {} written where slab {} was due", wavelength, table.slabs.size()));
  table.slabs.push_back(slab);
}

void MemorySink::finish(double seconds) {
  table.seconds = seconds;
}

} // namespace scatter::table
