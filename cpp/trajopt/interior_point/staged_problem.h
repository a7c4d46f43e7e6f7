// A staged nonlinear program: nodes w_0 .. w_{n-1} of one size and globals p,
//
//   min  sum_k cost(w_k, w_{k+1}, p) + cost_last(w_{n-1}, p) + cost_globals(p)
//   s.t. lower <= constraints of the same three kinds <= upper,  lower <= (w, p) <= upper
//
// Equal bounds make an equality, or pin a variable. Each kind is a `Part`: `count` copies of one
// function with one sparsity, whose k-th copy sees `span` neighbouring nodes and all globals. Its
// values live in buffers that whoever evaluates (a traced function, a test) reads and writes.
#pragma once

#include <functional>
#include <vector>

namespace trajopt::interior_point {

// Nonzeros of a matrix, in any order but without duplicates.
struct Pattern {
  std::vector<int> row, column;
  int nonzeros() const { return static_cast<int>(row.size()); }
};

struct Part {
  int count = 0;        // copies; 0: there are no such terms
  int span = 0;         // nodes a copy sees: 2 (stages), 1 (last node) or 0 (globals)
  int constraints = 0;  // rows of one copy
  Pattern jacobian;     // constraints x locals; locals: the nodes in order, then the globals
  Pattern hessian;      // locals x locals, lower triangle only

  // Written by the solver before an evaluation, one after the other for all copies.
  double* globals = nullptr;      // count x np
  double* multipliers = nullptr;  // count x constraints
  double* factor = nullptr;       // count: weight of the cost in the Hessian

  // Written by an evaluation.
  const double* cost = nullptr;             // count
  const double* constraint = nullptr;       // count x constraints
  const double* gradient = nullptr;         // count x locals: of the cost
  const double* jacobian_values = nullptr;  // count x nonzeros
  const double* hessian_values = nullptr;   // of factor * cost + multipliers' constraints

  std::function<void()> evaluate_values;       // cost and constraint
  std::function<void()> evaluate_derivatives;  // gradient, Jacobian and Hessian
};

struct StagedProblem {
  int nodes = 0, node_size = 0, globals = 0;
  Part stages, last, global;
  double* x = nullptr;               // what evaluations read: nodes x node_size
  std::vector<double> lower, upper;  // nodes x node_size, then globals
  std::vector<double> constraint_lower, constraint_upper;  // stages, last, global

  int variables() const { return nodes * node_size + globals; }
  int locals(const Part& part) const { return part.span * node_size + globals; }
  int rows() const {
    return stages.count * stages.constraints + last.count * last.constraints +
           global.count * global.constraints;
  }
};

// Throws ArgumentError naming the first inconsistency of sizes, patterns or bounds.
void check(const StagedProblem& problem);

}  // namespace trajopt::interior_point
