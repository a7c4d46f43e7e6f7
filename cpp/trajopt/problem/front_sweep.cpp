#include "trajopt/problem/front_sweep.h"

#include <algorithm>
#include <atomic>

#include "trajopt/base/fetch.h"

namespace trajopt {

namespace {

constexpr long kLine = linalg::PackedTriangle<double>::kColumns;

// No cache keeps more than this from one sweep to the next.
constexpr std::size_t kStreamedBytes = std::size_t{16} << 20;

// Fronts whose memory is asked for ahead of the one that is worked on.
constexpr int kAhead = 3;

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
      records_(linalg::size_product({record_, count})),
      finished_(record_),
      u_(width_ * ld_),
      coupling_u_(width_ * ld_),
      before_(width_) {
  for (linalg::BlockBuffer& s : schur_) s = linalg::BlockBuffer(2 * half_ * schur_ld_);
}

void FrontSweep::factor(const NodeRows& rows, const signed char* signs, double epsilon) {
  failed_ = -1;
  last_ = 0;
  std::fill_n(schur_[0].data(), schur_[0].size(), 0.0);
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
    if (k + kAhead < count_) fetch(rows.row(node(k + kAhead) + (down_ ? 0 : 2), 0), rows.length());
    write_front(rows, epsilon, k, v);
    row_kernels_.add_schur(schur(), schur_ld_, half_, offset(), u_.data(), v, ld_);
    e.inverse = finished;
    e.w = finished + w_at_;
    e.left.source = e.left.v = v;
    pivot_ = kernels_.eliminate(e);
    if (pivot_.row >= 0) {
      failed_ = node(k);
      return;
    }
    double* next = schur_[1 - last_].data();
    row_kernels_.start_schur(schur(), schur_ld_, half_, next);
    kernels_.update(2 * half_, 2 * half_, width_, next, schur_ld_, next, schur_ld_, v, ld_,
                    coupling_u_.data(), ld_, true);
    last_ = 1 - last_;
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
  const long part = static_cast<long>(half_) * m;
  std::fill_n(kept, 2 * part, 0.0);
  for (int k = 0; k < count_; ++k) {
    double* xi = x + static_cast<long>(node(k)) * width_ * m;
    if (k + kAhead < count_) fetch_downwards(record(k + kAhead), record_);
    double* stays = xi + static_cast<long>(offset()) * m;
    for (long j = 0; j < part; ++j) stays[j] += kept[part + j];
    std::copy_n(kept, part, kept + part);
    std::fill_n(kept, part, 0.0);
    kernels_.substitute_transposed(width_, record(k) + w_at_, xi, m, m, 0);
    kernels_.subtract_transposed(width_, 2 * half_, record(k) + v_at_, ld_, xi, kept, m, m, m, 0);
  }
}

void FrontSweep::backward(double* x, int m, double* kept) const {
  const long part = static_cast<long>(half_) * m;
  for (int k = count_ - 1; k >= 0; --k) {
    double* xi = x + static_cast<long>(node(k)) * width_ * m;
    if (k >= kAhead) fetch(record(k - kAhead), record_);
    const double* over = record(k);
    for (int r = 0; r < width_; ++r) {
      for (int j = 0; j < m; ++j) xi[static_cast<long>(r) * m + j] *= over[r];
    }
    kernels_.subtract(width_, 2 * half_, over + v_at_, ld_, kept, xi, m, m, m, 0);
    kernels_.substitute(width_, record(k) + w_at_, xi, m, m, 0);
    std::copy_n(kept + part, part, kept);
    std::copy_n(xi + static_cast<long>(offset()) * m, part, kept + part);
  }
}

}  // namespace trajopt
