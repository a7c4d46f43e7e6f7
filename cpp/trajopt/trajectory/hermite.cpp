#include "trajopt/trajectory/hermite.h"

#include <algorithm>

#include "trajopt/base/parallel.h"
#include "trajopt/model/configuration.h"

namespace trajopt {

HermiteSpline::HermiteSpline(const Model& model, int segments, int frames_per_segment)
    : model_(model),
      segments_(segments),
      per_segment_(frames_per_segment),
      balls_(0),
      weights_(4 * static_cast<std::size_t>(frames_per_segment)) {
  for (const Joint& joint : model.joints) {
    if (joint.type == JointType::ball) {
      runs_.push_back({joint.dof, 3, balls_++});
    } else if (runs_.empty() || runs_.back().ball >= 0) {
      runs_.push_back({joint.dof, 1, -1});
    } else {
      ++runs_.back().count;
    }
  }
  for (int i = 1; i <= per_segment_; ++i)
    hermite_weights(i / static_cast<double>(per_segment_), weights_.data() + 4L * (i - 1));
  for (double weight : weights_) {
    plain_.resize(plain_.size() + model.ndof, weight);
    for (const DofRun& run : runs_)
      if (run.ball >= 0) std::fill_n(plain_.end() - model.ndof + run.first, 3, 0.0);
  }
  rotations_.resize(static_cast<std::size_t>(frames()) * 4 * balls_ * 9);
}

SplineView HermiteSpline::view() const {
  return {segments_,    per_segment_,    balls_,        static_cast<int>(runs_.size()),
          runs_.data(), weights_.data(), plain_.data(), rotations_.data()};
}

void HermiteSpline::frames(const ControlPoints& points, double* out, int threads) const {
  const ModelView model = trajopt::view(model_);
  const SplineView spline = view();
  parallel_for(frames(), threads,
               [&](long f, int) { hermite_frame(model, spline, points, f, out + f * model.nq); });
}

void HermiteSpline::linearize(const ControlPoints& points, int threads) {
  if (balls_ == 0) return;
  const ModelView model = trajopt::view(model_);
  const SplineView spline = view();
  parallel_for(frames(), threads, [&](long f, int) {
    hermite_rotations(model, spline, points, f, rotations_.data() + f * 36 * balls_);
  });
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
