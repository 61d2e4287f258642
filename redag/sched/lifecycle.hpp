// The rules every scheduler shares: jobs from release to end, precedence, overrun, admission, accounting, and the
// events that tell of them. What runs where and when is left to the subclass: PriorityScheduler (ours) or a model of
// another executor. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "redag/sched/job.hpp"
#include "redag/sched/policy.hpp"
#include "redag/sched/precedence.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::sched {

class Lifecycle : public Scheduler {
 public:
  void release(TaskId task, Time nominal, Time now) final;
  void complete(JobSlot job, Time now, Outcome outcome) final;
  DagId add_dag(const Dag &dag, Time now) final;
  void remove_dag(DagId dag, Time now) final;
  [[nodiscard]] Accounting accounting(TaskId task) const final { return tasks_[task.value].accounting; }

  [[nodiscard]] const Job &job(JobSlot slot) const { return jobs_[slot.value]; }
  [[nodiscard]] const Config &config() const { return config_; }

 protected:
  struct TaskState {
    Duration deadline = 0;
    DagId dag;
    std::uint32_t group = kNil;     // position among the workload's groups
    std::uint32_t queue_depth = 0;  // 0: overrun by skipping
    bool timer = true;
    bool removed = false;
    Priority priority;

    std::uint32_t first_slot = 0;
    std::uint32_t slot_count = 0;
    std::uint32_t free_slot = kNil;     // list through Job::next
    std::uint32_t waiting = kNil;       // the job whose predecessors are incomplete
    std::uint32_t latest_ready = kNil;  // the job that became ready last; not started if ready_count > 0
    std::uint32_t ready_count = 0;      // ready and not started
    std::uint32_t next_number = 0;
    Accounting accounting;
  };
  struct DagState {
    std::uint32_t max_active = 0;
    std::uint32_t max_pending = 0;
    std::uint32_t pending = 0;  // released, not started
    std::uint32_t first_task = 0;
    std::uint32_t task_count = 0;
  };

  explicit Lifecycle(const Config &config) : config_(config) {}

  /// Adds the workload's DAGs; for the subclass's constructor.
  void load(const Workload &workload);

  // What a subclass decides with. Each is called with the job still in its old state.
  virtual void on_ready(std::uint32_t slot) = 0;      // the job can be queued
  virtual void on_withdrawn(std::uint32_t slot) = 0;  // a ready, not started job is skipped
  virtual void on_end(std::uint32_t slot) = 0;        // a started job ended; afterwards its slot is free
  virtual void on_reconfigured() = 0;                 // tasks or DAGs were added; priorities may have changed

  /// Moves time forward and, after a dispatch, empties the step's buffers. Every verb begins with it.
  void begin(Time now);

  // Decisions, recorded in the step.
  void start(std::uint32_t slot, WorkerId worker, std::uint32_t over, std::uint32_t level);
  void suspend(std::uint32_t slot);
  void resume(std::uint32_t slot, WorkerId worker, std::uint32_t over, std::uint32_t level);
  /// Tells the driver that a running job now has another level.
  void change_level(std::uint32_t slot, std::uint32_t level);
  void defer(std::uint32_t slot);

  /// What dispatch() returns.
  Step step();

  [[nodiscard]] std::size_t group_count() const { return group_positions_.size(); }
  [[nodiscard]] const TaskState &task_of(const Job &job) const { return tasks_[job.task.value]; }

  Config config_;
  std::vector<Job> jobs_;
  std::vector<TaskState> tasks_;
  std::vector<DagState> dag_states_;

 private:
  void admit(TaskId id, Time nominal, Time origin);
  void make_ready(std::uint32_t slot, Time origin);
  void skip(std::uint32_t slot, Reason reason);
  void append(const Dag &dag);
  void prioritise();
  std::uint32_t take_slot(TaskState &task);
  void free_slot(std::uint32_t slot);
  void emit(const Job &job, JobEventKind kind, std::int64_t value, Reason reason = Reason::None);

  Precedence precedence_;
  std::vector<Dag> dags_;  // as given: priorities are assigned anew when a DAG is added
  std::unordered_map<std::string, std::uint32_t> group_positions_;
  std::vector<JobEvent> events_;
  std::vector<Dispatch> dispatches_;
  Time now_ = 0;
  std::uint64_t next_sequence_ = 0;
  bool step_was_read_ = false;
};

}  // namespace redag::sched
