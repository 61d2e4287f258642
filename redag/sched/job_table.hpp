// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a scheduler knows: its DAGs, tasks and jobs, their priorities, which data is fresh, and the step that it is
// taking. Lifecycle changes it by the rules for jobs; a dispatcher changes it by its decisions. Not thread-safe.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/sched/config.hpp"
#include "redag/sched/degradation.hpp"
#include "redag/sched/job.hpp"
#include "redag/sched/policy.hpp"
#include "redag/sched/precedence.hpp"
#include "redag/sched/step_builder.hpp"

namespace redag::sched {

// Live -> Removed -> Gone. A task is gone once it has no job left and no job has its priority. With reuse_ids, its
// slot then serves another live task.
enum class TaskLife : std::uint8_t { Live, Removed, Gone };

inline constexpr std::uint32_t kUnboundedQueue = std::numeric_limits<std::uint32_t>::max();

// The first 64 bytes hold everything that a job needs from its release to its end.
struct alignas(64) TaskState {
  Duration deadline = 0;
  std::int64_t key = 0;        // static policies: the key of its jobs that have inherited nothing
  std::uint64_t released = 0;  // the number of the next job, whose lower half jobs have
  std::uint64_t finished = 0;
  std::uint32_t rank = 0;  // its place in the order of tasks; not valid for a task that is gone
  DagId dag;
  std::uint32_t free_slot = kNil;     // head of the list of free job slots, linked by Job::next
  std::uint32_t waiting = kNil;       // the job whose predecessors are incomplete
  std::uint32_t latest_ready = kNil;  // the job that became ready last; it has not started if ready_count > 0
  std::uint32_t ready_count = 0;      // ready and not started
  bool timer = true;
  bool joined = false;  // has predecessors or successors
  // More rules hold for its releases than for most: it is a timer with predecessors, or its DAG has a max_pending.
  bool is_special = false;
  bool degraded = false;  // HI mode, and its DAG is of lower criticality: its jobs are demoted from the start
  TaskLife life = TaskLife::Live;
  OnBudget on_budget = OnBudget::Abort;
  bool skips_next = false;  // a job used its budget: the next release is skipped
  bool on_grid = true;      // its releases are points of a grid, or it has no releases of its own

  std::uint64_t skipped = 0;
  std::uint64_t aborted = 0;
  std::uint64_t no_data = 0;  // of the aborted ones
  std::uint64_t deferred = 0;
  Duration period = 0;
  Duration offset = 0;
  Time let_through = kNoRelease;  // while degraded: its newest release that was let through
  std::uint32_t tier = 0;         // shared by the tasks that take turns
  std::uint32_t level = 0;
  std::uint32_t group = kNil;     // position among the groups
  std::uint32_t queue_depth = 0;  // 0: overrun by skipping; kUnboundedQueue: no limit
  std::uint32_t concurrency = 1;
  std::uint32_t topological_rank = 0;
  int fixed_priority = 0;
};

struct DagState {
  std::uint32_t max_active = 0;
  std::uint32_t max_pending = 0;
  std::uint32_t pending = 0;  // with max_pending: jobs released and not started
  Criticality criticality = Criticality::Normal;
  bool removed = false;
  bool free = false;          // its id can be used again
  std::vector<TaskId> tasks;  // without those that are gone
  Degrade degrade;

  [[nodiscard]] bool degrades() const { return criticality != Criticality::High; }
};

class JobTable {
 public:
  explicit JobTable(const Config &configuration) : config(configuration) {}

  // ---- reconfiguration; allocates ----

  DagId append_dag(const Dag &dag);
  /// Adds a task without edges.
  TaskId append_task(DagId dag, std::uint32_t rank, const Task &task);
  /// Removes tasks without any job left from the order of priority. With reuse_ids, also frees their slots.
  void collect();
  /// Assigns priorities to all tasks, and to the jobs that are ready or started.
  void prioritise();

  // ---- slots ----

  /// Takes a free slot for a job of the task.
  [[nodiscard, gnu::always_inline]] std::uint32_t take_slot(TaskState &task) {
    const std::uint32_t slot = task.free_slot;
    if (slot == kNil) return one_more_slot(task);
    task.free_slot = jobs[slot].next;
    return slot;
  }
  void free_slot(std::uint32_t slot, TaskState &task) {
    jobs[slot].state = JobState::Free;
    jobs[slot].next = task.free_slot;
    task.free_slot = slot;
  }

  // ---- counts of jobs that have not started ----

  /// A job of the task is released.
  void count_pending(const TaskState &task) {
    if (task.is_special) ++dags[task.dag.value].pending;
  }
  /// It starts, or is skipped.
  void count_no_longer_pending(const TaskState &task) {
    if (task.is_special) --dags[task.dag.value].pending;
  }
  /// The pending job becomes ready.
  void count_ready(TaskState &task, std::uint32_t slot) {
    ++task.ready_count;
    task.latest_ready = slot;
  }

  // ---- decisions; the step records them ----

