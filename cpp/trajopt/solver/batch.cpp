#include "trajopt/solver/batch.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "trajopt/base/error.h"

namespace trajopt {

namespace {

auto shape(const BatchItem& item) {
  const TrajectoryProblem& p = *item.member.problem;
  const ExecutorOptions o = executor_options(item.options);
  return std::tuple(p.options().formulation, p.options().periodic, p.frame_count(), p.nodes(),
                    p.model().nq, p.primal(), p.dual(), p.dense_terms().size(),
                    p.local_terms().size(), p.objective().callbacks.size(), o.smoothing,
                    o.augmentation, o.epsilon, o.ordering);
}

// The problems of one executor, each at its own question.
class Round {
 public:
  Round(BatchExecutor& executor, const std::vector<FunnelOptions>& options,
        const std::vector<Report>& reports)
      : executor_(executor),
        ends_(executor.size()),
        requests_(executor.size()),
        answers_(executor.size()) {
    for (int p = 0; p < executor.size(); ++p)
      funnels_.push_back(std::make_unique<Funnel>(executor.point(p), options[p], reports[p]));
  }

  std::vector<BatchEnd> run(const std::function<void()>& poll) {
    using Kind = Request::Kind;
    for (int p = 0; p < executor_.size(); ++p) take(p, [&] { return funnels_[p]->begin(); });
    // Every kind once a round, and corrections as long as there are any: who takes more or fewer
    // questions for an iteration than others is in step with them again at its end.
    while (any_left()) {
      if (poll) poll();
      for (Kind kind : {Kind::linearize, Kind::steps, Kind::trial}) answer(kind);
      while (answer(Kind::correction)) {
      }
      answer(Kind::move);
    }
    return std::move(ends_);
  }

 private:
  bool any_left() const {
    return std::any_of(requests_.begin(), requests_.end(),
                       [](const Request& r) { return r.kind != Request::Kind::nothing; });
  }

  // Answers all questions of a kind; false: there were none.
  bool answer(Request::Kind kind) {
    asking_.clear();
    for (int p = 0; p < executor_.size(); ++p)
      if (requests_[p].kind == kind) asking_.push_back(p);
    if (asking_.empty()) return false;
    executor_.answer(kind, asking_, requests_, answers_);
    for (int p : asking_) take(p, [&] { return funnels_[p]->resume(answers_[p]); });
    return true;
  }

  template <class Next>
  void take(int p, const Next& next) {
    try {
      requests_[p] = next();
      if (requests_[p].kind != Request::Kind::nothing) return;
      ends_[p].result = funnels_[p]->result();
      executor_.point(p).state();  // the last one may not have been fetched yet
    } catch (const DeviceError&) {
      throw;         // of all
    } catch (...) {  // of this problem's report
      requests_[p] = {};
      ends_[p].error = std::current_exception();
    }
  }

  BatchExecutor& executor_;
  std::vector<std::unique_ptr<Funnel>> funnels_;
  std::vector<BatchEnd> ends_;
  std::vector<Request> requests_;
  std::vector<Answer> answers_;
  std::vector<int> asking_;
};

class Groups {
 public:
  Groups(const std::vector<BatchItem>& items, const MakeBatchExecutor& make,
         const std::function<void()>& poll)
      : items_(items), make_(make), poll_(poll), ends_(items.size()) {}

  std::vector<BatchEnd> solve() {
    std::vector<std::vector<std::size_t>> groups;
    for (std::size_t i = 0; i < items_.size(); ++i) {
      const auto same = [&](const auto& g) { return same_shape(items_[g[0]], items_[i]); };
      const auto found = std::find_if(groups.begin(), groups.end(), same);
      if (found == groups.end()) {
        groups.push_back({i});
      } else {
        found->push_back(i);
      }
    }
    for (const auto& group : groups) solve_group(group);
    return std::move(ends_);
  }

 private:
  void solve_group(const std::vector<std::size_t>& group) {
    std::size_t most = group.size(), begin = 0;
    while (begin < group.size()) {
      const std::size_t count = std::min(most, group.size() - begin);
      const std::vector<std::size_t> part(group.begin() + begin, group.begin() + begin + count);
      try {
        if (!solve_part(part)) {
          most = (count + 1) / 2;
          continue;
        }
      } catch (const DeviceError&) {
        for (std::size_t i : part) ends_[i].error = std::current_exception();
      }
      begin += count;
    }
  }

  // False when the memory does not suffice, but might for fewer.
  bool solve_part(const std::vector<std::size_t>& part) {
    std::vector<BatchMember> members;
    std::vector<FunnelOptions> options;
    std::vector<Report> reports;
    for (std::size_t i : part) {
      members.push_back(items_[i].member);
      options.push_back(items_[i].options);
      reports.push_back(items_[i].report);
    }
    std::unique_ptr<BatchExecutor> executor;
    try {
      executor = make_(members, executor_options(options[0]));
    } catch (const DeviceMemoryError&) {
      if (part.size() == 1) throw;
      return false;
    }
    std::vector<BatchEnd> ends = solve_funnels(*executor, options, reports, poll_);
    for (std::size_t k = 0; k < part.size(); ++k) ends_[part[k]] = std::move(ends[k]);
    return true;
  }

  const std::vector<BatchItem>& items_;
  const MakeBatchExecutor& make_;
  const std::function<void()>& poll_;
  std::vector<BatchEnd> ends_;
};

}  // namespace

bool same_shape(const BatchItem& a, const BatchItem& b) { return shape(a) == shape(b); }

std::vector<BatchEnd> solve_funnels(BatchExecutor& executor,
                                    const std::vector<FunnelOptions>& options,
                                    const std::vector<Report>& reports,
                                    const std::function<void()>& poll) {
  return Round(executor, options, reports).run(poll);
}

Result solve_funnel(BatchExecutor& executor, const FunnelOptions& options,
                    const Observer& observer) {
  BatchEnd end = solve_funnels(executor, {options}, {report_to(observer)}, {})[0];
  if (end.error) std::rethrow_exception(end.error);
  return end.result;
}

std::vector<BatchEnd> solve_funnels(const std::vector<BatchItem>& items,
                                    const MakeBatchExecutor& make,
                                    const std::function<void()>& poll) {
  return Groups(items, make, poll).solve();
}

}  // namespace trajopt
