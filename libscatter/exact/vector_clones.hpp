#pragma once

// Clones of an inner loop for wider vectors, picked at start-up. Not under sanitizers, whose start-up comes
// later.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) &&     \
    !defined(__SANITIZE_THREAD__)
#define SCATTER_VECTOR_CLONES __attribute__((target_clones("avx512f", "fma", "default")))
// The same for loops with 64-bit integers among the doubles, which "fma" has in vectors of two only.
#define SCATTER_INTEGER_VECTOR_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define SCATTER_VECTOR_CLONES
#define SCATTER_INTEGER_VECTOR_CLONES
#endif
