#include <scatter/optics/version.hpp>

namespace scatter {

const char* version() {
  return SCATTER_VERSION;
}

} // namespace scatter
