// Factorization and solution on a GPU against the processor, with factors of either precision.
//
//   linalg_device check                small systems of every kind: equal bits? Exit code 1 if not.
//   linalg_device bench [SECONDS]      rows of JSON, each measurement for about SECONDS (0.3)
#include <cstdlib>
#include <cstring>
#include <new>

#include "device/systems.h"
#include "device/timing.h"
#include "trajopt/base/error.h"
#include "trajopt/base/parallel.h"
#include "trajopt/cuda/base/device.h"
#include "trajopt/cuda/linalg/factorization.h"
#include "trajopt/linalg/factorization.h"

namespace trajopt::bench {
namespace {

using linalg::Ordering;
using linalg::Precision;
using linalg::SymmetricBlockTridiagonal;
using Values = std::vector<double>;

constexpr Precision kPrecisions[] = {Precision::float64, Precision::float32};

linalg::Factorization on_processor(const Shape& shape, Ordering ordering, int chunks,
                                   Precision precision) {
  return linalg::Factorization(shape.blocks, shape.size, ordering, chunks, shape.batch, Isa::avx512,
                               precision);
}

bool same(const Values& a, const Values& b) {
  return std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

// Factor, solve and refine on both; prints what differs.
bool same_bits(const Shape& shape, Ordering ordering, int m, Precision precision) {
  const auto [blocks, size, batch] = shape;
  SymmetricBlockTridiagonal a(blocks, size, batch);
  std::vector<signed char> signs;
  fill(a, &signs);
  linalg::Factorization cpu = on_processor(shape, ordering, 3, precision);
  cuda::Factorization gpu(blocks, size, ordering, 3, batch, precision);
  cpu.factor(a, signs.data(), 1e-3, 2);
  gpu.factor(a, signs.data(), 1e-3);
  const Values rhs = ramp(batch * a.rows() * m);
  Values x = rhs, y = rhs;
  cpu.solve(x.data(), m);
  gpu.solve(y.data(), m);
  const bool solved = same(x, y);
  const auto e = cpu.refine(a, rhs.data(), x.data(), m, 5, 1e-15);
  const auto f = gpu.refine(a, rhs.data(), y.data(), m, 5, 1e-15);
  const bool refined = same(x, y) && e.steps == f.steps;
  if (!solved || !refined) {
    std::printf("DIFFERENT %s: %d x (%d, %d), %s, %s, %d columns\n",
                solved ? "refinement" : "solution", batch, blocks, size,
                linalg::ordering_name(ordering), linalg::precision_name(precision), m);
  }
  return solved && refined;
}

bool same_failure(double bad, Precision precision) {
  SymmetricBlockTridiagonal a(9, 11, 3);
  fill(a, nullptr);
  a.diagonal(4, 2)[5 * 12] = bad;
  std::string expected = "none", actual = "none";
  linalg::Factorization cpu = on_processor({9, 11, 3}, Ordering::cyclic, 1, precision);
  cuda::Factorization gpu(9, 11, Ordering::cyclic, 1, 3, precision);
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
  if (actual != expected) {
    std::printf("DIFFERENT failure: '%s' instead of '%s'\n", actual.c_str(), expected.c_str());
  }
  return actual == expected && expected != "none";
}

int check() {
  bool good = true;
  int systems = 0, failures = 0;
  for (const Shape& shape :
       {Shape{1, 1, 1}, Shape{2, 3, 1}, Shape{7, 8, 1}, Shape{9, 17, 2}, Shape{16, 36, 1},
        Shape{5, 64, 1}, Shape{4, 72, 2}, Shape{3, 130, 1}, Shape{3, 256, 1}, Shape{6, 5, 40}}) {
    for (Ordering ordering : {Ordering::sequential, Ordering::cyclic, Ordering::chunked}) {
      for (int m : {1, 9}) {
        for (Precision precision : kPrecisions) {
          good = same_bits(shape, ordering, m, precision) && good;
          ++systems;
        }
      }
    }
  }
  for (double bad : {0.0, -1.0, std::nan(""), double(INFINITY)}) {
    for (Precision precision : kPrecisions) {
      good = same_failure(bad, precision) && good;
      ++failures;
    }
  }
  std::printf("%s: %d systems and %d failures against the processor\n",
              good ? "equal bits" : "NOT EQUAL", systems, failures);
  return good ? 0 : 1;
}

// 7/3 size^3 per block are needed; an ordering that buys parallelism spends more.
double needed_flops(const Shape& s) {
  return 7.0 / 3.0 * s.size * s.size * s.size * static_cast<double>(s.blocks) * s.batch;
}

void measure_gpu(Row& row, const Shape& shape, const SymmetricBlockTridiagonal& a,
                 const std::vector<signed char>& signs, Ordering ordering, Precision precision,
                 double seconds) {
  cuda::Factorization gpu(shape.blocks, shape.size, ordering, 2, shape.batch, precision);
  const cuda::Stream stream;
  cuda::BlockTridiagonal matrix(shape.blocks, shape.size, shape.batch);
  cuda::DeviceBuffer<signed char> device_signs(signs.size());
  cuda::DeviceBuffer<double> regularization(1), rhs(signs.size()), x(signs.size());
  const Values host = ramp(signs.size());
  matrix.upload(a, stream);
  device_signs.upload(signs.data(), signs.size(), stream);
  regularization.set_zero(stream);
  rhs.upload(host.data(), host.size(), stream);
  gpu.reserve_refinement(1);
  const auto factor = cuda::Graph::capture(stream, [&] {
    gpu.enqueue_factor(matrix, device_signs.data(), regularization.data(), stream);
  });
  const auto solve = cuda::Graph::capture(stream, [&] {
    x.copy_from(rhs, host.size(), stream);
    gpu.enqueue_solve(x.data(), 1, stream);
  });
  const std::string name = linalg::ordering_name(ordering);
  const Timing t = time_gpu(seconds, stream, [&] { factor.launch(stream); });
  gpu.check(signs.data(), 0.0, stream);
  row.timing("gpu_factor_" + name, t);
  row.number(("gpu_gflops_" + name).c_str(), needed_flops(shape) / t.best_ms * 1e-6);
  row.timing("gpu_solve_" + name, time_gpu(seconds, stream, [&] { solve.launch(stream); }));
  row.number(("gpu_bytes_" + name).c_str(), static_cast<double>(gpu.device_bytes()));
  Values actual(host.size()), expected = host;
  x.download(actual.data(), actual.size(), stream);
  stream.synchronize();
  linalg::Factorization cpu = on_processor(shape, ordering, 2, precision);
  cpu.factor(a, signs.data(), 0.0, hardware_threads());
  cpu.solve(expected.data(), 1, hardware_threads());
  row.flag(("same_bits_" + name).c_str(), same(actual, expected));
}

void measure_cpu(Row& row, const Shape& shape, const SymmetricBlockTridiagonal& a,
                 const std::vector<signed char>& signs, Precision precision, double seconds) {
  linalg::Factorization cpu = on_processor(shape, Ordering::automatic, 2, precision);
  const Values rhs = ramp(signs.size());
  Values x(rhs.size());
  row.text("cpu_ordering", linalg::ordering_name(cpu.ordering()));
  std::vector<int> all = {1, 2, hardware_threads()};
  all.erase(std::unique(all.begin(), all.end()), all.end());
  for (int threads : all) {
    std::string suffix = "_";
    suffix += std::to_string(threads);
    row.timing("cpu_factor" + suffix,
               time_cpu(seconds, [&] { cpu.factor(a, signs.data(), 0.0, threads); }));
    row.timing("cpu_solve" + suffix, time_cpu(seconds, [&] {
                 x = rhs;
                 cpu.solve(x.data(), 1, threads);
               }));
  }
}

Row measure(const Shape& shape, Precision precision, double seconds) {
  Row row;
  row.text("program", "linalg").text("gpu", cuda::current_device().name);
  row.number("blocks", shape.blocks).number("size", shape.size).number("batch", shape.batch);
  row.text("precision", linalg::precision_name(precision));
  row.number("cpu_threads", hardware_threads());
  try {
    SymmetricBlockTridiagonal a(shape.blocks, shape.size, shape.batch);
    std::vector<signed char> signs;
    fill(a, &signs);
    measure_gpu(row, shape, a, signs, Ordering::cyclic, precision, seconds);
    measure_gpu(row, shape, a, signs, Ordering::chunked, precision, seconds);
    measure_cpu(row, shape, a, signs, precision, seconds);
  } catch (const DeviceError& error) {
    row.text("left_out", error.what());
  } catch (const std::bad_alloc&) {
    row.text("left_out", "not enough memory on the host");
  }
  return row;
}

int bench(double seconds) {
  for (const Shape& shape : shapes()) {
    for (Precision precision : kPrecisions) measure(shape, precision, seconds).print(stdout);
  }
  return 0;
}

int run(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  try {
    cuda::require_device();
    if (what == "check" && argc == 2) return check();
    if (what == "bench" && argc <= 3) return bench(argc > 2 ? std::atof(argv[2]) : 0.3);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  std::fprintf(stderr, "usage: %s check | bench [SECONDS]\n", argv[0]);
  return 2;
}

}  // namespace
}  // namespace trajopt::bench

int main(int argc, char** argv) { return trajopt::bench::run(argc, argv); }
