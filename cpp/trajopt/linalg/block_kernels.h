// The block operations a factorization is scheduled from, one table per instruction set.
//
// A block is eliminated from its last row to its first, using only lower triangles: A = Wt D W with
// W unit lower triangular and D diagonal. In that order every product reads rows of row-major
// blocks, so nothing is ever transposed or packed. `docs/linear_algebra.md` has the derivation;
// tests/cpp/linalg/reference.h has the definition that every kernel equals bit for bit.
#pragma once

#include "trajopt/base/isa.h"

namespace trajopt::linalg {

// A coupling S (size x size) of the block that is eliminated with one of its neighbours:
// U = W^-T S and V = D^-1 U. U == nullptr: there is no such neighbour.
struct Coupling {
  const double* source = nullptr;
  long source_ld = 0;
  double* v = nullptr;
  double* u = nullptr;
};

struct Elimination {
  int size = 0;
  long ld = 0;                       // of w, u and the couplings' u and v
  const double* diagonal = nullptr;  // the block; only its lower triangle counts; may be w itself
  long diagonal_ld = 0;
  const double* original = nullptr;    // the block before any update, leading dimension `size`
  const signed char* signs = nullptr;  // nullptr: all positive
  double regularization = 0.0;
  double* w = nullptr;        // out: W, its strict lower triangle
  double* u = nullptr;        // scratch: D W
  double* inverse = nullptr;  // out: the diagonal of D^-1
  Coupling left, right;
};

struct Pivot {
  int row = -1;  // -1: all pivots are good
  double value = 0.0;
};

struct BlockKernels {
  // Factors a block and solves for its couplings; stops at the first pivot that is not finite,
  // zero to working accuracy, or of the wrong sign.
  Pivot (*eliminate)(const Elimination& e);

  // target = source - Vt U (V: k x rows, U: k x columns), k descending. Lower triangle only when
  // `lower`; source == nullptr is zero. Columns are written up to a whole vector.
  void (*update)(int rows, int columns, int k, const double* source, long source_ld, double* target,
                 long target_ld, const double* v, const double* u, long ld, bool lower);

  // target = source^t, square.
  void (*transpose)(int size, const double* source, long source_ld, double* target, long target_ld);

  // x = W^-T x and x = W^-1 x for the size x m matrix x with leading dimension ldx.
  void (*substitute_transposed)(int size, const double* w, long ld, double* x, int m, long ldx);
  void (*substitute)(int size, const double* w, long ld, double* x, int m, long ldx);

  // y -= Vt x (k descending) and y -= V x (k ascending) for the rows x columns matrix V, whose rows
  // are padded to whole vectors or followed by more memory of the same buffer.
  void (*subtract_transposed)(int rows, int columns, const double* v, long ld, const double* x,
                              double* y, int m, long ldx, long ldy);
  void (*subtract)(int rows, int columns, const double* v, long ld, const double* x, double* y,
                   int m, long ldx, long ldy);

  // y -= A x with the lower triangle of the symmetric A (k ascending).
  void (*subtract_symmetric)(int size, const double* a, long ld, const double* x, double* y, int m,
                             long ldx, long ldy);
};

// The table of an instruction set, or of the best one below it that this machine has.
const BlockKernels& block_kernels(Isa isa);

// Leading dimension of internal blocks: whole cache lines, and not a multiple of eight of them, so
// that the rows of a column tile spread over the cache's sets.
inline long padded(int size) {
  const long lines = (size + 7) / 8;
  return 8 * (lines % 8 == 0 ? lines + 1 : lines);
}

}  // namespace trajopt::linalg
