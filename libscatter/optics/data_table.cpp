#include <scatter/optics/data_table.hpp>

#include <algorithm>
#include <charconv>
#include <stdexcept>
#include <string>

namespace scatter {
namespace {

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const auto comma = line.find(',');
    fields.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

} // namespace

std::vector<double> DataTable::interpolate(double key) const {
  // The last interval also serves key = last row, and a key on a row reproduces that row bit for bit.
  auto upper =
      std::lower_bound(rows.begin() + 1, rows.end() - 1, key, [](const std::vector<double>& row, double k) {
        return row[0] < k;
      });
  const auto& high = *upper;
  const auto& low = *(upper - 1);
  const double weight = (key - low[0]) / (high[0] - low[0]);
  std::vector<double> values;
  for (std::size_t i = 1; i < low.size(); ++i) values.push_back((1 - weight) * low[i] + weight * high[i]);
  return values;
}

DataTable parse_data_table(std::string_view text) {
  DataTable table;
  for (int number = 1; !text.empty(); ++number) {
    const auto end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.empty() || line[0] == '#') continue;
    const auto fields = split(line);
    if (table.columns.empty()) {
      table.columns = fields;
      continue;
    }
    std::vector<double> row;
    for (const auto field : fields) {
      double value = 0;
      const auto [stop, error] = std::from_chars(field.data(), field.data() + field.size(), value);
      if (error != std::errc{} || stop != field.data() + field.size())
        throw std::logic_error("data table, line " + std::to_string(number) + ": not a number");
      row.push_back(value);
    }
    if (row.size() != table.columns.size() || (!table.rows.empty() && !(row[0] > table.rows.back()[0])))
      throw std::logic_error("data table, line " + std::to_string(number) + ": wrong length or order");
    table.rows.push_back(std::move(row));
  }
  if (table.rows.size() < 2) throw std::logic_error("data table: fewer than two rows");
  return table;
}

} // namespace scatter
