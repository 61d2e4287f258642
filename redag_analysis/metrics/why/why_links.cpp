// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why_links.hpp"

#include <utility>

#include "redag_analysis/metrics/miss.hpp"

namespace redag::metrics {
namespace {

// True for two timer tasks whose jobs serve each other by release (docs/model.md, "Readiness").
bool release_together(const Task &a, const Task &b) {
  return a.activation == Activation::Timer && b.activation == Activation::Timer && a.period == b.period &&
         a.offset == b.offset;
}

}  // namespace

JobLinks::JobLinks(const trace::RunInfo &run)
    : run_(run),
      refs_(flatten(run.workload)),
      is_sink_(sinks_of(run.workload)),
      folder_(run.workload),
      live_(refs_.size()),
      finished_(refs_.size()) {}

void JobLinks::add(const JobEvent &event) {
  if (event.task.value >= refs_.size()) return;
  folder_.add(std::span(&event, 1));
  switch (event.kind) {
    case JobEventKind::Released: release(event); break;
    case JobEventKind::Ready:
      if (const JobHandle job = find({event.task, event.job});
          job != nullptr && task(event.task).activation == Activation::Timer) {
        link(*job);
      }
      break;
    case JobEventKind::Finished:
    case JobEventKind::Aborted:
    case JobEventKind::Skipped:
      folder_.drain_ended([this](const JobRecord &record) {
        if (const JobHandle job = find({record.task, record.number})) end(job, record);
      });
      break;
    default: break;
  }
}

void JobLinks::finish() {
  // Nothing was ready of what a job in flight waits for: the jobs that it waits for are in flight as well.
  for (const JobRecord &record : folder_.in_flight()) {
    const JobHandle job = find({record.task, record.number});
    if (job == nullptr) continue;
    job->record = record;
    if (record.ready == kNever) link_unfinished(*job);
  }
  for (std::vector<JobHandle> &task : live_) {
    for (JobHandle &job : task) {
      complete(*job);
      ended_.push_back(std::move(job));
    }
    task.clear();
  }
}

JobHandle JobLinks::find(const JobId &job) const {
  for (const JobHandle &one : live_[job.task.value]) {
    if (one->record.number == job.number) return one;
  }
  return nullptr;
}

Time JobLinks::end_of(const LinkedJob &job) const {
  const JobRecord &record = job.record;
  return record.outcome == JobOutcome::InFlight ? std::max(run_.end, record.seen) : record.finish;
}

TaskId JobLinks::predecessor(TaskId task, std::uint32_t index) const {
  const TaskRef &ref = refs_[task.value];
  return TaskId(task.value - ref.index + index);
}

void JobLinks::release(const JobEvent &event) {
  auto job = std::make_shared<LinkedJob>();
  job->record.task = event.task;
  job->record.number = event.job;
  job->record.release = event.value;
  job->record.seen = event.time;
  if (task(event.task).activation == Activation::Data) link(*job);
  live_[event.task.value].push_back(std::move(job));
}

void JobLinks::end(const JobHandle &job, const JobRecord &record) {
  job->record = record;
  complete(*job);
  std::erase(live_[record.task.value], job);
  if (record.ready == kNever && task(record.task).activation == Activation::Timer) link_unfinished(*job);
  if (record.outcome == JobOutcome::Finished && !is_sink_[record.task.value]) {
    std::deque<JobHandle> &finished = finished_[record.task.value];
    finished.push_back(job);
    if (finished.size() > kRecent) finished.pop_front();
  }
  ended_.push_back(job);
}

void JobLinks::complete(LinkedJob &job) const {
  job.has_ended = true;
  if (job.ending == nullptr) return;
  job.ending->is_known = true;
  job.ending->time = end_of(job);
}

// The job of `predecessor` whose data the job has: of an aligned task that of the same release, otherwise the newest.
JobHandle JobLinks::data_of(TaskId predecessor, const LinkedJob &job) const {
  const bool aligned = release_together(task(job.record.task), task(predecessor));
  const std::deque<JobHandle> &finished = finished_[predecessor.value];
  JobHandle newest;
  for (auto one = finished.rbegin(); one != finished.rend(); ++one) {
    const Time release = (*one)->record.release;
    if (aligned && release == job.record.release) return *one;
    if (newest == nullptr || release > newest->record.release) newest = *one;
  }
  return newest;
}

void JobLinks::link(LinkedJob &job) const {
  for (const std::uint32_t index : task(job.record.task).predecessors) {
    const JobHandle data = data_of(predecessor(job.record.task, index), job);
    if (data == nullptr) continue;
    if (job.last == nullptr || data->record.finish > job.last->record.finish) job.last = data;
    if (job.oldest == nullptr || data->record.origin < job.oldest->record.origin) job.oldest = data;
  }
}

// A job that never was ready waited for the first job of a predecessor that was still on its way, if there was one.
void JobLinks::link_unfinished(LinkedJob &job) const {
  for (const std::uint32_t index : task(job.record.task).predecessors) {
    const std::vector<JobHandle> &live = live_[predecessor(job.record.task, index).value];
    if (live.empty()) continue;
    if (job.last == nullptr || live.front()->record.release < job.last->record.release) job.last = live.front();
  }
}

}  // namespace redag::metrics
