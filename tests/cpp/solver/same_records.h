// Two solves that are to be the same, bit for bit.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "trajopt/solver/solver.h"

namespace trajopt::test {

inline bool same_bits(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }

inline void expect_same_records(const std::vector<IterationRecord>& actual,
                                const std::vector<IterationRecord>& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  for (std::size_t k = 0; k < actual.size(); ++k) {
    const IterationRecord &a = actual[k], &e = expected[k];
    ASSERT_TRUE(same_bits(a.objective, e.objective)) << "iteration " << k;
    ASSERT_EQ(a.terms.size(), e.terms.size());
    for (std::size_t t = 0; t < a.terms.size(); ++t)
      ASSERT_TRUE(same_bits(a.terms[t], e.terms[t])) << "iteration " << k << ", term " << t;
    ASSERT_TRUE(same_bits(a.constraint_norm, e.constraint_norm)) << "iteration " << k;
    ASSERT_TRUE(same_bits(a.frame_violation, e.frame_violation)) << "iteration " << k;
    ASSERT_TRUE(same_bits(a.step_norm, e.step_norm)) << "iteration " << k;
    ASSERT_TRUE(same_bits(a.gain_ratio, e.gain_ratio)) << "iteration " << k;
    ASSERT_TRUE(same_bits(a.damping, e.damping)) << "iteration " << k;
    ASSERT_EQ(a.accepted, e.accepted) << "iteration " << k;
    ASSERT_EQ(a.ordering, e.ordering) << "iteration " << k;
  }
}

inline void expect_same_state(const State& actual, const State& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  EXPECT_EQ(std::memcmp(actual.data(), expected.data(), actual.size() * sizeof(double)), 0);
}

}  // namespace trajopt::test
