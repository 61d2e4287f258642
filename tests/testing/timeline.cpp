// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/timeline.hpp"
#include "redag_analysis/executors/executors.hpp"

#include <map>
#include <utility>

#include <fmt/format.h>

namespace redag::testing {
namespace {

std::string in_ms(Time time) { return fmt::format("{:g}", static_cast<double>(time) / kMillisecond); }

}  // namespace

trace::RunInfo run_info(Workload workload, const std::string &executor, std::uint64_t seed) {
  trace::RunInfo info;
  info.executor = executor;
  info.config = executors::effective_config(*executors::find_executor(executor), sched::config_of(workload));
  info.preemption = trace::preemption_name(info.config.preemption);
  info.seed = seed;
  info.workload = std::move(workload);
  return info;
}

trace::Trace simulated(trace::RunInfo info, Duration horizon, sim::Options options) {
  trace::Trace trace{std::move(info), {}};
  const Workload &workload = trace.info.workload;
  options.horizon = horizon;
  options.seed = trace.info.seed;
  const auto scheduler = executors::make_scheduler(trace.info.executor, workload, trace.info.config);
  const auto keep = [&](std::span<const JobEvent> events) {
    trace.events.insert(trace.events.end(), events.begin(), events.end());
    return true;
  };
  trace.info.end = sim::simulate(workload, *scheduler, trace.info.config.workers, options, keep).end;
  return trace;
}

std::vector<JobEvent> simulate_events(const Workload &workload, Duration horizon, const sim::Options &options) {
  return simulated(run_info(workload, "redag", options.seed), horizon, options).events;
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
      case JobEventKind::Waits: lines[line_of[job]] += in_ms(event.time) + " ~"; break;
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
