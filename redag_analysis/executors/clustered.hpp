// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The schedulers of all clusters behind one interface, for a driver that runs them on one time line. Its ids and
// workers are those of the whole workload; each cluster's scheduler has its own (ClusterPart). Clusters share the
// devices, which serve requests in their order. Not thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "redag/derived/clusters.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::executors {

class ClusteredScheduler final : public sched::Scheduler {
 public:
  using Factory = std::function<std::unique_ptr<sched::Scheduler>(const ClusterPart &)>;

  /// Makes one scheduler for each cluster. Requires a valid workload.
  ClusteredScheduler(const Workload &workload, const Factory &make);

  using Scheduler::release;
  void release(TaskId task, Time nominal, Time now, Time origin) override;
  void miss(TaskId task, Time nominal, Time now, Reason reason) override;
  void complete(JobSlot job, Time now, sched::Outcome outcome) override;
  void preemption_point(JobSlot job, Time now) override;
  void wait(JobSlot job, DeviceId device, Time now) override;
  void wake(JobSlot job, Time now) override;
  void exceed(JobSlot job, sched::Limit limit, Time now) override;
  /// True if one of the clusters is in HI mode.
  [[nodiscard]] bool high_mode() const override;
  sched::Step dispatch(Time now, std::uint32_t most = sched::kNoLimit) override;
  void record_only(sched::EventKinds kinds) override;
  [[nodiscard]] bool outranked(JobSlot job) const override;
  // DAGs and tasks cannot be added or removed.
  DagId add_dag(const Dag &dag, Time now) override;
  void remove_dag(DagId dag, Time now) override;
  using Scheduler::add_task;
  TaskId add_task(DagId dag, std::uint32_t rank, const Task &task, Time now, bool more) override;
  void remove_task(TaskId task, Time now) override;
  void set_timing(TaskId task, Duration period, Duration deadline, Time now) override;
  void close(Time now) override;
  [[nodiscard]] std::span<const TaskId> tasks_of(DagId dag) const override { return tasks_of_[dag.value]; }
  [[nodiscard]] std::size_t task_slots() const override { return places_.size(); }
  [[nodiscard]] std::size_t dag_slots() const override { return tasks_of_.size(); }
  [[nodiscard]] sched::Accounting accounting(TaskId task) const override;
  [[nodiscard]] std::uint32_t ready(TaskId task) const override;
  [[nodiscard]] std::uint64_t thread_waits() const override;

 private:
  // A cluster's scheduler believes that its devices serve each request at once. What it decides is kept until they do.
  struct Request {
    sched::Dispatch serve;
    std::optional<JobEvent> event;
  };
  struct Asked {
    std::uint32_t device = 0;
    bool is_served = false;
  };
  struct Shared {
    std::uint32_t slots = 1;
    std::uint32_t used = 0;
    std::deque<Request> queue;
  };

  void keep(const JobEvent &event);
  void forget_request(JobSlot job);
  void serve(Time now);
  [[nodiscard]] sched::Scheduler &of(TaskId task) const { return *schedulers_[places_[task.value].part]; }
  [[nodiscard]] sched::Scheduler &of(JobSlot job) const { return *schedulers_[job.value % schedulers_.size()]; }
  [[nodiscard]] TaskId local(TaskId task) const { return places_[task.value].task; }
  [[nodiscard]] JobSlot local(JobSlot job) const { return JobSlot(job.value / schedulers_.size()); }
  [[nodiscard]] JobSlot whole(JobSlot job, std::size_t part) const {
    return job.valid() ? JobSlot(job.value * schedulers_.size() + part) : job;
  }

  std::vector<ClusterPart> parts_;
  std::vector<TaskPlace> places_;
  std::vector<std::unique_ptr<sched::Scheduler>> schedulers_;
  std::vector<std::vector<TaskId>> tasks_of_;  // by DagId
  std::vector<Shared> devices_;
  std::unordered_map<std::uint32_t, Asked> asked_;  // by JobSlot
  std::vector<sched::Dispatch> dispatches_;         // of the last step, like the events
  std::vector<JobEvent> events_;
};

}  // namespace redag::executors
