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

/// Of a function's builds for each of them the one for this machine.
template <typename Function>
[[nodiscard]] Function widest_of(Function plain, Function avx2, Function avx512) {
  const std::size_t width = vector_units()[0].width;
  return width == 8 ? avx512 : width == 4 ? avx2 : plain;
}

} // namespace scatter::exact
