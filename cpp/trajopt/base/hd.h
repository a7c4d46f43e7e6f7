// Host/device markers and the namespace in which compiled-per-instruction-set code lives.
//
// Numeric headers open `namespace trajopt::inline TRAJOPT_ISA`. A hot source file is compiled once
// per instruction set (AVX2, AVX-512, portable), each time with another TRAJOPT_ISA, so that the
// linker never merges an AVX-512 instantiation of a template into portable code.
#pragma once

#ifdef __CUDACC__
#define TRAJOPT_HD __host__ __device__
#else
#define TRAJOPT_HD
#endif

// Instead of `inline constexpr` for a table at namespace scope, of which a device needs its own.
#ifdef __CUDA_ARCH__
#define TRAJOPT_TABLE static __device__ constexpr
#else
#define TRAJOPT_TABLE inline constexpr
#endif

// Before a loop of a constant number of rounds, at most 16, whose arrays are to stay in registers.
#if defined(__CUDA_ARCH__)
#define TRAJOPT_UNROLL _Pragma("unroll")
#elif defined(__CUDACC__)
#define TRAJOPT_UNROLL  // nvcc's pass over the host's code
#else
#define TRAJOPT_UNROLL _Pragma("GCC unroll 16")
#endif

#ifndef TRAJOPT_ISA
#define TRAJOPT_ISA portable
#endif
