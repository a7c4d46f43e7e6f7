#include "trajopt/trajectory/hermite.h"

#include <gtest/gtest.h>

#include "problem/fixtures.h"
#include "trajopt/model/rotation.h"

namespace trajopt {
namespace {

constexpr int kSegments = 4, kPerSegment = 5, kFrames = kSegments * kPerSegment;

std::vector<double> random_configurations(const Model& model, int count, test::Random& random,
                                          double turn) {
  std::vector<double> q(static_cast<std::size_t>(count) * model.nq);
  configuration_from_vector(model, random.vector(model.ndof, 0.5).data(), q.data());
  for (int i = 1; i < count; ++i) {
    const double* before = q.data() + static_cast<long>(i - 1) * model.nq;
    integrate(model, before, random.vector(model.ndof, turn).data(),
              q.data() + static_cast<long>(i) * model.nq);
  }
  return q;
}

// Frames 0..N of the spline through control points z = 0..Z.
std::vector<double> frames_of(const Model& model, const HermiteSpline& spline,
                              const std::vector<double>& q, const std::vector<double>& v) {
  std::vector<double> frames((spline.frames() + 1L) * model.nq);
  std::copy_n(q.begin(), model.nq, frames.begin());
  spline.frames({q.data(), v.data(), q.data() + model.nq, v.data() + model.ndof},
                frames.data() + model.nq, 1);
  return frames;
}

TEST(Hermite, ReproducesCubics) {
  const Model model = test::make_character(false);
  const int d = model.ndof;
  test::Random random(1);
  const std::vector<double> a = random.vector(4 * static_cast<std::size_t>(d));
  const auto value = [&](int k, double s) {
    return ((a[4 * k + 3] * s + a[4 * k + 2]) * s + a[4 * k + 1]) * s + a[4 * k];
  };
  const auto slope = [&](int k, double s) {
    return (3 * a[4 * k + 3] * s + 2 * a[4 * k + 2]) * s + a[4 * k + 1];
  };
  HermiteSpline spline(model, kSegments, kPerSegment);
  std::vector<double> q, v;
  for (int z = 0; z <= kSegments; ++z) {
    for (int k = 0; k < d; ++k) {
      q.push_back(value(k, z));
      v.push_back(slope(k, z));
    }
  }
  const std::vector<double> frames = frames_of(model, spline, q, v);
  for (int i = 0; i <= kFrames; ++i) {
    const double s = static_cast<double>(i) / kPerSegment;
    for (int k = 0; k < d; ++k)
      EXPECT_NEAR(frames[i * d + k], value(k, s), 1e-14 * (1 + std::abs(value(k, s)) + s * s * s));
  }
}

// A ball that turns at a constant rate about a fixed axis is met exactly, past full turns.
TEST(Hermite, ReproducesUniformRotation) {
  const Model model = test::make_character();
  const int d = model.ndof, nq = model.nq;
  const double rate[3] = {1.2, -1.6, 1.5};  // 2.5 rad a segment, 10 rad in all
  std::vector<double> q((kSegments + 1) * nq, 0.0), v((kSegments + 1) * d, 0.0);
  std::vector<double> x(d, 0.0), expected(nq);
  const auto pose = [&](double s, double* out) {
    for (const Joint& joint : model.joints)
      for (int k = 0; k < 3 && joint.type == JointType::ball; ++k) x[joint.dof + k] = s * rate[k];
    configuration_from_vector(model, x.data(), out);
  };
  for (int z = 0; z <= kSegments; ++z) {
    pose(z, q.data() + z * nq);
    for (const Joint& joint : model.joints)
      for (int k = 0; k < 3 && joint.type == JointType::ball; ++k)
        v[z * d + joint.dof + k] = rate[k];
  }
  const HermiteSpline spline(model, kSegments, kPerSegment);
  const std::vector<double> frames = frames_of(model, spline, q, v);
  std::vector<double> error(d);
  for (int i = 0; i <= kFrames; ++i) {
    pose(static_cast<double>(i) / kPerSegment, expected.data());
    difference(model, frames.data() + i * nq, expected.data(), error.data());
    EXPECT_LE(test::largest(error), 1e-14) << "frame " << i;
  }
}

// With many frames a segment: no jump at the knots, and the velocity there is the control point's
// from both sides.
TEST(Hermite, SmoothAcrossSegments) {
  const Model model = test::make_character();
  const int d = model.ndof, nq = model.nq, fine = 2000;
  test::Random random(2);
  const std::vector<double> q = random_configurations(model, 3, random, 0.7);
  const std::vector<double> v = random.vector(3 * static_cast<std::size_t>(d), 1.0);
  const HermiteSpline spline(model, 2, fine);
  const std::vector<double> frames = frames_of(model, spline, q, v);
  const double* knot = frames.data() + static_cast<long>(fine) * nq;
  std::vector<double> left(d), right(d), gap(d);
  difference(model, knot, q.data() + nq, gap.data());
  EXPECT_LE(test::largest(gap), 1e-14);
  difference(model, knot, knot - nq, left.data());
  difference(model, knot + nq, knot, right.data());
  for (int k = 0; k < d; ++k) {
    EXPECT_NEAR(fine * left[k], v[d + k], 0.02);
    EXPECT_NEAR(fine * right[k], v[d + k], 0.02);
    EXPECT_NEAR(0.5 * fine * (left[k] + right[k]), v[d + k], 0.01);
  }
}

// fit() goes through the knots, and gives a spline of slow motion back.
TEST(Hermite, FitRoundTrip) {
  const Model model = test::make_character();
  const int d = model.ndof, nq = model.nq;
  test::Random random(3);
  const std::vector<double> q = random_configurations(model, kSegments + 1, random, 0.6);
  const std::vector<double> v = random.vector((kSegments + 1) * static_cast<std::size_t>(d), 0.5);
  for (const int per_segment : {10, 100}) {
    const HermiteSpline spline(model, kSegments, per_segment);
    const std::vector<double> frames = frames_of(model, spline, q, v);
    std::vector<double> fitted_q(q.size()), fitted_v(v.size()), error(d);
    spline.fit(frames.data(), fitted_q.data(), fitted_v.data());
    for (int z = 0; z <= kSegments; ++z) {
      difference(model, fitted_q.data() + z * nq, q.data() + z * nq, error.data());
      EXPECT_LE(test::largest(error), 1e-13);
      for (int k = 0; k < d; ++k)  // first order: the acceleration jumps at a knot
        EXPECT_NEAR(fitted_v[z * d + k], v[z * d + k], 20.0 / per_segment);
    }
  }
}

// Control points that come from a spline's own state: state_from_frames keeps constant motions.
TEST(Hermite, StateFromConstantFrames) {
  test::Case c = test::make_case({.formulation = Formulation::spline, .frames = 20, .turn = 0.0});
  const int nq = c.problem->model().nq;
  std::vector<double> frames;
  for (int i = 0; i < 20; ++i) frames.insert(frames.end(), c.state.begin(), c.state.begin() + nq);
  std::vector<double> back;
  c.problem->frames_of(c.problem->state_from_frames(frames.data()), back);
  for (int k = 0; k < nq; ++k)  // from the second knot on nothing moves
    for (int i = 10; i <= 20; ++i) EXPECT_NEAR(back[(i + 1) * nq + k], c.state[k], 1e-14);
}

}  // namespace
}  // namespace trajopt
