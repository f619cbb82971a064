#include <scatter/exact/vector_unit.hpp>

#include <vector>

namespace scatter::exact {

std::span<const VectorUnit> vector_units() {
  static const std::vector<VectorUnit> units = [] {
    std::vector<VectorUnit> found;
#if defined(__x86_64__) && defined(__GNUC__)
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
      found.push_back({"AVX-512", 8});
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) found.push_back({"AVX2", 4});
#endif
    found.push_back({"plain", 2});
    return found;
  }();
  return units;
}

} // namespace scatter::exact
