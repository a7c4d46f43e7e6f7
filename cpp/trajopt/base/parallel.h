// Loops over independent items. Work is split by index, never by who finishes first, and items do
// not share output, so the result has the same bits for every thread count.
#pragma once

#ifdef _OPENMP
#include <omp.h>
#endif

namespace trajopt {

inline int hardware_threads() {
#ifdef _OPENMP
  return omp_get_num_procs();
#else
  return 1;
#endif
}

// body(item, worker) for item in [0, count); worker in [0, threads) owns a scratch of its own.
template <class Body>
void parallel_for(long count, int threads, const Body& body) {
#ifdef _OPENMP
  if (threads > 1 && count > 1) {
#pragma omp parallel for schedule(static) num_threads(threads)
    for (long i = 0; i < count; ++i) body(i, omp_get_thread_num());
    return;
  }
#else
  (void)threads;
#endif
  for (long i = 0; i < count; ++i) body(i, 0);
}

}  // namespace trajopt
