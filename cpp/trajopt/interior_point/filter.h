// Pairs (constraint violation, barrier objective) that trial points must improve on [2.3].
#pragma once

#include <vector>

namespace trajopt::interior_point {

class Filter {
 public:
  explicit Filter(int capacity) { entries_.reserve(capacity); }

  void reset(double largest_violation) {
    entries_.clear();
    largest_violation_ = largest_violation;
  }

  bool accepts(double violation, double objective) const {
    if (violation > largest_violation_) return false;
    for (const Entry& e : entries_) {
      if (violation >= e.violation && objective >= e.objective) return false;
    }
    return true;
  }

  // Entries behind the new one in both measures say nothing more and go.
  void add(double violation, double objective) {
    std::erase_if(entries_, [&](const Entry& e) {
      return e.violation >= violation && e.objective >= objective;
    });
    entries_.push_back({violation, objective});
  }

 private:
  struct Entry {
    double violation, objective;
  };
  std::vector<Entry> entries_;
  double largest_violation_ = 0.0;
};

}  // namespace trajopt::interior_point
