#include "trajopt/trajectory/hermite.h"

#include <algorithm>

#include "trajopt/model/configuration.h"
#include "trajopt/model/rotation.h"

namespace trajopt {

namespace {

struct Basis {
  double h00, h10, h01, h11;
};

Basis hermite_basis(double s) {
  const double s2 = s * s, s3 = s2 * s;
  return {2 * s3 - 3 * s2 + 1, s3 - 2 * s2 + s, 3 * s2 - 2 * s3, s3 - s2};
}

Mat3<double> scaled(double c, const Mat3<double>& a) {
  Mat3<double> r;
  for (int i = 0; i < 9; ++i) r.m[i] = c * a.m[i];
  return r;
}

Mat3<double> transpose(const Mat3<double>& a) {
  return {{a.m[0], a.m[3], a.m[6], a.m[1], a.m[4], a.m[7], a.m[2], a.m[5], a.m[8]}};
}

Mat3<double> hat(const Vec3<double>& r) { return {{0, -r.z, r.y, r.z, 0, -r.x, -r.y, r.x, 0}}; }

Vec3<double> vec(const double* p) { return {p[0], p[1], p[2]}; }

// d(J_l^-1(h) w)/dh: J_l^-1(h) = I - [h]/2 + k [h]^2, k = k(|h|^2).
Mat3<double> inverse_jacobian_derivative(const Vec3<double>& h, const Vec3<double>& w) {
  const double t2 = dot(h, h);
  double k, dk;  // dk = k'/t with k' the derivative by t = |h|
  if (t2 < 1e-4) {
    k = 1.0 / 12 + t2 / 720 + t2 * t2 / 30240;
    dk = 1.0 / 360 + t2 / 7560;
  } else {
    const double t = sqrt(t2);
    double s, c;
    sincos(0.5 * t, s, c);
    const double cot = c / s;
    k = 1 / t2 - cot / (2 * t);
    dk = (-2 / (t2 * t) + cot / (2 * t2) + (1 + cot * cot) / (4 * t)) / t;
  }
  const Mat3<double> x = hat(h);
  const Vec3<double> xxw = x * (x * w);
  Mat3<double> d = scaled(0.5, hat(w));
  add_outer(d, dk, xxw, h);
  add_outer(d, k, h, w);
  add_outer(d, -2 * k, w, h);
  for (int i = 0; i < 3; ++i) d(i, i) += k * dot(h, w);
  return d;
}

}  // namespace

HermiteSpline::HermiteSpline(const Model& model, int segments, int frames_per_segment)
    : model_(model), segments_(segments), per_segment_(frames_per_segment), balls_(0) {
  for (const Joint& joint : model.joints) balls_ += joint.type == JointType::ball;
  weights_.resize(frames());
  rotations_.resize(static_cast<std::size_t>(frames()) * 4 * balls_ * 9);
  for (int i = 1; i <= frames(); ++i) {
    const int segment = (i - 1) / per_segment_;
    const Basis b = hermite_basis((i - segment * per_segment_) / static_cast<double>(per_segment_));
    const double value[4] = {b.h00, b.h10, b.h01, b.h11};
    for (int k = 0; k < 4; ++k) {
      weights_[i - 1].weights[k] = {
          segment - 1 + k / 2, k % 2, value[k],
          rotations_.data() + (static_cast<std::size_t>(i - 1) * 4 + k) * balls_ * 9};
    }
  }
}

void HermiteSpline::frames(const double* q, const double* v, double* out) const {
  const int nq = model_.nq, d = model_.ndof;
  std::copy(q, q + nq, out);
  for (int i = 1; i <= frames(); ++i) {
    const int z = (i - 1) / per_segment_;
    const Basis b = hermite_basis((i - z * per_segment_) / static_cast<double>(per_segment_));
    const double *qa = q + z * nq, *qb = qa + nq, *va = v + z * d, *vb = va + d;
    for (const Joint& joint : model_.joints) {
      double* r = out + static_cast<std::size_t>(i) * nq + joint.q;
      if (joint.type != JointType::ball) {
        *r = b.h00 * qa[joint.q] + b.h10 * va[joint.dof] + b.h01 * qb[joint.q] +
             b.h11 * vb[joint.dof];
        continue;
      }
      const Vec3<double> phi = quaternion_difference(qb + joint.q, qa + joint.q);
      const Vec3<double> end = left_jacobian_inverse(phi) * vec(vb + joint.dof);
      const Vec3<double> h = b.h10 * vec(va + joint.dof) + b.h01 * phi + b.h11 * end;
      double turn[4];
      quaternion_exp(h, turn);
      quaternion_product(turn, qa + joint.q, r);
    }
  }
}

void HermiteSpline::linearize(const double* q, const double* v) {
  const int nq = model_.nq, d = model_.ndof;
  if (balls_ == 0) return;
  for (int i = 1; i <= frames(); ++i) {
    const int z = (i - 1) / per_segment_;
    const Basis b = hermite_basis((i - z * per_segment_) / static_cast<double>(per_segment_));
    const double *qa = q + z * nq, *qb = qa + nq, *va = v + z * d, *vb = va + d;
    double* out = rotations_.data() + static_cast<std::size_t>(i - 1) * 4 * balls_ * 9;
    int ball = 0;
    for (const Joint& joint : model_.joints) {
      if (joint.type != JointType::ball) continue;
      const Vec3<double> wa = vec(va + joint.dof), wb = vec(vb + joint.dof);
      const Vec3<double> phi = quaternion_difference(qb + joint.q, qa + joint.q);
      const Mat3<double> inverse = left_jacobian_inverse(phi);
      const Vec3<double> h = b.h10 * wa + b.h01 * phi + b.h11 * (inverse * wb);
      const Mat3<double> j = left_jacobian(h);
      // End: phi = log(R_b R_a^T), h1' = J_l^-1(phi) omega_b; by phi:
      Mat3<double> end = scaled(b.h01, identity3<double>());
      end += scaled(b.h11, inverse_jacobian_derivative(phi, wb));
      const Mat3<double> by_phi = j * end;
      // Start: the chart moves along, R = exp(h) exp(delta) R_a; phi falls by J_l^-T(phi) delta.
      double turn[4];
      quaternion_exp(h, turn);
      Mat3<double> start = quaternion_matrix(turn);
      start += scaled(-1.0, by_phi * transpose(inverse));
      const Mat3<double> blocks[4] = {start, scaled(b.h10, j), by_phi * inverse,
                                      scaled(b.h11, j * inverse)};
      for (int k = 0; k < 4; ++k)
        std::copy(blocks[k].m, blocks[k].m + 9, out + (k * balls_ + ball) * 9);
      ++ball;
    }
  }
}

void HermiteSpline::fit(const double* frames, double* q, double* v) const {
  const int nq = model_.nq, d = model_.ndof;
  std::vector<double> before(d), after(d);
  for (int z = 0; z <= segments_; ++z) {
    const int i = z * per_segment_;
    const double* x = frames + static_cast<std::size_t>(i) * nq;
    std::copy(x, x + nq, q + z * nq);
    std::fill(before.begin(), before.end(), 0.0);
    std::fill(after.begin(), after.end(), 0.0);
    if (i > 0) difference(model_, x, x - nq, before.data());
    if (i < this->frames()) difference(model_, x + nq, x, after.data());
    const double c = per_segment_ / ((i > 0 ? 1.0 : 0.0) + (i < this->frames() ? 1.0 : 0.0));
    for (int k = 0; k < d; ++k) v[z * d + k] = c * (before[k] + after[k]);
  }
}

}  // namespace trajopt
