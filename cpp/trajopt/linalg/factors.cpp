#include "trajopt/linalg/factors.h"

#include <algorithm>
#include <atomic>
#include <type_traits>
#include <utility>

#include "trajopt/base/parallel.h"

namespace trajopt::linalg {

namespace {

// Matrix and factors together: beyond the first size a core's own caches keep little of them from
// one factorization to the next, beyond the second no cache does.
constexpr std::size_t kFetchedBytes = std::size_t{512} << 10;
constexpr std::size_t kLargeBytes = std::size_t{32} << 20;

template <class T>
std::size_t bytes(int blocks, int size) {
  return size_product({blocks, size, size, 2 * (sizeof(double) + sizeof(T))});
}

bool lower_block_wins(const PivotFailure& a, const PivotFailure& b) {
  return a.block >= 0 && (b.block < 0 || a.block < b.block);
}

}  // namespace

template <class T>
Factors<T>::Factors(int blocks, int size, int batch, const Schedule& schedule, Isa isa,
                    Storage storage)
    : blocks_(blocks),
      size_(size),
      batch_(batch),
      ld_(padded<T>(size)),
      block_(ld_ * size),
      large_(storage == Storage::automatic ? bytes<T>(blocks, size) > kLargeBytes
                                           : storage == Storage::streamed),
      fetched_(large_ || bytes<T>(blocks, size) > kFetchedBytes),
      v_ld_(large_ ? lines(size) : ld_),
      coupling_(v_ld_ * size),
      schedule_(schedule),
      kernels_(&block_kernels<T>(isa)),
      record_(blocks),
      has_left_(blocks),
      has_right_(blocks),
      schur_slot_(blocks, -1) {
  const auto& steps = schedule.steps;
  for (auto step = steps.rbegin(); step != steps.rend(); ++step) {
    has_left_[step->block] = step->left >= 0;
    has_right_[step->block] = step->right >= 0;
    record_[step->block] = item_length_;
    item_length_ += lines(size) + coupling_ * (has_left_[step->block] + has_right_[step->block]) +
                    PackedTriangle<T>::length(size);
  }
  fused_.assign(blocks, 1);
  const auto share = [&](int block) {
    if (block < 0 || schur_slot_[block] >= 0) return;
    schur_slot_[block] = schur_slots_++;
    fused_[block] = 0;
  };
  for (const Run& run : schedule.runs) {
    for (int s = run.begin; s < run.end; ++s) {
      const Step& step = steps[s];
      const int next = s + 1 < run.end ? steps[s + 1].block : -1;
      if (step.left != next || step.left_deferred) share(step.left);
      if (step.right != next) share(step.right);
    }
  }
  run_slots_ = schedule.max_runs();
  const int most = batch > 1 ? batch : run_slots_;
  workers_ = std::min(std::max(2, hardware_threads()), std::max(1, most));
  const int items_at_once = batch > 1 ? workers_ : 1;
  records_ = BasicBlockBuffer<T>(size_product({static_cast<long>(item_length_), batch}));
  schur_ = BasicBlockBuffer<T>(size_product({block_, schur_slots_, items_at_once}));
  scratch_ = BasicBlockBuffer<T>(size_product({block_, kScratchBlocks, workers_}));
  deferred_ = BasicBlockBuffer<T>(size_product({block_, run_slots_, items_at_once}));
  failures_.resize(batch);
  run_failures_.resize(run_slots_);
}

template <class T>
T* Factors<T>::schur(int item, int block, int worker) const {
  const int slot = schur_slot_[block];
  const int set = batch_ > 1 ? worker : item;
  return schur_.data() + block_ * (static_cast<long>(set) * schur_slots_ + slot);
}

template <class T>
T* Factors<T>::scratch(int worker, Scratch which, int set) const {
  return scratch_.data() + block_ * (static_cast<long>(worker) * kScratchBlocks + which + set);
}

template <class T>
T* Factors<T>::deferred_u(int worker, int run_slot) const {
  const int set = batch_ > 1 ? worker : 0;
  return deferred_.data() + block_ * (static_cast<long>(set) * run_slots_ + run_slot);
}

template <class T>
void Factors<T>::update_neighbour(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                                  bool left, const T* v, long v_ld, const T* u, int worker) {
  const int neighbour = left ? step.left : step.right;
  const bool first = left ? step.left_first : step.right_first;
  T* target = schur(item, neighbour, worker);
  const T* source = target;
  long source_ld = ld_;
  if (first) {
    if constexpr (std::is_same_v<T, double>) {
      source = a.diagonal(neighbour, item);
      source_ld = size_;
    } else {
      kernels_->convert(size_, a.diagonal(neighbour, item), target, ld_, true);
    }
  }
  kernels_->update(size_, size_, size_, source, source_ld, target, ld_, v, v_ld, u, ld_, true);
}

// Eliminates the blocks of a run one after the other.
template <class T>
PivotFailure Factors<T>::run(const SymmetricBlockTridiagonal& a, int item, const Run& run,
                             int run_slot, const signed char* signs, double regularization,
                             int worker) {
  BasicTraffic<T> traffic;
  traffic.size = size_;
  traffic.ld = ld_;
  traffic.target_ld = v_ld_;
  const T* pending_v = nullptr;  // of the step before, if it is the only one to update this block
  const T* pending_u = nullptr;
  for (int s = run.begin; s < run.end; ++s) {
    const Step& step = schedule_.steps[s];
    const int i = step.block, set = s % 2;
    BasicElimination<T> e;
    e.pending_v = std::exchange(pending_v, nullptr);
    e.pending_u = std::exchange(pending_u, nullptr);
    e.size = size_;
    e.ld = ld_;
    e.original = a.diagonal(i, item);
    e.original_step = size_ + 1L;
    e.signs = signs ? signs + static_cast<long>(i) * size_ : nullptr;
    e.regularization = regularization;
    e.w = large_ ? scratch(worker, kW, set) : w(item, i);
    e.u = scratch(worker, kU);
    e.inverse = inverse(item, i);
    read_diagonal(a, item, step, worker, e);
    if (step.left >= 0) {
      e.left.v = large_ ? scratch(worker, kLeftV, set) : left_v(item, i);
      e.left.u = step.left_deferred ? deferred_u(worker, run_slot) : scratch(worker, kLeftU, set);
      read_left(a, item, step, e);
    }
    if (step.right >= 0) {
      e.right.v = large_ ? scratch(worker, kRightV, set) : right_v(item, i);
      e.right.u = scratch(worker, kRightU, set);
      read_right(a, item, step, e);
    }
    if (fetched_) {
      e.traffic = &traffic;
      if (s + 1 < run.end) {
        const Step& next = schedule_.steps[s + 1];
        fetch(a, item, next, traffic);
        for (int r = 0; signs && r < size_; r += 64) {
          __builtin_prefetch(signs + static_cast<long>(next.block) * size_ + r);
        }
      }
    }
    const Pivot pivot = kernels_->eliminate(e);
    if (pivot.row >= 0) return {i, pivot};
    if (step.left >= 0 && step.right >= 0) {
      // The neighbours' new coupling: rows of the one that will be eliminated first.
      const bool right = step.fill_in_right;
      T* target = right ? left_v(item, step.right) : right_v(item, step.left);
      kernels_->update(size_, size_, size_, nullptr, 0, target, v_ld_, right ? e.right.v : e.left.v,
                       ld_, right ? e.left.u : e.right.u, ld_, false);
    }
    if (step.right >= 0) {
      if (fused_[step.right]) {
        pending_v = e.right.v, pending_u = e.right.u;
      } else {
        update_neighbour(a, item, step, false, e.right.v, ld_, e.right.u, worker);
      }
    }
    if (step.left >= 0 && !step.left_deferred) {
      if (fused_[step.left]) {
        pending_v = e.left.v, pending_u = e.left.u;
      } else {
        update_neighbour(a, item, step, true, e.left.v, ld_, e.left.u, worker);
      }
    }
    if (large_) {
      kernels_->move(traffic, size_);  // what may be left of the step before
      traffic.write_rows = size_;
      traffic.w = e.w;
      traffic.w_target = share(w(item, i), PackedTriangle<T>::length(size_));
      traffic.v[0] = step.left >= 0 ? e.left.v : nullptr;
      traffic.target[0] = left_v(item, i);
      traffic.v[1] = step.right >= 0 ? e.right.v : nullptr;
      traffic.target[1] = right_v(item, i);
    }
  }
  if (large_) {
    kernels_->move(traffic, size_);
    // What was written around the caches is in memory before another thread is told that it is.
    std::atomic_thread_fence(std::memory_order_seq_cst);
  }
  return {};
}

// The matrix's own blocks that a step will read.
template <class T>
void Factors<T>::fetch(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                       BasicTraffic<T>& traffic) const {
  traffic.fetch_rows = size_;
  // In the direction in which the sweep goes on, so that the processor's own prefetcher follows.
  traffic.fetch_upwards = step.right_original;
  // The pivots are always written through the caches.
  T* begin = inverse(item, step.block);
  T* pivots_end = left_v(item, step.block);
  T* record_end = w(item, step.block) + PackedTriangle<T>::length(size_);
  traffic.claim = share(begin, (large_ ? pivots_end : record_end) - begin);
  traffic.fetch_lower = a.diagonal(step.block, item);
  traffic.fetch_whole = nullptr;
  if (step.left_original) traffic.fetch_whole = a.lower(step.block - 1, item);
  if (step.right_original) traffic.fetch_whole = a.lower(step.block, item);
}

template <class T>
void Factors<T>::read_diagonal(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                               int worker, BasicElimination<T>& e) const {
  const double* block = a.diagonal(step.block, item);
  if (!step.diagonal_original && !fused_[step.block]) {
    e.diagonal = schur(item, step.block, worker);
    e.diagonal_ld = ld_;
  } else if constexpr (std::is_same_v<T, double>) {
    e.diagonal = block;
    e.diagonal_ld = size_;
  } else {
    kernels_->convert(size_, block, e.u, ld_, true);
    e.diagonal = e.u;
    e.diagonal_ld = ld_;
  }
}

template <class T>
void Factors<T>::read_left(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                           BasicElimination<T>& e) const {
  e.left.columns = size_;
  e.left.source = left_v(item, step.block);
  e.left.source_ld = v_ld_;
  if (!step.left_original) return;
  const double* block = a.lower(step.block - 1, item);
  if constexpr (std::is_same_v<T, double>) {
    e.left.source = block;
    e.left.source_ld = size_;
  } else {
    kernels_->convert(size_, block, e.left.v, ld_, false);
    e.left.source = e.left.v;
    e.left.source_ld = ld_;
  }
}

template <class T>
void Factors<T>::read_right(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                            BasicElimination<T>& e) const {
  e.right.columns = size_;
  e.right.source = right_v(item, step.block);
  e.right.source_ld = v_ld_;
  if (!step.right_original) return;
  // The matrix stores this coupling by the neighbour's rows.
  const double* block = a.lower(step.block, item);
  if constexpr (std::is_same_v<T, double>) {
    kernels_->transpose(size_, block, size_, e.right.v, ld_);
  } else {
    kernels_->convert(size_, block, e.right.u, ld_, false);
    kernels_->transpose(size_, e.right.u, ld_, e.right.v, ld_);
  }
  e.right.source = e.right.v;
  e.right.source_ld = ld_;
}

template <class T>
PivotFailure Factors<T>::factor_item(const SymmetricBlockTridiagonal& a, int item,
                                     const signed char* signs, double regularization, int threads,
                                     int worker) {
  const bool single = batch_ == 1;
  for (const Stage& stage : schedule_.stages) {
    const int runs = stage.end - stage.begin;
    PivotFailure failure;
    parallel_for(runs, threads, [&](long slot, int thread) {
      const int run_slot = static_cast<int>(slot);
      const PivotFailure found = run(a, item, schedule_.runs[stage.begin + slot], run_slot, signs,
                                     regularization, single ? thread : worker);
      if (single) {
        run_failures_[slot] = found;
      } else if (lower_block_wins(found, failure)) {
        failure = found;
      }
    });
    for (int r = 0; single && r < runs; ++r) {
      if (lower_block_wins(run_failures_[r], failure)) failure = run_failures_[r];
    }
    if (failure.block >= 0) return failure;
    parallel_for(runs, threads, [&](long slot, int thread) {
      const Step& step = schedule_.steps[schedule_.runs[stage.begin + slot].end - 1];
      if (!step.left_deferred) return;
      update_neighbour(a, item, step, true, left_v(item, step.block), v_ld_,
                       deferred_u(worker, static_cast<int>(slot)), single ? thread : worker);
    });
  }
  return {};
}

template <class T>
bool Factors<T>::factor(const SymmetricBlockTridiagonal& a, const signed char* signs,
                        double regularization, int threads) {
  const auto signs_of = [&](long item) { return signs ? signs + item * a.rows() : nullptr; };
  threads = std::min(threads, workers_);
  if (batch_ == 1) {
    failures_[0] = factor_item(a, 0, signs, regularization, threads, 0);
  } else {
    parallel_for(batch_, threads, [&](long item, int worker) {
      failures_[item] =
          factor_item(a, static_cast<int>(item), signs_of(item), regularization, 1, worker);
    });
  }
  return std::none_of(failures_.begin(), failures_.end(),
                      [](const PivotFailure& f) { return f.block >= 0; });
}

template class Factors<double>;
template class Factors<float>;

}  // namespace trajopt::linalg
