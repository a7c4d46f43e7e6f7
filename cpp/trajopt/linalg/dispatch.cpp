#include "trajopt/linalg/block_kernels.h"

namespace trajopt::linalg {

#define TRAJOPT_LINALG_TABLES(isa)                       \
  namespace isa {                                        \
  extern const BasicBlockKernels<double> kBlockKernels;  \
  extern const BasicBlockKernels<float> kBlockKernels32; \
  }

TRAJOPT_LINALG_TABLES(portable)
#ifdef TRAJOPT_X86
TRAJOPT_LINALG_TABLES(avx2)
TRAJOPT_LINALG_TABLES(avx512)
#endif

#undef TRAJOPT_LINALG_TABLES

template <>
const BasicBlockKernels<double>& block_kernels<double>(Isa isa) {
  if (active_isa() < isa) isa = active_isa();
  switch (isa) {
#ifdef TRAJOPT_X86
    case Isa::avx512:
      return avx512::kBlockKernels;
    case Isa::avx2:
      return avx2::kBlockKernels;
#endif
    default:
      return portable::kBlockKernels;
  }
}

template <>
const BasicBlockKernels<float>& block_kernels<float>(Isa isa) {
  if (active_isa() < isa) isa = active_isa();
  switch (isa) {
#ifdef TRAJOPT_X86
    case Isa::avx512:
      return avx512::kBlockKernels32;
    case Isa::avx2:
      return avx2::kBlockKernels32;
#endif
    default:
      return portable::kBlockKernels32;
  }
}

}  // namespace trajopt::linalg
