// Tables of kernels that are compiled once per instruction set, and the choice among them.
#pragma once

#include <algorithm>

#include "trajopt/base/isa.h"

namespace trajopt {

// A table's variants; null where one was not compiled.
template <class Table>
struct KernelVariants {
  const Table* portable;
  const Table* avx2;
  const Table* avx512;

  // The variant that runs; none beyond `most`.
  const Table& active(Isa most = Isa::avx512) const {
    const Isa isa = std::min(active_isa(), most);
    if (avx512 && isa == Isa::avx512) return *avx512;
    if (avx2 && isa >= Isa::avx2) return *avx2;
    return *portable;
  }
};

}  // namespace trajopt

// Declares the tables `name` of a type, which *_kernels.cpp define in the namespaces of their
// instruction sets within the one at hand, and the function `variants()` that returns them.
#ifdef TRAJOPT_X86
#define TRAJOPT_KERNEL_TABLE(Type, name, variants)        \
  inline namespace portable {                             \
  extern const Type name;                                 \
  }                                                       \
  namespace avx2 {                                        \
  extern const Type name;                                 \
  }                                                       \
  namespace avx512 {                                      \
  extern const Type name;                                 \
  }                                                       \
  inline ::trajopt::KernelVariants<Type> variants() {     \
    return {&portable::name, &avx2::name, &avx512::name}; \
  }
#else
#define TRAJOPT_KERNEL_TABLE(Type, name, variants) \
  inline namespace portable {                      \
  extern const Type name;                          \
  }                                                \
  inline ::trajopt::KernelVariants<Type> variants() { return {&portable::name, nullptr, nullptr}; }
#endif
