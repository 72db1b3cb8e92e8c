/// \file
/// Functions in versions for several widths of vectors, of which the machine takes the best.
#pragma once

// Sanitizers do not get on with the resolvers of clones, and other compilers do not know them. All versions give the
// same bits, as no product is contracted with a sum (-ffp-contract=off).
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__linux__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define TREEMARCH_VECTOR_CLONES __attribute__((target_clones("default", "avx2", "avx512f")))
#else
#define TREEMARCH_VECTOR_CLONES
#endif
