// The factorization on a GPU against the one on the processor, bit for bit. Needs a GPU.
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "linalg/random_matrix.h"
#include "trajopt/base/error.h"
#include "trajopt/cuda/linalg/factorization.h"
#include "trajopt/cuda/linalg/launches.h"
#include "trajopt/linalg/factorization.h"

namespace trajopt {
namespace {

using linalg::Ordering;
using linalg::Precision;
using linalg::Refinement;
using linalg::SymmetricBlockTridiagonal;
using test::fill_random;
using test::mixed_signs;
using test::random_vector;
using Values = std::vector<double>;

constexpr Ordering kOrderings[] = {Ordering::sequential, Ordering::cyclic, Ordering::chunked};
constexpr Precision kPrecisions[] = {Precision::float64, Precision::float32};

linalg::Factorization on_processor(int blocks, int size, Ordering ordering, int chunks, int batch,
                                   Precision precision) {
  return linalg::Factorization(blocks, size, ordering, chunks, batch, Isa::avx512, precision);
}

bool same(const Values& a, const Values& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}

struct Problem {
  SymmetricBlockTridiagonal a;
  std::vector<signed char> signs;
  Problem(int blocks, int size, int batch, unsigned seed) : a(blocks, size, batch) {
    const auto one = mixed_signs(a.rows(), size);
    for (int item = 0; item < batch; ++item) signs.insert(signs.end(), one.begin(), one.end());
    fill_random(a, signs.data(), seed);
  }
  long values(int m) const { return a.batch() * a.rows() * m; }
};

void compare_in(Precision precision, int blocks, int size, int batch, Ordering ordering, int chunks,
                const std::vector<int>& columns) {
  SCOPED_TRACE(std::to_string(batch) + " x " + std::to_string(blocks) + " blocks of " +
               std::to_string(size) + ", " + linalg::ordering_name(ordering) + ", " +
               linalg::precision_name(precision));
  linalg::Factorization cpu = on_processor(blocks, size, ordering, chunks, batch, precision);
  cuda::Factorization gpu(blocks, size, ordering, chunks, batch, precision);
  ASSERT_EQ(gpu.precision(), precision);
  // Twice: the second one launches the graph that the first one captured.
  for (unsigned round = 1; round <= 2; ++round) {
    const Problem p(blocks, size, batch, round);
    const double regularization = 1e-2 * round;
    cpu.factor(p.a, p.signs.data(), regularization, 2);
    gpu.factor(p.a, p.signs.data(), regularization);
    for (int m : columns) {
      const Values rhs = random_vector(p.values(m), 2);
      Values x = rhs, y = rhs;
      cpu.solve(x.data(), m);
      gpu.solve(y.data(), m);
      ASSERT_TRUE(same(x, y)) << "solve with " << m << " columns";
      for (int steps : {0, 1, 20}) {
        Values better = x, other = x;
        const Refinement e = cpu.refine(p.a, rhs.data(), better.data(), m, steps, 1e-15);
        const Refinement f = gpu.refine(p.a, rhs.data(), other.data(), m, steps, 1e-15);
        ASSERT_EQ(f.steps, e.steps);
        ASSERT_TRUE(same({f.residual}, {e.residual}));
        ASSERT_TRUE(same(better, other)) << "refine with " << m << " columns";
      }
    }
  }
}

void compare(int blocks, int size, int batch, Ordering ordering, int chunks,
             const std::vector<int>& columns = {1, 1, 3, 17}) {
  for (Precision precision : kPrecisions) {
    compare_in(precision, blocks, size, batch, ordering, chunks, columns);
  }
}

TEST(DeviceFactorization, EveryOrderingAndLength) {
  for (int blocks : {1, 2, 3, 5, 8, 16, 17, 31, 100}) {
    for (Ordering ordering : kOrderings) {
      compare(blocks, 12, 1, ordering, 3);
      compare(blocks, 5, 7, ordering, 2);
      if (HasFatalFailure()) return;
    }
  }
}

TEST(DeviceFactorization, SizesOfBlocks) {
  for (int size = 1; size <= 256; size += size < 80 ? 1 : 16) {
    compare(4, size, 1, Ordering::cyclic, 1, {size % 2 == 0 ? 1 : 9});
    if (HasFatalFailure()) return;
  }
  compare(3, 255, 2, Ordering::chunked, 2, {1});
  compare(3, 256, 2, Ordering::chunked, 2, {5});
}

TEST(DeviceFactorization, NoProblemsAtAll) { compare(4, 3, 0, Ordering::cyclic, 1); }

// Right-hand sides and matrices beyond float32's range, and columns of zeros.
TEST(DeviceFactorization, RangeOfFloat32) {
  const Problem p(150, 8, 2, 7);
  const int m = 10;
  for (Ordering ordering : kOrderings) {
    linalg::Factorization cpu = on_processor(150, 8, ordering, 2, 2, Precision::float32);
    cuda::Factorization gpu(150, 8, ordering, 2, 2, Precision::float32);
    cpu.factor(p.a, p.signs.data());
    gpu.factor(p.a, p.signs.data());
    Values rhs = random_vector(p.values(m), 8);
    const double scales[m] = {1.0, 1e300, 1e-300, 1e-320, 0.0, 1e40, 1e-50, -3.0, 5e37, 1e-38};
    for (std::size_t i = 0; i < rhs.size(); ++i) rhs[i] *= scales[i % m];
    Values x = rhs, y = rhs;
    cpu.solve(x.data(), m);
    gpu.solve(y.data(), m);
    EXPECT_TRUE(same(x, y));
    cpu.refine(p.a, rhs.data(), x.data(), m, 10, 1e-15);
    gpu.refine(p.a, rhs.data(), y.data(), m, 10, 1e-15);
    EXPECT_TRUE(same(x, y));
  }
}

// The room for rounded columns grows; what was recorded with the old one is recorded anew.
TEST(DeviceFactorization, ColumnsThatGrowInNumber) {
  const Problem p(6, 10, 1, 9);
  linalg::Factorization cpu = on_processor(6, 10, Ordering::cyclic, 1, 1, Precision::float32);
  cuda::Factorization gpu(6, 10, Ordering::cyclic, 1, 1, Precision::float32);
  cpu.factor(p.a, p.signs.data());
  gpu.factor(p.a, p.signs.data());
  for (int m : {2, 2, 9, 2, 30, 30}) {
    const Values rhs = random_vector(p.values(m), m);
    Values x = rhs, y = rhs;
    cpu.solve(x.data(), m);
    gpu.solve(y.data(), m);
    EXPECT_TRUE(same(x, y)) << m;
    gpu.reserve_refinement(m + 3);
    gpu.solve(y.data(), m);
    cpu.solve(x.data(), m);
    EXPECT_TRUE(same(x, y)) << m;
  }
}

TEST(DeviceFactorization, Float32TakesHalfTheMemory) {
  const cuda::Factorization wide(50, 64, Ordering::cyclic);
  const cuda::Factorization narrow(50, 64, Ordering::cyclic, 2, 1, Precision::float32);
  const double share = static_cast<double>(narrow.device_bytes()) / wide.device_bytes();
  EXPECT_NEAR(share, 0.5, 0.01);
  cuda::Factorization used(50, 64, Ordering::cyclic, 2, 1, Precision::float32);
  used.reserve_solution(3);
  // Rounded columns, and two doubles for each.
  EXPECT_EQ(used.device_bytes() - narrow.device_bytes(), 3 * (50 * 64 * 4 + 2 * 8));
}

// The interface that stays on the device, in a graph of the caller's own.
void in_a_graph(Precision precision) {
  const Problem p(20, 24, 3, 5);
  linalg::Factorization cpu = on_processor(20, 24, Ordering::cyclic, 1, 3, precision);
  cuda::Factorization gpu(20, 24, Ordering::cyclic, 1, 3, precision);
  const Values rhs = random_vector(p.values(2), 6);
  const cuda::Stream stream;
  cuda::BlockTridiagonal a(20, 24, 3);
  cuda::DeviceBuffer<signed char> signs(p.signs.size());
  cuda::DeviceBuffer<double> regularization(1), b(rhs.size()), x(rhs.size());
  cuda::PinnedBuffer<double> value(1);
  gpu.reserve_refinement(2);
  const cuda::Graph graph = cuda::Graph::capture(stream, [&] {
    regularization.upload(value.data(), 1, stream);
    gpu.enqueue_factor(a, signs.data(), regularization.data(), stream);
    x.copy_from(b, rhs.size(), stream);
    gpu.enqueue_solve(x.data(), 2, stream);
    gpu.enqueue_refine(a, b.data(), x.data(), 2, 4, 1e-15, stream);
  });
  a.upload(p.a, stream);
  signs.upload(p.signs.data(), p.signs.size(), stream);
  b.upload(rhs.data(), rhs.size(), stream);
  for (double shift : {0.0, 1e-3, 0.5}) {
    value[0] = shift;
    graph.launch(stream);
    gpu.check(p.signs.data(), shift, stream);
    Values actual(rhs.size()), expected = rhs;
    x.download(actual.data(), actual.size(), stream);
    const Refinement f = gpu.refinement(stream);
    cpu.factor(p.a, p.signs.data(), shift);
    cpu.solve(expected.data(), 2);
    const Refinement e = cpu.refine(p.a, rhs.data(), expected.data(), 2, 4, 1e-15);
    EXPECT_EQ(f.steps, e.steps);
    EXPECT_TRUE(same(actual, expected));
  }
}

TEST(DeviceFactorization, InAGraph) {
  for (Precision precision : kPrecisions) in_a_graph(precision);
}

void same_block_pivot_and_words(Precision precision) {
  const double bad[] = {std::nan(""), INFINITY, 0.0, -1e3, 1e39};
  for (int where = 0; where < 9; ++where) {
    for (double value : bad) {
      SymmetricBlockTridiagonal a(9, 11, 2);
      fill_random(a, nullptr, 11);
      a.diagonal(where, 1)[5 * 11 + 5] = value;
      a.diagonal((where * 2) % 9, 1)[2 * 11 + 2] = value;
      for (Ordering ordering : kOrderings) {
        linalg::Factorization cpu = on_processor(9, 11, ordering, 3, 2, precision);
        cuda::Factorization gpu(9, 11, ordering, 3, 2, precision);
        std::string expected = "none", actual = "none";
        try {
          cpu.factor(a);
        } catch (const FactorizationError& error) {
          expected = error.what();
        }
        try {
          gpu.factor(a);
        } catch (const FactorizationError& error) {
          actual = error.what();
        }
        EXPECT_EQ(actual, expected);
        Values x(2 * a.rows(), 1.0);
        const bool refused = precision == Precision::float32 || value != 1e39;
        EXPECT_EQ(actual != "none", refused) << value;
        if (refused) {
          EXPECT_THROW(gpu.solve(x.data()), ArgumentError);
        }
        // It recovers.
        SymmetricBlockTridiagonal good(9, 11, 2);
        fill_random(good, nullptr, 12);
        gpu.factor(good);
        gpu.solve(x.data());
        for (double v : x) EXPECT_TRUE(std::isfinite(v));
      }
    }
  }
}

TEST(DeviceFactorizationFailure, SameBlockPivotAndWords) {
  for (Precision precision : kPrecisions) same_block_pivot_and_words(precision);
}

// What docs/cuda.md says of the smallest GPU supported, of compute capability 7.5.
TEST(DeviceFactorization, SharedMemoryOfTheLargestBlocks) {
  EXPECT_LE(cuda::linalg_shared_memory<double>(490), std::size_t{64} << 10);
  EXPECT_LE(cuda::linalg_shared_memory<float>(720), std::size_t{64} << 10);
}

TEST(DeviceFactorizationFailure, TooLarge) {
  try {
    cuda::Factorization(10000, 200, Ordering::cyclic, 1, 10000);
    ADD_FAILURE();
  } catch (const DeviceError& error) {
    EXPECT_NE(std::string(error.what()).find("asked for"), std::string::npos) << error.what();
  }
  EXPECT_THROW(cuda::Factorization(1, 100000), DeviceError);
  EXPECT_THROW(cuda::Factorization(1, 100000, Ordering::cyclic, 1, 1, Precision::float32),
               DeviceError);
  compare(3, 8, 1, Ordering::cyclic, 1);
}

TEST(DeviceFactorizationFailure, Arguments) {
  EXPECT_THROW(cuda::Factorization(0, 3), ArgumentError);
  EXPECT_THROW(cuda::Factorization(3, 3, Ordering::chunked, 0), ArgumentError);
  cuda::Factorization gpu(4, 2);
  EXPECT_THROW(gpu.factor(SymmetricBlockTridiagonal(3, 2)), ArgumentError);
  const cuda::Stream stream;
  const cuda::BlockTridiagonal a(4, 2);
  EXPECT_THROW(gpu.enqueue_refine(a, nullptr, nullptr, 3, 1, 0.0, stream), ArgumentError);
  cuda::Factorization narrow(4, 2, Ordering::cyclic, 1, 1, Precision::float32);
  narrow.reserve_solution(2);
  EXPECT_THROW(narrow.enqueue_solve(nullptr, 3, stream), ArgumentError);
}

}  // namespace
}  // namespace trajopt
