// The elimination order of a block tridiagonal matrix, as data.
//
// While blocks are eliminated the remaining ones always form a chain. Eliminating block i, whose
// neighbours in the chain are `left` < i < `right`, updates the two neighbours' diagonal blocks and
// couples them to each other. A schedule is a list of stages; the runs of a stage touch different
// blocks and may execute at once; the steps of a run follow each other.
#pragma once

#include <vector>

namespace trajopt::linalg {

enum class Ordering {
  automatic,   // sequential for a batch or a short chain, two sweeps that meet in the middle else
  sequential,  // block Thomas, from the last block to the first
  cyclic,      // odd-even reduction: log2(n) stages, every second block of the chain at once
  chunked,     // independent sweeps over chunks, then cyclic reduction of the blocks between them
  frontal      // node by node, of a trajectory's KKT system only (problem/frontal_kkt.h)
};

const char* ordering_name(Ordering ordering);

struct Step {
  int block = 0;
  int left = -1;  // neighbours in the chain when the block is eliminated; -1: none
  int right = -1;
  bool left_original = false;      // the coupling to the neighbour is the matrix's own block,
  bool right_original = false;     // not fill
  bool diagonal_original = false;  // no earlier step has updated this diagonal block
  bool left_first = false;         // this step is the first to update the neighbour's diagonal
  bool right_first = false;
  bool left_deferred = false;  // the left neighbour lies outside the run: update it after a
                               // barrier, so that two runs never write to one block
  bool fill_in_right = false;  // the new coupling is stored with its right end, else its left
};

struct Run {
  int begin, end;  // range of steps
};

struct Stage {
  int begin, end;  // range of runs
};

struct Schedule {
  Ordering ordering;  // never `automatic`
  std::vector<Step> steps;
  std::vector<Run> runs;
  std::vector<Stage> stages;

  int max_runs() const;  // over the stages
};

// chunks: number of independent sweeps of `chunked`, reduced until each has a block. Throws
// ArgumentError for `frontal`, which knows more of a matrix than its blocks.
Schedule make_schedule(int blocks, Ordering ordering, int chunks);

}  // namespace trajopt::linalg
