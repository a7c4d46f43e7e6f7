#include "trajopt/interior_point/tape.h"

#include <string>

#include "trajopt/base/error.h"
#include "trajopt/base/kernel_table.h"
#include "trajopt/base/parallel.h"

namespace trajopt::interior_point {

TRAJOPT_KERNEL_TABLE(TapeKernel, kTapeKernel, tape_tables)

namespace {

bool within(int i, std::size_t size) { return i >= 0 && static_cast<std::size_t>(i) < size; }

bool valid(const Instruction& i, int registers, std::size_t constants,
           const std::vector<TapeInput>& inputs, const std::vector<TapeOutput>& outputs) {
  switch (static_cast<Operation>(i.operation)) {
    case Operation::constant:
      return within(i.out, registers) && within(i.a, constants);
    case Operation::input:
      return within(i.out, registers) && within(i.a, inputs.size()) &&
             within(i.b, inputs[i.a].size);
    case Operation::output:
      return within(i.a, registers) && within(i.out, outputs.size()) &&
             within(i.b, outputs[i.out].size);
    default:
      return within(i.operation, static_cast<std::size_t>(Operation::count)) &&
             within(i.out, registers) && within(i.a, registers) && within(i.b, registers);
  }
}

}  // namespace

Tape::Tape(std::vector<Instruction> code, std::vector<double> constants, int registers,
           std::vector<TapeInput> inputs, std::vector<TapeOutput> outputs, int copies, int threads)
    : code_(std::move(code)),
      constants_(std::move(constants)),
      inputs_(std::move(inputs)),
      outputs_(std::move(outputs)),
      copies_(copies),
      threads_(threads > 1 ? threads : 1),
      lanes_(tape_tables().active().lanes),
      kernel_(tape_tables().active().run),
      scratch_bytes_(sizeof(double) * lanes_ * (registers > 0 ? registers : 1)) {
  for (std::size_t k = 0; k < code_.size(); ++k) {
    const Instruction& i = code_[k];
    if (!valid(i, registers, constants_.size(), inputs_, outputs_)) {
      throw ArgumentError("instruction " + std::to_string(k) + " of the tape is (" +
                          std::to_string(i.operation) + ", " + std::to_string(i.out) + ", " +
                          std::to_string(i.a) + ", " + std::to_string(i.b) +
                          "): no such operation, register, constant, input or output");
    }
  }
  for (int t = 0; t < threads_; ++t) scratch_.push_back(aligned_buffer(scratch_bytes_));
}

void Tape::evaluate() {
  const View view{code_.data(), static_cast<long>(code_.size()), constants_.data(), inputs_.data(),
                  outputs_.data()};
  const long groups = (copies_ + lanes_ - 1) / lanes_;
  parallel_for(groups, threads_, [&](long group, int worker) {
    const int first = static_cast<int>(group) * lanes_;
    const int copies = copies_ - first < lanes_ ? copies_ - first : lanes_;
    kernel_(view, first, copies, scratch_[worker].get());
  });
}

}  // namespace trajopt::interior_point
