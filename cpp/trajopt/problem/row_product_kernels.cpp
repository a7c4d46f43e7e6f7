// Compiled once per instruction set: products with a matrix that is read row after row.
#include "trajopt/linalg/tile.h"
#include "trajopt/problem/row_products.h"

namespace trajopt {
inline namespace TRAJOPT_ISA {
namespace {

using linalg::add;
using linalg::broadcast;
using linalg::fnma;
using linalg::fnma_first;
using linalg::kWidth;
using linalg::load;
using linalg::store;
using linalg::Vec;
using linalg::with_constant;

constexpr int W = kWidth<double>;
constexpr int kLanes = RowProductKernels::kLanes;
constexpr int kParts = kLanes / W;  // vectors that hold a row's lanes

// Doubles between what subtract_lower() reads and what it asks for: its triangles leave gaps at
// which a processor's own prefetcher stops.
constexpr long kAhead = 2048;

// Vectors of columns whose sums stay in registers.
constexpr int kBlock = W == 8 ? 8 : 4;

// The lanes of a row's product, and their sum in W lanes.
struct Lanes {
  Vec<double> part[kParts];

  TRAJOPT_ALWAYS_INLINE void clear() {
    for (auto& p : part) p = broadcast(0.0);
  }
  TRAJOPT_ALWAYS_INLINE Vec<double> folded() const {
    Vec<double> p[kParts];
    for (int i = 0; i < kParts; ++i) p[i] = part[i];
    for (int half = kParts / 2; half > 0; half /= 2)
      for (int i = 0; i < half; ++i) p[i] = add(p[i], p[i + half]);
    return p[0];
  }
};

// The sums of W rows' lanes, one in each lane.
TRAJOPT_ALWAYS_INLINE Vec<double> sums(Vec<double> (&rows)[W]) {
  linalg::transpose(rows);
#pragma GCC unroll 3
  for (int half = W / 2; half > 0; half /= 2) {
#pragma GCC unroll 4
    for (int i = 0; i < half; ++i) rows[i] = add(rows[i], rows[i + half]);
  }
  return rows[0];
}

// Adds `sum`, by rows, to `height` <= W rows of y (rows, M).
template <int M>
TRAJOPT_ALWAYS_INLINE void add_to(Vec<double> (&sum)[M], int height, double* y) {
  if constexpr (M == 2) linalg::interleave(sum[0], sum[1]);
#pragma GCC unroll 2
  for (int j = 0; j < M; ++j) {
    const int count = M * height - j * W;
    if (count >= W) {
      store(y + j * W, add(load(y + j * W), sum[j]));
    } else if (count > 0) {
      store(y + j * W, add(load(y + j * W, count), sum[j]), count);
    }
  }
}

// Minus a row times M vectors. Groups of kLanes columns: Groups of them, or as many as there are.
template <int M, int Groups>
TRAJOPT_ALWAYS_INLINE void row_times(const double* row, int columns, const double* x, long ld_x,
                                     Lanes (&lanes)[M]) {
  const int groups = Groups > 0 ? Groups : (columns + kLanes - 1) / kLanes;
#pragma GCC unroll 8
  for (int g = 0; g < groups; ++g) {
#pragma GCC unroll 4
    for (int p = 0; p < kParts; ++p) {
      const int c = g * kLanes + p * W;
      if (g + 1 == groups && c >= columns) break;
      const Vec<double> a =
          g + 1 < groups || columns - c >= W ? load(row + c) : load(row + c, columns - c);
#pragma GCC unroll 2
      for (int j = 0; j < M; ++j)
        lanes[j].part[p] = fnma(load(x + j * ld_x + c), a, lanes[j].part[p]);
    }
  }
}

template <int M, int Groups>
void subtract_rows(int rows, int columns, const double* v, long ld, const double* x, long ld_x,
                   double* y) {
  for (int r0 = 0; r0 < rows; r0 += W) {
    const int height = rows - r0 < W ? rows - r0 : W;
    Vec<double> sum[M][W];
#pragma GCC unroll 8
    for (int k = 0; k < W; ++k) {
      Lanes lanes[M];
      for (Lanes& l : lanes) l.clear();
      if (k < height) row_times<M, Groups>(v + (r0 + k) * ld, columns, x, ld_x, lanes);
#pragma GCC unroll 2
      for (int j = 0; j < M; ++j) sum[j][k] = lanes[j].folded();
    }
    Vec<double> all[M];
#pragma GCC unroll 2
    for (int j = 0; j < M; ++j) all[j] = sums(sum[j]);
    add_to(all, height, y + static_cast<long>(r0) * M);
  }
}

template <int M>
void subtract_rows(int rows, int columns, const double* v, long ld, const double* x, long ld_x,
                   double* y) {
  const int groups = (columns + kLanes - 1) / kLanes;
  if (groups > 8) return subtract_rows<M, 0>(rows, columns, v, ld, x, ld_x, y);
  with_constant<8>(
      groups, [&]<int Groups>() { subtract_rows<M, Groups>(rows, columns, v, ld, x, ld_x, y); });
}

void subtract_rows_any(int rows, int columns, const double* v, long ld, const double* x, long ld_x,
                       double* y, int m) {
  m == 1 ? subtract_rows<1>(rows, columns, v, ld, x, ld_x, y)
         : subtract_rows<2>(rows, columns, v, ld, x, ld_x, y);
}

// What subtract_lower() works on.
struct Lower {
  int kept;
  const double* a;
  long ld;
  const double* x;
  long ld_x;
  double* sum;
  long ld_sum;
  double* lanes;  // rows x M x kLanes
};

// Rows [begin, end) times columns [c0, c0 + NV W): all of them exist, or in the last vector, with
// Diagonal, those up to the diagonal, which all the rows have there.
template <int M, int NV, bool Diagonal>
TRAJOPT_ALWAYS_INLINE void subtract_block(const Lower& s, int begin, int end, int c0) {
  Vec<double> sum[M][NV];
#pragma GCC unroll 2
  for (int j = 0; j < M; ++j)
#pragma GCC unroll 8
    for (int v = 0; v < NV; ++v) sum[j][v] = load(s.sum + j * s.ld_sum + c0 + v * W);
  for (int r = begin; r < end; ++r) {
    const double* row = s.a + r * s.ld + c0;
    if (Diagonal)
      for (long k = 0; k < s.ld; k += kLanes) linalg::prefetch_second(row - c0 + k + kAhead);
    const int count = s.kept + r + 1 - c0 - (NV - 1) * W;  // of the last vector
    Lanes lanes[M];
    Vec<double> factor[M];
#pragma GCC unroll 2
    for (int j = 0; j < M; ++j) {
      factor[j] = broadcast(s.x[j * s.ld_x + s.kept + r]);
      double* from = s.lanes + (static_cast<long>(r) * M + j) * kLanes;
      for (int p = 0; p < kParts; ++p)
        lanes[j].part[p] = c0 == 0 ? broadcast(0.0) : load(from + p * W);
    }
#pragma GCC unroll 8
    for (int v = 0; v < NV; ++v) {
      const bool last = Diagonal && v == NV - 1;
      const Vec<double> a = last && count < W ? load(row + v * W, count) : load(row + v * W);
#pragma GCC unroll 2
      for (int j = 0; j < M; ++j) {
        Vec<double>& part = lanes[j].part[v % kParts];
        part = fnma(load(s.x + j * s.ld_x + c0 + v * W), a, part);
        sum[j][v] =
            last ? fnma_first(count - 1, factor[j], a, sum[j][v]) : fnma(factor[j], a, sum[j][v]);
      }
    }
#pragma GCC unroll 2
    for (int j = 0; j < M; ++j) {
      double* to = s.lanes + (static_cast<long>(r) * M + j) * kLanes;
      for (int p = 0; p < kParts; ++p) store(to + p * W, lanes[j].part[p]);
    }
  }
#pragma GCC unroll 2
  for (int j = 0; j < M; ++j)
#pragma GCC unroll 8
    for (int v = 0; v < NV; ++v) store(s.sum + j * s.ld_sum + c0 + v * W, sum[j][v]);
}

template <int M>
void subtract_lower(const Lower& s, int rows) {
  for (int begin = 0, end = 0; begin < rows; begin = end) {
    const int last = (s.kept + begin) / W;  // the vector of these rows' diagonal entries
    end = (last + 1) * W - s.kept < rows ? (last + 1) * W - s.kept : rows;
    int v = 0;
    for (; v + kBlock <= last; v += kBlock) subtract_block<M, kBlock, false>(s, begin, end, v * W);
    with_constant<kBlock>(last + 1 - v,
                          [&]<int NV>() { subtract_block<M, NV, true>(s, begin, end, v * W); });
  }
  for (int j = 0; j < M; ++j) {
    double* sum = s.sum + j * s.ld_sum + s.kept;
    for (int r0 = 0; r0 < rows; r0 += W) {
      const int height = rows - r0 < W ? rows - r0 : W;
      Vec<double> row[W];
#pragma GCC unroll 8
      for (int k = 0; k < W; ++k) {
        const double* from = s.lanes + (static_cast<long>(r0 + k) * M + j) * kLanes;
        Lanes lanes;
        for (int p = 0; p < kParts; ++p)
          lanes.part[p] = k < height ? load(from + p * W) : broadcast(0.0);
        row[k] = lanes.folded();
      }
      Vec<double> all[1] = {sums(row)};
      add_to(all, height, sum + r0);
    }
  }
}

void subtract_lower_any(int kept, int rows, const double* a, long ld, const double* x, long ld_x,
                        double* sum, long ld_sum, double* scratch, int m) {
  const Lower s{kept, a, ld, x, ld_x, sum, ld_sum, scratch};
  m == 1 ? subtract_lower<1>(s, rows) : subtract_lower<2>(s, rows);
}

}  // namespace

extern const RowProductKernels kRowProductKernels;
const RowProductKernels kRowProductKernels{subtract_rows_any, subtract_lower_any};

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
