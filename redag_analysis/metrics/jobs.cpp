// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/jobs.hpp"

#include <algorithm>
#include <utility>

namespace redag::metrics {
namespace {

bool released_earlier(const JobRecord &a, const JobRecord &b) { return a.sequence < b.sequence; }

}  // namespace

const char *to_string(JobOutcome outcome) {
  switch (outcome) {
    case JobOutcome::InFlight: return "in_flight";
    case JobOutcome::Finished: return "finished";
    case JobOutcome::Skipped: return "skipped";
    case JobOutcome::Aborted: return "aborted";
  }
  return "?";
}

JobFolder::JobFolder(const Workload &workload) {
  tasks_.reserve(workload.task_count());
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) tasks_.push_back(TaskJobs{task.deadline, {}});
  }
}

void JobFolder::add(std::span<const JobEvent> events) {
  for (const JobEvent &event : events) add(event);
}

void JobFolder::add(const JobEvent &event) {
  if (event.task.value >= tasks_.size()) {
    ++ignored_;
    return;
  }
  if (is_mode_change(event.kind)) return;
  TaskJobs &task = tasks_[event.task.value];
  if (event.kind == JobEventKind::Released) {
    Live job;
    job.record.sequence = released_++;
    job.record.task = event.task;
    job.record.number = event.job;
    job.record.release = event.value;
    job.record.seen = event.time;
    job.record.deadline = event.value + task.deadline;
    job.since = event.value;
    task.live.push_back(job);
    return;
  }

  const auto found =
      std::find_if(task.live.begin(), task.live.end(), [&](const Live &job) { return job.record.number == event.job; });
  if (found == task.live.end()) {
    ++ignored_;
    return;
  }
  JobRecord &record = found->record;
  switch (event.kind) {
    case JobEventKind::Released: break;
    case JobEventKind::Ready:
      record.ready = event.time;
      record.origin = event.value;
      break;
    case JobEventKind::Deferred: record.deferred = true; break;
    case JobEventKind::Dispatched:
      // Started comes from another thread's ring, and may have arrived before Dispatched.
      if (!record.has_started()) record.start = event.time;
      record.worker = event.worker;
      record.deadline = event.value;
      found->move(true, event.time);
      break;
    case JobEventKind::Started: record.start = event.value; break;  // exact, even if the event was delivered late
    case JobEventKind::Preempted:
      ++record.preemptions;
      found->move(false, event.time);
      break;
    case JobEventKind::Waits: found->move(false, event.time); break;
    case JobEventKind::Resumed: found->move(true, event.time); break;
    case JobEventKind::Executed: record.processor = event.value; break;
    case JobEventKind::Exceeded: record.exceeded = true; break;
    case JobEventKind::Served:
    case JobEventKind::Woken:
    case JobEventKind::HighMode:
    case JobEventKind::LowMode: break;
    case JobEventKind::Finished:
    case JobEventKind::Skipped:
    case JobEventKind::Aborted: end(task, static_cast<std::size_t>(found - task.live.begin()), event); break;
  }
}

void JobFolder::Live::move(bool onto_worker, Time now) {
  if (now > since) {
    if (is_on_worker) record.on_worker += now - since;
    since = now;
  }
  is_on_worker = onto_worker;
}

void JobFolder::end(TaskJobs &task, std::size_t index, const JobEvent &event) {
  Live &job = task.live[index];
  if (event.kind == JobEventKind::Skipped) {
    job.record.outcome = JobOutcome::Skipped;
    job.record.finish = event.time;
  } else {
    job.record.outcome = event.kind == JobEventKind::Finished ? JobOutcome::Finished : JobOutcome::Aborted;
    job.record.finish = event.value;
  }
  job.record.reason = event.reason;
  job.move(false, job.record.finish);
  // On threads, the end of a body can precede the decision that took its worker.
  job.record.on_worker -= std::min(job.since - job.record.finish, job.record.on_worker);
  ended_.push_back(job.record);
  task.live.erase(task.live.begin() + static_cast<std::ptrdiff_t>(index));
}

std::vector<JobRecord> JobFolder::take_ended() { return std::exchange(ended_, {}); }

std::vector<JobRecord> JobFolder::in_flight() const {
  std::vector<JobRecord> records;
  for (const TaskJobs &task : tasks_) {
    for (const Live &job : task.live) records.push_back(job.record);
  }
  std::sort(records.begin(), records.end(), released_earlier);
  return records;
}

std::vector<JobRecord> fold_jobs(const Workload &workload, std::span<const JobEvent> events) {
  JobFolder folder(workload);
  folder.add(events);
  std::vector<JobRecord> records = folder.take_ended();
  const std::vector<JobRecord> live = folder.in_flight();
  records.insert(records.end(), live.begin(), live.end());
  std::sort(records.begin(), records.end(), released_earlier);
  return records;
}

}  // namespace redag::metrics
