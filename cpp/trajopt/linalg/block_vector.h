// Block times vectors: triangular substitution and products with size x m right-hand sides.
//
// With several columns the columns are the vector lanes. A single column is vectorized over the
// rows of the result instead, transposing in registers where the matrix is read along its rows;
// each element still sees the same chain of operations, so a column's bits do not depend on how
// many others are solved with it.
#pragma once

#include "trajopt/linalg/tile.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

// One column -----------------------------------------------------------------------------------

// y[0..columns) -= Vt x for `rows` rows of V, the last one first.
inline void subtract_transposed_one(int rows, int columns, const double* v, long ld,
                                    const double* x, double* y) {
  constexpr int kMost = 8;
  for (int c = 0; c < columns;) {
    const int nv = vectors(columns - c) < kMost ? vectors(columns - c) : kMost;
    const int tail = columns - c < nv * kWidth ? columns - c - (nv - 1) * kWidth : kWidth;
    with_constant<kMost>(nv, [&]<int NV>() {
      Vector a[NV];
#pragma GCC unroll 8
      for (int i = 0; i < NV; ++i) {
        a[i] = i == NV - 1 ? load(y + c + i * kWidth, tail) : load(y + c + i * kWidth);
      }
      for (int k = rows - 1; k >= 0; --k) {
        const Vector s = broadcast(x[k]);
#pragma GCC unroll 8
        for (int i = 0; i < NV; ++i) a[i] = fnma(s, load(v + k * ld + c + i * kWidth), a[i]);
      }
#pragma GCC unroll 8
      for (int i = 0; i < NV; ++i) {
        if (i == NV - 1) {
          store(y + c + i * kWidth, a[i], tail);
        } else {
          store(y + c + i * kWidth, a[i]);
        }
      }
    });
    c += nv * kWidth;
  }
}

// y[0..rows) -= V x for `columns` columns of V, the first one first.
inline void subtract_one(int rows, int columns, const double* v, long ld, const double* x,
                         double* y) {
  for (int r0 = 0; r0 < rows; r0 += kWidth) {
    const int height = rows - r0 < kWidth ? rows - r0 : kWidth;
    const double* row[kWidth];
    for (int r = 0; r < kWidth; ++r) row[r] = v + (r0 + (r < height ? r : height - 1)) * ld;
    Vector a = load(y + r0, height);
    int c = 0;
    for (; c + kWidth <= columns; c += kWidth) {
      Vector t[kWidth];
#pragma GCC unroll 8
      for (int r = 0; r < kWidth; ++r) t[r] = load(row[r] + c);
      transpose(t);
#pragma GCC unroll 8
      for (int j = 0; j < kWidth; ++j) a = fnma(broadcast(x[c + j]), t[j], a);
    }
    store(y + r0, a, height);
    for (; c < columns; ++c) {
      for (int r = 0; r < height; ++r) y[r0 + r] = fnma(x[c], row[r][c], y[r0 + r]);
    }
  }
}

inline void substitute_transposed_one(int size, const double* w, long ld, double* x) {
  for (int k0 = (size - 1) / kWidth * kWidth; k0 >= 0; k0 -= kWidth) {
    const int height = size - k0 < kWidth ? size - k0 : kWidth;
    const double* panel = w + k0 * ld;
    for (int r = height - 1; r > 0; --r) {
      for (int s = 0; s < r; ++s) x[k0 + s] = fnma(panel[r * ld + k0 + s], x[k0 + r], x[k0 + s]);
    }
    subtract_transposed_one(height, k0, panel, ld, x + k0, x);
  }
}

inline void substitute_one(int size, const double* w, long ld, double* x) {
  for (int k0 = 0; k0 < size; k0 += kWidth) {
    const int height = size - k0 < kWidth ? size - k0 : kWidth;
    const double* panel = w + k0 * ld;
    subtract_one(height, k0, panel, ld, x, x + k0);
    for (int s = 0; s + 1 < height; ++s) {
      for (int r = s + 1; r < height; ++r) {
        x[k0 + r] = fnma(panel[r * ld + k0 + s], x[k0 + s], x[k0 + r]);
      }
    }
  }
}

inline void subtract_symmetric_one(int size, const double* a, long ld, const double* x, double* y) {
  for (int k0 = 0; k0 < size; k0 += kWidth) {
    const int height = size - k0 < kWidth ? size - k0 : kWidth;
    const double* panel = a + k0 * ld;
    subtract_one(height, k0, panel, ld, x, y + k0);
    for (int j = 0; j < height; ++j) {
      for (int r = 0; r < height; ++r) {
        const double s = j >= r ? panel[j * ld + k0 + r] : panel[r * ld + k0 + j];
        y[k0 + r] = fnma(s, x[k0 + j], y[k0 + r]);
      }
    }
    // The rows below, whose first columns are this panel's, come in ascending order.
    Vector acc = load(y + k0, height);
    for (int j = k0 + height; j < size; ++j) {
      acc = fnma(broadcast(x[j]), load(a + j * ld + k0), acc);
    }
    store(y + k0, acc, height);
  }
}

