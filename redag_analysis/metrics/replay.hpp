// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The state of a run as its events tell it: where each job is, what each worker does, which ready jobs are eligible and
// how urgent they are (docs/model.md). Written from the model and not from the scheduler, lest the trace checker repeat
// the scheduler's mistakes. Policy ranks come from sched::assign_priorities. Not thread-safe.
#pragma once

#include <cstdint>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/policy.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::metrics {

/// The place in the total order of jobs; smaller is more urgent. `key` is the tier of the task (static policies), the
/// absolute deadline (edf) or the order of readiness (fifo). Inheritance changes the key alone.
struct Urgency {
  std::int64_t key = 0;
  Time turn = 0;  // Ties::Share
  std::uint32_t rank = 0;
  std::uint64_t sequence = 0;  // order of readiness

  friend auto operator<=>(const Urgency &, const Urgency &) = default;  // NOLINT(modernize-use-nullptr): a false alarm
};

struct LiveJob {
  // Waiting -> Ready -> Running <-> Suspended -> Ended; Waiting, Ready -> Ended.
  // Running -> (AtDevice ->) Away -> Woken -> Running: it waits without a worker, first in the queue of a device.
  enum class State : std::uint8_t { Waiting, Ready, Running, Suspended, AtDevice, Away, Woken, Ended };

  TaskId task;
  std::uint32_t number = 0;
  State state = State::Waiting;
  bool deferred = false;
  bool body_began = false;     // a Started event was seen
  bool executed_seen = false;  // an Executed event was seen
  bool exceeded = false;       // an Exceeded event was seen
  bool demoted = false;        // below everything else, except for what it inherits
  std::uint32_t worker = WorkerId::kNoneValue;
  Time release = 0;
  Time deadline = 0;
  Time origin = 0;
  Time turn = std::numeric_limits<Time>::min();  // final once it is ready
  bool replaces = false;                         // it has the turn of a job that it replaced
  Urgency own;
  Urgency raised;  // own, with the key of the most urgent job that waited for its group while it held it
  Time on_worker_since = 0;
  Duration executed = 0;     // up to the last event that changed its state
  std::int64_t device = -1;  // of its last wait
  std::uint32_t waits = 0;   // the number of its waits so far

  [[nodiscard]] bool started() const { return state >= State::Running && state != State::Ended; }
  [[nodiscard]] bool is_waiting() const { return state == State::AtDevice || state == State::Away; }
};

class Replay {
 public:
  struct JobRef {
    TaskId task;
    std::uint32_t number = 0;
    friend bool operator==(const JobRef &, const JobRef &) = default;
  };
  struct Waiter {
    Urgency urgency;
    TaskId task;
    std::uint32_t number = 0;
    friend auto operator<=>(const Waiter &, const Waiter &) = default;  // NOLINT(modernize-use-nullptr): a false alarm
  };
  static constexpr std::uint32_t kNoGroup = 0xffffffff;
  /// What keeps the first ready job of a task from being eligible, in the order of docs/model.md: the concurrency of
  /// its task, max_active of its DAG, its group, or nothing.
  enum class Gate : std::uint8_t { NoJob, Task, Dag, Group, Open };

  /// `workload` must outlive the replay.
  Replay(const Workload &workload, const sched::Config &config);

  /// Applies one event. Returns null, or the problem with the event. The state then follows the event as far as
  /// possible, because one mistake should not be reported forever. Requires a task of the workload.
  const char *apply(const JobEvent &event);

  [[nodiscard]] const LiveJob *find(TaskId task, std::uint32_t number) const;
  /// Jobs released and not ended, in order of release.
  [[nodiscard]] std::span<const LiveJob> jobs_of(TaskId task) const { return tasks_[task.value].live; }
  [[nodiscard]] const Task &task(TaskId id) const { return *tasks_[id.value].task; }
  [[nodiscard]] DagId dag_of(TaskId id) const { return tasks_[id.value].dag; }
  [[nodiscard]] std::uint32_t group_of(TaskId id) const { return tasks_[id.value].group; }
  [[nodiscard]] std::size_t task_count() const { return tasks_.size(); }

  // Numbers of jobs: active ones are started and unfinished, pending ones are released and not started.
  [[nodiscard]] std::uint32_t active(DagId dag) const { return dags_[dag.value].active; }
  [[nodiscard]] std::uint32_t pending(DagId dag) const { return dags_[dag.value].pending; }
  [[nodiscard]] std::uint32_t task_active(TaskId id) const { return tasks_[id.value].active; }
  [[nodiscard]] std::uint32_t group_active(std::uint32_t group) const { return groups_[group].active; }
  [[nodiscard]] std::uint32_t started() const { return started_; }

  [[nodiscard]] bool high_mode() const { return high_since_ != kNever; }
  /// The time at which HI mode began; kNever in LO mode.
  [[nodiscard]] Time high_since() const { return high_since_; }
  /// True if the task's DAG is of lower criticality: HI mode degrades it.
  [[nodiscard]] bool is_degradable(TaskId id) const { return dags_[dag_of(id).value].degradable; }

