// Scratch of the dynamics residual for one pack of frames, carved out of one buffer.
#pragma once

#include <cstddef>

#include "trajopt/dynamics/kinematics.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct ThreeMats {  // one for each node
  Mat3<S> q[3];
};
template <class S>
struct ThreeVecs {
  Vec3<S> q[3];
};

// Sum of forces on a subtree at one node: moment = sum f P^T, force = sum f.
template <class S>
struct Wrench {
  Mat3<S> moment;
  Vec3<S> force;
};

template <class S>
struct DynamicsWorkspace {
  static constexpr int kPoints = 4;  // contact points of a joint that are dealt with together

  Transform<S>* joints[3];
  Twist<S>* twists[3];
  // Sums over the subtree of each joint: second[q] = integral of rho P_q P_a^T (a: the inertia
  // node), first[q] = mass times centre of mass at node q; forces by test node. `second` and
  // `wrenches` are used up while the inward sweep passes: slot[j] and felt[t][j] tell which entry
  // holds joint j's, -1 when nothing has been added yet.
  ThreeMats<S>* second;
  ThreeVecs<S>* first;
  Wrench<S>* wrenches[3];
  S* directions;     // dP_q/dx of contact points: 3 nodes x 3 rows x chain each
  S* tested;         // the same, multiplied by a point's stiffness
  Vec3<S>* spheres;  // centres at the inertia node, for self collision
  Vec3<S>* hulls;    // and those of the balls around a joint's spheres
  int *slot, *felt[3];
  int* chain;    // dofs that move a point
  bool coupled;  // do spheres overlap: are there forces between branches?

  TRAJOPT_HD static std::size_t bytes(const ModelView& m) {
    const std::size_t j = m.njoint, d = m.ndof;
    const std::size_t small = (4 * j + d) * sizeof(int);
    return 3 * (j * sizeof(Transform<S>) + d * sizeof(Twist<S>) + j * sizeof(Wrench<S>)) +
           j * (sizeof(ThreeMats<S>) + sizeof(ThreeVecs<S>)) + 18 * kPoints * d * sizeof(S) +
           (m.nsphere + m.nhull) * sizeof(Vec3<S>) + (small + 63) / 64 * 64;
  }

  TRAJOPT_HD DynamicsWorkspace(const ModelView& m, void* memory) : coupled(false) {
    char* p = static_cast<char*>(memory);
    const auto take = [&p]<class T>(T*& pointer, std::size_t count) {
      pointer = reinterpret_cast<T*>(p);
      p += count * sizeof(T);
    };
    const std::size_t d = m.ndof;
    for (int k = 0; k < 3; ++k) {
      take(joints[k], m.njoint);
      take(twists[k], d);
      take(wrenches[k], m.njoint);
    }
    take(second, m.njoint);
    take(first, m.njoint);
    take(directions, 9 * kPoints * d);
    take(tested, 9 * kPoints * d);
    take(spheres, m.nsphere);
    take(hulls, m.nhull);
    take(slot, m.njoint);
    take(chain, d);
    for (int k = 0; k < 3; ++k) take(felt[k], m.njoint);
  }
};

}  // namespace trajopt::inline TRAJOPT_ISA
