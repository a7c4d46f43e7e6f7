#include "trajopt/linalg/schedule.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "trajopt/base/error.h"

namespace trajopt::linalg {

namespace {

// Collects the order of elimination, then derives what each step must know about the others.
class Builder {
 public:
  explicit Builder(int blocks) : left_(blocks), right_(blocks), when_(blocks) {
    for (int i = 0; i < blocks; ++i) {
      left_[i] = i - 1;
      right_[i] = i + 1 < blocks ? i + 1 : -1;
    }
  }

  void open_stage() { stage_begin_ = static_cast<int>(schedule_.runs.size()); }
  void close_stage() {
    const int end = static_cast<int>(schedule_.runs.size());
    if (end > stage_begin_) schedule_.stages.push_back({stage_begin_, end});
  }

  // Eliminates first, first + stride, ..., last one after the other.
  void add_run(int first, int last, int stride) {
    const int begin = static_cast<int>(schedule_.steps.size());
    for (int i = first;; i += stride) {
      eliminate(i);
      if (i == last) break;
    }
    schedule_.runs.push_back({begin, static_cast<int>(schedule_.steps.size())});
  }

  // Odd-even reduction of what is left: `chain` lists the remaining blocks.
  void reduce(std::vector<int> chain) {
    while (!chain.empty()) {
      std::vector<int> even;
      open_stage();
      for (std::size_t p = 0; p < chain.size(); ++p) {
        if (p % 2 == 1 || chain.size() == 1) {
          add_run(chain[p], chain[p], 1);
        } else {
          even.push_back(chain[p]);
        }
      }
      close_stage();
      chain = std::move(even);
    }
  }

  Schedule finish(Ordering ordering) {
    std::vector<char> touched(when_.size(), 0);
    for (const Stage& stage : schedule_.stages) {
      for (int r = stage.begin; r < stage.end; ++r) {
        for (int s = schedule_.runs[r].begin; s < schedule_.runs[r].end; ++s) {
          Step& step = schedule_.steps[s];
          step.diagonal_original = !touched[step.block];
          step.left_deferred = step.left >= 0 && s + 1 == schedule_.runs[r].end;
          if (step.right >= 0) step.right_first = !std::exchange(touched[step.right], 1);
          if (step.left >= 0 && !step.left_deferred) {
            step.left_first = !std::exchange(touched[step.left], 1);
          }
          if (step.left >= 0 && step.right >= 0) {
            step.fill_in_right = when_[step.right] < when_[step.left];
          }
        }
      }
      for (int r = stage.begin; r < stage.end; ++r) {
        Step& step = schedule_.steps[schedule_.runs[r].end - 1];
        if (step.left_deferred) step.left_first = !std::exchange(touched[step.left], 1);
      }
    }
    schedule_.ordering = ordering;
    return std::move(schedule_);
  }

 private:
  void eliminate(int i) {
    Step step;
    step.block = i;
    step.left = left_[i];
    step.right = right_[i];
    // Only neighbours in the original numbering are coupled by a block of the matrix itself.
    step.left_original = step.left == i - 1 && step.left >= 0;
    step.right_original = step.right == i + 1;
    if (step.left >= 0) right_[step.left] = step.right;
    if (step.right >= 0) left_[step.right] = step.left;
    when_[i] = static_cast<int>(schedule_.steps.size());
    schedule_.steps.push_back(step);
  }

  Schedule schedule_;
  std::vector<int> left_, right_, when_;
  int stage_begin_ = 0;
};

// Inner chunks fill in towards their right end: 19/3 B^3 flops a block against 7/3 B^3 in the two
// outer ones, which are longer in proportion. The first one, swept upwards, transposes a block a
// step: that takes 5 to 15 % of its time, small blocks the most.
constexpr double kInnerCost = 19.0;
constexpr double kOuterCost = 7.0;
constexpr double kUpwardCost = 1.1 * kOuterCost;

Schedule make_chunked(int blocks, int chunks) {
  chunks = std::clamp(chunks, 1, (blocks + 1) / 2);
  Builder builder(blocks);
  if (chunks == 1) {
    builder.open_stage();
    builder.add_run(blocks - 1, 0, -1);
    builder.close_stage();
    return builder.finish(Ordering::chunked);
  }
  const double unit =
      (blocks - (chunks - 1)) / (1.0 / kUpwardCost + 1.0 / kOuterCost + (chunks - 2) / kInnerCost);
  std::vector<int> separators;
  int previous = -1;
  for (int c = 1; c < chunks; ++c) {
    const double interior = unit * (1.0 / kUpwardCost + (c - 1) / kInnerCost);
    // Every chunk, also those still to come, keeps at least one block.
    const int last = blocks - 2 * (chunks - c);
    const int next = static_cast<int>(std::lround(interior)) + c - 1;
    previous = std::clamp(next, previous + 2, last);
    separators.push_back(previous);
  }
  builder.open_stage();
  builder.add_run(0, separators.front() - 1, 1);
  for (int c = 1; c + 1 < chunks; ++c) {
    builder.add_run(separators[c] - 1, separators[c - 1] + 1, -1);
  }
  builder.add_run(blocks - 1, separators.back() + 1, -1);
  builder.close_stage();
  builder.reduce(separators);
  return builder.finish(Ordering::chunked);
}

}  // namespace

const char* ordering_name(Ordering ordering) {
  switch (ordering) {
    case Ordering::sequential:
      return "sequential";
    case Ordering::cyclic:
      return "cyclic";
    case Ordering::chunked:
      return "chunked";
    case Ordering::frontal:
      return "frontal";
    default:
      return "auto";
  }
}

int Schedule::max_runs() const {
  int most = 0;
  for (const Stage& stage : stages) most = std::max(most, stage.end - stage.begin);
  return most;
}

Schedule make_schedule(int blocks, Ordering ordering, int chunks) {
  switch (ordering) {
    case Ordering::cyclic: {
      Builder builder(blocks);
      std::vector<int> chain(blocks);
      for (int i = 0; i < blocks; ++i) chain[i] = i;
      builder.reduce(std::move(chain));
      return builder.finish(Ordering::cyclic);
    }
    case Ordering::chunked:
      return make_chunked(blocks, chunks);
    case Ordering::frontal:
      throw ArgumentError(
          "ordering = 'frontal': expected the frames of a trajectory that is not periodic, on the "
          "processor; of blocks, 'sequential', 'cyclic' or 'chunked'");
    default: {
      Schedule schedule = make_chunked(blocks, 1);
      schedule.ordering = Ordering::sequential;
      return schedule;
    }
  }
}

}  // namespace trajopt::linalg
