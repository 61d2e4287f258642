// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Lifecycle holds the rules that all schedulers share: jobs from release to end, precedence, overrun, admission,
// budgets, HI mode, accounting, and the events that report them. Its dispatcher decides which job runs where and when:
// PriorityDispatcher, or the model of another executor. Not thread-safe.
//
// Include lifecycle_rules.hpp where a scheduler is instantiated for its dispatcher.
#pragma once

#include <concepts>
#include <cstdint>
#include <span>

#include "redag/sched/job_table.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::sched {

/// Decides which ready jobs run. It is constructed with a JobTable, which it may change by its decisions only. Each
/// report of a change is called while the job is still in its old state.
template <class D>
concept Dispatcher = requires(D dispatcher, const D &decided, std::uint32_t slot, const Job &job) {
  { D::kEnforcesLimits } -> std::convertible_to<bool>;  // it knows budgets and criticality
  dispatcher.on_ready(slot);                            // the job can be queued
  dispatcher.on_withdrawn(slot);                        // a ready job that has not started is skipped
  dispatcher.on_end(slot);                              // a started job ended; its slot is free after this call
  dispatcher.on_lowered(slot);   // a started job continues at own_key() and loses what it inherited
  dispatcher.on_reconfigured();  // tasks were added or timings changed: all priorities are new
  dispatcher.on_preemption_point(slot);
  dispatcher.decide(std::uint32_t{});  // takes the decisions; the argument is the most jobs that it may start
  { decided.outranked(job) } -> std::same_as<bool>;
  { decided.is_idle() } -> std::same_as<bool>;  // no job is ready or started
};

/// A dispatcher that can put a new job in the place of one that ends, without a decision over all jobs.
template <class D>
concept HandsOver = requires(D dispatcher, const D &decided, const Job &job, std::uint32_t slot) {
  // Returns true if jobs of the two tasks need the same places, apart from those of each task. Constant between two
  // calls of on_reconfigured().
  { decided.share_gates(TaskId(), TaskId()) } -> std::same_as<bool>;
  // Returns true if nothing but the new job of the task depends on the end of `job`: no job waits for its gates, and
  // none runs below it. The tasks share their gates.
  { decided.can_replace(job, TaskId()) } -> std::same_as<bool>;
  // The first job ends, and the second, which is ready, starts in its place if it is the most urgent one. It is neither
  // queued nor counted. Takes all decisions of the step. The last argument is the most jobs that may start.
  dispatcher.replace(slot, slot, std::uint32_t{});
};

/// A dispatcher whose jobs can wait without a worker. Both are called while the job is still in its old state.
template <class D>
concept LetsWait = requires(D dispatcher, std::uint32_t slot, DeviceId device) {
  dispatcher.on_wait(slot, device);
  dispatcher.on_wake(slot);
};

template <Dispatcher D>
class Lifecycle final : public Scheduler {
 public:
  /// Requires config.workers > 0 and valid DAGs with periods and deadlines set (inherit_periods). The other arguments
  /// are the dispatcher's.
  template <class... Arguments>
  Lifecycle(const Workload &workload, const Config &config, Arguments... arguments)
      : table_(config), dispatcher_(table_, arguments...), takes_turns_(takes_turns(config)) {
    load(workload);
  }
  // The dispatcher refers to the table.
  Lifecycle(const Lifecycle &) = delete;
  Lifecycle &operator=(const Lifecycle &) = delete;

