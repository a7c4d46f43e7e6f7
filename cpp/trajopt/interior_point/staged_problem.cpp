#include "trajopt/interior_point/staged_problem.h"

#include <string>

#include "trajopt/base/error.h"

namespace trajopt::interior_point {

namespace {

void check_pattern(const Pattern& pattern, int rows, int columns, bool lower, const char* name) {
  if (pattern.row.size() != pattern.column.size()) {
    throw ArgumentError(std::string(name) + " has " + std::to_string(pattern.row.size()) +
                        " row and " + std::to_string(pattern.column.size()) + " column indices");
  }
  for (std::size_t k = 0; k < pattern.row.size(); ++k) {
    const int r = pattern.row[k], c = pattern.column[k];
    if (r < 0 || r >= rows || c < 0 || c >= columns || (lower && r < c)) {
      throw ArgumentError(std::string(name) + " has a nonzero at (" + std::to_string(r) + ", " +
                          std::to_string(c) + "), expected one inside " + std::to_string(rows) +
                          " x " + std::to_string(columns) + (lower ? ", lower triangle" : ""));
    }
  }
}

void check_bounds(const std::vector<double>& lower, const std::vector<double>& upper, int size,
                  const char* name) {
  if (static_cast<int>(lower.size()) != size || static_cast<int>(upper.size()) != size) {
    throw ArgumentError(std::string(name) + " have lengths " + std::to_string(lower.size()) +
                        " and " + std::to_string(upper.size()) + ", expected " +
                        std::to_string(size));
  }
  for (int i = 0; i < size; ++i) {
    if (!(lower[i] <= upper[i])) {
      throw ArgumentError(std::string(name) + " of element " + std::to_string(i) + " are " +
                          std::to_string(lower[i]) + " and " + std::to_string(upper[i]) +
                          ": expected lower <= upper");
    }
  }
}

}  // namespace

void check(const StagedProblem& problem) {
  if (problem.nodes < 1 || problem.node_size < 1 || problem.globals < 0) {
    throw ArgumentError("a staged problem needs at least one node of at least one variable: " +
                        std::to_string(problem.nodes) + " nodes of " +
                        std::to_string(problem.node_size) + ", " + std::to_string(problem.globals) +
                        " globals");
  }
  const Part* parts[] = {&problem.stages, &problem.last, &problem.global};
  const int most[] = {problem.nodes - 1, 1, 1};
  for (int i = 0; i < 3; ++i) {
    const Part& part = *parts[i];
    if (part.count == 0) continue;
    if (part.span != 2 - i || part.count != most[i]) {
      throw ArgumentError("part " + std::to_string(i) + " has " + std::to_string(part.count) +
                          " copies over " + std::to_string(part.span) + " nodes, expected " +
                          std::to_string(most[i]) + " over " + std::to_string(2 - i));
    }
    const int locals = problem.locals(part);
    check_pattern(part.jacobian, part.constraints, locals, false, "the Jacobian");
    check_pattern(part.hessian, locals, locals, true, "the Hessian");
  }
  check_bounds(problem.lower, problem.upper, problem.variables(), "the variables' bounds");
  check_bounds(problem.constraint_lower, problem.constraint_upper, problem.rows(),
               "the constraints' bounds");
}

}  // namespace trajopt::interior_point
