// Solution with the factors.
#include "trajopt/base/fetch.h"
#include "trajopt/base/parallel.h"
#include "trajopt/linalg/factors.h"

namespace trajopt::linalg {

namespace {

// Asked for this far ahead of what is read, in bytes: with 4 KiB a core has too few requests under
// way, with 64 KiB the first level cache loses some of them again.
constexpr long kAheadBytes = 16384;

}  // namespace

// Eliminates a block's unknowns from the equations after it. The update of a deferred left
// neighbour is the caller's.
template <class T>
void Factors<T>::forward(int item, const Step& step, T* x, int m) const {
  const long ahead = -kAheadBytes / static_cast<long>(sizeof(T));
  // Not read here, but it lies between what is: without it, as many lines of a later block would
  // not be asked for.
  trajopt::fetch(inverse(item, step.block) + ahead, lines(size_));
  T* xi = x + static_cast<long>(step.block) * size_ * m;
  kernels_->substitute_transposed(size_, w(item, step.block), xi, m, m, ahead);
  if (step.right >= 0) {
    kernels_->subtract_transposed(size_, size_, right_v(item, step.block), v_ld_, xi,
                                  x + static_cast<long>(step.right) * size_ * m, m, m, m, ahead);
  }
  if (step.left >= 0 && !step.left_deferred) {
    kernels_->subtract_transposed(size_, size_, left_v(item, step.block), v_ld_, xi,
                                  x + static_cast<long>(step.left) * size_ * m, m, m, m, ahead);
  }
}

template <class T>
void Factors<T>::backward(int item, const Step& step, T* x, int m) const {
  const long ahead = kAheadBytes / static_cast<long>(sizeof(T));
  trajopt::fetch(inverse(item, step.block) + ahead, lines(size_));
  T* xi = x + static_cast<long>(step.block) * size_ * m;
  kernels_->scale(size_, inverse(item, step.block), xi, m);
  if (step.left >= 0) {
    kernels_->subtract(size_, size_, left_v(item, step.block), v_ld_,
                       x + static_cast<long>(step.left) * size_ * m, xi, m, m, m, ahead);
  }
  if (step.right >= 0) {
    kernels_->subtract(size_, size_, right_v(item, step.block), v_ld_,
                       x + static_cast<long>(step.right) * size_ * m, xi, m, m, m, ahead);
  }
  kernels_->substitute(size_, w(item, step.block), xi, m, m, ahead);
}

template <class T>
void Factors<T>::solve(int item, T* x, int m, int threads) const {
  for (const Stage& stage : schedule_.stages) {
    const int runs = stage.end - stage.begin;
    parallel_for(runs, threads, [&](long slot, int) {
      const Run& run = schedule_.runs[stage.begin + slot];
      for (int s = run.begin; s < run.end; ++s) forward(item, schedule_.steps[s], x, m);
    });
    parallel_for(runs, threads, [&](long slot, int) {
      const Step& step = schedule_.steps[schedule_.runs[stage.begin + slot].end - 1];
      if (!step.left_deferred) return;
      kernels_->subtract_transposed(size_, size_, left_v(item, step.block), v_ld_,
                                    x + static_cast<long>(step.block) * size_ * m,
                                    x + static_cast<long>(step.left) * size_ * m, m, m, m, 0);
    });
  }
  for (auto stage = schedule_.stages.rbegin(); stage != schedule_.stages.rend(); ++stage) {
    parallel_for(stage->end - stage->begin, threads, [&](long slot, int) {
      // What a thread read last is still in a cache: several keep to their runs, one turns around.
      const Run& run = schedule_.runs[threads > 1 ? stage->begin + slot : stage->end - 1 - slot];
      for (int s = run.end - 1; s >= run.begin; --s) backward(item, schedule_.steps[s], x, m);
    });
  }
}

template void Factors<double>::solve(int, double*, int, int) const;
template void Factors<float>::solve(int, float*, int, int) const;

}  // namespace trajopt::linalg
