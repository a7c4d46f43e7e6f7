#include "trajopt/base/isa.h"
#include "trajopt/problem/frame_kernels.h"
#include "trajopt/problem/node_kernels.h"

namespace trajopt {

namespace portable {
extern const FrameKernels kFrameKernels;
extern const NodeKernels kNodeKernels;
}
#ifdef TRAJOPT_X86
namespace avx2 {
extern const FrameKernels kFrameKernels;
extern const NodeKernels kNodeKernels;
}
namespace avx512 {
extern const FrameKernels kFrameKernels;
extern const NodeKernels kNodeKernels;
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

const NodeKernels& node_kernels() {
#ifdef TRAJOPT_X86
  switch (active_isa()) {
    case Isa::avx512:
      return avx512::kNodeKernels;
    case Isa::avx2:
      return avx2::kNodeKernels;
    default:
      break;
  }
#endif
  return portable::kNodeKernels;
}

}  // namespace trajopt
