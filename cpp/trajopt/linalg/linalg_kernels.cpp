// Compiled once per instruction set: the table of block operations.
#include "trajopt/linalg/block_kernels.h"
#include "trajopt/linalg/block_vector.h"
#include "trajopt/linalg/eliminate.h"
#include "trajopt/linalg/update.h"

namespace trajopt::linalg::inline TRAJOPT_ISA {

extern const BlockKernels kBlockKernels;
const BlockKernels kBlockKernels = {
    eliminate,           update,   transpose_block,    substitute_transposed, substitute,
    subtract_transposed, subtract, subtract_symmetric,
};

}  // namespace trajopt::linalg::inline TRAJOPT_ISA
