#include "trajopt/linalg/factorization.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"

namespace trajopt::linalg {

namespace {

constexpr int kShortChain = 4;  // too short to be worth two sweeps

Ordering resolve(Ordering ordering, int blocks, int batch) {
  if (ordering != Ordering::automatic) return ordering;
  return blocks < kShortChain || batch != 1 ? Ordering::sequential : Ordering::chunked;
}

}  // namespace

Factorization::Factorization(int blocks, int size, Ordering ordering, int chunks, int batch,
                             Isa isa)
    : blocks_(blocks),
      size_(size),
      batch_(batch),
      ld_(padded(size)),
      block_(ld_ * size),
      kernels_(&block_kernels(isa)) {
  if (blocks < 1 || size < 1 || batch < 0 || chunks < 1) {
    throw ArgumentError(
        "a factorization needs at least one block of at least one row: " + std::to_string(blocks) +
        " blocks of size " + std::to_string(size) + ", batch of " + std::to_string(batch) + ", " +
        std::to_string(chunks) + " chunks");
  }
  schedule_ = make_schedule(blocks, resolve(ordering, blocks, batch), chunks);
  left_slot_.assign(blocks, -1);
  right_slot_.assign(blocks, -1);
  for (const Step& step : schedule_.steps) {
    if (step.left >= 0) left_slot_[step.block] = slots_++;
    if (step.right >= 0) right_slot_[step.block] = slots_++;
  }
  run_slots_ = schedule_.max_runs();
  // More threads than this find no scratch of their own; the bits do not depend on the number.
  workers_ = std::max(2, hardware_threads());
  const long scratch_sets = batch > 1 ? std::min(workers_, batch) : 1;
  const std::size_t block_length = block_;
  w_ = BlockBuffer(block_length * blocks * batch);
  couplings_ = BlockBuffer(block_length * slots_ * batch);
  inverse_ = BlockBuffer(static_cast<std::size_t>(size) * blocks * batch);
  scratch_ = BlockBuffer(block_length * 3 * run_slots_ * scratch_sets);
  residual_ = BlockBuffer(static_cast<std::size_t>(size) * blocks * kRefineColumns);
  saved_ = BlockBuffer(static_cast<std::size_t>(size) * blocks * kRefineColumns);
  failures_.resize(std::max(run_slots_, batch));
}

double* Factorization::w(int item, int block) const {
  return w_.data() + block_ * (static_cast<long>(item) * blocks_ + block);
}

double* Factorization::coupling(int item, int slot) const {
  return couplings_.data() + block_ * (static_cast<long>(item) * slots_ + slot);
}

double* Factorization::scratch(int worker, int run_slot, int which) const {
  return scratch_.data() +
         block_ * (3 * (static_cast<long>(worker) * run_slots_ + run_slot) + which);
}

Pivot Factorization::eliminate(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                               const signed char* signs, double regularization, int run_slot,
                               int worker) {
  const int i = step.block;
  Elimination e;
  e.size = size_;
  e.ld = ld_;
  e.w = w(item, i);
  e.u = scratch(worker, run_slot, 0);
  e.diagonal = step.diagonal_original ? a.diagonal(i, item) : e.w;
  e.diagonal_ld = step.diagonal_original ? size_ : ld_;
  e.original = a.diagonal(i, item);
  e.signs = signs ? signs + static_cast<long>(i) * size_ : nullptr;
  e.regularization = regularization;
  e.inverse = inverse_.data() + (static_cast<long>(item) * blocks_ + i) * size_;
  if (step.left >= 0) {
    double* v = coupling(item, left_slot_[i]);
    const double* source = step.left_original ? a.lower(i - 1, item) : v;
    e.left = {source, step.left_original ? size_ : ld_, v, scratch(worker, run_slot, 1)};
  }
  if (step.right >= 0) {
    double* v = coupling(item, right_slot_[i]);
    // The matrix stores this coupling by the neighbour's rows.
    if (step.right_original) kernels_->transpose(size_, a.lower(i, item), size_, v, ld_);
    e.right = {v, ld_, v, scratch(worker, run_slot, 2)};
  }
  const Pivot pivot = kernels_->eliminate(e);
  if (pivot.row < 0 && step.left >= 0 && step.right >= 0) {
    // The neighbours' new coupling: rows of the one that will be eliminated first.
    if (step.fill_in_right) {
      kernels_->update(size_, size_, size_, nullptr, 0, coupling(item, left_slot_[step.right]), ld_,
                       e.right.v, e.left.u, ld_, false);
    } else {
      kernels_->update(size_, size_, size_, nullptr, 0, coupling(item, right_slot_[step.left]), ld_,
                       e.left.v, e.right.u, ld_, false);
    }
  }
  return pivot;
}

void Factorization::update_neighbour(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                                     bool left, int run_slot, int worker) {
  const int neighbour = left ? step.left : step.right;
  const bool first = left ? step.left_first : step.right_first;
  double* target = w(item, neighbour);
  const double* source = first ? a.diagonal(neighbour, item) : target;
  const int slot = left ? left_slot_[step.block] : right_slot_[step.block];
  kernels_->update(size_, size_, size_, source, first ? size_ : ld_, target, ld_,
                   coupling(item, slot), scratch(worker, run_slot, left ? 1 : 2), ld_, true);
}

Factorization::Failure Factorization::factor_item(const SymmetricBlockTridiagonal& a, int item,
                                                  const signed char* signs, double regularization,
                                                  int threads, int worker) {
  for (const Stage& stage : schedule_.stages) {
    const int runs = stage.end - stage.begin;
    Failure* failures = batch_ > 1 ? nullptr : failures_.data();
    Failure failure;  // of the only run there is when a batch is split over items
    const auto run_all = [&](long slot, int) {
      const Run& run = schedule_.runs[stage.begin + slot];
      const int run_slot = static_cast<int>(slot);
      Failure found;
      for (int s = run.begin; s < run.end && found.block < 0; ++s) {
        const Step& step = schedule_.steps[s];
        const Pivot pivot = eliminate(a, item, step, signs, regularization, run_slot, worker);
        if (pivot.row >= 0) {
          found = {step.block, pivot};
        } else {
          if (step.right >= 0) update_neighbour(a, item, step, false, run_slot, worker);
          if (step.left >= 0 && !step.left_deferred) {
            update_neighbour(a, item, step, true, run_slot, worker);
          }
        }
      }
      if (failures) {
        failures[slot] = found;
      } else if (found.block >= 0 && (failure.block < 0 || found.block < failure.block)) {
        failure = found;
      }
    };
    parallel_for(runs, threads, run_all);
    for (int r = 0; failures && r < runs; ++r) {
      const Failure& found = failures[r];
      if (found.block >= 0 && (failure.block < 0 || found.block < failure.block)) failure = found;
    }
    if (failure.block >= 0) return failure;
    parallel_for(runs, threads, [&](long slot, int) {
      const Step& step = schedule_.steps[schedule_.runs[stage.begin + slot].end - 1];
      if (step.left_deferred) {
        update_neighbour(a, item, step, true, static_cast<int>(slot), worker);
      }
    });
  }
  return {};
}

// No more threads than have scratch of their own, and only one where waking a second costs more
// than it saves.
int Factorization::useful_threads(int threads) const {
  constexpr double kWorthwhileFlops = 5e5;
  const double flops = 2.0 * batch_ * blocks_ * size_ * size_ * size_;
  return flops < kWorthwhileFlops ? 1 : std::clamp(threads, 1, workers_);
}

void Factorization::factor(const SymmetricBlockTridiagonal& a, const signed char* signs,
                           double regularization, int threads) {
  if (a.blocks() != blocks_ || a.size() != size_ || a.batch() != batch_) {
    throw ArgumentError("factor: the matrix has " + std::to_string(a.blocks()) +
                        " blocks of size " + std::to_string(a.size()) + " in a batch of " +
                        std::to_string(a.batch()) + ", this factorization is for " +
                        std::to_string(blocks_) + ", " + std::to_string(size_) + ", " +
                        std::to_string(batch_));
  }
  factored_ = false;
  threads = useful_threads(threads);
  const auto signs_of = [&](long item) { return signs ? signs + item * a.rows() : nullptr; };
  if (batch_ == 1) {
    const Failure failure = factor_item(a, 0, signs, regularization, threads, 0);
    if (failure.block >= 0) fail(0, failure, signs, regularization);
  } else {
    parallel_for(batch_, threads, [&](long item, int worker) {
      failures_[item] =
          factor_item(a, static_cast<int>(item), signs_of(item), regularization, 1, worker);
    });
    for (int item = 0; item < batch_; ++item) {
      if (failures_[item].block >= 0) fail(item, failures_[item], signs_of(item), regularization);
    }
  }
  factored_ = true;
}

void Factorization::fail(int item, const Failure& failure, const signed char* signs,
                         double regularization) const {
  const long row = static_cast<long>(failure.block) * size_ + failure.pivot.row;
  const bool positive = !signs || signs[row] > 0;
  const double d = failure.pivot.value;
  const char* reason = "is zero to working accuracy";
  if (!std::isfinite(d)) {
    reason = "is not finite";
  } else if (positive ? d < 0.0 : d > 0.0) {
    reason = "has the wrong sign";
  }
  char text[256];
  char where[48] = "";
  if (batch_ > 1) std::snprintf(where, sizeof where, " of problem %d", item);
  std::snprintf(text, sizeof text,
                "pivot %d of block %d%s is %g, which %s: expected a %s one (regularization %g)",
                failure.pivot.row, failure.block, where, d, reason,
                positive ? "positive" : "negative", regularization);
  throw FactorizationError(text, failure.block, failure.pivot.row);
}

}  // namespace trajopt::linalg
