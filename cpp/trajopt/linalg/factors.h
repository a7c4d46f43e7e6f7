// The factors A = Wt D W of a symmetric block tridiagonal matrix in scalar type T, and the executor
// that computes and applies them as a schedule says.
//
// A step's record lies where a solution finds it: the last step first, so that the forward sweep
// reads all memory downwards and the backward sweep upwards,
//
//   [ D^-1 | V of the left neighbour | V of the right neighbour | W packed ]  (all in cache lines)
//
// Large systems are bound by memory: there a block is worked on in cache and its factors are
// written once, around the caches, while the blocks of the next step are being fetched.
#pragma once

#include <vector>

#include "trajopt/linalg/block_buffer.h"
#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/block_tridiagonal.h"
#include "trajopt/linalg/schedule.h"

namespace trajopt::linalg {

struct PivotFailure {
  int block = -1;  // -1: none
  Pivot pivot;
};

// How finished blocks get to memory. The bits do not depend on it.
enum class Storage {
  automatic,  // by the size of the system
  cached,
  streamed  // around the caches
};

template <class T>
class Factors {
 public:
  Factors(int blocks, int size, int batch, const Schedule& schedule, Isa isa,
          Storage storage = Storage::automatic);

  // Factors all problems; failures[item] says which pivot was bad. False if there is any.
  bool factor(const SymmetricBlockTridiagonal& a, const signed char* signs, double regularization,
              int threads);
  const PivotFailure& failure(int item) const { return failures_[item]; }

  // x (blocks * size, m) of one problem, in place.
  void solve(int item, T* x, int m, int threads) const;

  int workers() const { return workers_; }  // more threads than this are of no use

 private:
  // The blocks one thread works on. All but U are double: the step
  // before may still have an update or its results' way to memory pending.
  enum Scratch { kU, kW, kLeftV = 3, kRightV = 5, kLeftU = 7, kRightU = 9, kScratchBlocks = 11 };

  PivotFailure factor_item(const SymmetricBlockTridiagonal& a, int item, const signed char* signs,
                           double regularization, int threads, int worker);
  PivotFailure run(const SymmetricBlockTridiagonal& a, int item, const Run& run, int run_slot,
                   const signed char* signs, double regularization, int worker);
  void fetch(const SymmetricBlockTridiagonal& a, int item, const Step& step,
             BasicTraffic<T>& traffic) const;
  // Where an elimination finds its block and couplings.
  void read_diagonal(const SymmetricBlockTridiagonal& a, int item, const Step& step, int worker,
                     BasicElimination<T>& e) const;
  void read_left(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                 BasicElimination<T>& e) const;
  void read_right(const SymmetricBlockTridiagonal& a, int item, const Step& step,
                  BasicElimination<T>& e) const;
  void update_neighbour(const SymmetricBlockTridiagonal& a, int item, const Step& step, bool left,
                        const T* v, long v_ld, const T* u, int worker);
  void forward(int item, const Step& step, T* x, int m) const;
  void backward(int item, const Step& step, T* x, int m) const;

  // Where the block's updated diagonal is kept until it is eliminated.
  T* schur(int item, int block, int worker) const;
  T* scratch(int worker, Scratch which, int set = 0) const;
  T* deferred_u(int worker, int run_slot) const;

  T* inverse(int item, int block) const { return records_.data() + record(item, block); }
  T* left_v(int item, int block) const { return inverse(item, block) + lines(size_); }
  T* right_v(int item, int block) const {
    return left_v(item, block) + (has_left_[block] ? coupling_ : 0);
  }
  T* w(int item, int block) const {
    return right_v(item, block) + (has_right_[block] ? coupling_ : 0);
  }
  std::size_t record(int item, int block) const {
    return static_cast<std::size_t>(item) * item_length_ + record_[block];
  }
  // To be worked off with the rows of a block.
  BasicPiece<T> share(T* data, long count) const {
    return {data, count, lines((count + size_ - 1) / size_)};
  }
  static long lines(long count) {
    constexpr long line = PackedTriangle<T>::kColumns;
    return (count + line - 1) / line * line;
  }

  int blocks_, size_, batch_;
  long ld_, block_;               // leading dimension and length of a block that is worked on
  bool large_;                    // too large for the caches
  bool fetched_;                  // large enough to be asked for ahead of its use
  long v_ld_ = 0, coupling_ = 0;  // leading dimension and length of a finished coupling
  const Schedule& schedule_;
  const BasicBlockKernels<T>* kernels_;
  std::vector<std::size_t> record_;  // offset of each block's record
  std::vector<char> has_left_, has_right_;
  std::vector<char> fused_;      // only the step before updates it: left pending, not stored
  std::vector<int> schur_slot_;  // of the others, -1: none
  std::size_t item_length_ = 0;
  int schur_slots_ = 0, run_slots_ = 0, workers_ = 1;
  BasicBlockBuffer<T> records_, schur_, scratch_, deferred_;
  std::vector<PivotFailure> failures_;      // one per item
  std::vector<PivotFailure> run_failures_;  // of a single problem, one per run of a stage
};

}  // namespace trajopt::linalg