  [[gnu::always_inline]] void start(std::uint32_t slot, WorkerId worker, std::uint32_t over, std::uint32_t level) {
    TaskState &task = task_of(jobs[slot]);
    --task.ready_count;
    count_no_longer_pending(task);
    start_uncounted(slot, worker, over, level);
  }
  /// As start(), for a job that was counted neither as pending nor as ready.
  [[gnu::always_inline]] void start_uncounted(std::uint32_t slot, WorkerId worker, std::uint32_t over,
                                              std::uint32_t level) {
    Job &job = jobs[slot];
    job.state = JobState::Running;
    job.worker = worker;
    step.emit(job, JobEventKind::Dispatched, job.deadline);
    step.tell(job, JobSlot(slot), DispatchKind::Start, JobSlot(over), level);
  }
  void suspend(std::uint32_t slot) {
    jobs[slot].state = JobState::Suspended;
    step.emit(jobs[slot], JobEventKind::Preempted, 0);
  }
  void resume(std::uint32_t slot, WorkerId worker, std::uint32_t over, std::uint32_t level) {
    Job &job = jobs[slot];
    job.state = JobState::Running;
    job.worker = worker;
    step.emit(job, JobEventKind::Resumed, 0);
    step.tell(job, JobSlot(slot), DispatchKind::Resume, JobSlot(over), level);
  }
  void wait(std::uint32_t slot, DeviceId device) {
    Job &job = jobs[slot];
    job.state = device.valid() ? JobState::Queued : JobState::Away;
    job.parked_at = device.valid() ? device.value : kNil;
    step.emit(job, JobEventKind::Waits, event_value(job));
  }
  void serve(std::uint32_t slot) {
    Job &job = jobs[slot];
    job.state = JobState::Away;
    step.emit(job.task, job.number, WorkerId(), JobEventKind::Served, event_value(job));
    step.tell_service(job, JobSlot(slot));
  }
  void wake(std::uint32_t slot) {
    Job &job = jobs[slot];
    step.emit(job.task, job.number, WorkerId(), JobEventKind::Woken, event_value(job));
    job.state = JobState::Woken;
    job.parked_at = kNil;
  }
  /// Records for the driver that a started job, running or suspended, has a new level. It replaces an earlier one of
  /// the same step. Therefore no step outgrows its storage.
  void change_level(std::uint32_t slot, std::uint32_t level) {
    step.drop_level(JobSlot(slot));
    step.tell(jobs[slot], JobSlot(slot), DispatchKind::Level, JobSlot(), level);
  }
  /// Counts that max_active keeps the job from starting, once for each job.
  void defer(std::uint32_t slot) {
    Job &job = jobs[slot];
    if (job.deferred) return;
    job.deferred = true;
    ++task_of(job).deferred;
    step.emit(job, JobEventKind::Deferred, 0);
  }

  // ---- keys ----

  /// The number of tiers. Under a static policy, the key of a job that is not demoted is below it. A demoted job's key
  /// is its task's tier plus this number. Under edf and fifo all demoted jobs have one key, the largest.
  [[nodiscard]] std::uint32_t tier_count() const { return tier_count_; }
  [[nodiscard]] static bool is_demoted_key(std::int64_t key) { return key == kDemotedKey; }
  /// The key of the task's demoted jobs: after all other jobs, and among themselves in the order of tiers.
  [[nodiscard]] std::int64_t demoted_key(const TaskState &task) const {
    return is_static(config.policy) ? std::int64_t{tier_count_} + task.tier : kDemotedKey;
  }
  /// The job's own key, without what it inherited.
  [[nodiscard]] std::int64_t own_key(const Job &job) const;

  [[nodiscard]] TaskState &task_of(const Job &job) { return tasks[job.task.value]; }
  [[nodiscard]] const TaskState &task_of(const Job &job) const { return tasks[job.task.value]; }
  // Compared by address, which spares a division by the size of an entry.
  [[nodiscard]] bool has(TaskId task) const { return tasks.data() + task.value < std::to_address(tasks.end()); }
  [[nodiscard]] bool has(JobSlot job) const { return jobs.data() + job.value < std::to_address(jobs.end()); }
  [[nodiscard]] std::size_t group_slots() const { return groups_.size(); }

  const Config config;
  std::vector<Job> jobs;         // by JobSlot
  std::vector<TaskState> tasks;  // by TaskId
  std::vector<DagState> dags;    // by DagId
  std::vector<Device> devices;   // by DeviceId; set before the first DAG is added
  Precedence precedence;
  StepBuilder step;
  bool high_mode = false;             // DAGs of lower criticality are degraded
  bool has_removed = false;           // a task or DAG was removed, and perhaps is not gone
  bool keeps_timer_releases = false;  // timers have no overrun rule: any number of their jobs can wait
  std::uint64_t thread_waits = 0;     // how often only Config::max_started kept a job from starting

 private:
  static constexpr std::int64_t kDemotedKey = std::numeric_limits<std::int64_t>::max();

  struct Group {
    std::map<std::string, std::uint32_t>::iterator name;
    std::uint32_t tasks = 0;  // 0: the position is free
  };

  // The device of a job that waits, as events have it.
  [[nodiscard]] static std::int64_t event_value(const Job &job) {
    return job.parked_at == kNil ? -1 : std::int64_t{job.parked_at};
  }
  TaskId add_state(DagId dag, std::uint32_t rank, const Task &task);
  void reserve_step();
  void retire(TaskId id);
  std::uint32_t join_group(const std::string &name);
  void leave_group(std::uint32_t position);
  std::uint32_t new_slot();
  std::uint32_t one_more_slot(const TaskState &task);

  std::map<std::string, std::uint32_t> group_positions_;
  std::vector<Group> groups_;
  // Free ids and slots, with reuse_ids. Free group positions are always used again.
  std::vector<TaskId> free_tasks_;
  std::vector<DagId> free_dags_;
  std::vector<std::uint32_t> free_slots_;
  std::uint32_t tier_count_ = 0;
};

}  // namespace redag::sched
