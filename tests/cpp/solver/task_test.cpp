// Calls that stop to ask: values, exceptions and memory of calls inside each other.
#include "trajopt/solver/task.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace trajopt {
namespace {

class Asker {
 public:
  CallFrames& frames() { return frames_; }

  // Sums `depth` answers in calls inside each other; refuses negative ones.
  Task<std::string> sum(int depth) {
    depth_ = depth;
    total_ = 0;
    const bool good = co_await descend();
    co_return (good ? "sum " : "refused ") + std::to_string(total_);
  }
  void answer(int value) {
    answer_ = value;
    asker_.resume();
  }

 private:
  struct Question {
    Asker& asker;
    bool await_ready() const noexcept { return false; }
    void await_suspend(std::coroutine_handle<> handle) noexcept { asker.asker_ = handle; }
    int await_resume() const noexcept { return asker.answer_; }
  };

  Task<bool> descend() {
    if (depth_ == 0) co_return true;
    --depth_;
    const int value = co_await Question{*this};
    if (value == 0) throw std::runtime_error("nothing");
    if (value < 0) co_return false;
    total_ += value;
    const bool good = co_await descend();
    co_return good;
  }

  CallFrames frames_;
  std::coroutine_handle<> asker_;
  int depth_ = 0, total_ = 0, answer_ = 0;
};

TEST(Task, GoesOnWithEachAnswer) {
  Asker asker;
  for (int round = 0; round < 3; ++round) {
    Task<std::string> task = asker.sum(3);
    EXPECT_FALSE(task.done());
    task.start();
    for (int value : {1, 10, 100}) {
      EXPECT_FALSE(task.done());
      asker.answer(value + round);
    }
    ASSERT_TRUE(task.done());
    EXPECT_EQ(task.result(), "sum " + std::to_string(111 + 3 * round));
  }
}

TEST(Task, EndsEarlyThroughAllCalls) {
  Asker asker;
  Task<std::string> task = asker.sum(9);
  task.start();
  for (int value : {5, 6, -1}) asker.answer(value);
  ASSERT_TRUE(task.done());
  EXPECT_EQ(task.result(), "refused 11");
}

TEST(Task, ExceptionsComeOutOfTheResult) {
  Asker asker;
  Task<std::string> task = asker.sum(9);
  task.start();
  asker.answer(5);
  asker.answer(0);
  ASSERT_TRUE(task.done());
  EXPECT_THROW(task.result(), std::runtime_error);
}

// More calls than the owner's memory holds, and calls that are given up on the way.
TEST(Task, DeepCallsAndAbandonedOnes) {
  Asker asker;
  {
    Task<std::string> task = asker.sum(100);
    task.start();
    for (int k = 0; k < 100; ++k) asker.answer(1);
    ASSERT_TRUE(task.done());
    EXPECT_EQ(task.result(), "sum 100");
  }
  {
    Task<std::string> task = asker.sum(100);
    task.start();
    for (int k = 0; k < 60; ++k) asker.answer(1);
    EXPECT_FALSE(task.done());
  }
  Task<std::string> task = asker.sum(1);
  task.start();
  asker.answer(7);
  EXPECT_EQ(task.result(), "sum 7");
}

TEST(CallFrames, TheLastTakenIsTheFirstGivenBack) {
  CallFrames frames;
  std::vector<void*> taken;
  for (int k = 0; k < 20; ++k) taken.push_back(frames.take(300));
  for (; !taken.empty(); taken.pop_back()) {
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(taken.back()) % alignof(std::max_align_t), 0u);
    CallFrames::give_back(taken.back());
  }
  void* first = frames.take(8);
  CallFrames::give_back(first);
  EXPECT_EQ(frames.take(4000), first);
}

}  // namespace
}  // namespace trajopt
