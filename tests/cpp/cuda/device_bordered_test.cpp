// The bordered factorization on a GPU against the one on the processor, bit for bit. Needs a GPU.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "linalg/random_matrix.h"
#include "trajopt/base/error.h"
#include "trajopt/cuda/linalg/bordered.h"
#include "trajopt/linalg/bordered.h"

namespace trajopt {
namespace {

using linalg::Ordering;
using linalg::SymmetricBlockTridiagonal;
using test::mixed_signs;
using test::random_vector;
using Values = std::vector<double>;

bool same(const Values& a, const Values& b) {
  return std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

struct System {
  SymmetricBlockTridiagonal k;
  Values e, f;
  std::vector<signed char> signs, border_signs;

  System(int blocks, int size, int border, unsigned seed = 1)
      : k(blocks, size),
        e(random_vector(k.rows() * border, seed + 1)),
        f(random_vector(border * border, seed + 2)),
        signs(mixed_signs(k.rows(), size)),
        border_signs(mixed_signs(border, border)) {
    test::fill_random(k, signs.data(), seed);
    for (double& value : e) value *= 0.1;
    for (int i = 0; i < border; ++i) {
      f[i * border + i] = border_signs[i] * (5.0 * border + k.rows());
      for (int j = i + 1; j < border; ++j) f[i * border + j] = std::nan("");
    }
  }
  // Zeros but in so many blocks at either end of K.
  void limit(int reach) {
    for (long i = static_cast<long>(reach) * k.size(); i < k.rows() - reach * k.size(); ++i)
      std::fill_n(e.data() + i * border(), border(), 0.0);
  }
  int border() const { return static_cast<int>(border_signs.size()); }
  long rows() const { return k.rows() + border(); }

  linalg::BorderedFactorization factored(Ordering ordering, double regularization,
                                         int reach = 0) const {
    linalg::BorderedFactorization factors(k.blocks(), k.size(), border(), ordering, 3, Isa::avx512,
                                          reach);
    factors.factor(k, e.data(), f.data(), signs.data(), border_signs.data(), regularization);
    return factors;
  }
};

// Systems of one shape in device memory.
class OnDevice {
 public:
  explicit OnDevice(std::span<const System> all)
      : count_(all.size()),
        k_(all[0].k.blocks(), all[0].k.size(), static_cast<int>(count_)),
        e_(count_ * all[0].e.size()),
        f_(count_ * all[0].f.size()),
        regularization_(1),
        listed_(count_ + 1),
        signs_(count_ * all[0].signs.size()),
        border_signs_(count_ * all[0].border_signs.size()) {
    upload(all);
  }
  explicit OnDevice(const System& s) : OnDevice(std::span(&s, 1)) {}

  void upload(std::span<const System> all) {
    SymmetricBlockTridiagonal k(k_.blocks(), k_.size(), k_.batch());
    Values e, f;
    host_signs_.clear();
    host_border_signs_.clear();
    for (std::size_t i = 0; i < count_; ++i) {
      const System& s = all[i];
      const long square = static_cast<long>(k.size()) * k.size();
      std::copy_n(s.k.diagonal(0), k.blocks() * square, k.diagonal(0, i));
      if (k.blocks() > 1) std::copy_n(s.k.lower(0), (k.blocks() - 1) * square, k.lower(0, i));
      e.insert(e.end(), s.e.begin(), s.e.end());
      f.insert(f.end(), s.f.begin(), s.f.end());
      host_signs_.insert(host_signs_.end(), s.signs.begin(), s.signs.end());
      host_border_signs_.insert(host_border_signs_.end(), s.border_signs.begin(),
                                s.border_signs.end());
    }
    k_.upload(k, stream_);
    e_.upload(e.data(), e.size(), stream_);
    f_.upload(f.data(), f.size(), stream_);
    signs_.upload(host_signs_.data(), host_signs_.size(), stream_);
    border_signs_.upload(host_border_signs_.data(), host_border_signs_.size(), stream_);
    stream_.synchronize();
  }
  // The launches from here on are for these items.
  void list(cuda::BorderedFactorization& b, std::vector<int> items) {
    const int places = static_cast<int>(items.size()) + 1;  // one stays empty
    items.insert(items.begin(), static_cast<int>(items.size()));
    listed_.upload(items.data(), items.size(), stream_);
    stream_.synchronize();
    b.list(listed_.data(), places);
  }
  void factor(cuda::BorderedFactorization& b, double regularization) {
    regularization_.upload(&regularization, 1, stream_);
    b.enqueue_factor(k_, e_.data(), f_.data(), signs_.data(), border_signs_.data(),
                     regularization_.data(), stream_);
    b.check(host_signs_.data(), host_border_signs_.data(), regularization, stream_);
  }
  void solve(const cuda::BorderedFactorization& b, Values& x, int m) {
    on_copy(x, [&](double* at) { b.enqueue_solve(at, m, stream_); });
  }
  void refine(cuda::BorderedFactorization& b, const Values& rhs, Values& x, int m, int steps,
              double tolerance) {
    b.reserve_refinement(m, stream_);
    cuda::DeviceBuffer<double> from(rhs.size());
    from.upload(rhs.data(), rhs.size(), stream_);
    on_copy(x, [&](double* at) {
      b.enqueue_refine(k_, from.data(), at, m, steps, tolerance, stream_);
    });
  }

 private:
  template <class Enqueue>
  void on_copy(Values& x, const Enqueue& enqueue) {
    cuda::DeviceBuffer<double> copy(x.size());
    copy.upload(x.data(), x.size(), stream_);
    enqueue(copy.data());
    copy.download(x.data(), x.size(), stream_);
    stream_.synchronize();
  }

  cuda::Stream stream_;
  const std::size_t count_;
  cuda::BlockTridiagonal k_;
  cuda::DeviceBuffer<double> e_, f_, regularization_;
  cuda::DeviceBuffer<int> listed_;
  cuda::DeviceBuffer<signed char> signs_, border_signs_;
  std::vector<signed char> host_signs_, host_border_signs_;
};

TEST(DeviceBordered, SameBits) {
  struct Shape {
    int blocks, size, border;
  };
  for (const auto& [blocks, size, border] :
       {Shape{1, 1, 1}, Shape{5, 6, 1}, Shape{8, 9, 3}, Shape{10, 12, 8}, Shape{6, 5, 17},
        Shape{4, 40, 40}, Shape{7, 72, 72}, Shape{3, 8, 130}}) {
    const System system(blocks, size, border);
    OnDevice device(system);
    for (Ordering ordering : {Ordering::sequential, Ordering::cyclic, Ordering::chunked}) {
      const auto cpu = system.factored(ordering, 1e-3);
      cuda::BorderedFactorization gpu(blocks, size, border, ordering, 3);
      device.factor(gpu, 1e-3);
      EXPECT_TRUE(gpu.factored());
      for (int m : {1, 4, 11}) {
        Values x = random_vector(system.rows() * m, 4), other = x;
        cpu.solve(x.data(), x.data() + system.k.rows() * m, m);
        device.solve(gpu, other, m);
        ASSERT_TRUE(same(other, x)) << blocks << " " << size << " " << border << " " << m;
      }
    }
  }
}

// Columns of rows x m, each refined on the processor by itself.
void refine_columns(linalg::BorderedFactorization& factors, const System& s, const double* rhs,
                    double* x, int m, int steps, double tolerance) {
  const long n = s.rows(), chain = s.k.rows();
  Values b(n), y(n);
  for (int j = 0; j < m; ++j) {
    for (long i = 0; i < n; ++i) b[i] = rhs[i * m + j], y[i] = x[i * m + j];
    factors.refine(s.k, s.f.data(), b.data(), b.data() + chain, y.data(), y.data() + chain, steps,
                   tolerance);
    for (long i = 0; i < n; ++i) x[i * m + j] = y[i];
  }
}

// Columns that converge at different speeds, and one with nothing to solve. With another border
// than the one that was factored no step helps, and the first has to be taken back.
TEST(DeviceBordered, SameRefinement) {
  for (int border : {1, 9, 23}) {
    for (const auto& [regularization, factor] :
         {std::pair(1e-9, 1.0), std::pair(3.0, 1.0), std::pair(200.0, 1.0), std::pair(0.1, 9.0)}) {
      System system(6, 8, border);
      OnDevice device(system);
      linalg::BorderedFactorization cpu = system.factored(Ordering::cyclic, regularization);
      cuda::BorderedFactorization gpu(6, 8, border, Ordering::cyclic);
      device.factor(gpu, regularization);
      for (double& value : system.f) value *= factor;
      device.upload(std::span(&system, 1));
      for (int m : {1, 2, 11}) {
        Values rhs = random_vector(system.rows() * m, 6);
        for (long i = 0; m > 1 && i < system.rows(); ++i) rhs[i * m + 1] = i % 4 == 0 ? 0.0 : 1e9;
        for (long i = 0; m > 2 && i < system.rows(); ++i) rhs[i * m + 2] = 0.0;
        Values x = rhs;
        cpu.solve(x.data(), x.data() + system.k.rows() * m, m);
        for (double tolerance : {0.0, 1e-10}) {
          for (int steps : {0, 1, 2, 20}) {
            Values expected = x, actual = x;
            refine_columns(cpu, system, rhs.data(), expected.data(), m, steps, tolerance);
            device.refine(gpu, rhs, actual, m, steps, tolerance);
            ASSERT_TRUE(same(actual, expected))
                << border << " " << regularization << " " << m << " " << tolerance << " " << steps;
          }
        }
      }
    }
  }
}

// The border of a ring, whose other couplings are known to be zero.
TEST(DeviceBordered, SameBitsOfALimitedReach) {
  const int m = 2;
  for (int reach : {1, 2}) {
    for (int size : {5, 40}) {
      System system(6, size, size);
      system.limit(reach);
      OnDevice device(system);
      linalg::BorderedFactorization cpu = system.factored(Ordering::cyclic, 0.3, reach);
      cuda::BorderedFactorization gpu(6, size, size, Ordering::cyclic, 2, 1, reach);
      device.factor(gpu, 0.3);
      const Values rhs = random_vector(system.rows() * m, 6);
      Values expected = rhs, actual = rhs;
      cpu.solve(expected.data(), expected.data() + system.k.rows() * m, m);
      device.solve(gpu, actual, m);
      ASSERT_TRUE(same(actual, expected)) << reach << " " << size;
      refine_columns(cpu, system, rhs.data(), expected.data(), m, 4, 0.0);
      device.refine(gpu, rhs, actual, m, 4, 0.0);
      ASSERT_TRUE(same(actual, expected)) << reach << " " << size;
    }
  }
}

// Items that are not listed keep their factors and their vectors.
TEST(DeviceBordered, SomeOfABatch) {
  const int border = 7, m = 2;
  std::vector<System> systems;
  for (unsigned seed : {1u, 11u, 21u, 31u}) systems.emplace_back(5, 6, border, seed);
  OnDevice device(systems);
  cuda::BorderedFactorization gpu(5, 6, border, Ordering::cyclic, 3, 4);
  device.factor(gpu, 1e-2);
  std::vector<linalg::BorderedFactorization> cpu;
  for (const System& s : systems) cpu.push_back(s.factored(Ordering::cyclic, 1e-2));
  const auto expect_same = [&](const std::vector<int>& listed) {
    const long each = systems[0].rows() * m, chain = systems[0].k.rows() * m;
    const Values rhs = random_vector(4 * each, 5);
    Values expected = rhs, actual = rhs;
    for (int i : listed) {
      double* x = expected.data() + i * each;
      cpu[i].solve(x, x + chain, m);
      refine_columns(cpu[i], systems[i], rhs.data() + i * each, x, m, 5, 1e-12);
    }
    device.solve(gpu, actual, m);
    device.refine(gpu, rhs, actual, m, 5, 1e-12);
    EXPECT_TRUE(same(actual, expected));
  };
  expect_same({0, 1, 2, 3});
  for (int i : {3, 1}) {
    systems[i] = System(5, 6, border, 50 + i);
    cpu[i] = systems[i].factored(Ordering::cyclic, 1e-2);
  }
  device.upload(systems);
  device.list(gpu, {3, 1});
  device.factor(gpu, 1e-2);
  expect_same({3, 1});
  device.list(gpu, {2});
  expect_same({2});
  device.list(gpu, {0, 1, 2});
  expect_same({0, 1, 2});
}

TEST(DeviceBordered, SameFailures) {
  for (int where = 0; where < 3; ++where) {
    System system(5, 4, 3);
    if (where == 0) system.k.diagonal(2)[5] = -1e3;
    if (where == 1) system.f[4] = -1e4;
    if (where == 2) system.e[7] = std::nan("");
    std::string expected = "none", actual = "none";
    linalg::BorderedFactorization cpu(5, 4, 3, Ordering::cyclic);
    cuda::BorderedFactorization gpu(5, 4, 3, Ordering::cyclic);
    try {
      cpu.factor(system.k, system.e.data(), system.f.data(), system.signs.data(),
                 system.border_signs.data());
    } catch (const FactorizationError& error) {
      expected = error.what();
    }
    try {
      OnDevice(system).factor(gpu, 0.0);
    } catch (const FactorizationError& error) {
      actual = error.what();
    }
    EXPECT_NE(expected, "none");
    EXPECT_EQ(actual, expected);
    EXPECT_FALSE(gpu.factored());
  }
}

TEST(DeviceBordered, NamesTheProblemOfABatch) {
  std::vector<System> systems;
  for (int item = 0; item < 3; ++item) systems.emplace_back(5, 4, 3);
  systems[1].f[4] = -1e4;
  cuda::BorderedFactorization gpu(5, 4, 3, Ordering::cyclic, 2, 3);
  OnDevice device(systems);
  try {
    device.factor(gpu, 0.0);
    ADD_FAILURE();
  } catch (const FactorizationError& error) {
    EXPECT_NE(std::string(error.what()).find("border (block 5) of problem 1"), std::string::npos)
        << error.what();
  }
}

TEST(DeviceBordered, Arguments) {
  EXPECT_THROW(cuda::BorderedFactorization(3, 3, 0), ArgumentError);
  EXPECT_THROW(cuda::BorderedFactorization(3, 3, 3, Ordering::cyclic, 2, 1, 2), ArgumentError);
  EXPECT_THROW(cuda::BorderedFactorization(3, 3, 100000), DeviceError);
}

}  // namespace
}  // namespace trajopt
