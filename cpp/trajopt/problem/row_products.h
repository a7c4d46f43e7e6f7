// Products with a matrix that is read once, row after row. Memory comes at its full rate only to
// who asks for it in the order in which it lies there, so nothing is read by columns: a row's
// product is summed up in eight lanes, lane l the columns l, l + 8, l + 16 ..., which are added as
// ((l0+l4) + (l2+l6)) + ((l1+l5) + (l3+l7)). That makes the same bits of every vector width.
//
// Vectors are the columns of their matrices, one behind the other at a distance of `ld_x` or
// `ld_sum`, and followed by finite numbers up to a whole cache line.
#pragma once

#include "trajopt/base/isa.h"

namespace trajopt {

struct RowProductKernels {
  static constexpr int kLanes = 8;
  static constexpr int kMost = 2;  // vectors at a time

  // y -= V x, V (rows x columns) with leading dimension ld, for m <= kMost vectors x; y (rows, m)
  // row-major.
  void (*subtract_rows)(int rows, int columns, const double* v, long ld, const double* x, long ld_x,
                        double* y, int m);

  // The rows of a symmetric matrix from `kept` on, of which the columns up to the diagonal are
  // given: every entry serves its row and its column.
  //
  //   sum_c -= A_rc x_{kept + r}, c < kept + r;   sum_{kept + r} -= A_rc x_c, c <= kept + r
  //
  // for m <= kMost vectors x and sums of kept + rows elements. scratch: kLanes * rows * m.
  void (*subtract_lower)(int kept, int rows, const double* a, long ld, const double* x, long ld_x,
                         double* sum, long ld_sum, double* scratch, int m);
};

// Of an instruction set, or of the best one below it that is active.
const RowProductKernels& row_product_kernels(Isa isa);

}  // namespace trajopt
