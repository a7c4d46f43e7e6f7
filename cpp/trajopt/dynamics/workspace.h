// Scratch of the dynamics residual for one pack of frames, carved out of one buffer.
#pragma once

#include <cstddef>

#include "trajopt/dynamics/kinematics.h"

namespace trajopt::inline TRAJOPT_ISA {

// Sum over a subtree, tested at the inertia node a: second[q] = integral of rho P_q P_a^T,
// first[q] = mass times centre of mass at node q.
template <class S>
struct Composite {
  Mat3<S> second[3];
  Vec3<S> first[3];
};

// Sum of forces on a subtree at one node: moment = sum f P^T, force = sum f.
template <class S>
struct Wrench {
  Mat3<S> moment;
  Vec3<S> force;
};

// Derivative of a subtree's contact wrench tested at node t with respect to the motion of node q:
// the 6x6 matrix sum W_t^T A W_q with W = [-[P]x, I], as four 3x3 blocks.
template <class S>
struct Stiffness {
  Mat3<S> ww, wv, vw, vv;
};

template <class S>
struct DynamicsWorkspace {
  Transform<S>* joints[3];
  Twist<S>* twists[3];
  Composite<S>* composites;   // per joint
  Wrench<S>* wrenches[3];     // per joint: contact and self collision, by test node
  Stiffness<S>* stiffness;    // per joint, 9: t * 3 + q
  Vec3<S>* spheres;           // centres at the inertia node, for self collision
  unsigned char* touched[3];  // per joint: does any lane's subtree feel a force at this node?

  TRAJOPT_HD static std::size_t bytes(const ModelView& m) {
    const std::size_t j = m.njoint, d = m.ndof;
    return 3 * (j * sizeof(Transform<S>) + d * sizeof(Twist<S>) + j * sizeof(Wrench<S>)) +
           j * (sizeof(Composite<S>) + 9 * sizeof(Stiffness<S>)) + m.nsphere * sizeof(Vec3<S>) +
           ((3 * j + 63) / 64) * 64;
  }

  TRAJOPT_HD DynamicsWorkspace(const ModelView& m, void* memory) {
    char* p = static_cast<char*>(memory);
    const auto take = [&p]<class T>(T*& pointer, std::size_t count) {
      pointer = reinterpret_cast<T*>(p);
      p += count * sizeof(T);
    };
    for (int k = 0; k < 3; ++k) {
      take(joints[k], m.njoint);
      take(twists[k], m.ndof);
      take(wrenches[k], m.njoint);
    }
    take(composites, m.njoint);
    take(stiffness, 9 * static_cast<std::size_t>(m.njoint));
    take(spheres, m.nsphere);
    for (int k = 0; k < 3; ++k) take(touched[k], m.njoint);
  }
};

}  // namespace trajopt::inline TRAJOPT_ISA
