// Conjugate gradients for min |A x + c|^2 inside a ball, matrix-free.
//
// Conjugate gradients on A^T A x = -A^T c (CGLS: A^T A is never formed), started at zero and cut
// where they leave the ball (Steihaug). Every iterate lies in the range of A^T, and the lengths of
// the iterates grow, so an unfinished solution is short rather than wrong.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace trajopt::linalg {

struct LeastSquares {
  int iterations = 0;
  bool at_boundary = false;
  double residual = 0;  // |A x + c|
};

inline double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum = std::fma(a[i], b[i], sum);
  return sum;
}

// multiply(x, y): y = A x; multiply_transposed(y, x): x = A^T y. `x` has its length on entry, its
// contents are replaced. Stops when |A^T r| <= tolerance |A^T c|.
template <class Multiply, class MultiplyTransposed>
LeastSquares least_squares_in_ball(const Multiply& multiply,
                                   const MultiplyTransposed& multiply_transposed,
                                   const std::vector<double>& c, double radius, int max_iterations,
                                   double tolerance, std::vector<double>& x) {
  std::fill(x.begin(), x.end(), 0.0);
  std::vector<double> r(c), image(c.size()), s(x.size());  // r = -(A x + c), s = A^T r
  for (double& value : r) value = -value;
  multiply_transposed(r, s);
  std::vector<double> p(s);
  double gamma = dot(s, s);
  const double target = tolerance * tolerance * gamma;
  LeastSquares result;
  while (result.iterations < max_iterations && gamma > target) {
    multiply(p, image);
    const double curvature = dot(image, image);
    if (!(curvature > 0)) break;
    double alpha = gamma / curvature;
    const double xx = dot(x, x), xp = dot(x, p), pp = dot(p, p);
    const double room = radius * radius - xx;
    if (xx + 2 * alpha * xp + alpha * alpha * pp >= radius * radius) {
      alpha = room / (xp + std::sqrt(xp * xp + pp * room));
      result.at_boundary = true;
    }
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::fma(alpha, p[i], x[i]);
    for (std::size_t i = 0; i < r.size(); ++i) r[i] = std::fma(-alpha, image[i], r[i]);
    ++result.iterations;
    if (result.at_boundary) break;
    multiply_transposed(r, s);
    const double next = dot(s, s);
    const double beta = next / gamma;
    gamma = next;
    for (std::size_t i = 0; i < p.size(); ++i) p[i] = std::fma(beta, p[i], s[i]);
  }
  result.residual = std::sqrt(dot(r, r));
  return result;
}

}  // namespace trajopt::linalg
