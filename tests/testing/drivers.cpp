// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/drivers.hpp"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/derived/demand.hpp"
#include "redag/derived/rng.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_lab/run/run_workload.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::testing {
namespace {

trace::Trace empty_trace(const RunSpec &spec, trace::Driver driver) {
  trace::Trace trace;
  trace.info.workload = spec.workload;
  trace.info.executor = spec.executor;
  trace.info.config = config_of(spec);
  trace.info.preemption = trace::preemption_name(spec.preemption);
  trace.info.driver = driver;
  trace.info.seed = spec.seed;
  trace.info.end = spec.horizon;
  return trace;
}

// The timer tasks' grid points before the horizon, in the order in which they are seen.
struct Arrival {
  Time seen = 0;
  Time nominal = 0;
  TaskId task;
};

std::vector<Arrival> arrivals(const RunSpec &spec) {
  std::vector<Arrival> found;
  const std::vector<TaskRef> tasks = flatten(spec.workload);
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    const Task &task = *tasks[i].task;
    if (task.activation != Activation::Timer) continue;
    std::uint32_t number = 0;
    Time seen = 0;
    for (Time nominal = task.offset; nominal < spec.horizon; nominal += task.period) {
      seen = std::max(seen, nominal + release_jitter(task, TaskId(i), number++, spec.seed));
      found.push_back({seen, nominal, TaskId(i)});
    }
  }
  std::stable_sort(found.begin(), found.end(), [](const Arrival &a, const Arrival &b) { return a.seen < b.seen; });
  return found;
}

// The jobs that a driver has started, and random events on them.
class RandomJobs {
 public:
  RandomJobs(const Workload &workload, sched::Scheduler &scheduler, sched::Preemption preemption, std::uint64_t seed)
      : tasks_(flatten(workload)),
        devices_(workload.platform.devices.size()),
        scheduler_(scheduler),
        preemption_(preemption),
        rng_(seed) {}

  void carry_out(const sched::Step &step) {
    for (const sched::Dispatch &dispatch : step.dispatches) {
      for (Started &job : started_) {
        if (dispatch.over.valid() && job.slot == dispatch.over) job.runs = false;
      }
      if (dispatch.kind == sched::DispatchKind::Level) continue;
      if (dispatch.kind == sched::DispatchKind::Start) {
        started_.push_back({dispatch.job, dispatch.task, true, false, false, {}});
        continue;
      }
      for (Started &job : started_) {
        if (job.slot != dispatch.job) continue;
        job.runs = dispatch.kind == sched::DispatchKind::Resume;
        job.wait = job.runs ? Waiting::No : Waiting::Served;
      }
    }
  }

  /// Ends a job, brings one to a preemption point, or does nothing.
  void something_happens(Time now) {
    if (started_.empty()) return;
    const auto choice = static_cast<std::size_t>(rng_.uniform(0, static_cast<std::int64_t>(started_.size()) - 1));
    Started &job = started_[choice];
    if (job.wait != Waiting::No && goes_on_waiting(job, now)) return;
    if (job.wait == Waiting::No && !job.runs && preemption_ != sched::Preemption::Full) return;
    const double dice = rng_.uniform01();
    if (job.runs && devices_ > 0 && rng_.uniform01() < 0.3) return begin_wait(job, now);
    if (dice < 0.2 && exceed(job, now)) return;
    if (job.runs && preemption_ == sched::Preemption::Cooperative && dice < 0.5) {
      scheduler_.preemption_point(job.slot, now);
      return;
    }
    const JobSlot slot = job.slot;
    started_.erase(started_.begin() + static_cast<std::ptrdiff_t>(choice));
    scheduler_.complete(slot, now,
                        dice > 0.97   ? sched::Outcome::Threw
                        : dice > 0.94 ? sched::Outcome::NoData
                                      : sched::Outcome::Finished);
  }

  Rng &rng() { return rng_; }

 private:
  enum class Waiting : std::uint8_t { No, Asked, Served, Woken };
  struct Started {
    JobSlot slot;
    TaskId task;
    bool runs = true;
    bool used_budget = false;
    bool used_wcet_low = false;
    Waiting wait = Waiting::No;
  };

  // The job asks a device, or waits for something else.
  void begin_wait(Started &job, Time now) {
    const auto device = static_cast<std::size_t>(rng_.uniform(0, static_cast<std::int64_t>(devices_)));
    const DeviceId asked = device < devices_ ? DeviceId(device) : DeviceId::none();
    job.runs = false;
    job.wait = asked.valid() ? Waiting::Asked : Waiting::Served;
    scheduler_.wait(job.slot, asked, now);
  }

  // Returns false if the job is to end while it waits.
  bool goes_on_waiting(Started &job, Time now) {
    if (rng_.uniform01() < 0.05) return false;
    if (job.wait == Waiting::Served) {
      job.wait = Waiting::Woken;
      scheduler_.wake(job.slot, now);
    }
    return true;
  }

  // Makes the job use up one of its limits, if any is left.
  bool exceed(Started &job, Time now) {
    const Task &task = *tasks_[job.task.value].task;
    if (task.wcet_low > 0 && !job.used_wcet_low) {
      job.used_wcet_low = true;
      scheduler_.exceed(job.slot, sched::Limit::WcetLow, now);
      return true;
    }
    if (task.budget == 0 || job.used_budget) return false;
    job.used_budget = true;
    scheduler_.exceed(job.slot, sched::Limit::Budget, now);
    return true;
  }

