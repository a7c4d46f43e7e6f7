#include "trajopt/problem/front_sweep.h"

#include <algorithm>
#include <atomic>

#include "trajopt/base/fetch.h"

namespace trajopt {

namespace {

constexpr long kLine = linalg::PackedTriangle<double>::kColumns;

// No cache keeps more than this from one sweep to the next.
constexpr std::size_t kStreamedBytes = std::size_t{16} << 20;

// How many fronts ahead memory is asked for, and in how many parts: all lines of a front at once
// would stop the arithmetic until they are under way.
constexpr int kAhead = 2, kParts = 5;

// Doubles between what the first half of a solution reads and what it asks for. It needs little of
// that and the second half nothing: records are read line by line, downwards and then upwards, and
// a processor's own prefetcher follows. What jumps to and fro in a record gets half the rate.
constexpr long kForwardAhead = 344;

long lines(long count) { return (count + kLine - 1) / kLine * kLine; }

}  // namespace

FrontSweep::FrontSweep(int nodes, int count, int primal, int dual, Direction direction, Isa isa,
                       linalg::Storage storage)
    : nodes_(nodes),
      count_(count),
      dual_(dual),
      width_(primal + dual),
      half_(direction == Direction::down ? primal : width_),
      down_(direction == Direction::down),
      ld_(std::max(lines(2L * half_), linalg::padded(width_))),
      schur_ld_(linalg::padded(2 * half_)),
      v_at_(lines(width_)),
      w_at_(v_at_ + width_ * ld_),
      record_(w_at_ + linalg::PackedTriangle<double>::length(width_)),
      streamed_(storage == linalg::Storage::streamed ||
                (storage == linalg::Storage::automatic &&
                 linalg::size_product({record_, count, sizeof(double)}) > kStreamedBytes)),
      kernels_(linalg::block_kernels(isa)),
      row_kernels_(node_row_kernels(isa)),
      products_(row_product_kernels(isa)),
      records_(linalg::size_product({record_, count})),
      finished_(record_),
      u_(width_ * ld_),
      coupling_u_(width_ * ld_),
      before_(width_) {
  for (linalg::BlockBuffer& s : schur_) s = linalg::BlockBuffer(2 * half_ * schur_ld_);
}

void FrontSweep::factor(const NodeRows& rows, const signed char* signs, double epsilon, double* x,
                        int m, double* kept) {
  failed_ = -1;
  last_ = 0;
  std::fill_n(schur_[0].data(), schur_[0].size(), 0.0);
  std::fill_n(kept, 2L * half_ * m, 0.0);
  linalg::Elimination e;
  e.size = width_;
  e.ld = e.diagonal_ld = e.left.source_ld = ld_;
  e.signs = signs;
  e.diagonal = e.u = u_.data();
  e.original = before_.data();
  e.original_step = 1;
  e.left.columns = 2 * half_;
  e.left.u = coupling_u_.data();
  for (int k = 0; k < count_; ++k) {
    double* finished = streamed_ ? finished_.data() : record(k);
    double* v = finished + v_at_;
    const double* wanted = rows.row(node(std::min(k + kAhead, count_ - 1)) + (down_ ? 0 : 2), 0);
    const auto ask = [&](int part) __attribute__((always_inline)) {
      const long length = lines(rows.length() / kParts);
      fetch(wanted + part * length, length);
    };
    ask(0);
    write_front(rows, epsilon, k, v);
    ask(1);
    row_kernels_.add_schur(schur(), schur_ld_, half_, offset(), u_.data(), v, ld_);
    ask(2);
    e.inverse = finished;
    e.w = finished + w_at_;
    e.left.source = e.left.v = v;
    pivot_ = kernels_.eliminate(e);
    if (pivot_.row >= 0) {
      failed_ = node(k);
      return;
    }
    ask(3);
    double* next = schur_[1 - last_].data();
    row_kernels_.start_schur(schur(), schur_ld_, half_, next);
    kernels_.update(2 * half_, 2 * half_, width_, next, schur_ld_, next, schur_ld_, v, ld_,
                    coupling_u_.data(), ld_, true);
    last_ = 1 - last_;
    ask(4);
    if (m > 0) forward_front(k, finished, x, m, kept);
    if (streamed_) kernels_.stream(finished, record(k), record_);
  }
  // What was written around the caches is in memory before another thread is told that it is.
  if (streamed_) std::atomic_thread_fence(std::memory_order_seq_cst);
}

// The matrix's own entries, in place of U and V.
void FrontSweep::write_front(const NodeRows& rows, double epsilon, int front, double* v) {
  double* p = u_.data();
  row_kernels_.write_pivots(rows, node(front), p, ld_);
  for (int r = 0; r < dual_; ++r) p[r * (ld_ + 1)] = -epsilon;
  for (int r = 0; r < width_; ++r) before_.data()[r] = p[r * (ld_ + 1)];
  if (down_) {
    row_kernels_.write_couplings_before(rows, node(front), v, ld_);
  } else {
    row_kernels_.write_couplings_behind(rows, node(front), v, ld_);
  }
}

void FrontSweep::forward(double* x, int m, double* kept) const {
  std::fill_n(kept, 2L * half_ * m, 0.0);
  for (int k = 0; k < count_; ++k) forward_front(k, record(k), x, m, kept);
}

void FrontSweep::forward_front(int front, const double* record, double* x, int m,
                               double* kept) const {
  const long part = static_cast<long>(half_) * m;
  double* xi = x + static_cast<long>(node(front)) * width_ * m;
  double* stays = xi + static_cast<long>(offset()) * m;
  for (long j = 0; j < part; ++j) stays[j] += kept[part + j];
  std::copy_n(kept, part, kept + part);
  std::fill_n(kept, part, 0.0);
  kernels_.substitute_transposed(width_, record + w_at_, xi, m, m, -kForwardAhead);
  kernels_.subtract_transposed(width_, 2 * half_, record + v_at_, ld_, xi, kept, m, m, m,
                               -kForwardAhead);
}

void FrontSweep::backward(double* x, int m, double* kept) const {
  const int columns = 2 * half_;
  double* by_columns = kept + static_cast<long>(columns) * m;
  for (int j = 0; j < m; ++j) {
    double* column = by_columns + j * ld_;
    for (int r = 0; r < columns; ++r) column[r] = kept[static_cast<long>(r) * m + j];
    std::fill(column + columns, column + ld_, 0.0);
  }
  for (int k = count_ - 1; k >= 0; --k) {
    double* xi = x + static_cast<long>(node(k)) * width_ * m;
    const double* over = record(k);
    for (int r = 0; r < width_; ++r) {
      for (int j = 0; j < m; ++j) xi[static_cast<long>(r) * m + j] *= over[r];
    }
    subtract_couplings(over + v_at_, by_columns, xi, m, by_columns + m * ld_);
    kernels_.substitute(width_, over + w_at_, xi, m, m, 0);
    const double* stays = xi + static_cast<long>(offset()) * m;
    for (int j = 0; j < m; ++j) {
      double* column = by_columns + j * ld_;
      std::copy_n(column + half_, half_, column);
      for (int r = 0; r < half_; ++r) column[half_ + r] = stays[static_cast<long>(r) * m + j];
    }
  }
}

// xi -= V times the columns of the nodes that stay; scratch: width.
void FrontSweep::subtract_couplings(const double* v, const double* columns, double* xi, int m,
                                    double* scratch) const {
  if (m <= RowProductKernels::kMost) {
    products_.subtract_rows(width_, 2 * half_, v, ld_, columns, ld_, xi, m);
    return;
  }
  for (int j = 0; j < m; ++j) {
    for (int r = 0; r < width_; ++r) scratch[r] = xi[static_cast<long>(r) * m + j];
    products_.subtract_rows(width_, 2 * half_, v, ld_, columns + j * ld_, ld_, scratch, 1);
    for (int r = 0; r < width_; ++r) xi[static_cast<long>(r) * m + j] = scratch[r];
  }
}

}  // namespace trajopt