  /// The jobs on a worker, with the suspended ones (Cooperative) below.
  [[nodiscard]] std::span<const JobRef> stack(std::uint32_t worker) const { return workers_[worker]; }
  [[nodiscard]] std::uint32_t worker_count() const { return static_cast<std::uint32_t>(workers_.size()); }
  [[nodiscard]] std::uint32_t free_workers() const { return free_workers_; }
  /// The job that executes on a worker; null if there is none.
  [[nodiscard]] const LiveJob *running(std::uint32_t worker) const;
  /// Started jobs that wait for a worker: preempted (full preemption) or woken.
  [[nodiscard]] std::span<const JobRef> suspended() const { return suspended_; }

  /// Eligible jobs, most urgent first; of each task its first ready one. Empty while `max_started` jobs are started.
  [[nodiscard]] const std::set<Waiter> &eligible() const { return at_thread_limit() ? none_ : eligible_; }
  /// The same, regardless of `max_started`: some of these jobs may lack only a thread.
  [[nodiscard]] const std::set<Waiter> &eligible_but_for_threads() const { return eligible_; }
  [[nodiscard]] Gate gate(TaskId id) const { return tasks_[id.value].gate; }
  /// True while `max_started` jobs are started.
  [[nodiscard]] bool at_thread_limit() const { return config_.max_started > 0 && started_ >= config_.max_started; }
  /// Tasks whose first ready job waits for its DAG's max_active alone and has not been counted as deferred.
  [[nodiscard]] const std::set<TaskId> &owed_deferral() const { return owed_deferral_; }

  /// True if the job is below all others, except for what it inherits.
  [[nodiscard]] bool is_demoted(const LiveJob &job) const { return job.own.key == demoted_key(job.task); }
  /// True if only its demotion keeps `job` from being as urgent as `other`.
  [[nodiscard]] bool is_passed_by_demotion(const LiveJob &job, const LiveJob &other) const;
  /// The urgency with what the job now inherits from those that wait for its group.
  [[nodiscard]] Urgency inherited(const LiveJob &job) const;
  /// The same, but only from waiting jobs that go before a job of urgency `looked_at`, which has `started` or not. Jobs
  /// are looked at in their order; those after it have not yet handed on their priority.
  [[nodiscard]] Urgency inherited(const LiveJob &job, const Urgency &looked_at, bool started) const;
  /// True if a job of this urgency may take the worker of one that runs with urgency `running`.
  [[nodiscard]] bool preempts(const Urgency &urgency, const Urgency &running) const;
  /// True if a worker that is free for both goes to the first job. The more urgent job goes first; within a level (full
  /// preemption) the started one does.
  [[nodiscard]] bool goes_first(const Urgency &urgency, bool started, const Urgency &other, bool other_started) const;

 private:
  struct TaskState {
    const redag::Task *task = nullptr;
    DagId dag;
    std::uint32_t group = kNoGroup;
    std::uint32_t active = 0;
    std::vector<LiveJob> live;
    Gate gate = Gate::NoJob;  // what keeps the first ready job from being eligible
    Waiter waiter;            // the first ready job, unless gate is NoJob
  };
  struct Shared {  // a DAG or a group
    std::uint32_t active = 0;
    std::uint32_t pending = 0;
    std::uint32_t capacity = 0;  // 0: no bound
    std::vector<TaskId> tasks;
    bool degradable = false;
  };

  template <class Predicate>
  [[nodiscard]] Urgency inherited_from(const LiveJob &job, Predicate hands_on) const;
  LiveJob *find_mutable(TaskId task, std::uint32_t number);
  const char *apply_to(LiveJob &job, const JobEvent &event);
  const char *change_mode(const JobEvent &event);
  void demote(LiveJob &job, bool by_mode);
  [[nodiscard]] std::int64_t demoted_key(TaskId task) const;
  [[nodiscard]] bool waits_for_data(TaskId id) const;
  void hand_turn_on(const LiveJob &skipped, Reason reason);
  [[nodiscard]] std::uint32_t level_of(const Urgency &urgency) const;
  const char *begin_wait(LiveJob &job, const JobEvent &event);
  const char *take_worker(LiveJob &job, const JobEvent &event);
  const char *leave_worker(const LiveJob &job);
  void move_to(LiveJob &job, LiveJob::State state);
  void erase(TaskId task, std::uint32_t number);
  void refresh(TaskId task);
  void refresh_sharers(TaskId task);
  [[nodiscard]] Gate gate_of(const TaskState &task, const LiveJob *&first) const;
  [[nodiscard]] Urgency urgency_of(const LiveJob &job);
  [[nodiscard]] std::int64_t undemoted_key(TaskId task, Time deadline, std::uint64_t sequence) const;

  sched::Config config_;
  std::vector<sched::Priority> priorities_;
  std::vector<std::uint32_t> level_of_key_;  // static policies: by tier, and again for demoted jobs
  std::vector<TaskState> tasks_;
  std::vector<Shared> dags_;
  std::vector<Shared> groups_;
  std::vector<std::vector<JobRef>> workers_;
  std::vector<JobRef> suspended_;
  std::set<Waiter> eligible_;
  std::set<TaskId> owed_deferral_;
  const std::set<Waiter> none_;
  Time high_since_ = kNever;
  std::uint32_t free_workers_ = 0;
  std::uint32_t started_ = 0;
  std::uint64_t next_sequence_ = 0;
};

}  // namespace redag::metrics
