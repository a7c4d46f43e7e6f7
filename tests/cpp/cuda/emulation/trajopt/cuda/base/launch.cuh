// Stands in for the launch.cuh of the CUDA executor: a launch runs its jobs on the processor, the
// last first, each with a group of emulated ranks.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "cuda/emulation/stream_queue.h"
#include "trajopt/base/buffer.h"
#include "trajopt/base/group.h"
#include "trajopt/cuda/base/check.h"
#include "trajopt/cuda/base/stream.h"

namespace trajopt::cuda {

template <class Work>
void load() {}

template <class Work>
void launch(const Work& work, const Stream& stream) {
  ASSERT_LE(work.ranks(), Work::kMaxRanks);
  emulation::enqueue(stream.get(), [work] {
    const Emulated group(work.ranks(), RankOrder::reverse);
    const AlignedBuffer space = aligned_buffer(work.bytes());
    for (long job = work.jobs() - 1; job >= 0; --job) {
      std::fill_n(space.get(), work.bytes(), std::byte{0xff});
      work(group, job, space.get());
    }
  });
}

}  // namespace trajopt::cuda
