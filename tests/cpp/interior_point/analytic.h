// Staged problems written by hand: a term gives its values and dense derivatives for one copy.
#pragma once

#include <functional>
#include <limits>
#include <vector>

#include "trajopt/interior_point/interior_point.h"

namespace trajopt::interior_point::test {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Of one copy: locals in; cost, rows, gradient, Jacobian (rows x locals) and Hessian of
// factor * cost + multipliers . rows (locals x locals, lower triangle counts) out.
struct Sample {
  const double* v = nullptr;
  double cost = 0;
  std::vector<double> c, gradient, jacobian, hessian;
};
using Term = std::function<void(int k, Sample& s, double factor, const double* multipliers)>;

class Analytic {
 public:
  StagedProblem problem;

  Analytic(int nodes, int size, int globals) {
    problem.nodes = nodes;
    problem.node_size = size;
    problem.globals = globals;
    x_.resize(nodes * size);
    problem.x = x_.data();
    problem.lower.assign(problem.variables(), -kInf);
    problem.upper.assign(problem.variables(), kInf);
  }
  Analytic(const Analytic&) = delete;
  Analytic& operator=(const Analytic&) = delete;

  // Parts in the order stages, last, global; bounds of the rows of one copy.
  void add(Part& part, int span, int count, const std::vector<double>& lower,
           const std::vector<double>& upper, Term term) {
    Memory& m = memory_[2 - span];
    m.term = std::move(term);
    part.span = span;
    part.count = count;
    part.constraints = static_cast<int>(lower.size());
    const int locals = problem.locals(part), rows = part.constraints;
    for (int c = 0; c < locals; ++c) {
      for (int r = 0; r < rows; ++r) {
        part.jacobian.row.push_back(r);
        part.jacobian.column.push_back(c);
      }
      for (int r = c; r < locals; ++r) {
        part.hessian.row.push_back(r);
        part.hessian.column.push_back(c);
      }
    }
    m.globals.resize(count * problem.globals);
    m.multipliers.resize(count * rows);
    m.factor.resize(count);
    m.cost.resize(count);
    m.c.resize(count * rows);
    m.gradient.resize(count * locals);
    m.jacobian.resize(count * part.jacobian.nonzeros());
    m.hessian.resize(count * part.hessian.nonzeros());
    m.local.resize(locals);
    m.sample.c.resize(rows);
    m.sample.gradient.resize(locals);
    m.sample.jacobian.resize(rows * locals);
    m.sample.hessian.resize(locals * locals);
    part.globals = m.globals.data();
    part.multipliers = m.multipliers.data();
    part.factor = m.factor.data();
    part.cost = m.cost.data();
    part.constraint = m.c.data();
    part.gradient = m.gradient.data();
    part.jacobian_values = m.jacobian.data();
    part.hessian_values = m.hessian.data();
    part.evaluate_values = part.evaluate_derivatives = [this, &part, &m] { evaluate(part, m); };
    for (int k = 0; k < count; ++k) {
      problem.constraint_lower.insert(problem.constraint_lower.end(), lower.begin(), lower.end());
      problem.constraint_upper.insert(problem.constraint_upper.end(), upper.begin(), upper.end());
    }
  }

  Outcome solve(Point& point, Options options = {}, const Observer& observer = {}) {
    return interior_point::solve(problem, options, point, observer);
  }

 private:
  struct Memory {
    Term term;
    std::vector<double> globals, multipliers, factor, cost, c, gradient, jacobian, hessian, local;
    Sample sample;
  };

  void evaluate(const Part& part, Memory& m) {
    const int size = problem.node_size, seen = part.span * size, locals = problem.locals(part);
    const int first = part.span == 1 ? problem.nodes - 1 : 0, rows = part.constraints;
    for (int k = 0; k < part.count; ++k) {
      std::copy_n(x_.data() + (first + k) * (part.span > 0 ? size : 0), seen, m.local.begin());
      std::copy_n(m.globals.data() + k * problem.globals, problem.globals, m.local.begin() + seen);
      Sample& s = m.sample;
      s.v = m.local.data();
      s.cost = 0;
      for (auto* v : {&s.c, &s.gradient, &s.jacobian, &s.hessian})
        std::fill(v->begin(), v->end(), 0);
      m.term(k, s, m.factor[k], m.multipliers.data() + k * rows);
      m.cost[k] = s.cost;
      std::copy_n(s.c.begin(), rows, m.c.begin() + k * rows);
      std::copy_n(s.gradient.begin(), locals, m.gradient.begin() + k * locals);
      double* j = m.jacobian.data() + k * part.jacobian.nonzeros();
      double* h = m.hessian.data() + k * part.hessian.nonzeros();
      for (int c = 0; c < locals; ++c) {
        for (int r = 0; r < rows; ++r) *j++ = s.jacobian[r * locals + c];
        for (int r = c; r < locals; ++r) *h++ = s.hessian[r * locals + c];
      }
    }
  }

  std::vector<double> x_;
  Memory memory_[3];
};

}  // namespace trajopt::interior_point::test