  std::vector<TaskRef> tasks_;
  std::size_t devices_;
  sched::Scheduler &scheduler_;
  sched::Preemption preemption_;
  Rng rng_;
  std::vector<Started> started_;
};

// True if the last task of a workload could also be added while running. It then has no edges, and does not change the
// place of its DAG (chain_aware).
bool last_task_is_alone(const Workload &workload) {
  const Dag &dag = workload.dags.back();
  const auto last = static_cast<std::uint32_t>(dag.tasks.size() - 1);
  if (last == 0 || dag.tasks[last].activation != Activation::Timer || !dag.tasks[last].predecessors.empty())
    return false;
  if (std::none_of(dag.tasks.begin(), dag.tasks.end() - 1,
                   [&](const Task &task) { return task.period <= dag.tasks[last].period; })) {
    return false;
  }
  return std::none_of(dag.tasks.begin(), dag.tasks.end(), [last](const Task &task) {
    return std::count(task.predecessors.begin(), task.predecessors.end(), last) > 0;
  });
}

// Adds that task at the place that it has among the others. Among equal ranks it is the last, and chain_aware reverses
// the ranks. It gets its timing afterwards.
void add_last_task(sched::Scheduler &scheduler, const Dag &whole, DagId dag, PolicyKind policy, Time now) {
  const std::uint32_t rank = topological_ranks(whole).back();
  REDAG_CHECK(rank > 0, "another source stands before it");
  Task task = whole.tasks.back();
  task.period = task.deadline = kSecond;
  const TaskId id = scheduler.add_task(dag, policy == PolicyKind::ChainAware ? rank : rank - 1, task, now);
  scheduler.set_timing(id, whole.tasks.back().period, whole.tasks.back().deadline, now);
}

}  // namespace

sched::Config config_of(const RunSpec &spec) {
  sched::Config config{spec.workload.platform.workers, spec.preemption, spec.workload.policy, 0, 0};
  config.ties = spec.workload.ties;
  return config;
}

trace::Trace SimulatorDriver::run(const RunSpec &spec) {
  return simulated(empty_trace(spec, trace::Driver::Simulator).info, spec.horizon);
}

trace::Trace ManualDriver::run(const RunSpec &spec) {
  trace::Trace trace = empty_trace(spec, trace::Driver::Threads);
  trace.info.stepped = spec.seed % 2 == 0;
  Workload at_first = spec.workload;
  bool one_is_missing = last_task_is_alone(spec.workload);
  if (one_is_missing) at_first.dags.back().tasks.pop_back();
  sched::PriorityScheduler scheduler(at_first, trace.info.config);
  RandomJobs jobs(spec.workload, scheduler, spec.preemption, spec.seed);
  std::uint32_t most = sched::kNoLimit;
  const auto decide = [&](Time instant) {
    if (trace.info.stepped && jobs.rng().uniform01() < 0.3) {
      const auto choice = static_cast<std::uint32_t>(jobs.rng().uniform(0, 3));
      most = choice == 3 ? sched::kNoLimit : choice;
    }
    const sched::Step step = scheduler.dispatch(instant, most);
    jobs.carry_out(step);
    trace.events.insert(trace.events.end(), step.events.begin(), step.events.end());
  };
  Time now = 0;
  // Everything that happens at one instant is decided together, before time moves on.
  const auto move_to = [&](Time later) {
    if (later > now) decide(now);
    now = later;
  };
  for (const Arrival &arrival : arrivals(spec)) {
    // On average two events happen to jobs between two releases.
    while (jobs.rng().uniform01() < 0.67) {
      move_to(now + jobs.rng().uniform(0, std::max<Duration>(0, arrival.seen - now) / 2));
      jobs.something_happens(now);
    }
    move_to(std::max(now, arrival.seen));
    if (one_is_missing && arrival.task.value + 1 == spec.workload.task_count()) {
      one_is_missing = false;
      add_last_task(scheduler, spec.workload.dags.back(), DagId(spec.workload.dags.size() - 1), spec.workload.policy,
                    now);
    }
    const double dice = jobs.rng().uniform01();
    if (dice < 0.06) {
      scheduler.miss(arrival.task, arrival.nominal, now, dice < 0.03 ? Reason::Overrun : Reason::QueueFull);
    } else {
      scheduler.release(arrival.task, arrival.nominal, now);
    }
  }
  decide(now);
  return trace;
}

trace::Trace ThreadsDriver::run(const RunSpec &spec) {
  lab::RunOptions options;
  options.duration = spec.horizon;
  options.seed = spec.seed;
  options.executor = spec.executor;
  switch (spec.preemption) {
    case sched::Preemption::None: options.preemption = PreemptionMode::None; break;
    case sched::Preemption::Cooperative: options.preemption = PreemptionMode::Cooperative; break;
    case sched::Preemption::Full: options.preemption = PreemptionMode::Os; break;
  }
  Result<lab::RunResult> result = lab::run_workload(spec.workload, options);
  REDAG_CHECK(result.has_value(), "the workload could not be run on threads");
  return std::move(result->trace);
}

}  // namespace redag::testing
