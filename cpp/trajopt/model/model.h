// A character: a tree of joints, each carrying a rigid link.
//
// Joint j sits at T_j(x) = T_parent(j) * offset_j * E_j(x): a slide, a hinge or a ball. A free base
// is three slides and a ball. Bodies welded together are one link. Links may be massless.
//
// Two coordinate vectors: x in R^D has a rotation vector per ball; q in R^nq has a unit quaternion.
// The optimizer moves q by tangent steps in R^D (q <- q (+) delta, R <- exp(delta) R), so no chart
// ever wraps or degenerates; x is what users see.
#pragma once

#include <vector>

#include "trajopt/base/hd.h"

namespace trajopt {

enum class JointType : int { slide = 0, hinge = 1, ball = 2 };

struct Joint {
  JointType type;
  int parent;  // -1: the world
  int dof;     // first of its 1 or 3 entries of x
  int q;       // first of its 1 or 4 entries of q
  double
      offset[12];  // rotation (row-major 9), translation (3): parent's frame -> this joint's frame
  double axis[3];  // unit; unused for a ball
  double mass;     // of the link; 0 for an intermediate joint
  double second[6];  // integral of rho p p^T about the joint frame's origin: xx xy xz yy yz zz
  double first[3];   // mass times centre of mass, in the joint frame
  // Filled in by finalize:
  double subtree_mass = 0;
  bool massless = false;
  bool plain = false;  // offset has no rotation: multiplying by it changes nothing
  int aligned = -1;    // k when the axis is the k-th of the frame, else -1

  TRAJOPT_HD int ndof() const { return type == JointType::ball ? 3 : 1; }
  TRAJOPT_HD int nq() const { return type == JointType::ball ? 4 : 1; }
};

struct ContactPoint {  // a sphere; radius 0 for box corners and mesh vertices
  int joint;
  double position[3];
  double radius;
};

struct SpherePair {  // indices of two spheres that must not penetrate each other
  int a, b;
};

// Pairs begin .. end - 1 of one sphere and spheres of one joint: none overlaps while the sphere's
// centre is `reach` or more from that of the joint's hull.
struct PairRun {
  int begin, end;
  int a, hull;
  double reach;
};

struct Model {
  int ndof = 0;
  int nq = 0;
  double mass = 0;
  std::vector<Joint> joints;
  std::vector<int> dof_joint;   // D
  std::vector<int> dof_parent;  // D: the next dof towards the world, -1 at the root
  std::vector<double> lower, upper;
  std::vector<int> actuated, unactuated;  // dof indices
  std::vector<ContactPoint> points;
  std::vector<ContactPoint> spheres;  // for self collision
  std::vector<SpherePair> pairs;
  // Filled in by finalize:
  std::vector<ContactPoint> hulls;  // a ball around all spheres of a joint
  std::vector<PairRun> runs;        // all pairs, in their order
};

// What a kernel sees of a Model: plain pointers, also valid on a device.
struct ModelView {
  int ndof, nq, njoint, nactuated, nunactuated, npoint, nsphere, npair, nhull, nrun;
  double mass;
  const Joint* joints;
  const int* dof_joint;
  const int* dof_parent;
  const double* lower;
  const double* upper;
  const int* actuated;
  const int* unactuated;
  const ContactPoint* points;
  const ContactPoint* spheres;
  const SpherePair* pairs;
  const ContactPoint* hulls;
  const PairRun* runs;
};

// Fills the derived members (dof offsets, parents, subtree masses, runs of pairs) and checks the
// tree.
void finalize(Model& model);

ModelView view(const Model& model);

}  // namespace trajopt
