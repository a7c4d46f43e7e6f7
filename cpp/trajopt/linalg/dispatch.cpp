#include "trajopt/base/kernel_table.h"
#include "trajopt/linalg/block_kernels.h"

namespace trajopt::linalg {

TRAJOPT_KERNEL_TABLE(BasicBlockKernels<double>, kBlockKernels, block_tables)
TRAJOPT_KERNEL_TABLE(BasicBlockKernels<float>, kBlockKernels32, block_tables32)

template <>
const BasicBlockKernels<double>& block_kernels<double>(Isa isa) {
  return block_tables().active(isa);
}

template <>
const BasicBlockKernels<float>& block_kernels<float>(Isa isa) {
  return block_tables32().active(isa);
}

}  // namespace trajopt::linalg
