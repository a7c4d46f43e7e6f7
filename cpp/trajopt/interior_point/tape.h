// A scalar function as a list of operations on registers, evaluated for many copies of its
// arguments at once: one copy per SIMD lane. This is what a traced stage function is after its
// tracer has differentiated it; an interpreter that decodes each operation once for several copies
// spends its time on arithmetic instead.
//
// Lanes never mix, and every operation is the same in every lane, so a copy's bits depend neither
// on its neighbours nor on the instruction set nor on the number of threads.
#pragma once

#include <vector>

#include "trajopt/base/buffer.h"

namespace trajopt::interior_point {

// Order is known to trajopt.collocation.tape.
enum class Operation : int {
  assign,
  add,
  sub,
  mul,
  div,
  neg,
  exp,
  log,
  pow,
  constpow,
  sqrt,
  sq,
  twice,
  sin,
  cos,
  tan,
  asin,
  acos,
  atan,
  lt,
  le,
  eq,
  ne,
  logic_not,
  logic_and,
  logic_or,
  floor,
  ceil,
  fmod,
  fabs,
  sign,
  copysign,
  if_else_zero,
  erf,
  fmin,
  fmax,
  inv,
  sinh,
  cosh,
  tanh,
  asinh,
  acosh,
  atanh,
  atan2,
  constant,  // out = constants[a]
  input,     // out = element b of input a
  output,    // element b of output `out` = register a
  count
};

struct Instruction {
  int operation, out, a, b;
};

// Element e < size of copy k is data[k * step + e]. Inputs of neighbouring copies may overlap.
struct TapeInput {
  const double* data;
  long size, step;
};
struct TapeOutput {
  double* data;
  long size, step;
};

class Tape {
 public:
  // Throws ArgumentError when an operation, register, constant, input or output does not exist.
  Tape(std::vector<Instruction> code, std::vector<double> constants, int registers,
       std::vector<TapeInput> inputs, std::vector<TapeOutput> outputs, int copies, int threads);

  void evaluate();

  // Of the kernels, one per instruction set.
  struct View {
    const Instruction* code;
    long length;
    const double* constants;
    const TapeInput* inputs;
    const TapeOutput* outputs;
  };
  using Kernel = void (*)(const View& view, int first, int copies, void* registers);

 private:
  std::vector<Instruction> code_;
  std::vector<double> constants_;
  std::vector<TapeInput> inputs_;
  std::vector<TapeOutput> outputs_;
  int copies_, threads_, lanes_;
  Kernel kernel_;
  std::size_t scratch_bytes_;
  std::vector<AlignedBuffer> scratch_;  // per thread
};

struct TapeKernel {
  int lanes;
  Tape::Kernel run;  // copies first, ..., first + copies - 1 with copies <= lanes
};

}  // namespace trajopt::interior_point
