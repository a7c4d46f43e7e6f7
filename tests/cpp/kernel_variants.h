// The variants of a table of kernels that this machine can run.
#pragma once

#include <utility>
#include <vector>

#include "trajopt/base/kernel_table.h"

namespace trajopt::test {

// (name, table) of every instruction set there is here, whatever TRAJOPT_ISA says.
template <class Table>
std::vector<std::pair<const char*, const Table*>> runnable(const KernelVariants<Table>& table) {
  std::vector<std::pair<const char*, const Table*>> all{{isa_name(Isa::portable), table.portable}};
  if (table.avx2 && best_isa() >= Isa::avx2) all.emplace_back(isa_name(Isa::avx2), table.avx2);
  if (table.avx512 && best_isa() >= Isa::avx512)
    all.emplace_back(isa_name(Isa::avx512), table.avx512);
  return all;
}

}  // namespace trajopt::test
