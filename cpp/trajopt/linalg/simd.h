// The few vector operations the linear algebra kernels are made of, per instruction set and scalar.
//
// A Vec<T> holds kWidth<T> neighbouring elements of a row. Lanes never mix except in transpose()
// and the broadcasts of a lane, which only move data, so every element goes through the same scalar
// operations everywhere.
#pragma once

#if defined(__AVX512F__)
#include "trajopt/linalg/simd_avx512.h"
#elif defined(__AVX2__) && defined(__FMA__)
#include "trajopt/linalg/simd_avx2.h"
#else
#include "trajopt/linalg/simd_portable.h"
#endif

namespace trajopt::linalg::inline TRAJOPT_ISA {

// Elements of a cache line: the unit of all internal storage, whatever the vector's width.
template <class T>
inline constexpr int kLine = 64 / static_cast<int>(sizeof(T));

// c - a*b with one rounding.
TRAJOPT_ALWAYS_INLINE double fnma(double a, double b, double c) { return __builtin_fma(-a, b, c); }
TRAJOPT_ALWAYS_INLINE float fnma(float a, float b, float c) { return __builtin_fmaf(-a, b, c); }

// Asks for the line of p, into the first or into the second level cache; any address is allowed.
TRAJOPT_ALWAYS_INLINE void prefetch(const void* p) { __builtin_prefetch(p, 0, 3); }
TRAJOPT_ALWAYS_INLINE void prefetch_second(const void* p) { __builtin_prefetch(p, 0, 2); }

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
