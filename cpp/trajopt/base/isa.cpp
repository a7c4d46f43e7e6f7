#include "trajopt/base/isa.h"

#include <cstdlib>
#include <cstring>
#include <initializer_list>

namespace trajopt {

namespace {

Isa detect() {
  Isa best = Isa::portable;
#ifdef TRAJOPT_X86
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
      __builtin_cpu_supports("bmi2")) {
    best = Isa::avx2;
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw")) {
      best = Isa::avx512;
    }
  }
#endif
  if (const char* wish = std::getenv("TRAJOPT_ISA")) {
    for (Isa isa : {Isa::portable, Isa::avx2, Isa::avx512}) {
      if (std::strcmp(wish, isa_name(isa)) == 0 && isa < best) return isa;
    }
  }
  return best;
}

}  // namespace

Isa active_isa() {
  static const Isa isa = detect();
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