  using Scheduler::release;
  void release(TaskId task, Time nominal, Time now, Time origin) override;
  void receive(TaskId task, TaskId sender, Time at, Time now, Time origin) override;
  void miss(TaskId task, Time nominal, Time now, Reason reason) override;
  void complete(JobSlot job, Time now, Outcome outcome) override;
  void preemption_point(JobSlot job, Time now) override;
  void exceed(JobSlot job, Limit limit, Time now) override;
  void wait(JobSlot job, DeviceId device, Time now) override;
  void wake(JobSlot job, Time now) override;
  Step dispatch(Time now, std::uint32_t most = kNoLimit) override;
  Step finish(JobSlot job, Time now, Outcome outcome, std::uint32_t most = kNoLimit) override;
  void record_only(EventKinds kinds) override { table_.step.record_only(kinds); }
  [[nodiscard]] bool outranked(JobSlot job) const override;
  [[nodiscard]] bool high_mode() const override { return table_.high_mode; }
  DagId add_dag(const Dag &dag, Time now) override;
  void remove_dag(DagId dag, Time now) override;
  using Scheduler::add_task;
  TaskId add_task(DagId dag, std::uint32_t rank, const Task &task, Time now, bool more) override;
  void set_predecessors(TaskId task, std::span<const TaskId> predecessors, Time now) override;
  void remove_task(TaskId task, Time now) override;
  void set_timing(TaskId task, Duration period, Duration deadline, Time now) override;
  void close(Time now) override;
  [[nodiscard]] std::span<const TaskId> tasks_of(DagId dag) const override { return table_.dags[dag.value].tasks; }
  [[nodiscard]] std::span<const Device> devices() const override { return table_.devices; }
  [[nodiscard]] std::size_t task_slots() const override { return table_.tasks.size(); }
  [[nodiscard]] std::size_t dag_slots() const override { return table_.dags.size(); }
  [[nodiscard]] Accounting accounting(TaskId task) const override {
    const TaskState &state = table_.tasks[task.value];
    return Accounting{.released = state.released,
                      .finished = state.finished,
                      .skipped = state.skipped,
                      .aborted = state.aborted,
                      .deferred = state.deferred,
                      .no_data = state.no_data};
  }
  [[nodiscard]] std::uint32_t ready(TaskId task) const override { return table_.tasks[task.value].ready_count; }
  [[nodiscard]] std::uint32_t level(TaskId task) const override {
    const TaskState &state = table_.tasks[task.value];
    return state.life == TaskLife::Gone ? kNoLevel : state.level;
  }
  [[nodiscard]] std::uint64_t thread_waits() const override { return table_.thread_waits; }

  /// What the scheduler knows. Tests see there how memory grows.
  [[nodiscard]] JobTable &table() { return table_; }

 private:
  [[nodiscard]] static bool takes_turns(const Config &config) {
    return config.ties == Ties::Share && config.policy != PolicyKind::Fifo;
  }
  void load(const Workload &workload);
  void reprioritise();
  void find_heirs();

  // From release to readiness.
  [[gnu::always_inline]] inline void admit(TaskId id, Time nominal, Time origin);
  void admit_by_rules(TaskId id, Time nominal, Time origin);
  void refuse(TaskId id, Time nominal, Reason reason);
  inline void use_data(TaskId id);
  [[nodiscard]] Time turn_of(const TaskState &task, Time origin) const;
  inline void make_ready(std::uint32_t slot, Time origin);
  [[nodiscard, gnu::always_inline]] inline std::uint32_t add_ready_job(TaskId id, TaskState &task, Time nominal,
                                                                       Time origin, Time turn);
  [[nodiscard, gnu::always_inline]] inline std::int64_t key_of_next(const TaskState &task, Time deadline) const;
  [[gnu::always_inline]] inline bool hand_over(std::uint32_t slot, Time now, std::uint32_t most);
  void tell_hand_over(const Job &ended, const Job &next, Time now);
  void skip(std::uint32_t slot, Reason reason);
  [[gnu::always_inline]] inline void end(std::uint32_t slot, Time now, Outcome outcome);
  [[gnu::always_inline]] inline Step take_step(std::uint32_t most);
  template <class Predicate>
  void skip_all(Reason reason, Predicate which);
  [[nodiscard]] bool takes_releases(const TaskState &task) const { return task.life == TaskLife::Live && !closed_; }

  // Budgets and HI mode.
  [[nodiscard]] Reason refusal(TaskState &task, Time nominal);
  [[nodiscard]] bool is_let_through(TaskState &task, Time nominal);
  void enter_high_mode(const Job &cause);
  void leave_high_mode();
  void demote(std::uint32_t slot);
  void forget_skip(TaskState &task);
  void refresh_restricted() { restricted_ = closed_ || table_.high_mode || owed_skips_ > 0; }

  JobTable table_;
  D dispatcher_;
  bool takes_turns_;
  bool closed_ = false;
  std::uint32_t owed_skips_ = 0;  // number of tasks with skips_next
  bool restricted_ = false;       // some releases are refused: closed, in HI mode, or a skip is owed
  Job mode_cause_;                // HI mode: the job that began it
  Time high_since_ = 0;
  std::uint64_t next_sequence_ = 0;
};

}  // namespace redag::sched
