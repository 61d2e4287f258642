// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/clustered.hpp"

#include <algorithm>
#include <limits>

#include "redag/base/check.hpp"

namespace redag::executors {
namespace {

[[noreturn]] void refuse_change() {
  REDAG_CHECK(false, "DAGs and tasks of clusters are not changed while they run");
  std::abort();
}

}  // namespace

ClusteredScheduler::ClusteredScheduler(const Workload &workload, const Factory &make)
    : parts_(parts_of(workload)), places_(places_in(parts_)) {
  for (const Device &device : workload.platform.devices) devices_.push_back(Shared{device.slots, 0, {}});
  for (ClusterPart &part : parts_) {
    for (Device &device : part.workload.platform.devices) device.slots = std::numeric_limits<std::uint32_t>::max();
    schedulers_.push_back(make(part));
  }
  std::size_t next_task = 0;
  for (const Dag &dag : workload.dags) {
    std::vector<TaskId> &tasks = tasks_of_.emplace_back();
    for (std::size_t i = 0; i < dag.tasks.size(); ++i) tasks.emplace_back(next_task++);
  }
}

void ClusteredScheduler::release(TaskId task, Time nominal, Time now, Time origin) {
  of(task).release(local(task), nominal, now, origin);
}

void ClusteredScheduler::miss(TaskId task, Time nominal, Time now, Reason reason) {
  of(task).miss(local(task), nominal, now, reason);
}

void ClusteredScheduler::complete(JobSlot job, Time now, sched::Outcome outcome) {
  forget_request(job);
  of(job).complete(local(job), now, outcome);
}

// The job may ask a device, or be served.
void ClusteredScheduler::forget_request(JobSlot job) {
  const auto asked = asked_.find(job.value);
  if (asked == asked_.end()) return;
  Shared &device = devices_[asked->second.device];
  if (asked->second.is_served) --device.used;
  std::erase_if(device.queue, [job](const Request &one) { return one.serve.job == job; });
  asked_.erase(asked);
}

void ClusteredScheduler::preemption_point(JobSlot job, Time now) { of(job).preemption_point(local(job), now); }

void ClusteredScheduler::wait(JobSlot job, DeviceId device, Time now) {
  if (device.valid()) asked_[job.value] = Asked{device.value};
  of(job).wait(local(job), device, now);
}

void ClusteredScheduler::wake(JobSlot job, Time now) {
  forget_request(job);
  of(job).wake(local(job), now);
}

void ClusteredScheduler::keep(const JobEvent &event) {
  for (Request &request : devices_[static_cast<std::size_t>(event.value)].queue) {
    if (request.serve.task == event.task && request.serve.number == event.job) request.event = event;
  }
}

void ClusteredScheduler::serve(Time now) {
  for (Shared &device : devices_) {
    for (; device.used < device.slots && !device.queue.empty(); ++device.used) {
      const Request &first = device.queue.front();
      asked_.at(first.serve.job.value).is_served = true;
      dispatches_.push_back(first.serve);
      if (first.event) events_.push_back(*first.event);
      if (first.event) events_.back().time = now;
      device.queue.pop_front();
    }
  }
}

void ClusteredScheduler::exceed(JobSlot job, sched::Limit limit, Time now) { of(job).exceed(local(job), limit, now); }

bool ClusteredScheduler::high_mode() const {
  return std::any_of(schedulers_.begin(), schedulers_.end(), [](const auto &one) { return one->high_mode(); });
}

sched::Step ClusteredScheduler::dispatch(Time now, std::uint32_t most) {
  dispatches_.clear();
  events_.clear();
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const ClusterPart &part = parts_[p];
    const sched::Step step = schedulers_[p]->dispatch(now, most);
    for (sched::Dispatch dispatch : step.dispatches) {
      if (dispatch.kind == sched::DispatchKind::Start && most != sched::kNoLimit) --most;
      dispatch.job = whole(dispatch.job, p);
      dispatch.over = whole(dispatch.over, p);
      dispatch.task = part.tasks[dispatch.task.value];
      if (dispatch.worker.valid()) dispatch.worker.value += part.first_worker;
      if (dispatch.kind == sched::DispatchKind::Serve) {
        devices_[asked_.at(dispatch.job.value).device].queue.push_back(Request{dispatch, std::nullopt});
      } else {
        dispatches_.push_back(dispatch);
      }
    }
    for (JobEvent event : step.events) {
      event.task = part.tasks[event.task.value];
      if (event.worker != WorkerId::kNoneValue) event.worker += part.first_worker;
      event.kind == JobEventKind::Served ? keep(event) : events_.push_back(event);
    }
  }
  serve(now);
  return sched::Step{dispatches_, events_};
}

void ClusteredScheduler::record_only(sched::EventKinds kinds) {
  for (const auto &scheduler : schedulers_) scheduler->record_only(kinds);
}

bool ClusteredScheduler::outranked(JobSlot job) const { return of(job).outranked(local(job)); }

DagId ClusteredScheduler::add_dag(const Dag & /*dag*/, Time /*now*/) { refuse_change(); }
void ClusteredScheduler::remove_dag(DagId /*dag*/, Time /*now*/) { refuse_change(); }
TaskId ClusteredScheduler::add_task(DagId /*dag*/, std::uint32_t /*rank*/, const Task & /*task*/, Time /*now*/,
                                    bool /*more*/) {
  refuse_change();
}
void ClusteredScheduler::remove_task(TaskId /*task*/, Time /*now*/) { refuse_change(); }
void ClusteredScheduler::set_timing(TaskId /*task*/, Duration /*period*/, Duration /*deadline*/, Time /*now*/) {
  refuse_change();
}

void ClusteredScheduler::close(Time now) {
  for (const auto &scheduler : schedulers_) scheduler->close(now);
}

sched::Accounting ClusteredScheduler::accounting(TaskId task) const { return of(task).accounting(local(task)); }

std::uint32_t ClusteredScheduler::ready(TaskId task) const { return of(task).ready(local(task)); }

std::uint64_t ClusteredScheduler::thread_waits() const {
  std::uint64_t waits = 0;
  for (const auto &scheduler : schedulers_) waits += scheduler->thread_waits();
  return waits;
}

}  // namespace redag::executors
