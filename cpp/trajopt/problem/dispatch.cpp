#include "trajopt/base/isa.h"
#include "trajopt/problem/frame_kernels.h"

namespace trajopt {

namespace portable {
extern const FrameKernels kFrameKernels;
}
#ifdef TRAJOPT_X86
namespace avx2 {
extern const FrameKernels kFrameKernels;
}
namespace avx512 {
extern const FrameKernels kFrameKernels;
}
#endif

const FrameKernels& frame_kernels() {
#ifdef TRAJOPT_X86
  switch (active_isa()) {
    case Isa::avx512:
      return avx512::kFrameKernels;
    case Isa::avx2:
      return avx2::kFrameKernels;
    default:
      break;
  }
#endif
  return portable::kFrameKernels;
}

}  // namespace trajopt
