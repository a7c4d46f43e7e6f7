// How many multiply-adds one core can do: independent chains in registers, no memory.
// Prints GFLOP/s; compiled and run by bench/_cost.py.
#include <chrono>
#include <cstdio>

#if defined(__AVX512F__)
using Vector = double __attribute__((vector_size(64)));
#else
using Vector = double __attribute__((vector_size(32)));
#endif

int main() {
  constexpr int kChains = 12;  // two units with a latency of four or five cycles
  constexpr int kLanes = sizeof(Vector) / sizeof(double);
  constexpr long kSteps = 20'000'000;
  Vector a[kChains], scale, shift;
  for (int l = 0; l < kLanes; ++l) {
    scale[l] = 0.999999;
    shift[l] = 1e-6;
    for (int c = 0; c < kChains; ++c) a[c][l] = c + l;
  }
  double best = 0, sum = 0;
  for (int repeat = 0; repeat < 5; ++repeat) {
    const auto begin = std::chrono::steady_clock::now();
    for (long s = 0; s < kSteps; ++s) {
      for (int c = 0; c < kChains; ++c) a[c] = a[c] * scale + shift;
    }
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    const double rate = 2.0 * kChains * kLanes * kSteps / elapsed.count() * 1e-9;
    best = rate > best ? rate : best;
    for (int c = 0; c < kChains; ++c) sum += a[c][0];
  }
  std::printf("%.1f\n", best);
  return sum == 12345.0;  // the sum is used, so the loop stays
}
