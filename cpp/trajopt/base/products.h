// c[rows[i], columns[j]] += sum_k a[k, i] b[k, j] over packs, in register tiles.
//
// Each element starts from what c holds and accumulates over k ascending with fma, whatever the
// tiling; so a sum may be built up by several calls, in the order of the calls.
#pragma once

#include "trajopt/base/pack.h"
#include "trajopt/base/unrolled.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct Panel {  // k x n, row stride `stride`; element i stands at index[i] of the target
  const S* values;
  int stride;
  const int* index;
  int n;
};

namespace products_detail {

// 18 accumulators keep both multiply-add units of an AVX-512 core busy and leave registers for the
// operands; 16 registers hold half of that.
template <class S>
inline constexpr int kTileColumns = lanes<S> == 8 ? 6 : 3;
inline constexpr int kTileRows = 3;

template <class S, int I, int J>
TRAJOPT_HD inline void tile(int depth, const Panel<S>& a, int i0, const Panel<S>& b, int j0,
                            bool fresh, S* c, int ld) {
  S sum[I * J];
  // Addresses as a pointer and a byte offset: one addressing mode for each of the I J elements.
  char* row[I];
  long column[J];
  unrolled<I>([&](auto i) TRAJOPT_INLINE_BODY {
    row[i] = reinterpret_cast<char*>(c + static_cast<long>(a.index[i0 + i]) * ld);
  });
  unrolled<J>([&](auto j) TRAJOPT_INLINE_BODY {
    column[j] = static_cast<long>(b.index[j0 + j]) * static_cast<long>(sizeof(S));
  });
  const auto element = [&](auto k) TRAJOPT_INLINE_BODY -> S& {
    return *reinterpret_cast<S*>(row[k / J] + column[k % J]);
  };
  if (fresh) {
    unrolled<I * J>([&](auto k) TRAJOPT_INLINE_BODY { sum[k] = S(0.0); });
  } else {
    unrolled<I * J>([&](auto k) TRAJOPT_INLINE_BODY { sum[k] = element(k); });
  }
  const S *x = a.values + i0, *y = b.values + j0;
  const long next_x = a.stride, next_y = b.stride;
  for (int k = 0; k < depth; ++k, x += next_x, y += next_y) {
    unrolled<J>([&](auto j) TRAJOPT_INLINE_BODY {
      const S yj = y[j];
      unrolled<I>([&](auto i) TRAJOPT_INLINE_BODY {
        constexpr int at = i * J + j;
        sum[at] = fma(x[i], yj, sum[at]);
      });
    });
  }
  unrolled<I * J>([&](auto k) TRAJOPT_INLINE_BODY { element(k) = sum[k]; });
}

template <class S, int I>
TRAJOPT_HD inline void tile_row(int depth, const Panel<S>& a, int i0, const Panel<S>& b, int last,
                                bool fresh, S* c, int ld) {
  constexpr int T = kTileColumns<S>;
  int j = 0;
  for (; j + T <= last; j += T) tile<S, I, T>(depth, a, i0, b, j, fresh, c, ld);
  if constexpr (T > 3) {
    switch (last - j) {
      case 5:
        return tile<S, I, 5>(depth, a, i0, b, j, fresh, c, ld);
      case 4:
        return tile<S, I, 4>(depth, a, i0, b, j, fresh, c, ld);
      case 3:
        return tile<S, I, 3>(depth, a, i0, b, j, fresh, c, ld);
      default:
        break;
    }
  }
  if (last - j == 2) return tile<S, I, 2>(depth, a, i0, b, j, fresh, c, ld);
  if (last - j == 1) return tile<S, I, 1>(depth, a, i0, b, j, fresh, c, ld);
}

}  // namespace products_detail

// fresh: overwrites instead of adding. lower: a and b index the same list; elements right of the
// diagonal may be left out.
template <class S>
TRAJOPT_HD inline void add_products(int depth, const Panel<S>& a, const Panel<S>& b, bool fresh,
                                    bool lower, S* c, int ld) {
  using namespace products_detail;
  for (int i = 0; i < a.n; i += kTileRows) {
    const int rows = a.n - i < kTileRows ? a.n - i : kTileRows;
    const int last = lower ? i + rows : b.n;
    if (rows == 3) {
      tile_row<S, 3>(depth, a, i, b, last, fresh, c, ld);
    } else if (rows == 2) {
      tile_row<S, 2>(depth, a, i, b, last, fresh, c, ld);
    } else {
      tile_row<S, 1>(depth, a, i, b, last, fresh, c, ld);
    }
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
