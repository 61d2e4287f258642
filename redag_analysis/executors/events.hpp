// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Models of the event-driven executors of ROS 2: rclcpp's experimental EventsExecutor, and EventsCBGExecutor. They
// decide which ready job runs next. Not thread-safe. They allocate where the executors' queues do, because the number
// of events has no bound.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "redag/sched/lifecycle.hpp"
#include "redag_analysis/executors/callback_threads.hpp"
#include "redag_analysis/executors/ready_jobs.hpp"

namespace redag::executors {

/// An event says that a timer expired or a message arrived. It waits in a queue and names the entity, not the job. The
/// thread that takes it runs the entity's oldest job. It runs nothing if there is no job left: a newer message took the
/// place, and an earlier event ran that.
///
/// EventsExecutor, as of Jazzy (rclcpp/src/rclcpp/experimental/executors/events_executor/events_executor.cpp,
/// timers_manager.cpp, simple_events_queue.hpp):
/// - One thread, one queue, first in, first out (spin, execute_event).
/// - The timers' thread calls a timer when it expires (execute_ready_timers_unsafe) and queues the event. No period is
///   ever lost, and any number of jobs of an overrunning timer wait. `overrun` has no effect on timers here.
///
/// EventsCBGExecutor, of cm_executors, at commit 63018d1 (src/FirstInFirstOutScheduler.cpp, scheduler.hpp,
/// timer_manager.hpp, ready_entity.hpp):
/// - A queue for each callback group, and a queue of the groups that have events. A thread takes the first event of the
///   first group. When the callback is over, the group goes to the end if it has more events. Groups thus take turns.
///   No two callbacks of a group, even a reentrant one, run at once; nor do jobs of a task with `concurrency`.
/// - A timer is called when its event is taken, and expires again only after its callback is over
///   (TimerQueue::add_timer_to_running_map). All periods until then but one are lost.
///
/// Not modelled: the cost of queues, locks and waking threads; services and clients; the order in which timers that
/// expire at one instant are called (here: the order of their releases).
///
/// A timer task is a timer, a data task a subscription; `group` is as in redag_analysis/executors/wait_set.hpp. These
/// executors do not know max_active, priorities and preemption.
class EventsDispatcher {
 public:
  static constexpr bool kEnforcesLimits = false;

  enum class Kind : std::uint8_t { Events, CallbackGroups };

  /// Requires Preemption::None and config.workers > 0; Kind::Events requires 1 worker.
  EventsDispatcher(sched::JobTable &table, Kind kind);

  void on_ready(std::uint32_t slot);
  void on_withdrawn(std::uint32_t slot);
  void on_end(std::uint32_t slot);
  void on_lowered(std::uint32_t /*slot*/) {}
  void on_reconfigured();
  void on_preemption_point(std::uint32_t /*slot*/) {}
  void decide(std::uint32_t most);
  [[nodiscard]] bool outranked(const sched::Job & /*job*/) const { return false; }
  [[nodiscard]] bool is_idle() const { return true; }

 private:
  struct Entity {
    ReadyJobs ready;
    std::uint32_t group = 0;  // position in groups_
    bool armed = true;        // CallbackGroups, a timer: its event is not queued, and its job does not run
  };
  struct Group {
    std::deque<TaskId> events;
    bool idle = true;  // not in the queue of groups, and none of its jobs runs
  };

  [[nodiscard]] bool rearms(TaskId task) const {
    return kind_ == Kind::CallbackGroups && table_.tasks[task.value].timer;
  }
  std::uint32_t take();
  std::uint32_t take_from(Group &group);
  void enqueue(TaskId task);
  void give_back_groups();
  void give_back(std::uint32_t group);

  sched::JobTable &table_;
  CallbackThreads threads_;
  Kind kind_;
  std::vector<Entity> entities_;            // by TaskId
  std::vector<Group> groups_;               // Events: one; otherwise by the positions that on_reconfigured() sets
  std::deque<std::uint32_t> ready_groups_;  // groups with events and without a running job, in turn
  std::vector<TaskId> ended_;               // jobs whose group is still to go back
};

using EventsScheduler = sched::Lifecycle<EventsDispatcher>;

}  // namespace redag::executors
