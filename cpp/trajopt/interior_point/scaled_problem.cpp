#include "trajopt/interior_point/scaled_problem.h"

#include <algorithm>
#include <cmath>

namespace trajopt::interior_point {

namespace {

constexpr double kLargestGradient = 100.0;
constexpr double kSmallestScale = 1e-8;

double scale_of(double largest) {
  return largest > kLargestGradient ? std::max(kLargestGradient / largest, kSmallestScale) : 1.0;
}

// Sums propagate infinities and NaNs, so one test covers a whole array.
bool finite(const double* x, std::size_t size) {
  double sum = 0.0;
  for (std::size_t i = 0; i < size; ++i) sum += x[i] * 0.0;
  return sum == 0.0;
}

std::vector<ScaledProblem::Run> runs(const Pattern& pattern) {
  std::vector<ScaledProblem::Run> found;
  for (int e = 0; e < pattern.nonzeros(); ++e) {
    if (e == 0 || pattern.column[e] != pattern.column[e - 1]) {
      found.push_back({pattern.column[e], e, e});
    }
    found.back().end = e + 1;
  }
  return found;
}

}  // namespace

ScaledProblem::ScaledProblem(StagedProblem& problem)
    : problem_(problem),
      variables_(problem.variables()),
      rows_(problem.rows()),
      pinned_(variables_),
      row_scale_(rows_, 1.0),
      gradient_(variables_) {
  for (int i = 0; i < variables_; ++i) pinned_[i] = problem.lower[i] == problem.upper[i];
  const Part* parts[] = {&problem.stages, &problem.last, &problem.global};
  const int first_node[] = {0, problem.nodes - 1, problem.nodes};
  int row = 0, most = 1;
  for (int i = 0; i < 3; ++i) {
    Terms& t = terms_[i];
    t.part = parts[i];
    t.locals = problem.locals(*t.part);
    t.first_node = first_node[i];
    t.first_row = row;
    row += t.part->count * t.part->constraints;
    most = std::max(most, t.locals);
    t.jacobian.resize(static_cast<std::size_t>(t.part->count) * t.part->jacobian.nonzeros());
    t.hessian.resize(static_cast<std::size_t>(t.part->count) * t.part->hessian.nonzeros());
    t.jacobian_runs = runs(t.part->jacobian);
    t.hessian_runs = runs(t.part->hessian);
    t.pinned.resize(t.part->count);
    const int nodes = problem.nodes * problem.node_size;
    const bool global =
        std::any_of(pinned_.begin() + nodes, pinned_.end(), [](char c) { return c; });
    for (int k = 0; k < t.part->count; ++k) {
      const auto begin = pinned_.begin() + (t.first_node + k) * problem.node_size;
      t.pinned[k] = global || std::any_of(begin, begin + t.part->span * problem.node_size,
                                          [](char c) { return c; });
    }
  }
  local_in_.resize(most);
  local_out_.resize(most);
}

const double* ScaledProblem::locals(const Terms& t, int k, const double* flat) const {
  const int size = problem_.node_size, seen = t.part->span * size;
  const double* nodes = flat + (t.first_node + k) * size;
  if (problem_.globals == 0) return nodes;
  std::copy_n(nodes, seen, local_in_.data());
  std::copy_n(flat + problem_.nodes * size, problem_.globals, local_in_.data() + seen);
  return local_in_.data();
}

void ScaledProblem::scatter_add(const Terms& t, int k, const double* local, double* flat) const {
  const int size = problem_.node_size, seen = t.part->span * size;
  double* nodes = flat + (t.first_node + k) * size;
  double* globals = flat + problem_.nodes * size;
  for (int i = 0; i < seen; ++i) nodes[i] += local[i];
  for (int i = 0; i < problem_.globals; ++i) globals[i] += local[seen + i];
}

// Calls add(y) with y the locals of copy k.
template <class Add>
void ScaledProblem::add_to_locals(const Terms& t, int k, double* flat, const Add& add) const {
  if (problem_.globals == 0) {
    add(flat + (t.first_node + k) * problem_.node_size);
    return;
  }
  std::fill_n(local_out_.data(), t.locals, 0.0);
  add(local_out_.data());
  scatter_add(t, k, local_out_.data(), flat);
}

void ScaledProblem::load(const double* x) {
  const int nodes = problem_.nodes * problem_.node_size;
  std::copy_n(x, nodes, problem_.x);
  for (const Terms& t : terms_) {
    for (int k = 0; k < t.part->count; ++k) {
      std::copy_n(x + nodes, problem_.globals, t.part->globals + k * problem_.globals);
    }
  }
}

bool ScaledProblem::values(const double* x, double& objective, double* constraint) {
  load(x);
  double sum = 0.0;
  for (const Terms& t : terms_) {
    if (t.part->count == 0) continue;
    t.part->evaluate_values();
    for (int k = 0; k < t.part->count; ++k) sum += t.part->cost[k];
    const int rows = t.part->count * t.part->constraints;
    for (int i = 0; i < rows; ++i) {
      constraint[t.first_row + i] = row_scale_[t.first_row + i] * t.part->constraint[i];
    }
  }
  objective = objective_scale_ * sum;
  return std::isfinite(objective) && finite(constraint, rows_);
}

bool ScaledProblem::derivatives(const double* x, const double* multipliers, double weight) {
  load(x);
  std::fill(gradient_.begin(), gradient_.end(), 0.0);
  bool good = true;
  for (Terms& t : terms_) {
    if (t.part->count == 0) continue;
    const int rows = t.part->count * t.part->constraints;
    for (int i = 0; i < rows; ++i) {
      t.part->multipliers[i] = row_scale_[t.first_row + i] * multipliers[t.first_row + i];
    }
    std::fill_n(t.part->factor, t.part->count, weight * objective_scale_);
    t.part->evaluate_derivatives();
    good = take_derivatives(t) && good;
  }
  for (int i = 0; i < variables_; ++i) {
    gradient_[i] = pinned_[i] ? 0.0 : objective_scale_ * gradient_[i];
  }
  return good && finite(gradient_.data(), gradient_.size());
}

bool ScaledProblem::take_derivatives(Terms& t) {
  const Part& part = *t.part;
  const int nj = part.jacobian.nonzeros(), nh = part.hessian.nonzeros();
  for (int k = 0; k < part.count; ++k) {
    scatter_add(t, k, part.gradient + static_cast<long>(k) * t.locals, gradient_.data());
    const double* j = part.jacobian_values + static_cast<long>(k) * nj;
    const double* scale = row_scale_.data() + t.first_row + k * part.constraints;
    double* to = t.jacobian.data() + static_cast<long>(k) * nj;
    for (int e = 0; e < nj; ++e) to[e] = scale[part.jacobian.row[e]] * j[e];
    double* h = t.hessian.data() + static_cast<long>(k) * nh;
    std::copy_n(part.hessian_values + static_cast<long>(k) * nh, nh, h);
    if (!t.pinned[k]) continue;
    const int size = problem_.node_size, seen = part.span * size;
    const auto fixed = [&](int local) {
      return pinned_[local < seen ? (t.first_node + k) * size + local
                                  : problem_.nodes * size + local - seen] != 0;
    };
    for (int e = 0; e < nj; ++e) {
      if (fixed(part.jacobian.column[e])) to[e] = 0.0;
    }
    for (int e = 0; e < nh; ++e) {
      if (fixed(part.hessian.row[e]) || fixed(part.hessian.column[e])) h[e] = 0.0;
    }
  }
  return finite(t.jacobian.data(), t.jacobian.size()) && finite(t.hessian.data(), t.hessian.size());
}

void ScaledProblem::choose_scales() {
  double largest = 0.0;
  for (double g : gradient_) largest = std::max(largest, std::abs(g));
  objective_scale_ = scale_of(largest);
  std::vector<double> row(rows_, 0.0);
  for (const Terms& t : terms_) {
    const Pattern& pattern = t.part->jacobian;
    const int nonzeros = pattern.nonzeros();
    for (int k = 0; k < t.part->count; ++k) {
      for (int e = 0; e < nonzeros; ++e) {
        double& most = row[t.first_row + k * t.part->constraints + pattern.row[e]];
        most = std::max(most, std::abs(t.jacobian[static_cast<std::size_t>(k) * nonzeros + e]));
      }
    }
  }
  for (int i = 0; i < rows_; ++i) row_scale_[i] = scale_of(row[i]);
}

void ScaledProblem::add_jacobian_product(const double* v, double* y) const {
  for (const Terms& t : terms_) {
    const int* row = t.part->jacobian.row.data();
    const double* j = t.jacobian.data();
    double* to = y + t.first_row;
    for (int k = 0; k < t.part->count; ++k) {
      const double* x = locals(t, k, v);
      for (const Run& run : t.jacobian_runs) {
        const double of_column = x[run.column];
        for (int e = run.begin; e < run.end; ++e) to[row[e]] += j[e] * of_column;
      }
      j += t.part->jacobian.nonzeros();
      to += t.part->constraints;
    }
  }
}

void ScaledProblem::add_jacobian_transposed_product(const double* v, double* y) const {
  for (const Terms& t : terms_) {
    const int* row = t.part->jacobian.row.data();
    const double* j = t.jacobian.data();
    const double* from = v + t.first_row;
    for (int k = 0; k < t.part->count; ++k) {
      add_to_locals(t, k, y, [&](double* to) {
        for (const Run& run : t.jacobian_runs) {
          double sum = 0.0;
          for (int e = run.begin; e < run.end; ++e) sum += j[e] * from[row[e]];
          to[run.column] += sum;
        }
      });
      j += t.part->jacobian.nonzeros();
      from += t.part->constraints;
    }
  }
}

void ScaledProblem::add_hessian_product(const double* v, double* y) const {
  for (const Terms& t : terms_) {
    const int* row = t.part->hessian.row.data();
    const double* h = t.hessian.data();
    for (int k = 0; k < t.part->count; ++k) {
      const double* x = locals(t, k, v);
      add_to_locals(t, k, y, [&](double* to) {
        for (const Run& run : t.hessian_runs) {
          const double of_column = x[run.column];
          double sum = 0.0;
          for (int e = run.begin; e < run.end; ++e) {
            to[row[e]] += h[e] * of_column;
            if (row[e] != run.column) sum += h[e] * x[row[e]];
          }
          to[run.column] += sum;
        }
      });
      h += t.part->hessian.nonzeros();
    }
  }
}

}  // namespace trajopt::interior_point
