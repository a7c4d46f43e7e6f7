// Compiled once per instruction set: the KKT matrix by nodes.
#include "trajopt/base/fetch.h"
#include "trajopt/linalg/simd.h"
#include "trajopt/problem/kkt_rows.h"
#include "trajopt/problem/node_rows.h"

namespace trajopt {
inline namespace TRAJOPT_ISA {
namespace {

using linalg::add;
using linalg::kWidth;
using linalg::load;
using linalg::store;
using linalg::Vec;

constexpr int W = kWidth<double>;

TRAJOPT_ALWAYS_INLINE void copy_row(const double* from, int n, double* to) {
  int k = 0;
  for (; k + W <= n; k += W) store(to + k, load(from + k));
  if (k < n) store(to + k, load(from + k, n - k), n - k);
}

TRAJOPT_ALWAYS_INLINE void add_row(const double* from, int n, double* to) {
  int k = 0;
  for (; k + W <= n; k += W) store(to + k, add(load(to + k), load(from + k)));
  if (k < n) store(to + k, add(load(to + k, n - k), load(from + k, n - k)), n - k);
}

// Row r of the blocks number `block` of `Count` windows behind each other, summed in their order.
template <int Count>
TRAJOPT_ALWAYS_INLINE void sum_rows(const double* window, int d, const int* block, int r,
                                    double* to) {
  const long dd = static_cast<long>(d) * d;
  const double* from[Count];
  for (int q = 0; q < Count; ++q) from[q] = window + (6 * q + block[q]) * dd + r * d;
  const auto sum = [&](const auto& part) {
    Vec<double> v = part(from[0]);
    for (int q = 1; q < Count; ++q) v = add(v, part(from[q]));
    return v;
  };
  int k = 0;
  for (; k + W <= d; k += W) store(to + k, sum([&](const double* p) { return load(p + k); }));
  if (k < d) store(to + k, sum([&](const double* p) { return load(p + k, d - k); }), d - k);
}

// The rows of node f from the windows of frames f .. f + Behind. Those of the next node are asked
// for meanwhile: a store waits for what it writes to.
template <int Behind>
void write_node(const NodeRows& s, long f, const double* window, const double* jacobian,
                double* rows) {
  const int d = s.primal, m = s.dual;
  const long md = static_cast<long>(m) * d;
  constexpr int kFar[] = {2}, kNear[] = {1, 4}, kSelf[] = {0, 3, 5};  // of kWindowBlocks
  for (int r = 0; r < m; ++r) {
    double* row = rows + s.at(f, r);
    fetch(row + s.length(), s.columns());
    copy_row(jacobian + 2 * md + r * d, d, row);
    copy_row(jacobian + md + r * d, d, row + d);
  }
  for (int r = 0; r < d; ++r) {
    double* row = rows + s.at(f, m + r);
    fetch(row + s.length(), s.columns());
    sum_rows<1>(window, d, kFar, r, row);
    sum_rows<Behind == 0 ? 1 : 2>(window, d, kNear, r, row + d);
    for (int k = 0; k < m; ++k) row[2 * d + k] = jacobian[k * d + r];
    sum_rows<Behind + 1>(window, d, kSelf, r, row + 2 * d + m);
  }
}

void add_windows(const NodeRows& s, long begin, long end, const double* windows,
                 const double* jacobians, double* rows, double* spill) {
  const long dd = static_cast<long>(s.primal) * s.primal, md = static_cast<long>(s.dual) * s.primal;
  for (long f = begin; f < end; ++f) {
    const double *window = windows + (f - begin) * 6 * dd,
                 *jacobian = jacobians + (f - begin) * 3 * md;
    const auto write = end - f > 2 ? write_node<2> : (end - f == 2 ? write_node<1> : write_node<0>);
    write(s, f, window, jacobian, rows);
  }
  copy_row(windows + 3 * dd, static_cast<int>(3 * dd), spill);
  if (end > begin + 1) copy_row(windows + 11 * dd, static_cast<int>(dd), spill + 3 * dd);
}

// In the order of the frames: a node's entries are the sums that they are within a chunk.
void add_spill(const NodeRows& s, long first, const double* spill, double* rows) {
  const int d = s.primal, m = s.dual;
  const long dd = static_cast<long>(d) * d;
  for (int r = 0; r < d; ++r) {
    double* row = rows + s.at(first - 1, m + r);
    add_row(spill + dd + r * d, d, row + d);
    add_row(spill + r * d, d, row + 2 * d + m);
    if (first + 1 < s.nodes) add_row(spill + 3 * dd + r * d, d, row + 2 * d + m);
    if (first > 1) add_row(spill + 2 * dd + r * d, d, rows + s.at(first - 2, m + r) + 2 * d + m);
  }
}

// On the diagonals of node i with nodes i, i-1, i-2.
void damping_weights(const NodeRows& s, long i, double* weights) {
  metric_weights(s.smoothing, static_cast<int>(i), s.nodes, false, weights);
  for (int back = 0; back < 3; ++back) weights[back] *= s.damping;
}

void write_pivots(const NodeRows& s, int i, double* p, long ld) {
  double w[3];
  damping_weights(s, i, w);
  for (int r = 0; r < s.width(); ++r) copy_row(s.row(i, r) + s.kept(), r + 1, p + r * ld);
  for (int r = s.dual; r < s.width(); ++r) p[r * (ld + 1)] += w[0];
}

void write_couplings_before(const NodeRows& s, int i, double* c, long ld) {
  double w[3];
  damping_weights(s, i, w);
  for (int r = 0; r < s.width(); ++r) copy_row(s.row(i, r), s.kept(), c + r * ld);
  for (int r = 0; r < s.primal; ++r) {
    double* row = c + (s.dual + r) * ld;
    row[r] += w[2];
    row[s.primal + r] += w[1];
  }
}

// target (columns x rows) = the transpose of source, of whose rows whole vectors are read.
void transpose_block(const double* source, long source_ld, int rows, int columns, double* target,
                     long target_ld) {
  for (int c = 0; c < columns; c += W) {
    const int height = columns - c < W ? columns - c : W;
    for (int r = 0; r < rows; r += W) {
      const int width = rows - r < W ? rows - r : W;
      Vec<double> t[W];
      for (int k = 0; k < W; ++k) t[k] = load(source + (r + (k < width ? k : 0)) * source_ld + c);
      linalg::transpose(t);
      for (int k = 0; k < W; ++k)
        if (k < height) store(target + (c + k) * target_ld + r, t[k], width);
    }
  }
}

void write_couplings_behind(const NodeRows& s, int i, double* c, long ld) {
  const int d = s.primal, m = s.dual, width = s.width();
  for (int r = 0; r < m; ++r)
    for (int k = 0; k < 2 * width; ++k) c[r * ld + k] = 0.0;
  for (int ahead = 2; ahead > 0; --ahead, c += width) {
    double w[3];
    damping_weights(s, i + ahead, w);
    transpose_block(s.row(i + ahead, 0) + (2 - ahead) * d, s.columns(), width, d, c + m * ld, ld);
    for (int r = 0; r < d; ++r) c[(m + r) * ld + m + r] += w[ahead];
  }
}

void add_schur(const double* before, long schur_ld, int half, int first, double* p, double* c,
               long ld) {
  for (int r = 0; r < half; ++r) {
    const double* change = before + (half + r) * schur_ld;
    add_row(change, half, c + (first + r) * ld + half);
    add_row(change + half, r + 1, p + (first + r) * ld + first);
  }
}

void start_schur(const double* before, long schur_ld, int half, double* next) {
  const Vec<double> zero = linalg::broadcast(0.0);
  for (int r = 0; r < half; ++r) {
    double *far = next + r * schur_ld, *near = next + (half + r) * schur_ld;
    for (int k = 0; k <= r; k += W) store(far + k, zero);
    for (int k = 0; k < half; k += W) store(near + k, zero);
    copy_row(before + r * schur_ld, r + 1, near + half);
  }
}

void subtract_damping(const NodeRows& s, long i, const double* x, double* r, int m) {
  const long node = static_cast<long>(s.width()) * m, part = static_cast<long>(s.primal) * m;
  const long tangent = i * node + static_cast<long>(s.dual) * m;
  double w[3][3] = {};
  for (int ahead = 0; ahead < 3; ++ahead)
    if (i + ahead < s.nodes) damping_weights(s, i + ahead, w[ahead]);
  for (int by = -2; by <= 2; ++by) {
    if (i + by < 0 || i + by >= s.nodes) continue;
    const double weight = by <= 0 ? w[0][-by] : w[by][by];
    const double* other = x + tangent + by * node;
    TRAJOPT_INDEPENDENT
    for (long k = 0; k < part; ++k) r[tangent + k] = fma(-weight, other[k], r[tangent + k]);
  }
}

}  // namespace

extern const NodeRowKernels kNodeRowKernels;
const NodeRowKernels kNodeRowKernels{
    add_windows, add_spill,   write_pivots,    write_couplings_before, write_couplings_behind,
    add_schur,   start_schur, subtract_damping};

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
