// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Lifecycle holds the rules that all schedulers share: jobs from release to end, precedence, overrun, admission,
// budgets, HI mode, accounting, and the events that report them. A subclass decides which job runs where and when:
// PriorityScheduler, or a model of another executor. Not thread-safe.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "redag/sched/degradation.hpp"
#include "redag/sched/job.hpp"
#include "redag/sched/policy.hpp"
#include "redag/sched/precedence.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::sched {

class Lifecycle : public Scheduler {
 public:
  void release(TaskId task, Time nominal, Time now) final;
  void miss(TaskId task, Time nominal, Time now, Reason reason) final;
  void complete(JobSlot job, Time now, Outcome outcome) final;
  void exceed(JobSlot job, Limit limit, Time now) override;
  [[nodiscard]] bool high_mode() const final { return high_mode_; }
  DagId add_dag(const Dag &dag, Time now) final;
  void remove_dag(DagId dag, Time now) final;
  TaskId add_task(DagId dag, std::uint32_t rank, const Task &task, Time now) final;
  void remove_task(TaskId task, Time now) final;
  void set_timing(TaskId task, Duration period, Duration deadline, Time now) final;
  void close(Time now) final;
  [[nodiscard]] std::span<const TaskId> tasks_of(DagId dag) const final { return dag_states_[dag.value].tasks; }
  [[nodiscard]] Criticality criticality(DagId dag) const final { return dag_states_[dag.value].criticality; }
  [[nodiscard]] std::size_t task_slots() const final { return tasks_.size(); }
  [[nodiscard]] std::size_t dag_slots() const final { return dag_states_.size(); }
  [[nodiscard]] Accounting accounting(TaskId task) const final {
    const TaskState &state = tasks_[task.value];
    return Accounting{state.released_earlier + state.next_number, state.finished, state.skipped, state.aborted,
                      state.deferred};
  }
  [[nodiscard]] std::uint32_t ready(TaskId task) const final { return tasks_[task.value].ready_count; }

  [[nodiscard]] const Job &job(JobSlot slot) const { return jobs_[slot.value]; }
  [[nodiscard]] const Config &config() const { return config_; }
  /// The numbers of slots for jobs and for groups. Tests use them to see how memory grows.
  [[nodiscard]] std::size_t job_slots() const { return jobs_.size(); }
  [[nodiscard]] std::size_t group_slots() const { return groups_.size(); }

 protected:
  // Live -> Removed -> Gone. A task is gone once it has no job left and no job has its priority. With reuse_ids, its
  // slot then serves another live task.
  enum class TaskLife : std::uint8_t { Live, Removed, Gone };

  // The first 64 bytes hold everything that a job needs from its release to its end.
  struct alignas(64) TaskState {
    Duration deadline = 0;
    std::int64_t key = 0;  // static policies: the key of its jobs that have inherited nothing
    std::uint64_t finished = 0;
    std::uint32_t rank = 0;  // its place in the order of tasks; not valid for a task that is gone
    DagId dag;
    std::uint32_t queue_depth = 0;      // 0: overrun by skipping; kUnboundedQueue: no limit
    std::uint32_t free_slot = kNil;     // head of the list of free job slots, linked by Job::next
    std::uint32_t waiting = kNil;       // the job whose predecessors are incomplete
    std::uint32_t latest_ready = kNil;  // the job that became ready last; it has not started if ready_count > 0
    std::uint32_t ready_count = 0;      // ready and not started
    std::uint32_t next_number = 0;      // number of the next job, modulo 2^32
    bool timer = true;
    bool joined = false;  // has predecessors or successors
    TaskLife life = TaskLife::Live;
    OnBudget on_budget = OnBudget::Abort;
    bool skips_next = false;  // a job used its budget: the next release is skipped
    bool degraded = false;    // HI mode, and its DAG is of lower criticality: its jobs are demoted from the start

    std::uint64_t released_earlier = 0;  // releases before next_number last wrapped around to 0
    std::uint64_t skipped = 0;
    std::uint64_t aborted = 0;
    std::uint64_t deferred = 0;
    Duration period = 0;
    Duration offset = 0;
    Time let_through = kNoRelease;  // while degraded: its newest release that was let through
    std::uint32_t tier = 0;         // shared by the tasks that take turns
    std::uint32_t level = 0;
    std::uint32_t group = kNil;  // position among the groups
    std::uint32_t concurrency = 1;
    std::uint32_t topological_rank = 0;
    int fixed_priority = 0;
  };
  struct DagState {
    std::uint32_t max_active = 0;
    std::uint32_t max_pending = 0;
    std::uint32_t pending = 0;  // released, not started
    Criticality criticality = Criticality::Normal;
    bool removed = false;
    bool free = false;          // its id can be used again
    std::vector<TaskId> tasks;  // without those that are gone
    Degrade degrade;
  };

  // AllKept: no overrun rule, any number of jobs can wait.
  enum class TimerReleases : std::uint8_t { AsTheTaskSays, AllKept };

  explicit Lifecycle(const Config &config, TimerReleases kept = TimerReleases::AsTheTaskSays)
      : config_(config), takes_turns_(config.ties == Ties::Share && config.policy != PolicyKind::Fifo), kept_(kept) {}

  /// Adds the workload's DAGs. For the constructor of the subclass.
  void load(const Workload &workload);

  // Hooks for the subclass's decisions. Each is called while the job is still in its old state.
  virtual void on_ready(std::uint32_t slot) = 0;      // the job can be queued
  virtual void on_withdrawn(std::uint32_t slot) = 0;  // a ready job that has not started is skipped
  virtual void on_end(std::uint32_t slot) = 0;        // a started job ended; its slot is free after this call
  virtual void on_lowered(std::uint32_t slot) = 0;  // a started job continues at own_key() and loses what it inherited
  virtual void on_reconfigured() = 0;               // tasks were added or timings changed: all priorities are new

