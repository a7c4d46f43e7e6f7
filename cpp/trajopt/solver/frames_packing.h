// What of a problem is given, as the launches see it: its arrays go into a parcel, and what points
// to them points to where they will be.
#pragma once

#include <cstddef>
#include <vector>

#include "trajopt/problem/frames_work.h"
#include "trajopt/solver/executor.h"
#include "trajopt/solver/parcel.h"

namespace trajopt {

// Fills the members of `system` that are given; the others stay as they are.
void pack_problem(Parcel& parcel, const TrajectoryProblem& problem, const ExecutorOptions& options,
                  FramesSystem& system);

// Memory that a rank needs for any frame of any of the problems.
std::size_t rank_scratch_bytes(const std::vector<BatchMember>& members, double augmentation);

}  // namespace trajopt
