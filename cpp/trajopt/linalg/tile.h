// The register tile all block operations share: MR rows by NV vectors of an output, kept in
// registers while products are subtracted from it in a fixed order.
#pragma once

#include "trajopt/linalg/simd.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// As many accumulators as fit: 8 x 3 of 32 registers, 4 x 3 of 16.
inline constexpr int kTileRows = kWidth<double> == 8 ? 8 : 4;
inline constexpr int kTileVectors = 3;
template <class T>
inline constexpr int kTileColumns = kTileVectors* kWidth<T>;

template <class T>
constexpr int vectors(int columns) {
  return (columns + kWidth<T> - 1) / kWidth<T>;
}

// A strided view of the operand whose elements are broadcast: element (k, r) is
// data[k * step + r * row]. Negative steps run through k downwards.
template <class T>
struct Scalars {
  const T* data;
  long step;
  long row;
};

template <class T, int MR, int NV>
struct Tile {
  static constexpr int W = kWidth<T>;
  Vec<T> a[MR][NV];

  TRAJOPT_ALWAYS_INLINE void clear() {
#pragma GCC unroll 8
    for (int r = 0; r < MR; ++r) {
#pragma GCC unroll 3
      for (int v = 0; v < NV; ++v) a[r][v] = broadcast(T(0));
    }
  }

  // `tail` columns of the last vector exist; Tail = false: all of them.
  template <bool Tail>
  TRAJOPT_ALWAYS_INLINE void read(const T* p, long ld, int tail) {
#pragma GCC unroll 8
    for (int r = 0; r < MR; ++r) {
#pragma GCC unroll 3
      for (int v = 0; v < NV; ++v) {
        const T* q = p + r * ld + v * W;
        a[r][v] = Tail && v == NV - 1 ? load(q, tail) : load(q);
      }
    }
  }

  template <bool Tail>
  TRAJOPT_ALWAYS_INLINE void write(T* p, long ld, int tail) const {
#pragma GCC unroll 8
    for (int r = 0; r < MR; ++r) {
#pragma GCC unroll 3
      for (int v = 0; v < NV; ++v) {
        T* q = p + r * ld + v * W;
        if (Tail && v == NV - 1) {
          store(q, a[r][v], tail);
        } else {
          store(q, a[r][v]);
        }
      }
    }
  }

  // a[r][c] -= s(k, r) * b[k][c] for k = 0, 1, ..., count-1: one chain of fma per element.
  template <bool Tail>
  TRAJOPT_ALWAYS_INLINE void subtract(int count, Scalars<T> s, const T* b, long ldb, int tail) {
    const T* p = s.data;
    for (int k = 0; k < count; ++k) {
      Vec<T> row[NV];
#pragma GCC unroll 3
      for (int v = 0; v < NV; ++v) {
        const T* q = b + v * W;
        row[v] = Tail && v == NV - 1 ? load(q, tail) : load(q);
      }
#pragma GCC unroll 8
      for (int r = 0; r < MR; ++r) {
        const Vec<T> x = broadcast(p[r * s.row]);
#pragma GCC unroll 3
        for (int v = 0; v < NV; ++v) a[r][v] = fnma(x, row[v], a[r][v]);
      }
      p += s.step;
      b += ldb;
    }
  }

  // Substitution within the tile's own rows: row r of the unit lower triangular w is applied to the
  // rows before it, a[s] -= w[s] * a[r] for s < r.
  TRAJOPT_ALWAYS_INLINE void substitute_row(int r, const T* w) {
#pragma GCC unroll 8
    for (int s = 0; s < r; ++s) {
      const Vec<T> x = broadcast(w[s]);
#pragma GCC unroll 3
      for (int v = 0; v < NV; ++v) a[s][v] = fnma(x, a[r][v], a[s][v]);
    }
  }

  // The last row first.
  TRAJOPT_ALWAYS_INLINE void substitute_transposed(const T* w, long ldw) {
#pragma GCC unroll 8
    for (int r = MR - 1; r > 0; --r) substitute_row(r, w + r * ldw);
  }

  // The first row first: a[r] -= w[r][s] * a[s] for s < r.
  TRAJOPT_ALWAYS_INLINE void substitute(const T* w, long ldw) {
#pragma GCC unroll 8
    for (int s = 0; s + 1 < MR; ++s) {
#pragma GCC unroll 8
      for (int r = s + 1; r < MR; ++r) {
        const Vec<T> x = broadcast(w[r * ldw + s]);
#pragma GCC unroll 3
        for (int v = 0; v < NV; ++v) a[r][v] = fnma(x, a[s][v], a[r][v]);
      }
    }
  }
};

// Calls body.template operator()<N>() for the N in 1..Max equal to n.
template <int Max, class Body>
TRAJOPT_ALWAYS_INLINE void with_constant(int n, const Body& body) {
  if constexpr (Max > 1) {
    if (n < Max) return with_constant<Max - 1>(n, body);
  }
  body.template operator()<Max>();
}

// Height of the next panel when `rows` are left: what full tiles leave over comes first, so that
// all others begin at whole vectors.
constexpr int next_panel(int rows) {
  const int over = rows % kTileRows;
  return over > 0 ? over : kTileRows;
}

// Width in vectors of the next column tile when `left` vectors are left.
constexpr int next_vectors(int left) {
  if (left == kTileVectors + 1) return 2;
  return left < kTileVectors ? left : kTileVectors;
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
