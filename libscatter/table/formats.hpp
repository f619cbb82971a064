#pragma once

#include <scatter/table/files.hpp>

/// One pair of functions per file format; files.cpp chooses by extension. Internal to the library.
namespace scatter::table {

std::unique_ptr<Sink>
make_netcdf_sink(const std::string& path, const TableHeader& header, const FileOptions& options);
std::unique_ptr<Sink>
make_exr_sink(const std::string& path, const TableHeader& header, const FileOptions& options);
/// path "-" is standard output.
std::unique_ptr<Sink>
make_json_sink(const std::string& path, const TableHeader& header, const FileOptions& options);

std::unique_ptr<Source> open_netcdf(const std::filesystem::path& path);
std::unique_ptr<Source> open_exr(const std::filesystem::path& path);
std::unique_ptr<Source> open_json(const std::filesystem::path& path);

/// Throws RunError if `bytes` are more than the disk of `path` has left.
void check_free_disk(const std::string& path, double bytes);

/// Numbers that one table holds, whatever the format: all slabs, matrix and amplitudes where asked.
[[nodiscard]] double count_numbers(const TableHeader& header);

/// One column of a row-major [T][F][inner] array (or [P][T][F][inner]: rows = P * T), or all of it without
/// phi.
template <class T>
std::vector<T>
select_column(std::vector<T> all, std::size_t columns, std::size_t inner, std::optional<std::size_t> phi) {
  if (!phi || all.empty()) return all;
  std::vector<T> one;
  one.reserve(all.size() / columns);
  for (std::size_t at = *phi * inner; at < all.size(); at += columns * inner)
    one.insert(
        one.end(), all.begin() + static_cast<std::ptrdiff_t>(at),
        all.begin() + static_cast<std::ptrdiff_t>(at + inner));
  return one;
}

} // namespace scatter::table
