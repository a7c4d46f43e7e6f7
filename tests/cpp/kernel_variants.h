// The variants of a table of kernels that this machine can run.
#pragma once

#include <utility>
#include <vector>

#include "trajopt/base/isa.h"

namespace trajopt::test {

// (name, table) of every instruction set there is here, whatever TRAJOPT_ISA says. Tables that were
// not compiled are null.
template <class Kernels>
std::vector<std::pair<const char*, const Kernels*>> kernel_variants(const Kernels* portable,
                                                                    const Kernels* avx2,
                                                                    const Kernels* avx512) {
  std::vector<std::pair<const char*, const Kernels*>> all{{isa_name(Isa::portable), portable}};
  if (avx2 && best_isa() >= Isa::avx2) all.emplace_back(isa_name(Isa::avx2), avx2);
  if (avx512 && best_isa() >= Isa::avx512) all.emplace_back(isa_name(Isa::avx512), avx512);
  return all;
}

}  // namespace trajopt::test

// Declares the tables `name` of a type and `variants()`, which lists them.
#ifdef TRAJOPT_X86
#define TRAJOPT_KERNEL_VARIANTS(type, name)                                          \
  namespace portable {                                                               \
  extern const type name;                                                            \
  }                                                                                  \
  namespace avx2 {                                                                   \
  extern const type name;                                                            \
  }                                                                                  \
  namespace avx512 {                                                                 \
  extern const type name;                                                            \
  }                                                                                  \
  inline auto variants() {                                                           \
    return test::kernel_variants<type>(&portable::name, &avx2::name, &avx512::name); \
  }
#else
#define TRAJOPT_KERNEL_VARIANTS(type, name) \
  namespace portable {                      \
  extern const type name;                   \
  }                                         \
  inline auto variants() { return test::kernel_variants<type>(&portable::name, nullptr, nullptr); }
#endif
