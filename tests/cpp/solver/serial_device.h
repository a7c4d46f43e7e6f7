// A device for FramesExecutor that makes every launch on the processor: the launches, the plan of
// the factorization and the recordings of a GPU, with ranks and jobs in a chosen order. Its memory
// is not the problem's, and full of NaN until it is written.
#pragma once

#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "trajopt/base/buffer.h"
#include "trajopt/base/error.h"
#include "trajopt/linalg/group_border_sequence.h"
#include "trajopt/solver/frames_executor.h"

namespace trajopt::test {

struct LaunchOrder {
  RankOrder order = RankOrder::forward;
  int ranks = 0;  // of a group; 0: as many as the launch asks for
};

class SerialDevice {
 public:
  explicit SerialDevice(LaunchOrder how) : how_(how), log_(std::make_shared<Log>()) {}

  struct Bytes {
    AlignedBuffer memory;
    std::byte* data() const { return memory.get(); }
  };
  Bytes allocate(std::size_t bytes) const {
    Bytes b{aligned_buffer(bytes + 1)};
    std::memset(b.data(), 0xff, bytes);
    return b;
  }
  template <class T>
  T* pinned(std::size_t count) const {
    log_->pinned.push_back(allocate(count * sizeof(T)));
    return reinterpret_cast<T*>(log_->pinned.back().data());
  }
  void upload(void* to, const void* from, std::size_t bytes) const {
    if (bytes > 0) std::memcpy(to, from, bytes);
  }
  void download(void* to, const void* from, std::size_t bytes) const { upload(to, from, bytes); }

  // While a recording is being made nothing is done.
  void copy_in(void* to, const void* from, std::size_t bytes) const {
    then([=] { std::memcpy(to, from, bytes); });
  }
  void copy_out(void* to, const void* from, std::size_t bytes) const { copy_in(to, from, bytes); }

  template <class Work>
  void operator()(const Work& work) const {
    then([how = how_, work] {
      const int ranks = how.ranks > 0 ? how.ranks : work.ranks();
      const Emulated group(ranks, how.order);
      const long jobs = work.jobs();
      std::vector<double> space(work.bytes() / sizeof(double) + 2);
      for (long j = 0; j < jobs; ++j) {
        std::memset(space.data(), 0xff, space.size() * sizeof(double));
        work(group, how.order == RankOrder::forward ? j : jobs - 1 - j, space.data());
      }
    });
  }

  using Recording = std::vector<std::function<void()>>;
  template <class Enqueue>
  Recording record(const Enqueue& enqueue) const {
    log_->enqueued.clear();
    enqueue();
    return std::move(log_->enqueued);
  }
  void play(const Recording& recording) const {
    for (const auto& work : recording) work();
  }
  // At once, or into the recording: everything a recording needs is enqueued.
  void then(std::function<void()> work) const { log_->enqueued.push_back(std::move(work)); }

  class Solver;

 private:
  struct Log {
    Recording enqueued;
    std::vector<Bytes> pinned;
  };
  LaunchOrder how_;
  std::shared_ptr<Log> log_;
};

class SerialDevice::Solver {
 public:
  Solver(const SerialDevice& device, int blocks, int size, linalg::Ordering ordering,
         const std::vector<signed char>& signs, int batch, bool ring)
      : run_(device),
        ring_(ring),
        chain_(ring ? blocks - 1 : blocks),
        plan_(make_group_plan(chain_, linalg::make_schedule(chain_, ordering, 2))),
        batch_(batch),
        matrix_(chain_, size, batch) {
    for (int item = 0; item < batch; ++item) {
      const auto border = signs.begin() + matrix_.rows();
      signs_.insert(signs_.end(), signs.begin(), border);
      border_signs_.insert(border_signs_.end(), border, signs.end());
    }
    s_.blocks = chain_;
    s_.size = size;
    s_.slots = plan_.slots;
    s_.runs = plan_.runs;
    s_.ld = linalg::group_ld(size);
    const long block = s_.block_length();
    w_.resize(batch * chain_ * block);
    couplings_.resize(batch * plan_.slots * block);
    inverse_.resize(batch * matrix_.rows());
    scratch_.resize(batch * plan_.runs * 3 * block);
    failures_.resize(batch * plan_.runs);
    failed_stage_.resize(batch);
    s_.diagonal = matrix_.diagonal(0);
    s_.lower = matrix_.lower(0);
    s_.signs = signs_.data();
    s_.regularization = &regularization_;
    s_.w = w_.data();
    s_.couplings = couplings_.data();
    s_.inverse = inverse_.data();
    s_.scratch = scratch_.data();
    s_.failures = failures_.data();
    s_.failed_stage = failed_stage_.data();
    s_.failed_item = &failed_item_;
    if (ring) make_border(size);
  }
  Solver(const Solver&) = delete;

