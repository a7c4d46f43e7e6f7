// Compiled once per instruction set: the tables of block operations.
#include "trajopt/linalg/block_columns.h"
#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/eliminate.h"
#include "trajopt/linalg/update.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

#ifdef __AVX512F__
constexpr LaneIndex make_lane_index() {
  LaneIndex index{};
  for (int lane = 0; lane < 16; ++lane) {
    for (int i = 0; i < 8 && lane < 8; ++i) index.of_8[lane][i] = lane;
    for (int i = 0; i < 16; ++i) index.of_16[lane][i] = lane;
  }
  return index;
}
const LaneIndex kLaneIndex = make_lane_index();
#endif

template <class T>
constexpr BasicBlockKernels<T> kTable = {
    eliminate<T>,
    update<T>,
    transpose_block<T>,
    convert<T>,
    stream_lines<T>,
    move<T>,
    substitute_transposed<T>,
    substitute<T>,
    scale<T>,
    subtract_transposed<T>,
    subtract<T>,
    subtract_symmetric<T>,
};

extern const BasicBlockKernels<double> kBlockKernels;
const BasicBlockKernels<double> kBlockKernels = kTable<double>;
extern const BasicBlockKernels<float> kBlockKernels32;
const BasicBlockKernels<float> kBlockKernels32 = kTable<float>;

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
