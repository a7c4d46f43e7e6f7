// Sweep 2 of the dynamics: what a joint carries, summed from the tips of the tree to its root.
#pragma once

#include "trajopt/dynamics/workspace.h"
#include "trajopt/force/physics.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct StencilPack {  // Stencil, one per lane
  S acceleration[3], contact[3], velocity[3][3];
};

template <class S>
TRAJOPT_HD inline void clear(Mat3<S>& m) {
  for (S& e : m.m) e = S(0.0);
}
template <class S>
TRAJOPT_HD inline void clear(Vec3<S>& v) {
  v = {S(0.0), S(0.0), S(0.0)};
}
template <class S>
TRAJOPT_HD inline void clear(Wrench<S>& w) {
  clear(w.moment);
  clear(w.force);
}

// weight * force at the place `at` of a link, tested at node t.
template <class S>
TRAJOPT_HD inline void add_force(DynamicsWorkspace<S>& ws, int t, int joint, const S& weight,
                                 const Vec3<S>& force, const Vec3<S>& at) {
  Wrench<S>& w = ws.wrenches[t][joint];
  if (!ws.touched[t][joint]) {
    clear(w);
    ws.touched[t][joint] = 1;
  }
  w.force = fma(weight, force, w.force);
  add_outer(w.moment, weight, force, at);
}

// sum_q s_q m_q
template <class S>
TRAJOPT_HD inline Mat3<S> blend(const S* s, const Mat3<S>& m0, const Mat3<S>& m1,
                                const Mat3<S>& m2) {
  Mat3<S> r;
  for (int i = 0; i < 9; ++i) r.m[i] = fma(s[2], m2.m[i], fma(s[1], m1.m[i], s[0] * m0.m[i]));
  return r;
}

// The link's own inertia and weight, on top of what its children have handed over.
//
// X = sum p P_a^T = second R_a^T + first t_a^T gives sum P_q P_a^T = R_q X + t_q first_a^T, and
// with U = sum_q acceleration_q T_q - [0 g] the wrench of inertia and weight U_R X + U_t first_a^T.
template <class S, bool Derivatives>
TRAJOPT_HD inline void add_link(const Joint& joint, const Physics& physics,
                                const StencilPack<S>& stencil, int a, int j,
                                DynamicsWorkspace<S>& ws) {
  ThreeVecs<S>& firsts = ws.first[j];
  Wrench<S>& wrench = ws.wrenches[a][j];
  if (ws.slot[j] < 0) {  // a tip
    ws.slot[j] = j;
    for (int q = 0; q < 3; ++q) {
      clear(firsts.q[q]);
      if constexpr (Derivatives) clear(ws.second[j].q[q]);
    }
  }
  if (!ws.touched[a][j]) {
    clear(wrench);
    ws.touched[a][j] = 1;
  }
  if (joint.massless) return;

  const S mass = S(joint.mass);
  const Vec3<S> first = broadcast3<S>(joint.first);
  const Transform<S>* t[3] = {&ws.joints[0][j], &ws.joints[1][j], &ws.joints[2][j]};
  Vec3<S> own[3];
  for (int q = 0; q < 3; ++q) {
    own[q] = fma(mass, t[q]->translation, t[q]->rotation * first);
    firsts.q[q] += own[q];
  }
  const Vec3<S>& first_a = own[a];
  const double* s = joint.second;
  const Mat3<S> second{
      {S(s[0]), S(s[1]), S(s[2]), S(s[1]), S(s[3]), S(s[4]), S(s[2]), S(s[4]), S(s[5])}};
  const Transform<S>& ta = *t[a];
  Mat3<S> x;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k)
      x(i, k) = fma(first[i], ta.translation[k],
                    fma(second(i, 2), ta.rotation(k, 2),
                        fma(second(i, 1), ta.rotation(k, 1), second(i, 0) * ta.rotation(k, 0))));

  const S* c = stencil.acceleration;
  const Mat3<S> turn = blend(c, t[0]->rotation, t[1]->rotation, t[2]->rotation);
  const Vec3<S> move =
      fma(c[2], t[2]->translation, fma(c[1], t[1]->translation, c[0] * t[0]->translation)) -
      broadcast3<S>(physics.gravity);
  Mat3<S> moment = turn * x;
  add_outer(moment, S(1.0), move, first_a);
  wrench.moment += moment;
  wrench.force += fma(mass, move, turn * first);
  if constexpr (Derivatives) {
    for (int q = 0; q < 3; ++q) {
      Mat3<S> m = t[q]->rotation * x;
      add_outer(m, S(1.0), t[q]->translation, first_a);
      ws.second[ws.slot[j]].q[q] += m;
    }
  }
}

// Hands everything over to the parent, the first child's sums as they are.
template <class S, bool Derivatives>
TRAJOPT_HD inline void add_to_parent(int parent, int j, DynamicsWorkspace<S>& ws) {
  if (ws.slot[parent] < 0) {
    ws.slot[parent] = ws.slot[j];
    ws.first[parent] = ws.first[j];
  } else {
    for (int q = 0; q < 3; ++q) {
      ws.first[parent].q[q] += ws.first[j].q[q];
      if constexpr (Derivatives) ws.second[ws.slot[parent]].q[q] += ws.second[ws.slot[j]].q[q];
    }
  }
  for (int t = 0; t < 3; ++t) {
    if (!ws.touched[t][j]) continue;
    // NOLINTNEXTLINE(clang-analyzer-core.NullDereference): there are as many joints as at first
    Wrench<S>& to = ws.wrenches[t][parent];
    const Wrench<S>& from = ws.wrenches[t][j];
    if (ws.touched[t][parent]) {
      to.moment += from.moment;
      to.force += from.force;
    } else {
      to = from;
      ws.touched[t][parent] = 1;
    }
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
