// Factor and solve of symmetric block tridiagonal systems over the shapes that occur, in GFLOP/s of
// the sequential sweep's count (7/3 B^3 a block), which is what every ordering is worth.
//
// The peer is the same sweep through dpotrf, dtrsm and dsyrk of the library that the environment
// variable TRAJOPT_BENCH_LAPACK names (MKL's libmkl_rt.so, an OpenBLAS, the one inside SciPy's
// wheel); its rows are absent without one. OpenBLAS may need OPENBLAS_CORETYPE=SkylakeX to use
// AVX-512 on a recent AMD processor, and every library one thread.
#include <benchmark/benchmark.h>
#include <dlfcn.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "trajopt/linalg/factorization.h"

namespace {

using namespace trajopt::linalg;

void fill(SymmetricBlockTridiagonal& a, const std::vector<signed char>& signs) {
  std::mt19937_64 generator(1);
  std::normal_distribution<double> normal;
  const int size = a.size();
  for (int i = 0; i < a.blocks(); ++i) {
    for (int r = 0; r < size; ++r) {
      double* row = a.diagonal(i) + static_cast<long>(r) * size;
      for (int s = 0; s < r; ++s) row[s] = normal(generator);
      row[r] = 4.0 * size * signs[static_cast<long>(i) * size + r];
    }
    for (long k = 0; i + 1 < a.blocks() && k < static_cast<long>(size) * size; ++k) {
      a.lower(i)[k] = normal(generator);
    }
  }
}

std::vector<signed char> make_signs(int blocks, int size, bool definite) {
  std::vector<signed char> signs(static_cast<std::size_t>(blocks) * size, 1);
  for (std::size_t i = 0; !definite && i < signs.size(); i += 3) signs[i] = -1;
  return signs;
}

void report(benchmark::State& state, double flops) {
  state.counters["GFLOP/s"] = benchmark::Counter(
      flops * static_cast<double>(state.iterations()) * 1e-9, benchmark::Counter::kIsRate);
}

double sweep_flops(int blocks, int size) { return 7.0 / 3.0 * blocks * size * size * size; }

void factor(benchmark::State& state, Ordering ordering, bool definite) {
  const int blocks = static_cast<int>(state.range(0)), size = static_cast<int>(state.range(1));
  const int threads = static_cast<int>(state.range(2));
  SymmetricBlockTridiagonal a(blocks, size);
  const auto signs = make_signs(blocks, size, definite);
  fill(a, signs);
  Factorization f(blocks, size, ordering);
  for (auto _ : state) f.factor(a, definite ? nullptr : signs.data(), 0.0, threads);
  report(state, sweep_flops(blocks, size));
}

void solve(benchmark::State& state, Ordering ordering) {
  const int blocks = static_cast<int>(state.range(0)), size = static_cast<int>(state.range(1));
  const int threads = static_cast<int>(state.range(2));
  SymmetricBlockTridiagonal a(blocks, size);
  const auto signs = make_signs(blocks, size, true);
  fill(a, signs);
  Factorization f(blocks, size, ordering);
  f.factor(a);
  std::vector<double> x(a.rows(), 1.0);
  for (auto _ : state) {
    x.assign(x.size(), 1.0);
    f.solve(x.data(), 1, threads);
    benchmark::DoNotOptimize(x.data());
  }
  report(state, 6.0 * blocks * size * size);
}

constexpr int kShapes[][2] = {{200, 40}, {200, 48}, {200, 82},  {20, 96},  {80, 72},
                              {20, 176}, {512, 64}, {2048, 32}, {8192, 16}};

void one_thread(benchmark::internal::Benchmark* b) {
  b->ArgNames({"n", "B", "threads"})->Unit(benchmark::kMillisecond)->UseRealTime();
  for (const auto& shape : kShapes) b->Args({shape[0], shape[1], 1});
}

void two_threads(benchmark::internal::Benchmark* b) {
  b->ArgNames({"n", "B", "threads"})->Unit(benchmark::kMillisecond)->UseRealTime();
  for (const auto& shape : kShapes) {
    for (int threads : {1, 2}) b->Args({shape[0], shape[1], threads});
  }
}

BENCHMARK_CAPTURE(factor, sequential_spd, Ordering::sequential, true)->Apply(one_thread);
BENCHMARK_CAPTURE(factor, sequential_quasidefinite, Ordering::sequential, false)->Apply(one_thread);
BENCHMARK_CAPTURE(factor, chunked_spd, Ordering::chunked, true)->Apply(two_threads);
BENCHMARK_CAPTURE(factor, cyclic_spd, Ordering::cyclic, true)->Apply(two_threads);
BENCHMARK_CAPTURE(solve, sequential, Ordering::sequential)->Apply(one_thread);
BENCHMARK_CAPTURE(solve, chunked, Ordering::chunked)->Apply(two_threads);

// The update alone, from cache: what share of the FMA peak the register tiles reach.
void update(benchmark::State& state) {
  const int size = static_cast<int>(state.range(0));
  const long ld = padded(size);
  const BlockBuffer c(size * ld), v(size * ld), u(size * ld);
  const BlockKernels& kernels = block_kernels(trajopt::active_isa());
  for (auto _ : state) {
    kernels.update(size, size, size, c.data(), ld, c.data(), ld, v.data(), ld, u.data(), ld, false);
    benchmark::ClobberMemory();
  }
  report(state, 2.0 * size * size * size);
}
BENCHMARK(update)->Arg(24)->Arg(40)->Arg(48)->Arg(82)->Arg(96)->Arg(176);

// Block Thomas in place, on a copy that is refreshed outside the clock.
struct Lapack {
  using Potrf = void (*)(const char*, const int*, double*, const int*, int*);
  using Trsm = void (*)(const char*, const char*, const char*, const char*, const int*, const int*,
                        const double*, const double*, const int*, double*, const int*);
  using Syrk = void (*)(const char*, const char*, const int*, const int*, const double*,
                        const double*, const int*, const double*, double*, const int*);
  Potrf potrf = nullptr;
  Trsm trsm = nullptr;
  Syrk syrk = nullptr;