  KktArrays arrays() {
    return {matrix_.diagonal(0), matrix_.lower(0), border_.data(), corner_.data()};
  }

  linalg::Ordering ordering() const { return plan_.ordering; }

  void list(const int* listed, int places) {
    s_.listed = listed;
    s_.batch = places;
  }
  void factor() {
    run_.then([this] {
      const linalg::GroupFailure none{-1, -1, 0.0};
      std::fill(failures_.begin(), failures_.end(), none);
      std::fill(border_failures_.begin(), border_failures_.end(), none);
      std::fill(failed_stage_.begin(), failed_stage_.end(), linalg::GroupSystem::kNever);
      failed_item_ = linalg::GroupSystem::kNever;
    });
    sequence_factor(run_, plan_, entries(), s_);
    if (ring_) sequence_border_factor(run_, plan_, entries(), s_, b_);
  }
  void solve(double* x, int m) {
    if (ring_) {
      sequence_border_solve(run_, plan_, entries(), s_, b_, x, m);
    } else {
      sequence_solve(run_, plan_, entries(), s_, {x, m, nullptr});
    }
  }
  void reserve(int m) {
    const long lanes = batch_ * (ring_ ? m : linalg::column_chunks(m));
    r_.resize(batch_ * (ring_ ? b_.stride(m) : matrix_.rows() * m));
    saved_.resize(r_.size());
    norm_.assign(lanes, 0.0);
    states_.resize(lanes);
    active_.resize(lanes);
    going_.resize(batch_ * linalg::column_chunks(m));
  }
  void refine(const double* rhs, double* x, int m, int steps, double tolerance) {
    if (ring_) {
      const linalg::BorderRefineArrays arrays{rhs,          r_.data(),      saved_.data(),
                                              norm_.data(), states_.data(), active_.data(),
                                              going_.data()};
      sequence_border_refine(run_, plan_, entries(), s_, b_, x, m, steps, tolerance, arrays);
      return;
    }
    const linalg::RefineArrays arrays{rhs,          r_.data(),      saved_.data(),
                                      norm_.data(), states_.data(), active_.data()};
    sequence_refine_start(run_, s_, x, m, steps, tolerance, arrays);
    for (int k = 0; k < steps; ++k)
      sequence_refine_step(run_, plan_, entries(), s_, x, m, steps, tolerance, arrays);
  }
  const int* failed() const { return failed_stage_.data(); }
  std::string failure(int item) const { return "stage " + std::to_string(failed_stage_[item]); }

 private:
  linalg::PlanEntries entries() const { return {plan_.eliminations.data(), plan_.updates.data()}; }

  void make_border(int size) {
    b_.border = size;
    b_.rows = matrix_.rows();
    b_.reached = static_cast<long>(KktSystem::kRingReach) * size;
    b_.ld = linalg::group_ld(size);
    border_.resize(batch_ * b_.rows * size);
    corner_.resize(static_cast<std::size_t>(batch_) * size * size);
    z_.resize(border_.size());
    schur_.resize(batch_ * b_.block_length());
    unscaled_.resize(schur_.size());
    border_inverse_.resize(static_cast<std::size_t>(batch_) * size);
    border_failures_.resize(batch_);
    b_.e = border_.data();
    b_.f = corner_.data();
    b_.signs = border_signs_.data();
    b_.regularization = &regularization_;
    b_.z = z_.data();
    b_.schur = schur_.data();
    b_.unscaled = unscaled_.data();
    b_.inverse = border_inverse_.data();
    b_.failures = border_failures_.data();
  }

  SerialDevice run_;
  const bool ring_;
  const int chain_;  // blocks, without a ring's border
  linalg::GroupPlan plan_;
  const int batch_;
  linalg::SymmetricBlockTridiagonal matrix_;
  std::vector<signed char> signs_, border_signs_;
  linalg::GroupSystem s_;
  linalg::GroupBorder b_;
  std::vector<double> w_, couplings_, inverse_, scratch_, r_, saved_, norm_;
  std::vector<double> border_, corner_, z_, schur_, unscaled_, border_inverse_;
  std::vector<linalg::GroupFailure> failures_, border_failures_;
  std::vector<linalg::GroupRefinement> states_;
  std::vector<int> active_, going_;
  std::vector<int> failed_stage_;
  int failed_item_ = 0;
  const double regularization_ = 0.0;
};

}  // namespace trajopt::test
