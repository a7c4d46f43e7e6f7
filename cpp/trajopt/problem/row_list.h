// The objective rows of one pack of frames, as they are written: groups over memory of one worker.
#pragma once

#include "trajopt/dynamics/residual.h"
#include "trajopt/problem/gram.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
class RowList {
 public:
  // Room for the rows, their Jacobians over whole windows, one group a row, and its dofs.
  TRAJOPT_HD static std::size_t bytes(int rows, int d) {
    const std::size_t r = rows, n = d;
    return (r + r * 3 * n) * sizeof(S) + r * sizeof(RowGroup<S>) + (r + 1) * n * sizeof(int) + 64;
  }

  TRAJOPT_HD RowList(int rows, int d, void* memory) {
    residual_ = static_cast<S*>(memory);
    jacobian_ = residual_ + rows;
    groups_ = reinterpret_cast<RowGroup<S>*>(jacobian_ + static_cast<std::size_t>(rows) * 3 * d);
    every_ = reinterpret_cast<int*>(groups_ + rows);
    dofs_ = every_ + d;
    for (int i = 0; i < d; ++i) every_[i] = i;
  }

  TRAJOPT_HD int count() const { return count_; }
  TRAJOPT_HD const RowGroup<S>* groups() const { return groups_; }

  // Where the dofs of the next group may be listed.
  TRAJOPT_HD int* dofs() { return dofs_; }
  TRAJOPT_HD const int* every_dof() const { return every_; }

  // Opens a group; with Derivatives the caller fills jacobian() and, unless it is left out of the
  // objective, residual().
  TRAJOPT_HD S* residual() { return residual_; }
  TRAJOPT_HD S* jacobian() { return jacobian_; }

  // Closes a group whose dofs stand in `dofs`: dofs(), or every_dof() for all.
  TRAJOPT_HD void add(int rows, int nodes, int columns, const int* dofs, bool objective = true) {
    S* jacobian = jacobian_;
    jacobian_ += rows * nodes * columns;
    const S* residual = objective ? residual_ : nullptr;
    residual_ += rows;
    if (count_ > 0) {  // rows about the same dofs as the ones before join them
      RowGroup<S>& before = groups_[count_ - 1];
      bool same = (before.residual != nullptr) == objective && before.nodes == nodes &&
                  before.columns == columns;
      for (int i = 0; same && i < columns; ++i) same = before.dofs[i] == dofs[i];
      if (same) {
        before.rows += rows;
        return;
      }
    }
    groups_[count_++] = {rows, nodes, columns, dofs, jacobian, residual};
    if (dofs == dofs_) dofs_ += columns;
  }

 private:
  int count_ = 0;
  S *residual_, *jacobian_;
  RowGroup<S>* groups_;
  int *every_, *dofs_;
};

}  // namespace trajopt::inline TRAJOPT_ISA
