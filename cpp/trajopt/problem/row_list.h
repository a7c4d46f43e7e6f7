// The objective rows of one pack of frames, in sets of rows that reach the same dofs.
//
// The order of the sets decides how sums over rows are rounded, so it may depend on the problem but
// not on a pack's frames: by place in the tree (the last dof that the rows can ever reach; rows
// that reach every dof come first), then by the order in which the terms write them. Leaving a set
// out because it is zero in all lanes, or widening it, moves no other set.
#pragma once

#include "trajopt/dynamics/residual.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct RowSet {
  int place;
  int rows;
  int nodes;          // the rows depend on nodes 0 .. nodes - 1
  int columns;        // per node
  const int* dofs;    // of the columns, ascending
  const S* jacobian;  // nodes x rows x columns
  const S* residual;  // rows; null: not part of the gradient

  TRAJOPT_HD const S* node(int q) const { return jacobian + q * rows * columns; }
  TRAJOPT_HD bool same_dofs(const RowSet& other) const {
    if (columns != other.columns) return false;
    for (int i = 0; i < columns; ++i)
      if (dofs[i] != other.dofs[i]) return false;
    return true;
  }
};

template <class S>
class RowList {
 public:
  static constexpr int kEverywhere = -1;  // place of rows that reach every dof

  // Room for the rows, their Jacobians over whole windows, one set a row, and its dofs.
  TRAJOPT_HD static std::size_t bytes(int rows, int d) {
    const std::size_t r = rows, n = d;
    const std::size_t small = r * sizeof(RowSet<S>) + (r + 3) * n * sizeof(int);
    return (r + r * 3 * n) * sizeof(S) + (small + 63) / 64 * 64;
  }

  TRAJOPT_HD RowList(int rows, int d, void* memory) {
    residual_ = static_cast<S*>(memory);
    jacobian_ = residual_ + rows;
    sets_ = reinterpret_cast<RowSet<S>*>(jacobian_ + static_cast<std::size_t>(rows) * 3 * d);
    every_ = reinterpret_cast<int*>(sets_ + rows);
    dofs_ = every_ + d;
    for (int i = 0; i < d; ++i) every_[i] = i;
  }

  TRAJOPT_HD int count() const { return count_; }
  TRAJOPT_HD const RowSet<S>* sets() const { return sets_; }
  TRAJOPT_HD const RowSet<S>& operator[](int k) const { return sets_[k]; }

  // Where the next set goes: the caller lists its dofs at dofs() (or takes every_dof()), fills
  // jacobian() and, if the rows belong to the objective, residual(), and then adds it.
  TRAJOPT_HD int* dofs() { return dofs_; }
  TRAJOPT_HD const int* every_dof() const { return every_; }
  TRAJOPT_HD S* jacobian() { return jacobian_; }
  TRAJOPT_HD S* residual() { return residual_; }

  TRAJOPT_HD void add(int place, int rows, int nodes, int columns, const int* dofs,
                      bool objective = true) {
    int k = count_++;
    for (; k > 0 && sets_[k - 1].place > place; --k) sets_[k] = sets_[k - 1];
    sets_[k] = {place, rows, nodes, columns, dofs, jacobian_, objective ? residual_ : nullptr};
    jacobian_ += nodes * rows * columns;
    if (objective) residual_ += rows;
    if (dofs == dofs_) dofs_ += columns;
  }

  // An evaluation keeps the residuals only.
  TRAJOPT_HD void add_residuals(int rows) { residual_ += rows; }

 private:
  int count_ = 0;
  S *residual_, *jacobian_;
  RowSet<S>* sets_;
  int *every_, *dofs_;
};

}  // namespace trajopt::inline TRAJOPT_ISA
