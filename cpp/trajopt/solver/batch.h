// Many problems solved by the default solver at once. Every problem takes its own decisions; what
// several ask for at a time is asked for together.
#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <vector>

#include "trajopt/solver/funnel.h"

namespace trajopt {

struct BatchItem {
  BatchMember member;
  FunnelOptions options;
  Report report;  // may be empty
};

struct BatchEnd {
  Result result;
  std::exception_ptr error;  // what ended this problem instead; the others go on
};

// Whether one executor can work on both.
bool same_shape(const BatchItem& a, const BatchItem& b);

// Solves the problems of an executor; the options decide how, but were its own when it was made.
// `poll`, if any, is called between the launches.
std::vector<BatchEnd> solve_funnels(BatchExecutor& executor,
                                    const std::vector<FunnelOptions>& options,
                                    const std::vector<Report>& reports,
                                    const std::function<void()>& poll);

// The only problem of an executor.
Result solve_funnel(BatchExecutor& executor, const FunnelOptions& options,
                    const Observer& observer);

using MakeBatchExecutor = std::function<std::unique_ptr<BatchExecutor>(
    const std::vector<BatchMember>&, const ExecutorOptions&)>;

// The same for problems of any shapes: one executor after the other for those of one shape, and
// where the device's memory does not suffice for them, for half as many at a time.
std::vector<BatchEnd> solve_funnels(const std::vector<BatchItem>& items,
                                    const MakeBatchExecutor& make,
                                    const std::function<void()>& poll);

}  // namespace trajopt
