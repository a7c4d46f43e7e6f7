#include "trajopt/base/kernel_table.h"
#include "trajopt/problem/frame_kernels.h"
#include "trajopt/problem/node_kernels.h"
#include "trajopt/problem/node_rows.h"
#include "trajopt/problem/row_products.h"
#include "trajopt/problem/spline_kernels.h"

namespace trajopt {

TRAJOPT_KERNEL_TABLE(FrameKernels, kFrameKernels, frame_tables)
TRAJOPT_KERNEL_TABLE(NodeKernels, kNodeKernels, node_tables)
TRAJOPT_KERNEL_TABLE(NodeRowKernels, kNodeRowKernels, node_row_tables)
TRAJOPT_KERNEL_TABLE(RowProductKernels, kRowProductKernels, row_product_tables)
TRAJOPT_KERNEL_TABLE(SplineKernels, kSplineKernels, spline_tables)

const FrameKernels& frame_kernels() { return frame_tables().active(); }

const NodeKernels& node_kernels() { return node_tables().active(); }

const NodeRowKernels& node_row_kernels(Isa isa) { return node_row_tables().active(isa); }

const RowProductKernels& row_product_kernels(Isa isa) { return row_product_tables().active(isa); }

const SplineKernels& spline_kernels() { return spline_tables().active(); }

}  // namespace trajopt
