#pragma once

#include <cstdio>
#include <cstdlib>

/// A property that no input may break; a fuzzer counts abort() as a find.
#define SCATTER_FUZZ_CHECK(condition)                                                                        \
  do {                                                                                                       \
    if (!(condition)) {                                                                                      \
      (void)std::fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition);              \
      std::abort();                                                                                          \
    }                                                                                                        \
  } while (false)