  explicit Lapack(const char* path) {
    void* library = dlopen(path, RTLD_NOW | RTLD_GLOBAL);
    if (!library) return;
    // SciPy's wheel prefixes its symbols.
    const auto find = [&](const std::string& name) {
      void* symbol = dlsym(library, name.c_str());
      return symbol ? symbol : dlsym(library, ("scipy_" + name).c_str());
    };
    potrf = reinterpret_cast<Potrf>(find("dpotrf_"));
    trsm = reinterpret_cast<Trsm>(find("dtrsm_"));
    syrk = reinterpret_cast<Syrk>(find("dsyrk_"));
  }
  bool found() const { return potrf && trsm && syrk; }
};

void lapack_factor(benchmark::State& state, const Lapack& lapack) {
  const int blocks = static_cast<int>(state.range(0)), size = static_cast<int>(state.range(1));
  SymmetricBlockTridiagonal a(blocks, size), work(blocks, size);
  fill(a, make_signs(blocks, size, true));
  const long entries = static_cast<long>(size) * size;
  const double one = 1.0, minus = -1.0;
  int info = 0;
  for (auto _ : state) {
    state.PauseTiming();
    std::copy_n(a.diagonal(0), blocks * entries, work.diagonal(0));
    std::copy_n(a.lower(0), (blocks - 1) * entries, work.lower(0));
    state.ResumeTiming();
    // Row-major lower triangles are column-major upper ones, A = Ut U, and the last block goes
    // first: a row-major lower(i) is then what dtrsm solves for without a transposition.
    for (int i = blocks - 1;; --i) {
      lapack.potrf("U", &size, work.diagonal(i), &size, &info);
      if (info != 0 || i == 0) break;
      double* s = work.lower(i - 1);  // column-major: A[i-1, i]
      lapack.trsm("R", "U", "N", "N", &size, &size, &one, work.diagonal(i), &size, s, &size);
      lapack.syrk("U", "N", &size, &size, &minus, s, &size, &one, work.diagonal(i - 1), &size);
    }
    if (info != 0) state.SkipWithError("dpotrf failed");
  }
  report(state, sweep_flops(blocks, size));
}

const bool registered = [] {
  const char* path = std::getenv("TRAJOPT_BENCH_LAPACK");
  static const Lapack lapack(path ? path : "");
  if (path && lapack.found()) {
    one_thread(benchmark::RegisterBenchmark(
        "lapack_factor", [](benchmark::State& state) { lapack_factor(state, lapack); }));
  }
  return true;
}();

}  // namespace
