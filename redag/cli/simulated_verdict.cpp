#include "redag/cli/simulated_verdict.hpp"

#include <algorithm>
#include <vector>

#include "redag/sched/priority_scheduler.hpp"
#include "redag/sim/simulator.hpp"

namespace redag::cli {
namespace {

// Looks for the first deadline that is missed.
class Watch {
 public:
  explicit Watch(const Workload &workload) : workload_(workload), tasks_(flatten(workload)), live_(tasks_.size()) {}

  // False once something was missed.
  bool add(std::span<const JobEvent> events) {
    for (const JobEvent &event : events) see(event);
    return ok_;
  }

  // Jobs that have not ended by `end` and should have.
  bool finish(Time end) {
    for (std::size_t t = 0; t < live_.size(); ++t) {
      for (const Live &job : live_[t]) judge(t, job, end);
    }
    return ok_;
  }

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
    if (job == jobs.end()) return;
    switch (event.kind) {
      case JobEventKind::Ready: job->origin = event.value; break;
      case JobEventKind::Finished:
        judge(event.task.value, *job, event.value);
        jobs.erase(job);
        break;
      case JobEventKind::Skipped:
      case JobEventKind::Aborted: ok_ = false; break;
      default: break;
    }
  }

  void judge(std::size_t task, const Live &job, Time end) {
    const Duration end_to_end = workload_.dags[tasks_[task].dag.value].deadline;
    ok_ = ok_ && end - job.release <= tasks_[task].task->deadline;
    if (end_to_end > 0 && job.origin != kNever) ok_ = ok_ && end - job.origin <= end_to_end;
  }

  const Workload &workload_;
  std::vector<TaskRef> tasks_;
  std::vector<std::vector<Live>> live_;
  bool ok_ = true;
};

}  // namespace

bool misses_nothing(const Workload &workload, const analysis::AnalysisPlatform &platform, Duration duration,
                    const std::atomic<bool> *stop) {
  sched::Config config;
  config.workers = platform.workers;
  config.preemption = platform.preemption;
  config.policy = workload.policy;
  config.levels = platform.levels;
  config.max_started = platform.max_started;
  sched::PriorityScheduler scheduler(workload, config);

  sim::Options options;
  options.horizon = duration;
  options.overheads = {platform.release_overhead, platform.dispatch_overhead, platform.preempt_overhead};
  options.demand = [](const Task &task, TaskId, std::uint32_t) { return task.wcet; };
  options.jitter = [](const Task &, TaskId, std::uint32_t) -> Duration { return 0; };
  Watch watch(workload);
  const sim::Result result =
      sim::simulate(workload, scheduler, platform.workers, options, [&](std::span<const JobEvent> events) {
        return watch.add(events) && (stop == nullptr || !stop->load(std::memory_order_relaxed));
      });
  return watch.finish(result.end) && result.end >= duration;
}

}  // namespace redag::cli
