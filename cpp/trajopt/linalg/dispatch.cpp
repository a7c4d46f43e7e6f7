#include "trajopt/linalg/block_kernels.h"

namespace trajopt::linalg {

namespace portable {
extern const BlockKernels kBlockKernels;
}
#ifdef TRAJOPT_X86
namespace avx2 {
extern const BlockKernels kBlockKernels;
}
namespace avx512 {
extern const BlockKernels kBlockKernels;
}
#endif

const BlockKernels& block_kernels(Isa isa) {
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

}  // namespace trajopt::linalg
