// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_testing/timeline.hpp"

#include <map>
#include <utility>

#include <fmt/format.h>

#include "redag/sched/priority_scheduler.hpp"

namespace redag::testing {
namespace {

std::string in_ms(Time time) { return fmt::format("{:g}", static_cast<double>(time) / kMillisecond); }

}  // namespace

std::vector<JobEvent> simulate_events(const Workload &workload, Duration horizon, const sim::Options &options) {
  sim::Options with_horizon = options;
  with_horizon.horizon = horizon;
  sched::PriorityScheduler scheduler(workload, sched::config_of(workload));
  std::vector<JobEvent> events;
  sim::simulate(workload, scheduler, workload.platform.workers, with_horizon, [&](std::span<const JobEvent> batch) {
    events.insert(events.end(), batch.begin(), batch.end());
    return true;
  });
  return events;
}

std::string timeline(const Workload &workload, std::span<const JobEvent> events) {
  const std::vector<TaskRef> tasks = flatten(workload);
  std::vector<std::string> lines;
  std::map<std::pair<TaskId, std::uint32_t>, std::size_t> line_of;
  std::string endings;
  for (const JobEvent &event : events) {
    const std::pair<TaskId, std::uint32_t> job{event.task, event.job};
    const std::string name = fmt::format("{}#{}", tasks[event.task.value].task->name, event.job);
    switch (event.kind) {
      case JobEventKind::Dispatched:
        line_of[job] = lines.size();
        lines.push_back(fmt::format("{} w{} {}-", name, event.worker, in_ms(event.time)));
        break;
      case JobEventKind::Resumed:
        lines[line_of[job]] += fmt::format(" w{} {}-", event.worker, in_ms(event.time));
        break;
      case JobEventKind::Preempted:
      case JobEventKind::Finished: lines[line_of[job]] += in_ms(event.time); break;
      case JobEventKind::Aborted:
        lines[line_of[job]] += in_ms(event.time);
        endings += fmt::format("{} aborted {} {}\n", name, to_string(event.reason), in_ms(event.time));
        break;
      case JobEventKind::Skipped:
        endings += fmt::format("{} skipped {} {}\n", name, to_string(event.reason), in_ms(event.time));
        break;
      default: break;
    }
  }
  std::string text;
  for (const std::string &line : lines) text += line + "\n";
  return text + endings;
}

}  // namespace redag::testing
