// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/simulated_verdict.hpp"

#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/metrics/deadline_watch.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace redag::lab {

bool misses_nothing(const Workload &workload, const analysis::AnalysisPlatform &platform, Duration duration,
                    const std::atomic<bool> *stop) {
  const sched::Config config = analysis::config_of(platform, workload);
  sched::PriorityScheduler scheduler(workload, config);

  sim::Options options;
  options.horizon = duration;
  options.overheads = {platform.release_overhead + platform.timer_overhead, platform.dispatch_overhead,
                       platform.preempt_overhead};
  options.demand = [](const Task &task, TaskId, std::uint32_t) { return task.wcet; };
  options.jitter = [](const Task &, TaskId, std::uint32_t) -> Duration { return 0; };
  metrics::DeadlineWatch watch(workload);
  bool missed = false;
  const auto see = [&missed](const metrics::JudgedJob &job) { missed = missed || job.miss != metrics::Miss::None; };
  const sim::Result result =
      sim::simulate(workload, scheduler, platform.workers, options, [&](std::span<const JobEvent> events) {
        watch.add(events, see);
        return !missed && (stop == nullptr || !stop->load(std::memory_order_relaxed));
      });
  watch.finish(result.end, see);
  return !missed && result.end >= duration;
}

}  // namespace redag::lab
