// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/self_check.hpp"

#include <algorithm>
#include <cmath>

#include "redag_lab/run/session.hpp"

namespace redag::lab {
namespace {

constexpr Duration kWakeUp = 100 * kMicrosecond;  // of a thread, which the model does not have
constexpr Duration kLongest = 600 * kSecond;

double error(Duration recorded, Duration simulated) {
  const double difference = std::abs(static_cast<double>(simulated - recorded));
  return difference <= static_cast<double>(kWakeUp) ? 0
                                                    : difference / static_cast<double>(std::max<Duration>(recorded, 1));
}

}  // namespace

Result<SelfCheck> check_against_recording(const ImportedWorkload &imported) {
  Workload workload = imported.workload;
  auto phase = imported.phases.begin();
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      if (task.phase == Phase::Unknown) {
        task.phase = Phase::Common;
        task.offset = *phase;
      }
      ++phase;
    }
  }
  SelfCheck check;
  check.executor = workload.platform.workers > 1 ? "mte" : "ste";
  SessionOptions options;
  options.duration = std::clamp<Duration>(imported.length, kSecond, kLongest);
  options.keep_trace = false;
  options.overheads.dispatch = imported.overhead;
  const Result<Session> session = run_session(workload, Variant{check.executor, check.executor, {}, false}, options);
  if (!session) return tl::unexpected(session.error());
  for (const metrics::TaskSummary &task : session->summary.tasks) {
    const metrics::Distribution &recorded = imported.responses[task.task.value];
    const metrics::Distribution &simulated = task.jobs.response;
    if (recorded.count == 0 || simulated.count == 0) {
      check.unknown.push_back(task.name);
    } else {
      check.tasks.push_back(
          {task.name, recorded, simulated, error(recorded.p50, simulated.p50), error(recorded.p99, simulated.p99)});
    }
  }
  return check;
}

}  // namespace redag::lab
