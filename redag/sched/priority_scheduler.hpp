// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ReDAG-RT's scheduler: one global order over all ready jobs of all DAGs (eqs. rm_priority and dispatch), per-DAG
// bounds, exclusive groups, and preemption. docs/model.md defines the semantics. A value without thread, clock or I/O.
// Not thread-safe.
//
// A decision costs O(log n) under edf and fifo, and O(1) under static policies while no tier holds many jobs. It costs
// O(m) more if it must find the least urgent running job anew: the one known before has ended, lost its worker, or
// changed its priority.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "redag/sched/device_queues.hpp"
#include "redag/sched/lifecycle.hpp"
#include "redag/sched/ready_queue.hpp"

namespace redag::sched {

class PriorityDispatcher {
 public:
  static constexpr bool kEnforcesLimits = true;

  /// Limited levels require a static policy.
  explicit PriorityDispatcher(JobTable &table);

  void on_ready(std::uint32_t slot) { push(slot); }
  void on_withdrawn(std::uint32_t slot);
  void on_end(std::uint32_t slot);
  void on_lowered(std::uint32_t slot);
  void on_wait(std::uint32_t slot, DeviceId device);
  void on_wake(std::uint32_t slot);
  void on_reconfigured();
  void on_preemption_point(std::uint32_t slot) { open(table_.jobs[slot].worker.value); }
  void decide(std::uint32_t most) {
    if (may_place() && top() != kNil) place_ready_jobs(most);
    if (unsettled_) settle();
  }
  [[nodiscard]] bool share_gates(TaskId a, TaskId b) const {
    return task_gates_[a.value].shares_all_with(task_gates_[b.value]);
  }
  [[nodiscard]] bool can_replace(const Job &job, TaskId next) const;
  void replace(std::uint32_t ended, std::uint32_t slot, std::uint32_t most);
  [[nodiscard]] bool outranked(const Job &job) const { return top() != kNil && outranks(table_.jobs[top()], job); }
  [[nodiscard]] bool is_idle() const;

 private:
  // A job must pass its gates to start and holds them until it ends: its task, its DAG, its group, and the platform's
  // threads. A job that finds a gate full is parked there, outside the ready queue. Invariant: of all ready jobs that
  // need the gate, the (capacity - used) most urgent ones are not parked there.
  struct Gate {
    std::uint32_t capacity = 1;
    std::uint32_t used = 0;       // jobs started and unfinished
    std::uint32_t holder = kNil;  // shared gates: the job that started last; of a group, the only one
    HeapQueue parked;
  };
  enum class GateKind : std::uint8_t { Task, Dag, Group, Threads };
  // The gates of one task in the order in which they are tried: its own gate, then those that it shares with others.
  // The alignment keeps them within one cache line.
  struct alignas(32) TaskGates {
    Gate own;
    std::array<std::uint32_t, 3> shared{};  // positions in shared_gates_
    std::array<GateKind, 3> kinds{};
    std::uint8_t count = 0;  // number of shared gates

    [[nodiscard]] bool shares_all_with(const TaskGates &other) const {
      if (count != other.count) return false;
      for (std::uint32_t i = 0; i < count; ++i) {
        if (shared[i] != other.shared[i]) return false;
      }
      return true;
    }
  };
  struct alignas(16) Worker {
    std::uint32_t running = kNil;  // the executing job; kNil while the worker is free or waits for a decision
    std::uint32_t stack = kNil;    // Cooperative: the topmost started job, running or suspended
    bool open = false;  // Cooperative: a nested job ended or a preemption point was reached, and a decision is due
  };
  struct Place {
    WorkerId worker;              // invalid: there is no place
    std::uint32_t victim = kNil;  // the job that loses the worker
  };

  /// The worker that became free last is kept apart. Mostly it is taken at once, and never enters the set.
  class FreeWorkers {
   public:
    explicit FreeWorkers(std::uint32_t workers) : others_(workers) {
      for (std::uint32_t w = 0; w < workers; ++w) others_.set(w);
    }
    void add(std::uint32_t worker) {
      if (last_ != kNil) others_.set(last_);
      last_ = worker;
    }
    void remove(std::uint32_t worker) {
      if (worker == last_) {
        last_ = kNil;
      } else {
        others_.clear(worker);
      }
    }
    [[nodiscard]] bool empty() const { return last_ == kNil && others_.empty(); }
    /// Requires !empty().
    [[nodiscard]] std::uint32_t first() const { return others_.empty() ? last_ : std::min(last_, others_.first()); }

   private:
    std::uint32_t last_ = kNil;
    LevelBitmap others_;
  };

