// An iteration runs hundreds of times a second: once its vectors exist it must not allocate.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "solver/flight.h"
#include "trajopt/solver/funnel_sqp.h"

namespace {
std::atomic<long> allocations{0};
}

// Not inlined: GCC would take free() for a mismatch with operator new.
[[gnu::noinline]] void* operator new(std::size_t bytes) {
  ++allocations;
  if (void* p = std::malloc(bytes ? bytes : 1)) return p;
  throw std::bad_alloc();
}
[[gnu::noinline]] void* operator new(std::size_t bytes, std::align_val_t alignment) {
  ++allocations;
  const std::size_t step = static_cast<std::size_t>(alignment);
  if (void* p = std::aligned_alloc(step, (bytes + step - 1) / step * step)) return p;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* p) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
[[gnu::noinline]] void operator delete(void* p, std::size_t, std::align_val_t) noexcept {
  std::free(p);
}

namespace trajopt {
namespace {

// Allocations by iteration, steps taken and refused among them.
struct Count {
  std::vector<long> after;
  int accepted = 0, refused = 0;
};

Count count_allocations(test::Case c, const FunnelOptions& options) {
  Count count;
  count.after.reserve(1000);
  solve_funnel(*c.problem, options, c.state, [&](const IterationRecord& record, const State&) {
    if (count.after.size() >= 3) ++(record.accepted ? count.accepted : count.refused);
    count.after.push_back(allocations);
    return count.after.size() < 21;
  });
  return count;
}

TEST(Allocation, NoneInAnIteration) {
  for (int threads : {1, 2}) {
    FunnelOptions options;
    options.damping = 1e-9;  // so that steps are too long at first: some are refused
    options.objective_tolerance = 0;
    options.window = 100;
    const Count count = count_allocations(test::make_flight(Formulation::frames, threads), options);
    ASSERT_EQ(count.after.size(), 21u);
    EXPECT_GT(count.accepted, 0);
    for (std::size_t k = 3; k < count.after.size(); ++k)
      EXPECT_EQ(count.after[k] - count.after[k - 1], 0) << "iteration " << k;
  }
}

TEST(Allocation, NoneWithContactsAndEveryTerm) {
  FunnelOptions options;
  options.objective_tolerance = 0;
  options.window = 100;
  options.funnel = 1e3;
  const Count count = count_allocations(test::make_case({.frames = 30, .turn = 0.02}), options);
  ASSERT_EQ(count.after.size(), 21u);
  EXPECT_GT(count.accepted, 0);
  EXPECT_GT(count.refused, 0);
  for (std::size_t k = 3; k < count.after.size(); ++k)
    EXPECT_EQ(count.after[k] - count.after[k - 1], 0) << "iteration " << k;
}

}  // namespace
}  // namespace trajopt
