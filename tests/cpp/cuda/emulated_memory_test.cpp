// A batch that the memory of the emulated device does not hold.
#include <gtest/gtest.h>

#include "cuda/emulation/stream_queue.h"
#include "solver/batch_cases.h"
#include "trajopt/base/error.h"
#include "trajopt/cuda/solver/executor.h"

namespace trajopt {
namespace {

// Counts what was made of a memory.
struct Maker {
  std::vector<std::size_t> made, refused;
  std::string message;

  MakeBatchExecutor function() {
    return [this](const std::vector<BatchMember>& members, const ExecutorOptions& options) {
      try {
        auto executor = cuda::make_executor(members, options);
        made.push_back(members.size());
        return executor;
      } catch (const DeviceMemoryError& error) {
        refused.push_back(members.size());
        message = error.what();
        throw;
      }
    };
  }
};

class Memory : public testing::Test {
 protected:
  ~Memory() override { emulation::set_memory(std::size_t{4} << 30); }
};

TEST_F(Memory, ABatchIsSplitUntilItFits) {
  // As much as three problems need and a tenth: what they share travels once only where its bytes
  // are equal, and those between the members of a structure are whatever lay there.
  test::Batch three(3);
  const std::size_t before = emulation::allocated_memory();
  std::vector<BatchMember> members;
  for (const BatchItem& item : three.items()) members.push_back(item.member);
  auto executor = cuda::make_executor(members, executor_options(test::options_for(1)));
  emulation::set_memory((emulation::allocated_memory() - before) * 11 / 10);
  executor.reset();

  test::Batch batch(5);
  Maker maker;
  const auto ends = solve_funnels(batch.items(), maker.function(), {});
  EXPECT_EQ(maker.refused, std::vector<std::size_t>{5});
  EXPECT_EQ(maker.made, (std::vector<std::size_t>{3, 2}));
  EXPECT_NE(maker.message.find("asked for"), std::string::npos) << maker.message;
  EXPECT_NE(maker.message.find("are free"), std::string::npos) << maker.message;
  test::expect_as_alone(batch, ends);
}

TEST_F(Memory, NothingFits) {
  emulation::set_memory(10000);
  test::Batch batch(3);
  Maker maker;
  for (const BatchEnd& end : solve_funnels(batch.items(), maker.function(), {})) {
    ASSERT_TRUE(end.error);
    EXPECT_THROW(std::rethrow_exception(end.error), DeviceMemoryError);
  }
}

}  // namespace
}  // namespace trajopt