  /// Returns false if no job can start or resume, whichever it is.
  [[nodiscard]] bool may_place() const {
    return table_.config.preemption != Preemption::None || !free_workers_.empty();
  }
  [[nodiscard]] Place find_place(const Job &job);
  [[nodiscard]] std::uint32_t least_urgent_running();
  void forget_least_urgent() { least_urgent_ = kNil; }
  [[nodiscard]] bool outranks(const Job &a, const Job &b) const;
  [[nodiscard]] std::uint32_t level_of(const Job &job) const;
  void tell_level(std::uint32_t slot, std::uint32_t old_level);
  void place_ready_jobs(std::uint32_t most);
  void settle();
  void start(std::uint32_t slot, Job &job, TaskGates &gates, Place place);
  bool resume(std::uint32_t slot, Job &job);
  void occupy(WorkerId worker, std::uint32_t slot);
  void note_running(std::uint32_t slot);
  void note_replaced(std::uint32_t ended, std::uint32_t slot);
  void make_way(Place place);
  void leave_worker(const Job &job);
  void leave_queue(std::uint32_t slot);
  void leave_device(std::uint32_t slot);
  [[nodiscard]] bool is_in_ready_queue(const Job &job) const;
  bool park_if_not_eligible(std::uint32_t slot, const Job &job, const TaskGates &to_pass);
  void park(std::uint32_t slot, GateKind kind, std::uint32_t position);
  void inherit(std::uint32_t holder, const Job &waiter);
  /// `change` changes the key of a started job.
  template <class Change>
  void rekey(std::uint32_t slot, Change change);
  void close_open_workers();
  bool set_aside(std::uint32_t slot);
  void put_back();

  std::uint32_t assign_levels();
  [[nodiscard]] std::uint32_t list_of(const Job &job) const;
  void push(std::uint32_t slot);
  void remove(std::uint32_t slot);
  void remove_unstarted(std::uint32_t slot);
  void enqueue(std::uint32_t slot);
  void dequeue(std::uint32_t slot);
  [[nodiscard]] bool is_ahead(const Job &a, const Job &b) const;
  [[nodiscard, gnu::always_inline]] std::uint32_t queue_top() const { return static_ ? levels_.top() : heap_.top(); }
  [[nodiscard, gnu::always_inline]] std::uint32_t top() const { return first_ != kNil ? first_ : queue_top(); }
  [[nodiscard]] static bool is_full(const Gate &gate) { return gate.used >= gate.capacity; }
  void promote_one(Gate &gate);
  void promote(Gate &gate);
  /// Returns the gate of Job::parked_at. Positions below the number of tasks are the tasks' own gates; the shared ones
  /// follow.
  [[nodiscard]] Gate &gate_at(std::uint32_t position) {
    return position < task_gates_.size() ? task_gates_[position].own : shared_gates_[position - task_gates_.size()];
  }
  template <class F>
  void for_gates_of(const Job &job, F f) {
    TaskGates &gates = task_gates_[job.task.value];
    f(gates.own);
    for (std::uint32_t i = 0; i < gates.count; ++i) f(shared_gates_[gates.shared[i]]);
  }
  /// A started job holds its gates until it ends.
  void hold_gates(std::uint32_t slot, TaskGates &gates) {
    ++gates.own.used;
    for (std::uint32_t i = 0; i < gates.count; ++i) {
      Gate &gate = shared_gates_[gates.shared[i]];
      ++gate.used;
      gate.holder = slot;
    }
  }
  void open(std::uint32_t worker);

  JobTable &table_;
  bool static_;
  // The ready queue: levels_ for static policies, otherwise heap_. A job that is ahead of all in it when it is added is
  // kept in first_ instead. It often starts at once, and never enters the queue.
  LevelQueue levels_;
  HeapQueue heap_;
  std::uint32_t first_ = kNil;
  std::uint32_t queued_started_ = 0;  // started jobs in the ready queue: preempted (Full), or woken
  std::uint32_t started_ = 0;         // jobs started and unfinished
  // Static policies: the level of each key, and the first key of that level.
  std::vector<std::uint32_t> level_of_key_;
  std::vector<std::uint32_t> first_of_level_;
  std::vector<TaskGates> task_gates_;  // by TaskId
  std::vector<Gate> shared_gates_;
  std::vector<Worker> workers_;
  FreeWorkers free_workers_;
  std::vector<std::uint32_t> open_workers_;
  DeviceQueues devices_;
  std::uint32_t least_urgent_ = kNil;  // Full: the least urgent running job; kNil: not known
  std::uint32_t held_back_ = kNil;     // during decide(): held-back jobs, linked by Job::next; they may not start
  bool unsettled_ = false;             // settle() has something to do
};

/// Limited levels require a static policy.
using PriorityScheduler = Lifecycle<PriorityDispatcher>;
extern template class Lifecycle<PriorityDispatcher>;

}  // namespace redag::sched
