// Pairs of spheres are found whatever is left out on the way to them: a run of pairs that its hull
// rules out holds none that overlaps.
#include <gtest/gtest.h>

#include <cmath>

#include "problem/fixtures.h"
#include "trajopt/dynamics/batch.h"

namespace trajopt {
namespace {

// Spheres along the trunk, the leg, and the hand of the character: many poses apart, some not.
Model character_with_spheres() {
  Model m = test::make_character();
  const int leg = 4, hand = static_cast<int>(m.joints.size()) - 1, base = 3;
  for (int k = 0; k < 4; ++k) m.spheres.push_back({base, {0.1 * k, 0.05 * k, 0.0}, 0.08});
  for (int k = 0; k < 4; ++k)
    m.spheres.push_back({leg, {0.0, 0.02 * k, -0.15 * k}, 0.05 + 0.01 * k});
  for (int k = 0; k < 4; ++k) m.spheres.push_back({hand, {0.08 * k, 0.0, -0.1}, 0.07});
  for (int a = 0; a < 12; ++a)
    for (int b = a + 1; b < 12; ++b)
      if (m.spheres[a].joint != m.spheres[b].joint) m.pairs.push_back({a, b});
  finalize(m);
  return m;
}

struct Forces {
  std::vector<double> fd, jacobian;
};

Forces forces(const Model& m, const Physics& physics, const std::vector<double>& x, long n) {
  const std::size_t d = m.ndof;
  const std::vector<double> dt(n, 0.1);
  std::vector<double> other[2];
  Forces out{std::vector<double>(n * d), std::vector<double>(n * d * d)};
  for (std::vector<double>& o : other) o.resize(n * d * d);
  DynamicsBatch b{.count = n,
                  .x = x.data() + 2 * d,
                  .x1 = x.data() + d,
                  .x2 = x.data(),
                  .dt = dt.data(),
                  .dt_before = dt.data(),
                  .fd = out.fd.data()};
  b.jacobians[0] = other[0].data();
  b.jacobians[1] = out.jacobian.data();
  b.jacobians[2] = other[1].data();
  dynamics_batch(m, physics, b, 1);
  return out;
}

TEST(SelfCollision, NoPairIsLostBehindAHull) {
  const Model m = character_with_spheres();
  ASSERT_LT(m.runs.size(), m.pairs.size());
  Model every = m;  // each pair by itself, and tested wherever its spheres are
  every.runs.clear();
  for (int k = 0; k < static_cast<int>(m.pairs.size()); ++k)
    every.runs.push_back({k, k + 1, m.pairs[k].a, 0, HUGE_VAL});

  const long n = 400;
  test::Random random(5);
  const std::vector<double> x = random.vector((n + 2) * m.ndof, 0.8);
  const Physics apart = test::make_physics(Integrator::linear_acceleration);
  Physics physics = apart;
  physics.self_collision = 10;
  const Forces with = forces(m, physics, x, n), all = forces(every, physics, x, n);
  EXPECT_EQ(with.fd, all.fd);
  EXPECT_EQ(with.jacobian, all.jacobian);

  const Forces without = forces(m, apart, x, n);
  long touching = 0;
  for (long i = 0; i < n; ++i) {
    bool same = true;
    for (int j = 0; j < m.ndof; ++j) same &= with.fd[i * m.ndof + j] == without.fd[i * m.ndof + j];
    touching += !same;
  }
  EXPECT_GT(touching, n / 20);
  EXPECT_LT(touching, n - n / 20);
}

}  // namespace
}  // namespace trajopt
