#include "trajopt/linalg/group_plan.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace trajopt::linalg {

namespace {

class Planner {
 public:
  Planner(int blocks, const Schedule& schedule)
      : schedule_(schedule),
        left_slot_(blocks, -1),
        right_slot_(blocks, -1),
        update_of_(blocks, -1) {
    plan_.ordering = schedule.ordering;
    plan_.runs = schedule.max_runs();
    for (const Step& step : schedule.steps) {
      if (step.left >= 0) left_slot_[step.block] = plan_.slots++;
      if (step.right >= 0) right_slot_[step.block] = plan_.slots++;
    }
  }

  GroupPlan finish() {
    for (int s = 0; s < static_cast<int>(schedule_.stages.size()); ++s) add_stage(s);
    return std::move(plan_);
  }

 private:
  void add_stage(int index) {
    const Stage& stage = schedule_.stages[index];
    int longest = 0;
    for (int r = stage.begin; r < stage.end; ++r) {
      longest = std::max(longest, schedule_.runs[r].end - schedule_.runs[r].begin);
    }
    for (int at = 0; at < longest; ++at) {
      updates_.clear();
      fills_.clear();
      const int begin = static_cast<int>(plan_.eliminations.size());
      for (int r = stage.begin; r < stage.end; ++r) {
        const Run& run = schedule_.runs[r];
        if (run.begin + at < run.end) add_step(schedule_.steps[run.begin + at], r - stage.begin);
      }
      for (int r = stage.begin; at + 1 == longest && r < stage.end; ++r) {
        const Step& step = schedule_.steps[schedule_.runs[r].end - 1];
        if (step.left_deferred) add_update(step, true, r - stage.begin);
      }
      close_level(index, begin);
    }
  }

  void add_step(const Step& step, int run) {
    const int left = left_slot_[step.block], right = right_slot_[step.block];
    plan_.eliminations.push_back({step.block, step.left, step.right, left, right, run,
                                  step.left_original, step.right_original, step.diagonal_original});
    if (step.right >= 0) add_update(step, false, run);
    if (step.left >= 0 && !step.left_deferred) add_update(step, true, run);
    if (step.left < 0 || step.right < 0) return;
    // The neighbours' new coupling: rows of the one that will be eliminated first. The term's V is
    // of that side, its U of the other.
    PlannedUpdate fill{};
    fill.fill = true;
    fill.target = step.fill_in_right ? left_slot_[step.right] : right_slot_[step.left];
    fill.terms = 1;
    fill.term[0] = {step.fill_in_right ? right : left, step.block, run, step.fill_in_right};
    fills_.push_back(fill);
  }

  void add_update(const Step& step, bool left, int run) {
    const int target = left ? step.left : step.right;
    const int slot = left ? left_slot_[step.block] : right_slot_[step.block];
    const PlannedTerm term{slot, step.block, run, left};
    if (update_of_[target] >= 0) {
      PlannedUpdate& other = updates_[update_of_[target]];
      if (other.terms == 2) throw std::logic_error("three updates of one block in a level");
      other.term[other.terms++] = term;
      return;
    }
    update_of_[target] = static_cast<int>(updates_.size());
    PlannedUpdate update{};
    update.target = target;
    update.from_original = left ? step.left_first : step.right_first;
    update.terms = 1;
    update.term[0] = term;
    updates_.push_back(update);
  }

  void close_level(int stage, int eliminations_begin) {
    PlannedLevel level;
    level.stage = stage;
    level.eliminations_begin = eliminations_begin;
    level.eliminations_end = static_cast<int>(plan_.eliminations.size());
    level.updates_begin = static_cast<int>(plan_.updates.size());
    plan_.updates.insert(plan_.updates.end(), updates_.begin(), updates_.end());
    level.fills_begin = static_cast<int>(plan_.updates.size());
    plan_.updates.insert(plan_.updates.end(), fills_.begin(), fills_.end());
    level.updates_end = static_cast<int>(plan_.updates.size());
    plan_.levels.push_back(level);
    for (const PlannedUpdate& update : updates_) update_of_[update.target] = -1;
  }

  const Schedule& schedule_;
  std::vector<int> left_slot_, right_slot_;
  GroupPlan plan_;
  std::vector<PlannedUpdate> updates_, fills_;  // of the level in work
  std::vector<int> update_of_;                  // index in updates_ of a block's, -1: none
};

}  // namespace

GroupPlan make_group_plan(int blocks, const Schedule& schedule) {
  return Planner(blocks, schedule).finish();
}

}  // namespace trajopt::linalg
