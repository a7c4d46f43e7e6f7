#include "trajopt/linalg/factorization.h"

#include <algorithm>
#include <string>

#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/linalg/pivot_error.h"

namespace trajopt::linalg {

namespace {

constexpr int kShortChain = 4;  // too short to be worth two sweeps

Ordering resolve(Ordering ordering, int blocks, int batch) {
  if (ordering != Ordering::automatic) return ordering;
  return blocks < kShortChain || batch != 1 ? Ordering::sequential : Ordering::chunked;
}

}  // namespace

Factorization::Factorization(int blocks, int size, Ordering ordering, int chunks, int batch,
                             Isa isa, Precision precision)
    : blocks_(blocks), size_(size), batch_(batch) {
  if (blocks < 1 || size < 1 || batch < 0 || chunks < 1) {
    throw ArgumentError(
        "a factorization needs at least one block of at least one row: " + std::to_string(blocks) +
        " blocks of size " + std::to_string(size) + ", batch of " + std::to_string(batch) + ", " +
        std::to_string(chunks) + " chunks");
  }
  schedule_ = std::make_unique<const Schedule>(
      make_schedule(blocks, resolve(ordering, blocks, batch), chunks));
  if (precision == Precision::float64) {
    double_ = std::make_unique<Factors<double>>(blocks, size, batch, *schedule_, isa);
  } else {
    single_ = std::make_unique<Factors<float>>(blocks, size, batch, *schedule_, isa);
    columns_ = BasicBlockBuffer<float>(size_product({blocks, size, batch, kColumnsAtOnce}));
  }
  residual_ = BlockBuffer(size_product({blocks, size, kColumnsAtOnce}));
  saved_ = BlockBuffer(size_product({blocks, size, kColumnsAtOnce}));
  magnitudes_ = BlockBuffer(blocks);
}

// Only one where waking a second costs more than it saves.
int Factorization::useful_threads(int threads) const {
  constexpr double kWorthwhileFlops = 5e5;
  const double flops = 2.0 * batch_ * blocks_ * size_ * size_ * size_;
  const int most = double_ ? double_->workers() : single_->workers();
  return flops < kWorthwhileFlops ? 1 : std::clamp(threads, 1, most);
}

bool Factorization::try_factor(const SymmetricBlockTridiagonal& a, const signed char* signs,
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
  factored_ = double_ ? double_->factor(a, signs, regularization, threads)
                      : single_->factor(a, signs, regularization, threads);
  return factored_;
}

void Factorization::factor(const SymmetricBlockTridiagonal& a, const signed char* signs,
                           double regularization, int threads) {
  if (try_factor(a, signs, regularization, threads)) return;
  for (int item = 0; item < batch_; ++item) {
    const PivotFailure& failure = double_ ? double_->failure(item) : single_->failure(item);
    const signed char* of_item = signs ? signs + item * a.rows() : nullptr;
    if (failure.block >= 0) fail(item, failure, of_item, regularization);
  }
}

void Factorization::fail(int item, const PivotFailure& failure, const signed char* signs,
                         double regularization) const {
  const long row = static_cast<long>(failure.block) * size_ + failure.pivot.row;
  const bool positive = !signs || signs[row] > 0;
  throw pivot_error(batch_ > 1 ? item : -1, failure.block, failure.pivot.row, failure.pivot.value,
                    positive, regularization);
}

}  // namespace trajopt::linalg
