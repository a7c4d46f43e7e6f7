// The objective as data: what each term wants, per frame. All terms are sums of squares.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "trajopt/problem/frame_kernels.h"

namespace trajopt {

// A term with rows that reach across the tree (see DenseKind); owns its arrays.
struct DenseObjective {
  std::string name;
  DenseTerm term;
  std::vector<double> weight;  // N
  std::vector<double> target;  // N x 3, or empty
};

enum class LocalKind : int {
  pose,         // x_i (-) target_i
  velocity,     // (x_i (-) x_{i-1})/dt - target_i
  acceleration  // second difference quotient of x on the (possibly uneven) grid
};

// A term each joint pays by itself.
struct LocalObjective {
  std::string name;
  LocalKind kind;
  std::vector<double> weight;      // N
  std::vector<double> dof_weight;  // D
  std::vector<double> target;      // pose: N x nq; velocity: N x D or empty
};

// A term computed elsewhere (a traced user function): residuals (N x rows) and, when `jacobian` is
// not null, derivatives by tangent steps of frames i, i-1, i-2 (N x rows x 3D).
struct CallbackObjective {
  std::string name;
  int rows;
  int frames;  // N
  double weight;
  std::function<void(const double* frames, double* residual, double* jacobian)> evaluate;
};

struct Objective {
  std::vector<DenseObjective> dense;
  std::vector<LocalObjective> local;
  std::vector<CallbackObjective> callbacks;

  std::size_t size() const { return dense.size() + local.size() + callbacks.size(); }
  std::vector<std::string> names() const {
    std::vector<std::string> out;
    for (const auto& t : dense) out.push_back(t.name);
    for (const auto& t : local) out.push_back(t.name);
    for (const auto& t : callbacks) out.push_back(t.name);
    return out;
  }
};

}  // namespace trajopt
