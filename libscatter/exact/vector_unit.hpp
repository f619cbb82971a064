#pragma once

#include <cstddef>
#include <span>

namespace scatter::exact {

/// Instructions that inner loops are compiled for.
struct VectorUnit {
  const char* name;  ///< "AVX-512", "AVX2", "plain"
  std::size_t width; ///< doubles per vector
};

/// Those that this machine has, widest first; never empty.
[[nodiscard]] std::span<const VectorUnit> vector_units();

} // namespace scatter::exact
