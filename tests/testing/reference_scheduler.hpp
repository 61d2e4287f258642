// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A second implementation of docs/model.md, as plain as possible: each dispatch() looks at every live job, sorts them
// by the total order and decides. For tests: PriorityScheduler must decide the same. It shares with the library's
// scheduler only the interface, assign_priorities() (for levels alone), is_static() and topological_ranks(). Ids are
// never reused. Not thread-safe.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "redag/sched/scheduler.hpp"

namespace redag::testing {

class ReferenceScheduler final : public sched::Scheduler {
 public:
  ReferenceScheduler(const Workload &workload, const sched::Config &config);

  using Scheduler::release;
  void release(TaskId task, Time nominal, Time now, Time origin) override;
  void miss(TaskId task, Time nominal, Time now, Reason reason) override;
  void complete(JobSlot job, Time now, sched::Outcome outcome) override;
  void exceed(JobSlot job, sched::Limit limit, Time now) override;
  void wait(JobSlot job, DeviceId device, Time now) override;
  void wake(JobSlot job, Time now) override;
  /// Does nothing: the reference always reports all events, for comparison.
  void record_only(sched::EventKinds /*kinds*/) override {}
  [[nodiscard]] bool high_mode() const override { return high_mode_; }
  void preemption_point(JobSlot job, Time now) override;
  sched::Step dispatch(Time now, std::uint32_t most = sched::kNoLimit) override;
  [[nodiscard]] bool outranked(JobSlot job) const override;
  DagId add_dag(const Dag &dag, Time now) override;
  void remove_dag(DagId dag, Time now) override;
  using Scheduler::add_task;
  TaskId add_task(DagId dag, std::uint32_t rank, const Task &task, Time now, bool more) override;
  void remove_task(TaskId task, Time now) override;
  void set_timing(TaskId task, Duration period, Duration deadline, Time now) override;
  void close(Time now) override;
  [[nodiscard]] std::span<const TaskId> tasks_of(DagId dag) const override { return dags_[dag.value].tasks; }
  [[nodiscard]] std::size_t task_slots() const override { return tasks_.size(); }
  [[nodiscard]] std::size_t dag_slots() const override { return dags_.size(); }
  [[nodiscard]] sched::Accounting accounting(TaskId task) const override;
  [[nodiscard]] std::uint32_t ready(TaskId task) const override;

 private:
  static constexpr std::size_t kNone = SIZE_MAX;

  /// What a completed job left for one successor.
  struct Data {
    bool fresh = false;
    Time release = std::numeric_limits<Time>::min();  // r of the newest job that completed: the data's
    Time origin = 0;
  };

  struct TaskState {
    Task task;
    std::size_t dag = 0;
    std::vector<std::size_t> predecessors;  // tasks of the workload
    std::uint32_t topological = 0;
    std::vector<Data> inputs;  // one for each predecessor
    bool removed = false;
    bool gone = false;  // removed, and no job has its priority: no longer in the order
    std::uint32_t next_number = 0;
    std::uint32_t rank = 0;
    std::uint32_t tier = 0;  // how many tasks are strictly more urgent; Ties::Fixed: its rank
    std::uint32_t level = 0;
    bool skips_next = false;
    bool has_edges = false;
    std::vector<Time> let_through;  // releases in HI mode
    sched::Accounting count;
  };

  struct DagState {
    Dag dag;
    std::vector<TaskId> tasks;
    bool removed = false;
  };

  /// Waiting -> Ready -> Running -> Done; Running <-> Suspended; Waiting, Ready -> Done (skipped). A job that waits
  /// without a worker: Running -> (AtDevice ->) Away -> Woken -> Running; AtDevice: in the device's queue.
  enum class State : std::uint8_t { Waiting, Ready, Running, Suspended, AtDevice, Away, Woken, Done };

  /// Jobs stay in `jobs_` forever; a slot is a position in it.
  struct Job {
    std::size_t task = 0;
    std::uint32_t number = 0;
    State state = State::Waiting;
    Time release = 0;
    Time deadline = 0;
    Time origin = 0;
    Time turn = 0;
    std::uint64_t ready_order = 0;
    std::uint32_t worker = WorkerId::kNoneValue;
    bool deferred = false;
    std::uint32_t told_level = UINT32_MAX;  // as last told to the driver
    bool at_point = false;                  // until the next dispatch
    std::size_t heir_of = kNone;            // the job whose priority this one has inherited
    bool demoted = false;
    std::size_t device = kNone;  // of its wait
    std::uint64_t asked = 0;     // order of the requests for devices
    std::vector<Data> consumed;  // parallel to the task's predecessors
  };

