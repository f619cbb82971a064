// Writes the tables that other people's programs then read: write_example_tables FOLDER.

#include "example_table.hpp"
#include <scatter/table/files.hpp>

#include <cstdio>
#include <exception>

int main(int count, char** arguments) try {
  using namespace scatter::table;
  if (count != 2) return 2;
  const std::string folder = arguments[1];
  TableHeader head = example::header(3, 181, 36);
  example::write(*make_file_sink(folder + "/plain.nc", head), head);
  example::write(*make_file_sink(folder + "/plain.exr", head), head);
  head.matrix = true;
  example::write(*make_file_sink(folder + "/matrix.exr", head, {.compression = Compression::deflate}), head);
  head.amplitudes = head.per_order = true;
  const FileOptions small{.compression = Compression::deflate, .precision = Precision::single_precision};
  example::write(*make_file_sink(folder + "/everything.nc", head, small), head);
  example::write(*make_file_sink(folder + "/everything.json", head), head);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
