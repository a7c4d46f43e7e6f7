// c[index[i], index[j]] += sum_k a[k, i] b[k, j] over packs, in register tiles.
//
// Each element starts from what c holds and accumulates over the panels and their rows in order,
// with fma, whatever the tiling; so a sum may be built up by several calls, in their order.
#pragma once

#include "trajopt/base/pack.h"
#include "trajopt/base/unrolled.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct Panel {  // depth x n numbers each, row stride n
  const S *a, *b;
  int depth;
};

namespace products_detail {

// 18 accumulators keep both multiply-add units of an AVX-512 core busy and leave registers for the
// operands; 16 registers hold half of that.
template <class S>
inline constexpr int kTileColumns = lanes<S> == 8 ? 6 : 3;
inline constexpr int kTileRows = 3;

template <class S, int I, int J>
TRAJOPT_HD inline void tile(const Panel<S>* panels, int count, const int* index, int n, int i0,
                            int j0, bool fresh, S* c, int ld) {
  S sum[I * J];
  // Addresses as a pointer and a byte offset: one addressing mode for each of the I J elements.
  char* row[I];
  long column[J];
  unrolled<I>([&](auto i) TRAJOPT_INLINE_BODY {
    row[i] = reinterpret_cast<char*>(c + static_cast<long>(index[i0 + i]) * ld);
  });
  unrolled<J>([&](auto j) TRAJOPT_INLINE_BODY {
    column[j] = static_cast<long>(index[j0 + j]) * static_cast<long>(sizeof(S));
  });
  const auto element = [&](auto k) TRAJOPT_INLINE_BODY -> S& {
    return *reinterpret_cast<S*>(row[k / J] + column[k % J]);
  };
  if (fresh) {
    unrolled<I * J>([&](auto k) TRAJOPT_INLINE_BODY { sum[k] = S(0.0); });
  } else {
    unrolled<I * J>([&](auto k) TRAJOPT_INLINE_BODY { sum[k] = element(k); });
  }
  for (const Panel<S>* p = panels; p != panels + count; ++p) {
    const S *x = p->a + i0, *y = p->b + j0;
    for (int k = 0; k < p->depth; ++k, x += n, y += n) {
      unrolled<J>([&](auto j) TRAJOPT_INLINE_BODY {
        const S yj = in_register(y[j]);
        unrolled<I>([&](auto i) TRAJOPT_INLINE_BODY {
          constexpr int at = decltype(i)::value * J + decltype(j)::value;
          sum[at] = fma(x[i], yj, sum[at]);
        });
      });
    }
  }
  unrolled<I * J>([&](auto k) TRAJOPT_INLINE_BODY { element(k) = sum[k]; });
}

template <class S, int I>
TRAJOPT_HD inline void tile_row(const Panel<S>* panels, int count, const int* index, int n, int i0,
                                int last, bool fresh, S* c, int ld) {
  constexpr int T = kTileColumns<S>;
  int j = 0;
  for (; j + T <= last; j += T) tile<S, I, T>(panels, count, index, n, i0, j, fresh, c, ld);
  const int left = last - j;
  if constexpr (T > 3) {
    if (left == 5) tile<S, I, 5>(panels, count, index, n, i0, j, fresh, c, ld);
    if (left == 4) tile<S, I, 4>(panels, count, index, n, i0, j, fresh, c, ld);
    if (left == 3) tile<S, I, 3>(panels, count, index, n, i0, j, fresh, c, ld);
  }
  if (left == 2) tile<S, I, 2>(panels, count, index, n, i0, j, fresh, c, ld);
  if (left == 1) tile<S, I, 1>(panels, count, index, n, i0, j, fresh, c, ld);
}

}  // namespace products_detail

// index: n rows and columns of c, row stride ld. fresh: overwrites instead of adding. lower:
// elements right of the diagonal may be left out.
template <class S>
TRAJOPT_HD inline void add_products(const Panel<S>* panels, int count, const int* index, int n,
                                    bool fresh, bool lower, S* c, int ld) {
  using namespace products_detail;
  for (int i = 0; i < n; i += kTileRows) {
    const int rows = n - i < kTileRows ? n - i : kTileRows;
    const int last = lower ? i + rows : n;
    if (rows == 3) {
      tile_row<S, 3>(panels, count, index, n, i, last, fresh, c, ld);
    } else if (rows == 2) {
      tile_row<S, 2>(panels, count, index, n, i, last, fresh, c, ld);
    } else {
      tile_row<S, 1>(panels, count, index, n, i, last, fresh, c, ld);
    }
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
