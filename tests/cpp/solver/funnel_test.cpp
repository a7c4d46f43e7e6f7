// The default solver's decisions, where an executor made for the purpose says what is found.
#include "trajopt/solver/funnel.h"

#include <gtest/gtest.h>

#include <cmath>

namespace trajopt {
namespace {

// A problem without constraints at its optimum: what is left of the slope is rounding, of either
// sign, and no trial is better.
class AtTheOptimum final : public SqpExecutor {
 public:
  AtTheOptimum(double slope, double trial) : slope_(slope), trial_(trial) {}

  Answer answer(const Request& request) override {
    Answer a;
    a.point.objective = request.kind == Request::Kind::trial ? trial_ : 1.0;
    a.steps.item[kTangentialSlope] = slope_;
    return a;
  }
  const std::vector<double>& terms() const override { return terms_; }
  const State& state() override { return terms_; }
  linalg::Ordering ordering() const override { return linalg::Ordering::sequential; }
  const std::string& error() const override { return error_; }
  void undo_correction() override {}
  PhaseSeconds take_seconds() override { return {}; }

 private:
  double slope_, trial_;
  std::vector<double> terms_;
  std::string error_;
};

TEST(Funnel, ARoundingIsNoReasonForAStep) {
  for (double slope : {-1e-20, 0.0, 1e-20}) {
    for (double trial : {1.0, 2.0}) {
      AtTheOptimum executor(slope, trial);
      const Report report = [&](const IterationRecord& record, SqpPoint&) {
        EXPECT_FALSE(record.accepted) << slope << ", objective " << trial;
        EXPECT_TRUE(std::isfinite(record.gain_ratio)) << slope << ", objective " << trial;
        return true;
      };
      EXPECT_EQ(run_funnel(executor, {.max_iterations = 5}, report).status, Status::solved);
    }
  }
}

}  // namespace
}  // namespace trajopt
