#include "redag/experiment/simulated_misses.hpp"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "redag/base/rng.hpp"
#include "redag/experiment/seed.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/sim/simulator.hpp"
#include "redag/trace/trace.hpp"

namespace redag::experiment {
namespace {

/// Follows the jobs of one run until the first miss.
class Watch {
 public:
  Watch(const Workload &workload, const analysis::System &system)
      : workload_(workload), system_(system), live_(system.tasks.size()) {}

  /// False once there is a miss.
  bool operator()(std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      see(event);
      if (!miss_.empty()) return false;
    }
    return true;
  }

  /// What has not ended by `end` has answered at least this late.
  void finish(Time end) {
    for (std::size_t t = 0; t < live_.size(); ++t) {
      for (const Live &job : live_[t]) judge(TaskId(t), job, end);
    }
  }

  [[nodiscard]] const std::string &miss() const { return miss_; }

 private:
  struct Live {
    std::uint32_t number = 0;
    Time release = 0;
    Time origin = kNever;
  };

  void see(const JobEvent &event) {
    std::vector<Live> &jobs = live_[event.task.value];
    if (event.kind == JobEventKind::Released) {
      jobs.push_back(Live{event.job, event.value, kNever});
      return;
    }
    const auto job = std::find_if(jobs.begin(), jobs.end(), [&](const Live &live) { return live.number == event.job; });
    switch (event.kind) {
      case JobEventKind::Ready: job->origin = event.value; break;
      case JobEventKind::Finished:
        judge(event.task, *job, event.value);
        jobs.erase(job);
        break;
      case JobEventKind::Skipped:
        miss_ = fmt::format("{}: job {} was skipped", trace::task_name(workload_, event.task), event.job);
        break;
      default: break;
    }
  }

  void judge(TaskId id, const Live &job, Time until) {
    const analysis::SystemTask &task = system_.tasks[id.value];
    if (until - job.release > task.deadline) {
      say(id, job, until - job.release, task.deadline, "deadline");
    }
    const Duration end_to_end = system_.dags[task.dag.value].deadline;
    if (end_to_end > 0 && job.origin != kNever && until - job.origin > end_to_end) {
      say(id, job, until - job.origin, end_to_end, "DAG's end-to-end deadline");
    }
  }

  void say(TaskId id, const Live &job, Duration response, Duration deadline, const char *which) {
    if (!miss_.empty()) return;
    miss_ = fmt::format("{}: job {} answered after at least {}, its {} is {}", trace::task_name(workload_, id),
                        job.number, format_duration(response), which, format_duration(deadline));
  }

  const Workload &workload_;
  const analysis::System &system_;
  std::vector<std::vector<Live>> live_;
  std::string miss_;
};

// What the runs have in common: every job takes its wcet, and none is released before time 0.
Workload at_worst(const Workload &workload) {
  Workload worst = workload;
  for (Dag &dag : worst.dags) {
    for (Task &task : dag.tasks) {
      task.bcet = task.wcet;
      task.execution = ExecutionTime{};
      task.offset = 0;
    }
  }
  return worst;
}

// Tasks of one unit are released together.
void draw_offsets(Workload &workload, const analysis::System &system, Rng &rng) {
  std::vector<Duration> offsets;
  for (const analysis::Unit &unit : system.units) offsets.push_back(rng.uniform(0, unit.period - 1));
  std::size_t id = 0;
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      if (task.activation == Activation::Timer) task.offset = offsets[system.tasks[id].unit];
      ++id;
    }
  }
}

}  // namespace

std::optional<SeenMiss> find_miss(const Workload &workload, const analysis::System &system,
                                  const SimulationEffort &effort, std::uint64_t seed) {
  Duration slowest = 0;
  for (const analysis::SystemTask &task : system.tasks) slowest = std::max(slowest, task.period);
  const sched::Config config = sim::simulated_config(workload);
  SeenMiss run{at_worst(workload), 0, 0, {}};
  for (std::uint32_t i = 0; i <= effort.offsets; ++i) {
    run.seed = derive_seed(seed, {i});
    if (i > 0) {
      Rng rng(run.seed);
      draw_offsets(run.workload, system, rng);
    }
    run.duration = slowest * (effort.periods + (i > 0 ? 1 : 0));
    sim::Options options;
    options.horizon = run.duration;
    options.seed = run.seed;
    sched::PriorityScheduler scheduler(run.workload, config);
    Watch watch(run.workload, system);
    const sim::Result result = sim::simulate(run.workload, scheduler, config.workers, options,
                                             [&watch](std::span<const JobEvent> events) { return watch(events); });
    if (watch.miss().empty()) watch.finish(result.end);
    if (watch.miss().empty()) continue;
    run.what = watch.miss();
    return run;
  }
  return std::nullopt;
}

}  // namespace redag::experiment
