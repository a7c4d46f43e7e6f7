// Between packs (element k of W frames in one register) and the frames' own arrays (element k
// behind element k - 1): moves, transposed in registers where the instruction set can. Lanes hold
// frames; lanes from `count` on repeat the last frame when read and are dropped when written.
//
// What is written never holds a negative zero: kernels may leave out work whose result is exactly
// zero in every lane, and with that nobody can tell whether they did.
#pragma once

#include "trajopt/base/pack.h"

namespace trajopt::inline TRAJOPT_ISA {

namespace lanes_detail {

// W rows of W numbers become its columns, in log2(W) rounds of shuffles.
template <int W>
__attribute__((always_inline)) inline void transpose(typename PackTypes<W>::Vector* r) {
#ifndef __CUDACC__  // whose front end does not know the builtin; a device has one lane
  if constexpr (W == 2) {
    const auto a = r[0], b = r[1];
    r[0] = __builtin_shufflevector(a, b, 0, 2);
    r[1] = __builtin_shufflevector(a, b, 1, 3);
  } else if constexpr (W == 4) {
    const auto a = __builtin_shufflevector(r[0], r[1], 0, 4, 2, 6);
    const auto b = __builtin_shufflevector(r[0], r[1], 1, 5, 3, 7);
    const auto c = __builtin_shufflevector(r[2], r[3], 0, 4, 2, 6);
    const auto d = __builtin_shufflevector(r[2], r[3], 1, 5, 3, 7);
    r[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
    r[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
    r[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
    r[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
  } else {
    typename PackTypes<W>::Vector t[8], u[8];
    for (int i = 0; i < 8; i += 2) {
      t[i] = __builtin_shufflevector(r[i], r[i + 1], 0, 8, 2, 10, 4, 12, 6, 14);
      t[i + 1] = __builtin_shufflevector(r[i], r[i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
    }
    for (int i = 0; i < 8; ++i) {
      const int j = i / 4 * 4 + i % 2;  // pairs (0, 2) and (1, 3) of each half
      u[i] = i % 4 < 2 ? __builtin_shufflevector(t[j], t[j + 2], 0, 1, 4, 5, 8, 9, 12, 13)
                       : __builtin_shufflevector(t[j], t[j + 2], 2, 3, 6, 7, 10, 11, 14, 15);
    }
    for (int i = 0; i < 4; ++i) {
      r[i] = __builtin_shufflevector(u[i], u[4 + i], 0, 1, 4, 5, 8, 9, 12, 13);
      r[4 + i] = __builtin_shufflevector(u[i], u[4 + i], 2, 3, 6, 7, 10, 11, 14, 15);
    }
  }
#endif
}

// Unaligned access to W numbers of one frame.
template <class S>
inline typename S::Vector load(const double* from) {
  typename S::Vector v;
  __builtin_memcpy(&v, from, sizeof(v));
  return v;
}

template <class S>
inline void store(double* to, typename S::Vector v, int n) {
  constexpr int W = lanes<S>;
  if (n == W) {
    __builtin_memcpy(to, &v, sizeof(v));
    return;
  }
#if defined(__AVX512F__)
  if constexpr (W == 8) {
    _mm512_mask_storeu_pd(to, static_cast<__mmask8>((1u << n) - 1), (__m512d)v);
    return;
  }
#endif
  for (int k = 0; k < n; ++k) to[k] = v[k];
}

}  // namespace lanes_detail

// The pack whose lane w is value(w).
template <class S, class Value>
TRAJOPT_HD inline S from_lanes(const Value& value) {
  if constexpr (lanes<S> == 1) {
    return value(0);
  } else if constexpr (lanes<S> == 2) {
    return typename S::Vector{value(0), value(1)};
  } else if constexpr (lanes<S> == 4) {
    return typename S::Vector{value(0), value(1), value(2), value(3)};
  } else {
    return typename S::Vector{value(0), value(1), value(2), value(3),
                              value(4), value(5), value(6), value(7)};
  }
}

// out[k] = elements k = 0 .. n - 1 of the frames at in, in + stride, ...
template <class S>
TRAJOPT_HD inline void load_lanes(const double* in, long stride, int count, int n, S* out) {
  const auto row = [&](int w) { return in + (w < count ? w : count - 1) * stride; };
  int k = 0;
  if constexpr (lanes < S >> 1) {
    constexpr int W = lanes<S>;
    for (; k + W <= n; k += W) {
      typename S::Vector r[W];
      for (int w = 0; w < W; ++w) r[w] = lanes_detail::load<S>(row(w) + k);
      lanes_detail::transpose<W>(r);
      for (int i = 0; i < W; ++i) out[k + i] = r[i];
    }
  }
  for (; k < n; ++k) out[k] = from_lanes<S>([&](int w) { return row(w)[k]; });
}

// The other way round: lane w < count of in[k] goes to out[w stride + k].
template <class S>
TRAJOPT_HD inline void store_lanes(const S* in, int n, double* out, long stride, int count) {
  const S zero(0.0);
  if constexpr (lanes<S> == 1) {
    for (int k = 0; k < n; ++k) out[k] = in[k] + zero;
  } else {
    constexpr int W = lanes<S>;
    // A first step shorter than the rest lets them write whole cache lines (of every frame, when
    // the stride is a multiple of W).
    const int skew = static_cast<int>(reinterpret_cast<std::uintptr_t>(out) / sizeof(double) % W);
    int step = n > 2 * W ? W - skew : W;
    for (int k = 0, left; k < n; k += left, step = W) {
      typename S::Vector r[W];
      left = n - k < step ? n - k : step;
      for (int i = 0; i < W; ++i) r[i] = (in[k + (i < left ? i : 0)] + zero).v;
      lanes_detail::transpose<W>(r);
      if (left == W && count == W) {
        for (int w = 0; w < W; ++w) lanes_detail::store<S>(out + w * stride + k, r[w], W);
      } else {
        for (int w = 0; w < count; ++w) lanes_detail::store<S>(out + w * stride + k, r[w], left);
      }
    }
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
