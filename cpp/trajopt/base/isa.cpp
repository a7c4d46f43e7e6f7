#include "trajopt/base/isa.h"

#include <cstdlib>
#include <cstring>
#include <initializer_list>

namespace trajopt {

Isa best_isa() {
#ifdef TRAJOPT_X86
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
      __builtin_cpu_supports("bmi2")) {
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw")) {
      return Isa::avx512;
    }
    return Isa::avx2;
  }
#endif
  return Isa::portable;
}

Isa active_isa() {
  static const Isa isa = [] {
    const Isa best = best_isa();
    if (const char* wish = std::getenv("TRAJOPT_ISA")) {
      for (const Isa wished : {Isa::portable, Isa::avx2}) {
        if (std::strcmp(wish, isa_name(wished)) == 0 && wished < best) return wished;
      }
    }
    return best;
  }();
  return isa;
}

const char* isa_name(Isa isa) {
  switch (isa) {
    case Isa::avx2:
      return "avx2";
    case Isa::avx512:
      return "avx512";
    default:
      return "portable";
  }
}

}  // namespace trajopt
