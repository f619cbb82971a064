#pragma once

#include <mutex>

namespace scatter {

/// Held by whoever makes or destroys a plan of FFTW, which serves one thread at a time. Running plans needs
/// no lock.
inline std::mutex& fftw_planner() {
  static std::mutex mutex;
  return mutex;
}

} // namespace scatter