  /// A job's place in the order. It inherits the priority: the first two members.
  struct Standing {
    bool demoted = false;
    std::int64_t priority = 0;  // smaller is more urgent
    Time turn = 0;
    std::uint32_t rank = 0;
    std::uint32_t number = 0;
  };

  /// A worker's jobs, the lowest first; only the last one can be running.
  using Stack = std::vector<std::size_t>;

  void add_tasks(const Dag &dag);
  void forget_what_is_gone();
  void rank_tasks();
  [[nodiscard]] Duration shortest_period(std::size_t dag) const;
  [[nodiscard]] bool more_urgent(const TaskState &a, const TaskState &b) const;
  [[nodiscard]] bool task_before(const TaskState &a, const TaskState &b) const;
  [[nodiscard]] bool same_phase(const TaskState &predecessor, const TaskState &successor) const;

  std::size_t new_job(std::size_t task, Time release, Time now);
  void skip_all(std::size_t task, Time now);
  void create_job(std::size_t task, Time release, Time origin, Time now, const std::vector<Data> &consumed);
  void resolve(std::size_t job, Time now);
  void deliver(std::size_t job, Time now);
  void skip(std::size_t job, Time now, Reason reason);

  [[nodiscard]] bool is_degradable(std::size_t task) const;
  [[nodiscard]] Reason refusal(std::size_t task, Time release);
  [[nodiscard]] bool is_taken(const TaskState &state, Time release) const;
  void begin_high_mode(std::size_t cause, Time now);
  void end_high_mode(Time now);
  void demote(std::size_t job);
  [[nodiscard]] bool is_demoted(const Job &job) const;

  [[nodiscard]] bool started(const Job &job) const;
  [[nodiscard]] std::vector<std::size_t> jobs_of(std::size_t task, State state) const;
  [[nodiscard]] bool task_busy(const Job &job) const;
  [[nodiscard]] bool dag_at_bound(const Job &job) const;
  [[nodiscard]] std::size_t group_holder(const Job &job) const;

  [[nodiscard]] const Job &effective(std::size_t job) const;
  [[nodiscard]] Standing own_standing(const Job &job) const;
  [[nodiscard]] Standing standing(std::size_t job) const;
  [[nodiscard]] static bool is_of_higher_priority(const Standing &a, const Standing &b);
  [[nodiscard]] static bool is_before(const Standing &a, const Standing &b);
  [[nodiscard]] bool has_levels() const;
  [[nodiscard]] std::uint32_t level_of(std::size_t job) const;
  [[nodiscard]] bool outranks(std::size_t a, std::size_t b) const;
  [[nodiscard]] bool considered_before(std::size_t a, std::size_t b) const;

  [[nodiscard]] std::size_t first_candidate(const std::vector<std::size_t> &passed_over, bool may_start) const;
  [[nodiscard]] std::uint32_t worker_for(std::size_t job) const;
  [[nodiscard]] bool can_start(std::size_t job, Time now);
  void place(std::size_t job, std::uint32_t worker, Time now);
  void resume_uncovered(Time now);
  void serve(Time now);
  [[nodiscard]] bool waits_for_worker(const Job &job) const;
  void leave_worker(const Job &job);
  [[nodiscard]] sched::Dispatch decision_of(std::size_t job) const;
  void tell_levels();
  void emit(JobEventKind kind, std::size_t job, Time now, std::int64_t value, std::uint32_t worker,
            Reason reason = Reason::None);

  sched::Config config_;
  std::vector<DagState> dags_;
  std::vector<TaskState> tasks_;
  std::vector<Device> devices_;
  std::uint64_t requests_ = 0;
  std::vector<Job> jobs_;
  std::vector<Stack> workers_;
  std::uint64_t ready_count_ = 0;
  bool closed_ = false;
  bool high_mode_ = false;
  std::size_t mode_cause_ = kNone;
  Time high_since_ = 0;
  std::vector<JobEvent> events_;
  std::vector<sched::Dispatch> dispatches_;
  std::vector<JobEvent> step_events_;
};

}  // namespace redag::testing
