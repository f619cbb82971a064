#pragma once

#include <string_view>
#include <vector>

namespace scatter {

/// A table of numbers with named columns, as the data files under tables/ hold them.
struct DataTable {
  std::vector<std::string_view> columns; ///< names, from the first line that is not a comment
  std::vector<std::vector<double>> rows; ///< one value per column, first column increasing

  /// The row at `key` of the first column, linear between rows, without the key itself.
  /// The caller keeps key within [rows.front()[0], rows.back()[0]].
  [[nodiscard]] std::vector<double> interpolate(double key) const;
};

/// Reads comma-separated values: lines that begin with # are comments, the first other line names the
/// columns. The names point into `text`, which must outlive the table. Throws std::logic_error on a malformed
/// table: the tables are part of the library, not input.
[[nodiscard]] DataTable parse_data_table(std::string_view text);

} // namespace scatter
