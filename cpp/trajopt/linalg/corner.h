// The square on the diagonal of a panel of MR rows: its rows of D W and of W.
#pragma once

#include <cstring>
#include <limits>

#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/pivot.h"
#include "trajopt/linalg/tile.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

template <class T>
TRAJOPT_ALWAYS_INLINE bool good_pivot(T d, T inverse, T sign, T before) {
  constexpr T kMost = std::numeric_limits<T>::max();
  const auto magnitude = [](T x) { return x < 0 ? -x : x; };
  // Without branches: they would be half of the work on a corner.
  return static_cast<bool>((magnitude(d) <= kMost) & (magnitude(inverse) <= kMost) &
                           (d * sign > 0) & (magnitude(d) > kPivotZero<T> * magnitude(before)));
}

// tile.subtract for a square of which only the lower triangle counts: the first rows are half a
// vector, where there is such a thing.
template <class T, int MR>
TRAJOPT_ALWAYS_INLINE void subtract_square(int count, Scalars<T> s, const T* b, long ldb,
                                           Tile<T, MR, vectors<T>(MR)>& tile) {
  if constexpr (kHalfWidth<T> == 0 || vectors<T>(MR) > 1) {
    tile.template subtract<false>(count, s, b, ldb, 0);
  } else {
    constexpr int H = MR < kHalfWidth<T> ? MR : kHalfWidth<T>;
    decltype(first_half(tile.a[0][0])) half[H];
#pragma GCC unroll 8
    for (int r = 0; r < H; ++r) half[r] = first_half(tile.a[r][0]);
    const T* p = s.data;
    for (int k = 0; k < count; ++k) {
      const Vec<T> row = load(b);
#pragma GCC unroll 8
      for (int r = 0; r < H; ++r) half[r] = fnma(p[r * s.row], first_half(row), half[r]);
#pragma GCC unroll 8
      for (int r = H; r < MR; ++r) {
        tile.a[r][0] = fnma(broadcast(p[r * s.row]), row, tile.a[r][0]);
      }
      p += s.step;
      b += ldb;
    }
#pragma GCC unroll 8
    for (int r = 0; r < H; ++r) tile.a[r][0] = widen(half[r]);
  }
}

template <class T>
struct Corner {
  static constexpr int kVectors = vectors<T>(kTileRows);
  static constexpr int kStride = kVectors * kWidth<T>;
  alignas(64) T u[kTileRows * kStride];
  alignas(64) T w[kTileRows * kStride];
  T pivot[kTileRows], inverse[kTileRows];
  T sign[kTileRows];   // of the pivots
  T shift[kTileRows];  // what regularization adds to them

  // The signs and shifts of rows k0..k0+MR-1, all at once: row by row, conversions of single bytes
  // would cost a small block a fifth of its time.
  template <int MR>
  TRAJOPT_ALWAYS_INLINE void prepare(const BasicElimination<T>& e, int k0) {
    const T regularization = static_cast<T>(e.regularization);
    if (e.signs) {
      for (int r = 0; r < MR; ++r) sign[r] = static_cast<T>(static_cast<int>(e.signs[k0 + r]));
    } else {
      for (int r = 0; r < MR; ++r) sign[r] = T(1);
    }
    for (int r = 0; r < MR; ++r) shift[r] = sign[r] * regularization;
  }

  // From the rows as they are after all updates from below. The pivots depend on each other in one
  // chain of division, product and subtraction; each one is computed ahead of its row's vector.
  // Without regularization (Shifted = false) the sum is out of it.
  template <int MR, bool Shifted>
  TRAJOPT_ALWAYS_INLINE void factor(Tile<T, MR, vectors<T>(MR)>& tile) {
    constexpr int W = kWidth<T>, NV = vectors<T>(MR);
    T d = tile.a[MR - 1][(MR - 1) / W][(MR - 1) % W];
#pragma GCC unroll 8
    for (int r = MR - 1; r >= 0; --r) {
      if constexpr (Shifted) d += shift[r];
      const T over = T(1) / d;
      pivot[r] = d;
      inverse[r] = over;
      if (r > 0) {
        const int v = (r - 1) / W, l = (r - 1) % W;
        const T x = tile.a[r][v][l];
        d = fnma(x * over, x, tile.a[r - 1][v][l]);
      }
      Vec<T> row[NV];
      const Vec<T> scale = broadcast(over);
#pragma GCC unroll 4
      for (int v = 0; v < NV; ++v) {
        row[v] = mul(tile.a[r][v], scale);
        store(u + r * kStride + v * W, tile.a[r][v]);
        store(w + r * kStride + v * W, row[v]);
      }
#pragma GCC unroll 8
      for (int s = r - 1; s >= 0; --s) {
        const Vec<T> factor = broadcast_lane(row[s / W], s % W);
#pragma GCC unroll 4
        for (int v = 0; v <= s / W; ++v) {
          tile.a[s][v] = fnma(factor, tile.a[r][v], tile.a[s][v]);
        }
      }
    }
  }

  // The first bad pivot of panel rows k0..k0+rows-1 in the order of elimination; -1: none.
  int check(const BasicElimination<T>& e, int k0, int rows) const {
    bool good[kTileRows], all = true;
    for (int r = 0; r < rows; ++r) {
      const T before = static_cast<T>(e.original[(k0 + r) * e.original_step]) + shift[r];
      good[r] = good_pivot(pivot[r], inverse[r], sign[r], before);
      all &= good[r];
      e.inverse[k0 + r] = inverse[r];
    }
    int r = rows - 1;
    for (; !all && r >= 0 && good[r]; --r) {
    }
    return all ? -1 : r;
  }

  // A packed row has room for the corner's columns and no more.
  template <int MR>
  TRAJOPT_ALWAYS_INLINE void write(const BasicElimination<T>& e, int k0) const {
    constexpr int W = kWidth<T>, NV = vectors<T>(MR);
    constexpr int kColumns = NV * W < kTileRows ? NV * W : kTileRows;
    T* packed = e.w + PackedTriangle<T>::at(e.size, k0, k0);
#pragma GCC unroll 8
    for (int r = 0; r < MR; ++r) {
      std::memcpy(packed + r * kLine<T>, w + r * kStride, kColumns * sizeof(T));
#pragma GCC unroll 4
      for (int v = 0; v < NV; ++v) {
        store(e.u + (k0 + r) * e.ld + k0 + v * W, load(u + r * kStride + v * W));
      }
    }
  }
};

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
