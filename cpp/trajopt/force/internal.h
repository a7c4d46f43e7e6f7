// Internal forces: joint limits and self collision, cubic penalties (positive energy outside).
//
// Pan prints both potentials with min(., 0)^3, which attracts; here E = w max(excess, 0)^3.
#pragma once

#include "trajopt/dynamics/composites.h"
#include "trajopt/force/physics.h"

namespace trajopt::inline TRAJOPT_ISA {

// Limits of slides and hinges at one node: gradient into fd, second derivative into the diagonal.
template <class S, Chart C, bool Derivatives>
TRAJOPT_HD inline void add_joint_limits(const ModelView& model, const Physics& physics, const S* q,
                                        S* fd, S* jacobian) {
  if (physics.limit <= 0) return;
  const S w3 = S(3.0 * physics.limit), w6 = S(6.0 * physics.limit);
  for (int j = 0; j < model.ndof; ++j) {
    const Joint& joint = model.joints[model.dof_joint[j]];
    if (joint.type == JointType::ball) continue;
    const S x = q[C == Chart::vector ? joint.dof : joint.q];
    const S under = max(S(model.lower[j]) - x, S(0.0));
    const S over = max(x - S(model.upper[j]), S(0.0));
    fd[j] += w3 * (over * over - under * under);
    if constexpr (Derivatives) jacobian[j * model.ndof + j] += w6 * (over + under);
  }
}

template <class S>
struct Overlap {      // of one sphere pair: E = w depth^3
  Vec3<S> direction;  // unit vector from b to a
  S distance, depth;
};

// Is one of the lanes' distances of two points below `reach`?
template <class S>
TRAJOPT_HD inline bool any_within(const Vec3<S>& a, const Vec3<S>& b, double reach) {
  const Vec3<S> r = a - b;
  return any(dot(r, r) < S(reach * reach));
}

// False when no lane's spheres overlap: that is known before any square root.
template <class S>
TRAJOPT_HD inline bool sphere_overlap(const ModelView& model, const SpherePair& pair,
                                      const Vec3<S>* centers, Overlap<S>& o) {
  const double reach = model.spheres[pair.a].radius + model.spheres[pair.b].radius;
  const Vec3<S> r = centers[pair.a] - centers[pair.b];
  const S distance2 = dot(r, r);
  if (!any(distance2 < S(reach * reach))) return false;
  o.distance = max(sqrt(distance2), S(1e-12));  // coincident centres push along no direction
  o.direction = (S(1.0) / o.distance) * r;
  o.depth = max(S(reach) - o.distance, S(0.0));
  return true;
}

// J_r^T [E'' u u^T + (E'/L)(I - u u^T)] J_r with J_r = dP_a/dx - dP_b/dx: couples branches.
template <class S>
TRAJOPT_HD inline void add_overlap_stiffness(const ModelView& model, const Physics& physics,
                                             const SpherePair& pair, const Overlap<S>& o,
                                             const Twist<S>* twists, const Vec3<S>* centers,
                                             S* jacobian) {
  const auto last_dof = [&](int joint) {
    return model.joints[joint].dof + (model.joints[joint].type == JointType::ball ? 2 : 0);
  };
  const S w = S(physics.self_collision);
  const S slope_over_length = S(-3.0) * w * o.depth * o.depth / o.distance;
  const S along = S(6.0) * w * o.depth - slope_over_length;
  // sign * dP/dx_j for j on either chain; on the shared part both contribute.
  const auto row = [&](int end, int j) {
    return end == 0 ? point_velocity(twists[j], centers[pair.a])
                    : S(-1.0) * point_velocity(twists[j], centers[pair.b]);
  };
  const int start[2] = {last_dof(model.spheres[pair.a].joint),
                        last_dof(model.spheres[pair.b].joint)};
  for (int e = 0; e < 2; ++e) {
    for (int j = start[e]; j >= 0; j = model.dof_parent[j]) {
      const Vec3<S> rj = row(e, j);
      const Vec3<S> t = fma(along * dot(o.direction, rj), o.direction, slope_over_length * rj);
      for (int f = 0; f < 2; ++f)
        for (int l = start[f]; l >= 0; l = model.dof_parent[l])
          jacobian[j * model.ndof + l] += dot(t, row(f, l));
    }
  }
}

template <class S>
TRAJOPT_HD inline void place_centers(const ContactPoint* balls, int count,
                                     const Transform<S>* joints, Vec3<S>* centers) {
  for (int k = 0; k < count; ++k)
    centers[k] = apply(joints[balls[k].joint], broadcast3<S>(balls[k].position));
}

// Wrenches at the inertia node a and their derivative; returns whether any spheres overlap.
template <class S, bool Derivatives>
TRAJOPT_HD inline bool add_self_collision(const ModelView& model, const Physics& physics, int a,
                                          DynamicsWorkspace<S>& ws, S* jacobian) {
  bool found = false;
  place_centers(model.spheres, model.nsphere, ws.joints[a], ws.spheres);
  place_centers(model.hulls, model.nhull, ws.joints[a], ws.hulls);
  for (int i = 0; i < model.nrun; ++i) {
    const PairRun& run = model.runs[i];
    if (!any_within(ws.spheres[run.a], ws.hulls[run.hull], run.reach)) continue;
    for (int k = run.begin; k < run.end; ++k) {
      const SpherePair& pair = model.pairs[k];
      Overlap<S> o;
      if (!sphere_overlap(model, pair, ws.spheres, o)) continue;
      found = true;
      const S slope = S(-3.0 * physics.self_collision) * o.depth * o.depth;  // dE/d distance
      add_force(ws, a, model.spheres[pair.a].joint, slope, o.direction, ws.spheres[pair.a]);
      add_force(ws, a, model.spheres[pair.b].joint, -slope, o.direction, ws.spheres[pair.b]);
      if constexpr (Derivatives)
        add_overlap_stiffness(model, physics, pair, o, ws.twists[a], ws.spheres, jacobian);
    }
  }
  return found;
}

}  // namespace trajopt::inline TRAJOPT_ISA
