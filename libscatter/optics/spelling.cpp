#include <scatter/optics/spelling.hpp>

#include <algorithm>
#include <numeric>

namespace scatter {
namespace {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

} // namespace

std::optional<std::string> nearest_name(std::string_view word, const std::vector<std::string>& known) {
  if (known.empty() || word.size() >= 100) return std::nullopt;
  const auto nearest =
      std::ranges::min_element(known, {}, [&](const std::string& name) { return edit_distance(word, name); });
  if (edit_distance(word, *nearest) > std::max<std::size_t>(2, nearest->size() / 2)) return std::nullopt;
  return *nearest;
}

} // namespace scatter
