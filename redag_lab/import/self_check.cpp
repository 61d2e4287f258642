// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/self_check.hpp"

#include <algorithm>
#include <cmath>

#include "redag_lab/run/session.hpp"

namespace redag::lab {
namespace {

constexpr Duration kLongest = 600 * kSecond;

double error(Duration recorded, Duration simulated, Duration noise) {
  const double difference = std::abs(static_cast<double>(simulated - recorded));
  return difference <= static_cast<double>(noise) ? 0
                                                  : difference / static_cast<double>(std::max<Duration>(recorded, 1));
}

}  // namespace

bool SelfCheck::is_reproduced() const {
  return std::all_of(tasks.begin(), tasks.end(), [](const ReproducedTask &task) { return task.is_reproduced(); });
}

Replayed replay(const ImportedWorkload &imported, const Workload &workload, const Variant &variant) {
  Replayed replayed{workload, {}};
  for (const TaskRef &ref : flatten(workload)) {
    Task &task = replayed.workload.dags[ref.dag.value].tasks[ref.index];
    task.jitter = 0;  // the gaps contain it
    if (task.phase != Phase::Unknown) continue;
    task.phase = Phase::Common;
    task.offset = imported.replays[ref.id.value].offset;
  }
  SessionOptions &options = replayed.options;
  options.duration = std::clamp<Duration>(imported.length, kSecond, kLongest);
  options.keep_trace = false;
  const auto nth = [](const std::vector<Duration> &values, std::uint32_t number) {
    return values.empty() ? 0 : values[number % values.size()];
  };
  const std::vector<Replay> &replays = imported.replays;
  // ReDAG-RT delays jobs by what the machine does beyond the usual. Threads of real-time priority are not even
  // preempted by others, which made a few runs last longer than nearly all.
  const bool is_ours = variant.is_redag();
  const bool is_undisturbed = is_ours && variant.preemption == PreemptionMode::Os && imported.is_wall_time;
  options.demand = [&imported, nth, is_ours, is_undisturbed](const Task &, TaskId task, std::uint32_t number) {
    const Replay &recorded = imported.replays[task.value];
    Duration execution = nth(recorded.executions, number);
    Duration delay = nth(recorded.delays, number);
    if (is_ours) delay = imported.overhead + std::max<Duration>(delay - imported.wake_ups.p50, 0);
    if (is_undisturbed) delay = imported.overhead;
    if (is_undisturbed) execution = std::min(execution, recorded.undisturbed);
    return std::max<Duration>(execution + delay, 1);
  };
  for (const Replay &recorded : replays) options.ranks.push_back(recorded.rank);
  options.gap = [&replays, nth](const Task &, TaskId task, std::uint32_t number) {
    return nth(replays[task.value].gaps, number);
  };
  return replayed;
}

Result<SelfCheck> check_against_recording(const ImportedWorkload &imported) {
  SelfCheck check;
  check.executor = imported.workload.platform.workers > 1 ? "mte" : "ste";
  const Variant variant{check.executor, check.executor, {}, false};
  const Replayed replayed = replay(imported, imported.workload, variant);
  check.noise = imported.wake_ups;
  const Result<Session> session = run_session(replayed.workload, variant, replayed.options);
  if (!session) return tl::unexpected(session.error());
  for (const metrics::TaskSummary &task : session->summary.tasks) {
    const metrics::Distribution &recorded = imported.replays[task.task.value].responses;
    const metrics::Distribution &simulated = task.jobs.response;
    if (recorded.count == 0 || simulated.count == 0) {
      check.unknown.push_back(task.name);
    } else {
      check.tasks.push_back({task.task, task.name, recorded, simulated,
                             error(recorded.p50, simulated.p50, check.noise.p50),
                             error(recorded.p99, simulated.p99, check.noise.p99)});
    }
  }
  return check;
}

}  // namespace redag::lab
