// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why_links.hpp"

#include <algorithm>

namespace redag::metrics {
namespace {

std::uint64_t job_key(const JobId &job) { return (std::uint64_t{job.task.value} << 32U) | job.number; }

// True for two timer tasks whose jobs serve each other by release (docs/model.md, "Readiness").
bool is_aligned(const Task &a, const Task &b) {
  return a.activation == Activation::Timer && b.activation == Activation::Timer && a.period == b.period &&
         a.offset == b.offset;
}

}  // namespace

JobLinks::JobLinks(const trace::Trace &trace)
    : trace_(trace), refs_(flatten(trace.info.workload)), jobs_(fold_jobs(trace.info.workload, trace.events)) {
  index_.reserve(jobs_.size());
  for (std::size_t i = 0; i < jobs_.size(); ++i) index_.emplace(job_key({jobs_[i].task, jobs_[i].number}), i);
  last_.assign(jobs_.size(), kNone);
  oldest_ = last_;
  finished_.resize(refs_.size());
  live_.resize(refs_.size());
  for (const JobEvent &event : trace.events) {
    if (event.task.value < refs_.size()) add(event);
  }
  for (const std::vector<std::size_t> &task : live_) {
    for (const std::size_t job : task) {
      if (jobs_[job].ready == kNever) link_unfinished(job);
    }
  }
  finished_.clear();
  live_.clear();
}

std::size_t JobLinks::find(const JobId &job) const {
  const auto found = index_.find(job_key(job));
  return found == index_.end() ? kNone : found->second;
}

Time JobLinks::end_of(std::size_t job) const {
  const JobRecord &record = jobs_[job];
  return record.outcome == JobOutcome::InFlight ? std::max(trace_.info.end, record.seen) : record.finish;
}

TaskId JobLinks::predecessor(TaskId task, std::uint32_t index) const {
  const TaskRef &ref = refs_[task.value];
  return TaskId(task.value - ref.index + index);
}

void JobLinks::add(const JobEvent &event) {
  const std::size_t job = find({event.task, event.job});
  if (job == kNone) return;
  const Task &of = task(event.task);
  std::vector<std::size_t> &live = live_[event.task.value];
  switch (event.kind) {
    case JobEventKind::Released:
      live.push_back(job);
      if (of.activation == Activation::Data) link(job);
      break;
    case JobEventKind::Ready:
      if (of.activation == Activation::Timer) link(job);
      break;
    case JobEventKind::Finished: finished_[event.task.value].push_back(job); [[fallthrough]];
    case JobEventKind::Aborted:
    case JobEventKind::Skipped:
      std::erase(live, job);
      if (jobs_[job].ready == kNever && of.activation == Activation::Timer) link_unfinished(job);
      break;
    default: break;
  }
}

// The job of `predecessor` whose data the job has: of an aligned task that of the same release, otherwise the newest.
std::size_t JobLinks::data_of(const Task &of, TaskId predecessor, const JobRecord &job) const {
  constexpr std::size_t kRecent = 64;
  const std::vector<std::size_t> &finished = finished_[predecessor.value];
  const bool aligned = is_aligned(of, task(predecessor));
  std::size_t newest = kNone;
  for (std::size_t i = finished.size(); i > 0 && finished.size() - i < kRecent; --i) {
    const std::size_t one = finished[i - 1];
    if (aligned && jobs_[one].release == job.release) return one;
    if (newest == kNone || jobs_[one].release > jobs_[newest].release) newest = one;
  }
  return newest;
}

void JobLinks::link(std::size_t job) {
  const JobRecord &record = jobs_[job];
  const Task &of = task(record.task);
  for (const std::uint32_t index : of.predecessors) {
    const TaskId from = predecessor(record.task, index);
    const std::size_t data = data_of(of, from, record);
    if (data == kNone) continue;
    const JobRecord &one = jobs_[data];
    if (last_[job] == kNone || one.finish > jobs_[last_[job]].finish) last_[job] = data;
    if (oldest_[job] == kNone || one.origin < jobs_[oldest_[job]].origin) oldest_[job] = data;
  }
}

// A job that never was ready waited for the first job of a predecessor that was still on its way, if there was one.
void JobLinks::link_unfinished(std::size_t job) {
  const JobRecord &record = jobs_[job];
  for (const std::uint32_t index : task(record.task).predecessors) {
    const std::vector<std::size_t> &live = live_[predecessor(record.task, index).value];
    if (live.empty()) continue;
    if (last_[job] == kNone || jobs_[live.front()].release < jobs_[last_[job]].release) last_[job] = live.front();
  }
}

}  // namespace redag::metrics
