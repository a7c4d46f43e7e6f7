#include "trajopt/problem/frame_body.h"

namespace trajopt {
inline namespace TRAJOPT_ISA {
namespace {

#if defined(__AVX512F__)
using Lane = Pack<8>;
#elif defined(__AVX2__)
using Lane = Pack<4>;
#else
using Lane = Pack<2>;
#endif

void evaluate(const FrameInput& in, long begin, int count, void* scratch, const FrameOutput& out) {
  run_frames<Lane, false>(in, begin, count, scratch, out);
}
void linearize(const FrameInput& in, long begin, int count, void* scratch, const FrameOutput& out) {
  run_frames<Lane, true>(in, begin, count, scratch, out);
}

}  // namespace

extern const FrameKernels kFrameKernels;
const FrameKernels kFrameKernels{lanes<Lane>, frame_scratch_bytes<Lane>, evaluate, linearize};

}  // namespace TRAJOPT_ISA
}  // namespace trajopt
