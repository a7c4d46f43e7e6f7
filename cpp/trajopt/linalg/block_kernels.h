// The block operations a factorization is scheduled from, one table per instruction set and scalar.
//
// A block is eliminated from its last row to its first, using only lower triangles: A = Wt D W with
// W unit lower triangular and D diagonal. In that order every product reads rows of row-major
// blocks, so nothing is ever transposed. `docs/linear_algebra.md` has the derivation;
// tests/cpp/linalg/reference.h has the definition that every kernel equals bit for bit.
#pragma once

#include "trajopt/base/isa.h"
#include "trajopt/linalg/packed_triangle.h"

namespace trajopt::linalg {

// A coupling S (size x columns) of the block that is eliminated with one of its neighbours:
// U = W^-T S and V = D^-1 U. U == nullptr: there is no such neighbour.
template <class T>
struct BasicCoupling {
  int columns = 0;
  const T* source = nullptr;
  long source_ld = 0;
  T* v = nullptr;
  T* u = nullptr;
};

// Memory worked off from its end, by so many elements for each row of a block: whole cache lines.
// (A row's exact share would take two divisions, which small blocks notice.)
template <class T>
struct BasicPiece {
  T* data = nullptr;
  long left = 0;
  long per_row = 0;
};

// Memory traffic spread over the arithmetic of one elimination: row by row, the last one first,
// blocks of the matrix that will be needed next are fetched, and lines of their factors claimed for
// writing or finished factors written around the caches.
template <class T>
struct BasicTraffic {
  int size = 0;
  int fetch_rows = 0;                   // still to be fetched
  bool fetch_upwards = false;           // the first row first
  const double* fetch_lower = nullptr;  // a lower triangle, leading dimension `size`
  const double* fetch_whole = nullptr;  // a block; nullptr: none
  BasicPiece<T> claim;                  // where results will be written through the caches
  int write_rows = 0;                   // still to be written
  const T* w = nullptr;                 // packed
  BasicPiece<T> w_target;
  long ld = 0;         // of v
  const T* v[2] = {};  // of the couplings; nullptr: none
  T* target[2] = {};
  long target_ld = 0;
};

template <class T>
struct BasicElimination {
  int size = 0;
  long ld = 0;                  // of u and the couplings' u and v
  const T* diagonal = nullptr;  // the block; only its lower triangle counts; may be u itself
  long diagonal_ld = 0;
  const double* original = nullptr;    // diagonal element k before any update is at
  long original_step = 0;              // original[k * original_step]
  const signed char* signs = nullptr;  // nullptr: all positive
  double regularization = 0.0;
  T* w = nullptr;        // out: W, its strict lower triangle, packed (packed_triangle.h)
  T* u = nullptr;        // scratch: D W
  T* inverse = nullptr;  // out: the diagonal of D^-1
  BasicCoupling<T> left, right;
  // What another block's elimination left to be done: the block is `diagonal` - Vt U with these,
  // leading dimension `ld`. It is formed on the way and never stored. nullptr: nothing.
  const T* pending_v = nullptr;
  const T* pending_u = nullptr;
  BasicTraffic<T>* traffic = nullptr;  // to be got over with meanwhile; nullptr: none
};

struct Pivot {
  int row = -1;  // -1: all pivots are good
  double value = 0.0;
};

template <class T>
struct BasicBlockKernels {
  // Factors a block and solves for its couplings; reports the first pivot that is not finite,
  // zero to working accuracy, or of the wrong sign, and then leaves the rest undone.
  Pivot (*eliminate)(const BasicElimination<T>& e);

  // target = source - Vt U (V: k x rows, U: k x columns), k descending. Lower triangle only when
  // `lower`; source == nullptr is zero. Columns are written up to a whole vector.
  void (*update)(int rows, int columns, int k, const T* source, long source_ld, T* target,
                 long target_ld, const T* v, long v_ld, const T* u, long u_ld, bool lower);

  // target = source^t, square.
  void (*transpose)(int size, const T* source, long source_ld, T* target, long target_ld);

  // target = source, for a matrix of doubles, rounded. Lower triangle only when `lower`.
  void (*convert)(int size, const double* source, T* target, long target_ld, bool lower);

  // target = source around the caches: whole cache lines, both from the beginning of one on.
  void (*stream)(const T* source, T* target, long count);

  // Some rows more of what there is to fetch and to write.
  void (*move)(BasicTraffic<T>& traffic, int rows);

  // x = W^-T x and x = W^-1 x for the size x m matrix x with leading dimension ldx and W packed.
  // One or two columns ask for the memory `ahead` elements before or behind what they read.
  void (*substitute_transposed)(int size, const T* packed, T* x, int m, long ldx, long ahead);
  void (*substitute)(int size, const T* packed, T* x, int m, long ldx, long ahead);

  // Row k of the size x m matrix x times d[k].
  void (*scale)(int size, const T* d, T* x, int m);

  // y -= Vt x (k descending) and y -= V x (k ascending) for the rows x columns matrix V, whose rows
  // are padded to whole vectors or followed by more memory of the same buffer.
  void (*subtract_transposed)(int rows, int columns, const T* v, long ld, const T* x, T* y, int m,
                              long ldx, long ldy, long ahead);
  void (*subtract)(int rows, int columns, const T* v, long ld, const T* x, T* y, int m, long ldx,
                   long ldy, long ahead);

  // y -= A x with the lower triangle of the symmetric A (k ascending).
  void (*subtract_symmetric)(int size, const T* a, long ld, const T* x, T* y, int m, long ldx,
                             long ldy, long ahead);
};

using Coupling = BasicCoupling<double>;
using Elimination = BasicElimination<double>;
using BlockKernels = BasicBlockKernels<double>;

// The table of an instruction set, or of the best one below it that this machine has.
template <class T = double>
const BasicBlockKernels<T>& block_kernels(Isa isa);

// Leading dimension of blocks that are worked on: whole cache lines, room for a whole vector behind
// the first column of the last panel, and not a multiple of eight lines, so that the rows of a
// column tile spread over the cache's sets.
template <class T = double>
long padded(int size) {
  constexpr int line = 64 / static_cast<int>(sizeof(T));
  const long lines = (size + line - 8 + line - 1) / line;
  return line * (lines % 8 == 0 ? lines + 1 : lines);
}

}  // namespace trajopt::linalg
