// target = source - Vt U - V't U' by a group of threads, one tile of the target at a time, with the
// bits of the SIMD kernel: per element one chain over the rows of V and U, the last first, in the
// scalar type T of the factors.
//
// The tile's operands pass through shared memory kRows rows at a time; a rank keeps a square of
// kSquare x kSquare elements in registers. Floor for a whole block: 2 B^3 flops for each term,
// (2 terms + 2) B^2 numbers; half the flops for a lower triangle.
#pragma once

#include "trajopt/base/group.h"
#include "trajopt/linalg/group_eliminate.h"

namespace trajopt::linalg::inline TRAJOPT_ISA::group {

inline constexpr int kSquare = 4;
inline constexpr int kRows = 16;     // of V and U in shared memory
inline constexpr int kMaxEdge = 64;  // of a tile

// A block is cut into tiles x tiles squares of equal edge, a multiple of kSquare.
TRAJOPT_HD constexpr int update_tiles(int size) { return (size + kMaxEdge - 1) / kMaxEdge; }
TRAJOPT_HD constexpr int update_edge(int size) {
  const int tiles = update_tiles(size);
  return ((size + tiles - 1) / tiles + kSquare - 1) / kSquare * kSquare;
}
// Ranks that find work.
TRAJOPT_HD constexpr int update_ranks(int size) {
  const int across = update_edge(size) / kSquare;
  return across * across;
}
template <class T>
struct alignas(16) Four {
  T v[kSquare];
};
template <class T = double>
constexpr std::size_t update_bytes(int size) {
  return sizeof(T) * 2 * kRows * update_edge(size);
}

template <class T>
struct Product {
  const T* v;
  const T* u;
};

template <class T>
struct BasicUpdate {
  int size = 0;           // of the target
  long depth = 0;         // rows of the factors
  long ld = 0;            // of the factors
  BlockSource<T> source;  // none: zero; may be the target
  long source_ld = 0;
  T* target = nullptr;
  long target_ld = 0;
  bool lower = false;  // only the lower triangle
  int terms = 0;
  Product<T> term[2];
};

using Update = BasicUpdate<double>;

// The square of a tile that a rank computes.
template <class T>
struct Square {
  int row, column;  // in squares
  bool mine;        // false: there is none for this rank
  T a[kSquare][kSquare];
};

template <class T>
TRAJOPT_HD inline void choose_square(int index, int across, bool triangle, Square<T>& s) {
  if (triangle) {
    // Row i of the triangle starts at index i (i + 1) / 2.
    s.row = 0;
    while (s.row < across && (s.row + 1) * (s.row + 2) / 2 <= index) ++s.row;
    s.mine = s.row < across;
    s.column = index - s.row * (s.row + 1) / 2;
  } else {
    s.mine = index < across * across;
    s.row = index / across;
    s.column = index % across;
  }
}

// Tile (tile_row, tile_column) of the target. `space`: update_bytes of memory the ranks share.
template <class Group, class T>
TRAJOPT_HD inline void update_tile(const Group& group, const BasicUpdate<T>& p, int tile_row,
                                   int tile_column, void* space) {
  const int across = update_edge(p.size) / kSquare;
  const int i0 = tile_row * across * kSquare, j0 = tile_column * across * kSquare;
  const bool triangle = p.lower && tile_row == tile_column;
  Four<T>* v = static_cast<Four<T>*>(space);
  Four<T>* u = v + kRows * across;
  typename Group::template Local<Square<T>> mine(group);
  const auto wanted = [&](int i, int j) {
    return i < p.size && j < p.size && (!triangle || j <= i);
  };
  // A group with fewer ranks than squares goes over the tile several times.
  const int squares = triangle ? across * (across + 1) / 2 : across * across;
  for (int pass = 0; pass < squares; pass += group.size()) {
    group.phase([&](int rank) {
      Square<T>& s = mine[rank];
      choose_square(pass + rank, across, triangle, s);
      TRAJOPT_UNROLL
      for (int r = 0; r < kSquare; ++r) {
        TRAJOPT_UNROLL
        for (int c = 0; c < kSquare; ++c) {
          const int i = i0 + kSquare * s.row + r, j = j0 + kSquare * s.column + c;
          const bool read = p.source && s.mine && wanted(i, j);
          s.a[r][c] = read ? p.source[i * p.source_ld + j] : T(0);
        }
      }
    });
    TRAJOPT_UNROLL
    for (int t = 0; t < 2; ++t) {
      if (t == p.terms) break;
      const Product<T> term = p.term[t];
      for (long last = p.depth; last > 0; last -= kRows) {
        const int rows = last < kRows ? static_cast<int>(last) : kRows;
        const long first = last - rows;
        for_each(group, rows * across * kSquare, [&](int at) {
          const int k = at / (across * kSquare), c = at % (across * kSquare);
          const long row = (first + k) * p.ld;
          v[at / kSquare].v[at % kSquare] = i0 + c < p.size ? term.v[row + i0 + c] : T(0);
          u[at / kSquare].v[at % kSquare] = j0 + c < p.size ? term.u[row + j0 + c] : T(0);
        });
        group.phase([&](int rank) {
          Square<T>& s = mine[rank];
          if (!s.mine) return;
          for (int k = rows - 1; k >= 0; --k) {
            const Four<T> x = v[k * across + s.row], y = u[k * across + s.column];
            TRAJOPT_UNROLL
            for (int r = 0; r < kSquare; ++r) {
              TRAJOPT_UNROLL
              for (int c = 0; c < kSquare; ++c)
                s.a[r][c] = minus_product(s.a[r][c], x.v[r], y.v[c]);
            }
          }
        });
      }
    }
    group.phase([&](int rank) {
      const Square<T>& s = mine[rank];
      if (!s.mine) return;
      TRAJOPT_UNROLL
      for (int r = 0; r < kSquare; ++r) {
        TRAJOPT_UNROLL
        for (int c = 0; c < kSquare; ++c) {
          const int i = i0 + kSquare * s.row + r, j = j0 + kSquare * s.column + c;
          if (wanted(i, j)) p.target[i * p.target_ld + j] = s.a[r][c];
        }
      }
    });
  }
}

}  // namespace trajopt::linalg::inline TRAJOPT_ISA::group
