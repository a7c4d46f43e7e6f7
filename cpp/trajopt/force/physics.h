// The force law and the time scheme as plain numbers, in whatever consistent units the model has.
#pragma once

#include "trajopt/base/hd.h"

namespace trajopt {

enum class Integrator : int { implicit = 0, verlet, fox_goodwin, linear_acceleration, trapezoidal };

struct Physics {
  double gravity[3] = {0, 0, -9.81};
  // Ground half space {P : n.P <= offset}.
  bool ground = false;
  double plane_normal[3] = {0, 0, 1};
  double plane_offset = 0;
  // Contact force on a point of depth d and velocity v:
  //   w_n d^2 s(1 - k_d v_n) n - w_t d^2 v_t                          (Pan eq. 6 when k_d = 0)
  //   w_n d^2 s(1 - k_d v_n) (n - mu v_t / sqrt(|v_t|^2 + eps^2))     (regularized Coulomb)
  double normal = 0;
  double friction = 0;
  double damping = 0;
  bool coulomb = false;
  double mu = 0.8;
  double slip_velocity = 0.05;
  // Internal energies limit * sum max(excess, 0)^3 and self_collision * sum max(overlap, 0)^3.
  double limit = 0;
  double self_collision = 0;
  Integrator integrator = Integrator::linear_acceleration;

  TRAJOPT_HD bool contact() const { return ground && normal > 0; }
};

// Nodes of a residual are frames i, i-1, i-2 (0, 1, 2). Everything that varies with the time step:
//   FD = <dT/dx at the inertia node, (sum_q acceleration_q T_q - g) M> + internal forces there
//        - sum_t contact_t J_t^T F(P_t, sum_q velocity_tq P_q).
struct Stencil {
  double acceleration[3];
  double contact[3];
  double velocity[3][3];
};

// The node whose directions test inertia and internal forces: i for Pan's scheme, else i-1.
TRAJOPT_HD inline int inertia_node(Integrator integrator) {
  return integrator == Integrator::implicit ? 0 : 1;
}

// dt: t_i - t_{i-1};  dt_before: t_{i-1} - t_{i-2}.
Stencil make_stencil(const Physics& physics, double dt, double dt_before);

}  // namespace trajopt
