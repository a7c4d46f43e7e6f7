// The bordered factorization on a GPU against the one on the processor, bit for bit. Needs a GPU.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
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

  System(int blocks, int size, int border)
      : k(blocks, size),
        e(random_vector(k.rows() * border, 2)),
        f(random_vector(border * border, 3)),
        signs(mixed_signs(k.rows(), size)),
        border_signs(mixed_signs(border, border)) {
    test::fill_random(k, signs.data(), 1);
    for (double& value : e) value *= 0.1;
    for (int i = 0; i < border; ++i) {
      f[i * border + i] = border_signs[i] * (5.0 * border + k.rows());
      for (int j = i + 1; j < border; ++j) f[i * border + j] = std::nan("");
    }
  }
};

// A system in device memory.
class OnDevice {
 public:
  explicit OnDevice(const System& s)
      : k_(s.k.blocks(), s.k.size()),
        e_(s.e.size()),
        f_(s.f.size()),
        regularization_(1),
        signs_(s.signs.size()),
        border_signs_(s.border_signs.size()) {
    k_.upload(s.k, stream_);
    e_.upload(s.e.data(), s.e.size(), stream_);
    f_.upload(s.f.data(), s.f.size(), stream_);
    signs_.upload(s.signs.data(), s.signs.size(), stream_);
    border_signs_.upload(s.border_signs.data(), s.border_signs.size(), stream_);
  }
  void factor(cuda::BorderedFactorization& b, const System& s, double regularization) {
    regularization_.upload(&regularization, 1, stream_);
    b.enqueue_factor(k_, e_.data(), f_.data(), signs_.data(), border_signs_.data(),
                     regularization_.data(), stream_);
    b.check(s.signs.data(), s.border_signs.data(), regularization, stream_);
  }
  void solve(const cuda::BorderedFactorization& b, Values& z, Values& y, int m) {
    cuda::DeviceBuffer<double> device_z(z.size()), device_y(y.size());
    device_z.upload(z.data(), z.size(), stream_);
    device_y.upload(y.data(), y.size(), stream_);
    b.enqueue_solve(device_z.data(), device_y.data(), m, stream_);
    device_z.download(z.data(), z.size(), stream_);
    device_y.download(y.data(), y.size(), stream_);
    stream_.synchronize();
  }

 private:
  cuda::Stream stream_;
  cuda::BlockTridiagonal k_;
  cuda::DeviceBuffer<double> e_, f_, regularization_;
  cuda::DeviceBuffer<signed char> signs_, border_signs_;
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
      linalg::BorderedFactorization cpu(blocks, size, border, ordering, 3);
      cuda::BorderedFactorization gpu(blocks, size, border, ordering, 3);
      cpu.factor(system.k, system.e.data(), system.f.data(), system.signs.data(),
                 system.border_signs.data(), 1e-3);
      device.factor(gpu, system, 1e-3);
      EXPECT_TRUE(gpu.factored());
      for (int m : {1, 4, 11}) {
        Values z = random_vector(system.k.rows() * m, 4), y = random_vector(border * m, 5);
        Values other_z = z, other_y = y;
        cpu.solve(z.data(), y.data(), m);
        device.solve(gpu, other_z, other_y, m);
        ASSERT_TRUE(same(other_y, y)) << blocks << " " << size << " " << border << " " << m;
        ASSERT_TRUE(same(other_z, z)) << blocks << " " << size << " " << border << " " << m;
      }
    }
  }
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
      OnDevice(system).factor(gpu, system, 0.0);
    } catch (const FactorizationError& error) {
      actual = error.what();
    }
    EXPECT_NE(expected, "none");
    EXPECT_EQ(actual, expected);
    EXPECT_FALSE(gpu.factored());
  }
}

TEST(DeviceBordered, Arguments) {
  EXPECT_THROW(cuda::BorderedFactorization(3, 3, 0), ArgumentError);
  EXPECT_THROW(cuda::BorderedFactorization(3, 3, 100000), DeviceError);
}

}  // namespace
}  // namespace trajopt
