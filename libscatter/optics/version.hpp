#pragma once

namespace scatter {

/// Version of the library, e.g. "0.1.0", as set by project() in the top-level CMakeLists.txt.
[[nodiscard]] const char* version();

} // namespace scatter