  /// The number of tiers. Under a static policy, the key of a job that is not demoted is below it. A demoted job's key
  /// is its task's tier plus this number. Under edf and fifo all demoted jobs have kDemotedKey.
  [[nodiscard]] std::uint32_t tier_count() const { return tier_count_; }
  [[nodiscard]] static bool is_demoted_key(std::int64_t key) { return key == kDemotedKey; }
  /// The job's own key, without what it inherited.
  [[nodiscard]] std::int64_t own_key(const Job &job) const;
  /// Ends HI mode. Call it when no job is ready or started.
  void restore();

  /// Advances the time to `now`. The first call after a dispatch also empties the step's buffers. Each public call that
  /// reports an event begins with it.
  void begin(Time now);

  // These record decisions in the step.
  void start(std::uint32_t slot, WorkerId worker, std::uint32_t over, std::uint32_t level);
  void suspend(std::uint32_t slot);
  void resume(std::uint32_t slot, WorkerId worker, std::uint32_t over, std::uint32_t level);
  /// Records for the driver that a started job, running or suspended, has a new level.
  void change_level(std::uint32_t slot, std::uint32_t level);
  void defer(std::uint32_t slot);

  /// Returns the recorded decisions and events: the result of dispatch().
  Step step();

  [[nodiscard]] std::size_t group_count() const { return groups_.size(); }
  [[nodiscard]] const TaskState &task_of(const Job &job) const { return tasks_[job.task.value]; }

  Config config_;
  std::vector<Job> jobs_;
  std::vector<TaskState> tasks_;
  std::vector<DagState> dag_states_;
  bool has_post_dispatch_work_ = false;  // dispatch() must also end HI mode or requeue held-back jobs

 private:
  static constexpr std::uint32_t kUnboundedQueue = std::numeric_limits<std::uint32_t>::max();
  static constexpr std::int64_t kDemotedKey = std::numeric_limits<std::int64_t>::max();

  void admit(TaskId id, Time nominal, Time origin);
  void admit_or_refuse(TaskId id, Time nominal, Time origin);
  void refuse(TaskId id, Time nominal, Reason reason);
  static std::uint32_t count_release(TaskState &task);
  [[nodiscard]] Time turn_of(const TaskState &task, Time release) const;
  [[nodiscard]] std::int64_t demoted_key(const TaskState &task) const;
  [[nodiscard]] Reason refusal(TaskState &task, Time nominal);
  [[nodiscard]] bool is_let_through(TaskState &task, Time nominal);
  [[nodiscard]] static bool shares_grid(const TaskState &a, const TaskState &b);
  void enter_high_mode(const Job &cause);
  void demote(std::uint32_t slot);
  void forget_skip(TaskState &task);
  void refresh_restricted() { restricted_ = closed_ || high_mode_ || owed_skips_ > 0; }
  [[nodiscard]] bool degrades(const DagState &dag) const { return dag.criticality != Criticality::High; }
  void make_ready(std::uint32_t slot, Time origin);
  void skip(std::uint32_t slot, Reason reason);
  [[nodiscard]] bool takes_releases(const TaskState &task) const { return task.life == TaskLife::Live && !closed_; }

  template <class Predicate>
  void skip_all(Reason reason, Predicate which);
  DagId append_dag(const Dag &dag);
  TaskId append_task(DagId dag, std::uint32_t rank, const Task &task);
  void reserve_step();
  void collect();
  void retire(TaskId id);
  void prioritise();
  std::uint32_t join_group(const std::string &name);
  void leave_group(std::uint32_t position);
  std::uint32_t new_slot();
  std::uint32_t take_slot(TaskState &task);
  void free_slot(std::uint32_t slot);
  void emit(const Job &job, JobEventKind kind, std::int64_t value, Reason reason = Reason::None);
  void tell(std::uint32_t slot, DispatchKind kind, std::uint32_t over, std::uint32_t level);

  struct Group {
    std::map<std::string, std::uint32_t>::iterator name;
    std::uint32_t tasks = 0;  // 0: the position is free
  };

  bool takes_turns_;
  TimerReleases kept_;
  Precedence precedence_;
  std::map<std::string, std::uint32_t> group_positions_;
  std::vector<Group> groups_;
  // Free ids and slots, with reuse_ids. Free group positions are always used again.
  std::vector<TaskId> free_tasks_;
  std::vector<DagId> free_dags_;
  std::vector<std::uint32_t> free_slots_;
  std::uint32_t tier_count_ = 0;
  bool closed_ = false;
  bool high_mode_ = false;
  std::uint32_t owed_skips_ = 0;  // number of tasks with skips_next
  bool restricted_ = false;       // some releases are refused: closed, in HI mode, or a skip is owed
  Job mode_cause_;                // HI mode: the job that began it
  Time high_since_ = 0;
  std::vector<JobEvent> events_;
  std::vector<Dispatch> dispatches_;
  Time now_ = 0;
  std::uint64_t next_sequence_ = 0;
  bool step_was_read_ = false;
};

template <class Predicate>
void Lifecycle::skip_all(Reason reason, Predicate which) {
  for (std::uint32_t slot = 0; slot < jobs_.size(); ++slot) {
    const JobState state = jobs_[slot].state;
    if ((state == JobState::Waiting || state == JobState::Ready) && which(jobs_[slot])) skip(slot, reason);
  }
}

}  // namespace redag::sched
