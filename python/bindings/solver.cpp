#include <algorithm>
#include <atomic>
#include <cmath>

#include "bindings.h"
#include "solve_call.h"
#include "trajopt/base/error.h"
#include "trajopt/solver/batch.h"
#ifdef TRAJOPT_WITH_CUDA
#include "trajopt/cuda/solver/executor.h"
#endif

namespace trajopt::bindings {

namespace {

// Set by one thread, looked at by others that solve.
struct StopFlag {
  std::atomic<bool> set{false};
};

MakeBatchExecutor maker(const std::string& device) {
#ifdef TRAJOPT_WITH_CUDA
  if (device == "cuda") return cuda::make_executor;
#else
  if (device == "cuda") throw DeviceError("device cuda: this package was built without CUDA");
#endif
  throw ArgumentError("device is '" + device + "', expected 'cpu' or 'cuda'");
}

// One after the other, where there is nothing to be gained from doing it together.
std::vector<BatchEnd> solve_in_turn(const std::vector<BatchItem>& items) {
  std::vector<BatchEnd> ends(items.size());
  for (std::size_t i = 0; i < items.size(); ++i) {
    const BatchItem& item = items[i];
    try {
      const auto executor = make_cpu_executor(*item.member.problem, executor_options(item.options),
                                              *item.member.state);
      ends[i].result = run_funnel(*executor, item.options, item.report);
    } catch (...) {
      ends[i].error = std::current_exception();
    }
  }
  return ends;
}

// Keeps the records of a problem that nobody watches.
Report keep_records(std::vector<IterationRecord>& records, const StopFlag& stop) {
  return [&](const IterationRecord& record, SqpPoint&) {
    records.push_back(record);
    return !stop.set;
  };
}

// Shows every record to Python, with a function that fetches the state: while it is looked at.
Report show_records(const py::object& function) {
  return [held = hold(function)](const IterationRecord& record, SqpPoint& point) {
    const py::gil_scoped_acquire gil;
    const auto at = std::make_shared<SqpPoint*>(&point);
    const py::cpp_function state([at] {
      if (*at == nullptr) throw ArgumentError("a snapshot can be taken during the callback only");
      return to_array((*at)->state());
    });
    const py::object go = (*held)(record_dict(record), state);
    *at = nullptr;
    return go.is_none() || go.cast<bool>();
  };
}

// Seconds of each kind of question to an executor of `members`, the least of some rounds.
py::dict time_requests(const std::vector<BatchMember>& members, const std::string& device,
                       const FunnelOptions& options, int rounds) {
  using Kind = Request::Kind;
  constexpr std::pair<const char*, Kind> kKinds[] = {{"linearize", Kind::linearize},
                                                     {"steps", Kind::steps},
                                                     {"trial", Kind::trial},
                                                     {"correction", Kind::correction}};
  const int count = static_cast<int>(members.size());
  std::vector<double> best(std::size(kKinds), HUGE_VAL);
  std::vector<Request> requests(count);
  std::vector<Answer> answers(count);
  std::vector<int> all(count);
  for (int p = 0; p < count; ++p) all[p] = p;
  {
    const py::gil_scoped_release release;
    std::unique_ptr<BatchExecutor> together;
    std::vector<std::unique_ptr<SqpExecutor>> each;
    if (device == "cpu") {
      for (const BatchMember& m : members)
        each.push_back(make_cpu_executor(*m.problem, executor_options(options), *m.state));
    } else {
      together = maker(device)(members, executor_options(options));
    }
    for (int round = 0; round < rounds; ++round) {
      for (std::size_t k = 0; k < std::size(kKinds); ++k) {
        const Request request{.kind = kKinds[k].second,
                              .damping = options.damping,
                              .tangential = 1,
                              .normal = 1,
                              .zeta = 1};
        std::fill(requests.begin(), requests.end(), request);
        Stopwatch watch;
        if (together) {
          together->answer(request.kind, all, requests, answers);
          for (const Answer& a : answers)
            if (a.error) std::rethrow_exception(a.error);
        } else {
          for (const auto& executor : each) executor->answer(request);
        }
        best[k] = std::min(best[k], watch.lap());
      }
    }
  }
  py::dict seconds;
  for (std::size_t k = 0; k < std::size(kKinds); ++k) seconds[kKinds[k].first] = best[k];
  return seconds;
}

// The exception that Python would see if it were thrown across its border.
py::object python_exception(const std::exception_ptr& error) {
  try {
    py::cpp_function([&] { std::rethrow_exception(error); })();
  } catch (const py::error_already_set& raised) {
    return raised.value();
  }
  return py::none();  // not reached: the call throws
}

// What a problem ended with, as Python sees it: (status, message, iterations, state, ordering,
// records), or an exception.
py::object end_object(const BatchEnd& end, const State& state,
                      const std::vector<IterationRecord>& records) {
  if (end.error) return python_exception(end.error);
  py::list list;
  for (const IterationRecord& r : records) list.append(record_dict(r));
  const Result& r = end.result;
  return py::make_tuple(status_name(r.status), r.message, r.iterations, to_array(state),
                        linalg::ordering_name(r.ordering), list);
}

}  // namespace

void register_solver(py::module_& m) {
  using namespace py::literals;  // NOLINT(google-build-using-namespace)
  const FunnelOptions f;
  m.def(
      "solve_funnel",
      [](TrajectoryProblem& problem, const Array& state, const py::object& observer,
         int max_iterations, double constraint_tolerance, double objective_tolerance, int window,
         double funnel, double smoothing, double damping, double augmentation, double epsilon,
         double normal_radius, int corrections, bool restore, const std::string& ordering,
         const std::string& device) {
        const FunnelOptions options{max_iterations,
                                    constraint_tolerance,
                                    objective_tolerance,
                                    window,
                                    funnel,
                                    smoothing,
                                    damping,
                                    augmentation,
                                    epsilon,
                                    normal_radius,
                                    corrections,
                                    restore,
                                    parse_ordering(ordering)};
        const auto solve = [&device](TrajectoryProblem& on, const FunnelOptions& with, State& from,
                                     const Observer& watch) {
          if (device == "cpu") return solve_funnel(on, with, from, watch);
          const auto executor = maker(device)({{&on, &from}}, executor_options(with));
          return solve_funnel(*executor, with, watch);
        };
        return run_solver(solve, problem, options, state, observer);
      },
      "problem"_a, "state"_a, "observer"_a = py::none(), py::kw_only(),
      "max_iterations"_a = f.max_iterations, "constraint_tolerance"_a = f.constraint_tolerance,
      "objective_tolerance"_a = f.objective_tolerance, "window"_a = f.window, "funnel"_a = f.funnel,
      "smoothing"_a = f.smoothing, "damping"_a = f.damping, "augmentation"_a = f.augmentation,
      "epsilon"_a = f.epsilon, "normal_radius"_a = f.normal_radius, "corrections"_a = f.corrections,
      "restore"_a = f.restore, "ordering"_a = "auto", "device"_a = "cpu");

  py::class_<StopFlag>(m, "StopFlag")
      .def(py::init<>())
      .def("set", [](StopFlag& flag) { flag.set = true; })
      .def("is_set", [](const StopFlag& flag) { return flag.set.load(); });

  // Many problems; what an observer is None for keeps its records until the end. poll() is called
  // between launches on a device.
  m.def(
      "solve_funnels",
      [](const std::vector<TrajectoryProblem*>& problems, const std::vector<Array>& starts,
         const std::vector<py::object>& observers, const StopFlag& stop, const py::object& poll,
         const std::vector<int>& max_iterations, const std::vector<bool>& restore,
         double constraint_tolerance, double objective_tolerance, const std::string& ordering,
         const std::string& device) {
        const std::size_t n = problems.size();
        if (starts.size() != n || observers.size() != n || max_iterations.size() != n ||
            restore.size() != n) {
          throw ArgumentError("solve_funnels: the lists have different lengths");
        }
        std::vector<State> states(n);
        std::vector<std::vector<IterationRecord>> records(n);
        std::vector<BatchItem> items(n);
        for (std::size_t i = 0; i < n; ++i) {
          states[i].assign(starts[i].data(), starts[i].data() + starts[i].size());
          items[i].member = {problems[i], &states[i]};
          FunnelOptions& options = items[i].options;
          options.max_iterations = max_iterations[i];
          options.restore = restore[i];
          options.constraint_tolerance = constraint_tolerance;
          options.objective_tolerance = objective_tolerance;
          options.ordering = parse_ordering(ordering);
          items[i].report =
              observers[i].is_none() ? keep_records(records[i], stop) : show_records(observers[i]);
        }
        const auto look = [&] {
          const py::gil_scoped_acquire gil;
          if (PyErr_CheckSignals() != 0) throw py::error_already_set();
          if (!poll.is_none()) poll();
        };
        std::vector<BatchEnd> ends;
        {
          const py::gil_scoped_release release;
          ends = device == "cpu" ? solve_in_turn(items) : solve_funnels(items, maker(device), look);
        }
        py::list out;
        for (std::size_t i = 0; i < n; ++i) out.append(end_object(ends[i], states[i], records[i]));
        return out;
      },
      "problems"_a, "states"_a, "observers"_a, "stop"_a, "poll"_a, py::kw_only(),
      "max_iterations"_a, "restore"_a, "constraint_tolerance"_a, "objective_tolerance"_a,
      "ordering"_a = "auto", "device"_a = "cpu");

  // For benchmarks: where the time of an iteration goes.
  m.def(
      "time_requests",
      [](const std::vector<TrajectoryProblem*>& problems, const std::vector<Array>& starts,
         const std::string& device, const std::string& ordering, int rounds) {
        if (starts.size() != problems.size() || problems.empty()) {
          throw ArgumentError("time_requests: as many states as problems are needed, at least one");
        }
        std::vector<State> states;
        states.reserve(starts.size());
        for (const Array& a : starts) states.emplace_back(a.data(), a.data() + a.size());
        std::vector<BatchMember> members;
        for (std::size_t i = 0; i < states.size(); ++i)
          members.push_back({problems[i], &states[i]});
        FunnelOptions options;
        options.ordering = parse_ordering(ordering);
        return time_requests(members, device, options, rounds);
      },
      "problems"_a, "states"_a, "device"_a, "ordering"_a, "rounds"_a);
}

}  // namespace trajopt::bindings
