// One direction of a frontal elimination (frontal_kkt.h): fronts one after the other, each with a
// node's rows as pivots and two nodes that stay, the `far` one and the `near` one, which is the
// next front's.
//
// A front's record is [D^-1 | V | W packed], as in linalg/factors.h; records lie so that the first
// half of a solution reads memory downwards and the second half upwards.
#pragma once

#include "trajopt/linalg/block_buffer.h"
#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/factors.h"
#include "trajopt/problem/node_rows.h"
#include "trajopt/problem/row_products.h"

namespace trajopt {

class FrontSweep {
 public:
  enum class Direction { down, up };

  // Eliminates `count` nodes of {dual, primal} rows from the last or from the first one on.
  FrontSweep(int nodes, int count, int primal, int dual, Direction direction, Isa isa,
             linalg::Storage storage);

  // Eliminates all fronts; the first pivot that is bad ends it. signs: of a node. With m > 0, what
  // forward(x, m, kept) does is done to each front while its record is in cache.
  void factor(const NodeRows& rows, const signed char* signs, double epsilon, double* x, int m,
              double* kept);
  int failed_node() const { return failed_; }  // -1: none
  const linalg::Pivot& pivot() const { return pivot_; }

  // What is left for the nodes that stay: the lower triangle of a Schur complement's change, rows
  // of the far node first.
  const double* schur() const { return schur_[last_].data(); }
  long schur_ld() const { return schur_ld_; }

  // The two halves of a solution for m columns x of all nodes. `kept` (2 half, m), far node first:
  // out, what the far and near nodes' right-hand sides change by; in, their solution, overwritten
  // like what is behind it up to kept_size(m).
  void forward(double* x, int m, double* kept) const;
  void backward(double* x, int m, double* kept) const;

  long kept_size(int m) const { return (2L * half_ + ld_) * m + width_; }

  int count() const { return count_; }
  int half() const { return half_; }             // rows of a node that stays
  int offset() const { return width_ - half_; }  // of the first of them in the node

 private:
  int node(int front) const { return down_ ? nodes_ - 1 - front : front; }
  double* record(int front) const { return records_.data() + (count_ - 1 - front) * record_; }
  void write_front(const NodeRows& rows, double epsilon, int front, double* v);
  void forward_front(int front, const double* record, double* x, int m, double* kept) const;
  void subtract_couplings(const double* v, const double* columns, double* xi, int m,
                          double* scratch) const;

  int nodes_, count_, dual_, width_, half_;
  bool down_;
  long ld_, schur_ld_;         // of U and V; of the Schur complements
  long v_at_, w_at_, record_;  // where V and W begin in a record, and its length
  bool streamed_;              // records are written around the caches
  const linalg::BlockKernels& kernels_;
  const NodeRowKernels& row_kernels_;
  const RowProductKernels& products_;
  linalg::BlockBuffer records_, finished_, u_, coupling_u_, before_;
  linalg::BlockBuffer schur_[2];
  int last_ = 0, failed_ = -1;
  linalg::Pivot pivot_;
};

}  // namespace trajopt
