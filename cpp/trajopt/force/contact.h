// Contact of a sphere with the ground half space (Pan eq. 6, Hunt-Crossley damping, friction cone).
//
// C^1 in the point's position and velocity. The force acts at the centre, with the centre's
// velocity, so it depends on one point fixed to the body.
#pragma once

#include "trajopt/base/vec3.h"
#include "trajopt/force/physics.h"

namespace trajopt::inline TRAJOPT_ISA {

template <class S>
struct ContactForce {
  Vec3<S> force;
  Mat3<S> by_position;  // dF/dP at fixed velocity
  Mat3<S> by_velocity;  // dF/dv
};

// Depth of a sphere in the ground, > 0 when it touches.
template <class S>
TRAJOPT_HD inline S ground_depth(const Physics& physics, const Vec3<S>& center, double radius) {
  const Vec3<S> n = broadcast3<S>(physics.plane_normal);
  return S(radius + physics.plane_offset) - dot(n, center);
}

template <class S, bool Derivatives>
TRAJOPT_HD inline void contact_force(const Physics& physics, const S& signed_depth,
                                     const Vec3<S>& velocity, ContactForce<S>& out) {
  constexpr double kSmoothing = 0.5;  // half width of the rounded corner of s(y) = max(y, 0)
  const Vec3<S> n = broadcast3<S>(physics.plane_normal);
  const S depth = max(signed_depth, S(0.0));
  const S depth2 = depth * depth;
  const S vn = dot(n, velocity);
  const Vec3<S> vt = fma(-vn, n, velocity);

  // s(y): y above e, 0 below -e, (y + e)^2 / (4e) between; s(1) = 1, so rest is untouched.
  const S y = fma(S(-physics.damping), vn, S(1.0));
  const S corner = y + S(kSmoothing);
  const S blend = corner * corner * S(0.25 / kSmoothing);
  const auto above = y > S(kSmoothing);
  const auto below = S(-kSmoothing) > y;
  const S s = select(above, y, select(below, S(0.0), blend));
  const S ds = select(above, S(1.0), select(below, S(0.0), corner * S(0.5 / kSmoothing)));

  const S fn = S(physics.normal) * depth2 * s;
  const S fn_depth = S(2.0 * physics.normal) * depth * s;              // d fn / d depth
  const S fn_vn = S(-physics.normal * physics.damping) * depth2 * ds;  // d fn / d vn

  if (physics.coulomb) {
    const S q = S(1.0) / sqrt(fma(S(physics.slip_velocity), S(physics.slip_velocity), dot(vt, vt)));
    const Vec3<S> direction = fma(S(-physics.mu) * q, vt, n);  // F = fn * direction
    out.force = fn * direction;
    if constexpr (Derivatives) {
      const S k = S(-physics.mu) * fn * q;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          const S tangent = S(i == j ? 1.0 : 0.0) - n[i] * n[j];
          out.by_position(i, j) = -fn_depth * direction[i] * n[j];
          out.by_velocity(i, j) =
              fma(fn_vn * direction[i], n[j], k * (tangent - q * q * vt[i] * vt[j]));
        }
      }
    }
  } else {
    const S kt = S(-physics.friction) * depth2;
    out.force = fma(fn, n, kt * vt);
    if constexpr (Derivatives) {
      const S kt_depth = S(-2.0 * physics.friction) * depth;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          const S tangent = S(i == j ? 1.0 : 0.0) - n[i] * n[j];
          out.by_position(i, j) = -fma(fn_depth, n[i], kt_depth * vt[i]) * n[j];
          out.by_velocity(i, j) = fma(kt, tangent, fn_vn * n[i] * n[j]);
        }
      }
    }
  }
}

}  // namespace trajopt::inline TRAJOPT_ISA
