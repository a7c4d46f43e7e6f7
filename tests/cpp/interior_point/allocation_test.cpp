// Between the first and the last iteration nothing is allocated.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "interior_point/analytic.h"

namespace {
std::atomic<long> allocations{0};
}

void* operator new(std::size_t bytes) {
  ++allocations;
  if (void* p = std::malloc(bytes ? bytes : 1)) return p;
  throw std::bad_alloc();
}
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  ++allocations;
  const std::size_t step = static_cast<std::size_t>(alignment);
  if (void* p = std::aligned_alloc(step, (bytes + step - 1) / step * step)) return p;
  throw std::bad_alloc();
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
void operator delete(void* p, std::align_val_t) noexcept { std::free(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { std::free(p); }

namespace trajopt::interior_point {
namespace {

TEST(Allocation, NoneInTheIterations) {
  using test::Analytic;
  using test::Sample;
  constexpr int kStages = 20;
  Analytic a(kStages + 1, 2, 1);
  a.add(a.problem.stages, 2, kStages, {0}, {0}, [](int, Sample& s, double f, const double* l) {
    const double u = s.v[1], p = s.v[4];
    s.cost = 0.05 * u * u;
    s.gradient[1] = 0.1 * u;
    s.c[0] = s.v[2] - s.v[0] - 0.05 * u * p;
    s.jacobian[0] = -1;
    s.jacobian[1] = -0.05 * p;
    s.jacobian[2] = 1;
    s.jacobian[4] = -0.05 * u;
    s.hessian[1 * 5 + 1] = 0.1 * f;
    s.hessian[4 * 5 + 1] = -0.05 * l[0];
  });
  a.problem.lower[0] = a.problem.upper[0] = 0;
  a.problem.lower[2 * kStages] = a.problem.upper[2 * kStages] = 1;
  a.problem.lower[2 * kStages + 2] = 0.5;
  a.problem.upper[2 * kStages + 2] = 2.0;
  for (int k = 0; k <= kStages; ++k) a.problem.upper[2 * k + 1] = 0.8;
  Point point{std::vector<double>(2 * kStages + 3, 0.3), {}, {}};
  point.x.back() = 1.0;
  long first = 0, last = 0;
  const Outcome out = a.solve(point, {}, [&](const Record& r, const double*) {
    if (r.iteration == 1) first = allocations;
    last = allocations;
    return true;
  });
  EXPECT_EQ(out.status, Status::solved) << out.message;
  EXPECT_GT(out.iterations, 3);
  EXPECT_EQ(last - first, 0);
}

}  // namespace
}  // namespace trajopt::interior_point
