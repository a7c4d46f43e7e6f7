#include "trajopt/dynamics/batch.h"

#include <algorithm>
#include <vector>

#include "trajopt/base/buffer.h"
#include "trajopt/base/parallel.h"
#include "trajopt/dynamics/residual.h"

namespace trajopt {

namespace {

StencilPack<double> scalar_stencil(const Stencil& s) {
  StencilPack<double> r;
  for (int q = 0; q < 3; ++q) {
    r.acceleration[q] = s.acceleration[q];
    r.contact[q] = s.contact[q];
    for (int p = 0; p < 3; ++p) r.velocity[q][p] = s.velocity[q][p];
  }
  return r;
}

}  // namespace

void dynamics_batch(const Model& model, const Physics& physics, const DynamicsBatch& b,
                    int threads) {
  const ModelView v = view(model);
  const std::size_t scratch = DynamicsWorkspace<double>::bytes(v);
  std::vector<AlignedBuffer> memory;
  for (int k = 0; k < std::max(threads, 1); ++k) memory.push_back(aligned_buffer(scratch));
  const long d = v.ndof;
  parallel_for(b.count, threads, [&](long i, int worker) {
    DynamicsWorkspace<double> ws(v, memory[worker].get());
    const StencilPack<double> stencil =
        scalar_stencil(make_stencil(physics, b.dt[i], b.dt_before[i]));
    const double* nodes[3] = {b.x + i * d, b.x1 + i * d, b.x2 + i * d};
    if (b.jacobians[0] != nullptr) {
      double* js[3];
      for (int q = 0; q < 3; ++q) js[q] = b.jacobians[q] + i * d * d;
      dynamics_residual<double, Chart::vector, true>(v, physics, stencil, nodes, ws, b.fd + i * d,
                                                     js);
    } else {
      double* none[3] = {nullptr, nullptr, nullptr};
      dynamics_residual<double, Chart::vector, false>(v, physics, stencil, nodes, ws, b.fd + i * d,
                                                      none);
    }
  });
}

void kinematics_batch(const Model& model, long count, const double* x, double* transforms) {
  const ModelView v = view(model);
  std::vector<Transform<double>> joints(v.njoint);
  std::vector<Twist<double>> twists(v.ndof);
  for (long i = 0; i < count; ++i) {
    forward_kinematics<double, Chart::vector>(v, x + i * v.ndof, joints.data(), twists.data());
    for (int j = 0; j < v.njoint; ++j) {
      double* t = transforms + (i * v.njoint + j) * 12;
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) t[4 * r + c] = joints[j].rotation(r, c);
        t[4 * r + 3] = joints[j].translation[r];
      }
    }
  }
}

void center_of_mass_batch(const Model& model, long count, const double* x, double* com) {
  const ModelView v = view(model);
  std::vector<Transform<double>> joints(v.njoint);
  std::vector<Twist<double>> twists(v.ndof);
  for (long i = 0; i < count; ++i) {
    forward_kinematics<double, Chart::vector>(v, x + i * v.ndof, joints.data(), twists.data());
    Vec3<double> sum{0, 0, 0};
    for (int j = 0; j < v.njoint; ++j) {
      sum += fma(v.joints[j].mass, joints[j].translation,
                 joints[j].rotation * broadcast3<double>(v.joints[j].first));
    }
    for (int k = 0; k < 3; ++k) com[3 * i + k] = sum[k] / v.mass;
  }
}

void contact_forces_batch(const Model& model, const Physics& physics, long count, const double* x,
                          const double* velocity, double* forces) {
  const ModelView v = view(model);
  std::vector<Transform<double>> joints(v.njoint);
  std::vector<Twist<double>> twists(v.ndof);
  for (long i = 0; i < count; ++i) {
    forward_kinematics<double, Chart::vector>(v, x + i * v.ndof, joints.data(), twists.data());
    for (int c = 0; c < v.npoint; ++c) {
      double* out = forces + (i * v.npoint + c) * 3;
      out[0] = out[1] = out[2] = 0;
      if (!physics.contact()) continue;
      const ContactPoint& point = v.points[c];
      const Vec3<double> p = apply(joints[point.joint], broadcast3<double>(point.position));
      ContactForce<double> contact;
      contact_force<double, false>(physics, ground_depth(physics, p, point.radius),
                                   broadcast3<double>(velocity + (i * v.npoint + c) * 3), contact);
      for (int k = 0; k < 3; ++k) out[k] = contact.force[k];
    }
  }
}

}  // namespace trajopt
