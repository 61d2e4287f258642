// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/check/check_start.hpp"

#include <algorithm>

namespace redag::metrics {

bool StartRules::applies() const {
  return context_.info.driver == trace::Driver::Threads && !context_.info.stepped &&
         context_.info.config.preemption == sched::Preemption::Full;
}

void StartRules::before(const JobEvent &event) {
  if (!applies()) return;
  const LiveJob *job = context_.replay.find(event.task, event.job);
  if (job == nullptr) return;  // the replay reports it
  const Replay::JobRef ref{event.task, event.job};
  switch (event.kind) {
    case JobEventKind::Dispatched: unbegun_.push_back(Unbegun{ref, event.time, kNever, {}}); break;
    case JobEventKind::Started:
      settle(ref, event.value);
      ran(*job, event.value);
      break;
    case JobEventKind::Finished:
    case JobEventKind::Aborted:
      settle(ref, kNever);
      if (job->body_began) ran(*job, event.value);
      break;
    default: break;
  }
}

// Records that the job's thread was on a processor at time `at`.
void StartRules::ran(const LiveJob &job, Time at) {
  for (Unbegun &waiting : unbegun_) {
    if (waiting.overtaken != kNever || at - waiting.dispatched <= kLateStart) continue;
    const LiveJob *urgent = context_.replay.find(waiting.job.task, waiting.job.number);
    if (urgent == nullptr || !context_.replay.preempts(urgent->own, job.raised)) continue;
    waiting.overtaken = at;
    waiting.by = Replay::JobRef{job.task, job.number};
  }
}

void StartRules::settle(const Replay::JobRef &job, Time begun) {
  const auto found = std::find_if(unbegun_.begin(), unbegun_.end(), [&](const Unbegun &one) { return one.job == job; });
  if (found == unbegun_.end()) return;
  judge(*found, begun);
  unbegun_.erase(found);
}

void StartRules::judge(const Unbegun &job, Time begun) {
  context_.expect(Rule::Start, job.overtaken == kNever || begun <= job.overtaken, job.job.task, job.job.number, [&] {
    return "it was dispatched at " + format_duration(job.dispatched) + ", but no thread had begun it when " +
           context_.job_name(job.by.task, job.by.number) + ", which is less urgent, ran at " +
           format_duration(job.overtaken);
  });
}

void StartRules::end_of_trace() {
  for (const Unbegun &job : unbegun_) judge(job, kNever);
}

}  // namespace redag::metrics
