#include "trajopt/dynamics/batch.h"

#include <algorithm>
#include <vector>

#include "trajopt/base/buffer.h"
#include "trajopt/base/kernel_table.h"
#include "trajopt/base/parallel.h"
#include "trajopt/dynamics/batch_kernels.h"
#include "trajopt/dynamics/kinematics.h"
#include "trajopt/force/contact.h"

namespace trajopt {

TRAJOPT_KERNEL_TABLE(BatchKernels, kBatchKernels, batch_tables)

const BatchKernels& batch_kernels() { return batch_tables().active(); }

void dynamics_batch(const Model& model, const Physics& physics, const DynamicsBatch& b,
                    int threads) {
  const ModelView v = view(model);
  const BatchKernels& kernels = batch_kernels();
  const long packs = (b.count + kernels.lanes - 1) / kernels.lanes;
  const std::size_t scratch = kernels.scratch_bytes(v);
  std::vector<AlignedBuffer> memory;
  for (int k = 0; k < std::max(threads, 1); ++k) memory.push_back(aligned_buffer(scratch));
  parallel_for(packs, threads, [&](long pack, int worker) {
    const long begin = pack * kernels.lanes;
    kernels.run(v, physics, b, begin,
                static_cast<int>(std::min<long>(kernels.lanes, b.count - begin)),
                memory[worker].get());
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
