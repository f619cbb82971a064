// Every reader of quantities: the first byte picks one, the rest is its text. Whatever the text, the answer
// keeps its promise (finite, in its domain, in order) or is an InputError of one line.
#include "check.hpp"
#include <scatter/drop/size_distribution.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/refractive_index.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string_view>

namespace {

bool all_finite(const std::vector<double>& values) {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}

void read(int reader, std::string_view text) {
  switch (reader) {
  case 'l':
    SCATTER_FUZZ_CHECK(scatter::parse_length(text) > 0);
    break;
  case 'a':
    SCATTER_FUZZ_CHECK(std::isfinite(scatter::parse_angle_deg(text)));
    break;
  case 'L': {
    const auto values = scatter::parse_lengths(text);
    SCATTER_FUZZ_CHECK(!values.empty() && values.size() <= 10'000'000 && all_finite(values));
    SCATTER_FUZZ_CHECK(std::ranges::all_of(values, [](double value) { return value > 0; }));
    break;
  }
  case 'A': {
    const auto values = scatter::parse_angles_deg(text);
    SCATTER_FUZZ_CHECK(!values.empty() && values.size() <= 10'000'000 && all_finite(values));
    // A single range always increases.
    if (text.find(',') == text.npos)
      SCATTER_FUZZ_CHECK(std::ranges::adjacent_find(values, std::greater_equal{}) == values.end());
    break;
  }
  case 'o': {
    const auto orders = scatter::parse_orders(text);
    SCATTER_FUZZ_CHECK(!orders.empty() && orders.front() >= 0 && orders.back() <= 1000);
    SCATTER_FUZZ_CHECK(std::ranges::adjacent_find(orders, std::greater_equal{}) == orders.end());
    break;
  }
  case 'i': {
    const auto index = scatter::parse_index(text);
    SCATTER_FUZZ_CHECK(
        index.real() > 0 && index.imag() >= 0 && std::isfinite(index.real()) && std::isfinite(index.imag()));
    break;
  }
  case 's': {
    const auto source = scatter::parse_index_source(text);
    // The name that goes into files reads back as the same source.
    const auto again = scatter::parse_index_source(scatter::index_source_name(source));
    SCATTER_FUZZ_CHECK(again.kind == source.kind && again.value == source.value);
    break;
  }
  case 'd': {
    if (text.starts_with("list:")) return; // any file of this machine
    const auto sizes = scatter::drop::parse_size_distribution(text);
    const auto [smallest, largest] = sizes.range(1e-5);
    SCATTER_FUZZ_CHECK(smallest > 0 && smallest < largest && std::isfinite(largest));
    for (const double radius : {smallest, std::sqrt(smallest) * std::sqrt(largest), largest})
      SCATTER_FUZZ_CHECK(sizes.density(radius) >= 0 && std::isfinite(sizes.density(radius)));
    break;
  }
  default:
    SCATTER_FUZZ_CHECK(std::isfinite(scatter::parse_number(text)));
    break;
  }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  try {
    read(data[0], {reinterpret_cast<const char*>(data) + 1, size - 1});
  } catch (const scatter::InputError& error) {
    const std::string_view message = error.what();
    SCATTER_FUZZ_CHECK(!message.empty() && message.size() < 400);
    SCATTER_FUZZ_CHECK(std::ranges::none_of(message, [](unsigned char c) { return c < 0x20 || c == 0x7F; }));
  }
  return 0;
}