// Several columns ------------------------------------------------------------------------------

// Applies body<MR, NV>(first row, first column, columns of the last vector) to tiles of a
// size x m matrix, panels of rows in descending or ascending order.
template <bool Descending, class Body>
inline void for_tiles(int size, int m, const Body& body) {
  for (int c = 0; c < m; c += kTileColumns) {
    const int columns = m - c < kTileColumns ? m - c : kTileColumns;
    const int tail = columns - (vectors(columns) - 1) * kWidth;
    with_constant<kTileVectors>(vectors(columns), [&]<int NV>() {
      for (int done = 0; done < size;) {
        const int height = next_panel(size - done);
        with_constant<kTileRows>(height, [&]<int MR>() {
          body.template operator()<MR, NV>(Descending ? size - done - MR : done, c, tail);
        });
        done += height;
      }
    });
  }
}

inline void substitute_transposed(int size, const double* w, long ld, double* x, int m, long ldx) {
  if (m == 1 && ldx == 1) return substitute_transposed_one(size, w, ld, x);
  for_tiles<true>(size, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    Tile<MR, NV> tile;
    tile.template read<true>(x + k0 * ldx + c, ldx, tail);
    tile.template subtract<true>(size - k0 - MR, {w + (size - 1) * ld + k0, -ld, 1},
                                 x + (size - 1) * ldx + c, -ldx, tail);
    tile.substitute_transposed(w + k0 * ld + k0, ld);
    tile.template write<true>(x + k0 * ldx + c, ldx, tail);
  });
}

inline void substitute(int size, const double* w, long ld, double* x, int m, long ldx) {
  if (m == 1 && ldx == 1) return substitute_one(size, w, ld, x);
  for_tiles<false>(size, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    Tile<MR, NV> tile;
    tile.template read<true>(x + k0 * ldx + c, ldx, tail);
    tile.template subtract<true>(k0, {w + k0 * ld, 1, ld}, x + c, ldx, tail);
    tile.substitute(w + k0 * ld + k0, ld);
    tile.template write<true>(x + k0 * ldx + c, ldx, tail);
  });
}

inline void subtract_transposed(int rows, int columns, const double* v, long ld, const double* x,
                                double* y, int m, long ldx, long ldy) {
  if (m == 1 && ldx == 1 && ldy == 1) return subtract_transposed_one(rows, columns, v, ld, x, y);
  for_tiles<false>(columns, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    Tile<MR, NV> tile;
    tile.template read<true>(y + k0 * ldy + c, ldy, tail);
    tile.template subtract<true>(rows, {v + (rows - 1) * ld + k0, -ld, 1}, x + (rows - 1) * ldx + c,
                                 -ldx, tail);
    tile.template write<true>(y + k0 * ldy + c, ldy, tail);
  });
}

inline void subtract(int rows, int columns, const double* v, long ld, const double* x, double* y,
                     int m, long ldx, long ldy) {
  if (m == 1 && ldx == 1 && ldy == 1) return subtract_one(rows, columns, v, ld, x, y);
  for_tiles<false>(rows, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    Tile<MR, NV> tile;
    tile.template read<true>(y + k0 * ldy + c, ldy, tail);
    tile.template subtract<true>(columns, {v + k0 * ld, 1, ld}, x + c, ldx, tail);
    tile.template write<true>(y + k0 * ldy + c, ldy, tail);
  });
}

inline void subtract_symmetric(int size, const double* a, long ld, const double* x, double* y,
                               int m, long ldx, long ldy) {
  if (m == 1 && ldx == 1 && ldy == 1) return subtract_symmetric_one(size, a, ld, x, y);
  for_tiles<false>(size, m, [&]<int MR, int NV>(int k0, int c, int tail) {
    double panel[MR * MR];  // the block on the diagonal, both triangles
    for (int j = 0; j < MR; ++j) {
      for (int r = 0; r < MR; ++r) {
        panel[j * MR + r] = j >= r ? a[(k0 + j) * ld + k0 + r] : a[(k0 + r) * ld + k0 + j];
      }
    }
    Tile<MR, NV> tile;
    tile.template read<true>(y + k0 * ldy + c, ldy, tail);
    tile.template subtract<true>(k0, {a + k0 * ld, 1, ld}, x + c, ldx, tail);
    tile.template subtract<true>(MR, {panel, MR, 1}, x + k0 * ldx + c, ldx, tail);
    tile.template subtract<true>(size - k0 - MR, {a + (k0 + MR) * ld + k0, ld, 1},
                                 x + (k0 + MR) * ldx + c, ldx, tail);
    tile.template write<true>(y + k0 * ldy + c, ldy, tail);
  });
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
