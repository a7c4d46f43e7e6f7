// Iterative refinement against the matrix without its regularization.
#pragma once

namespace trajopt::linalg {

struct Refinement {
  int steps = 0;          // corrections applied
  double residual = 0.0;  // max over items and columns of |rhs - A x|_max / |rhs|_max
};

// The loop for one right-hand side: evaluate() returns the relative residual, correct() applies a
// correction and undo() takes it back. Stops when the residual is below `tolerance`, no longer
// halves, or after max_steps. A correction is taken back when it doubles the residual, not when the
// residual stays where rounding keeps it: there the error of an ill-conditioned system still falls,
// and which of two such residuals is the larger is chance.
template <class Evaluate, class Correct, class Undo>
Refinement refine_loop(int max_steps, double tolerance, const Evaluate& evaluate,
                       const Correct& correct, const Undo& undo) {
  Refinement result{0, evaluate()};
  while (result.steps < max_steps && !(result.residual <= tolerance)) {
    correct();
    const double residual = evaluate();
    if (!(residual < 2.0 * result.residual)) {
      undo();
      break;
    }
    const bool halved = residual <= 0.5 * result.residual;
    result.residual = residual;
    ++result.steps;
    if (!halved) break;
  }
  return result;
}

// Largest magnitude of a rows x columns matrix; NaN if there is one.
double largest_magnitude(const double* x, long rows, int columns, long ld);

}  // namespace trajopt::linalg
