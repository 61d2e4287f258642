// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Models of the event-driven executors of ROS 2: rclcpp's experimental EventsExecutor, and EventsCBGExecutor. Owns
// which ready job runs next. Not thread-safe. Allocates where the executors' queues do:
// events in them have no bound.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "redag_analysis/executors/callback_threads.hpp"
#include "redag_analysis/executors/ready_jobs.hpp"

namespace redag::sched {

/// An event says that a timer expired or a message came. It waits in a queue and names the entity, not the job: whoever
/// takes it runs the entity's oldest job, and where there is none any more (a newer message took its place, and an
/// earlier event ran that), nothing.
///
/// EventsExecutor, as of Jazzy (rclcpp/src/rclcpp/experimental/executors/events_executor/events_executor.cpp,
/// timers_manager.cpp, simple_events_queue.hpp):
/// - One thread, one queue, first in, first out (spin, execute_event).
/// - The timers' thread calls a timer when it expires (execute_ready_timers_unsafe) and queues the event: no period is
///   ever lost, and of a timer that overruns any number of jobs wait. `overrun` means nothing to timers here.
///
/// EventsCBGExecutor, of cm_executors, at commit 63018d1 (src/FirstInFirstOutScheduler.cpp, scheduler.hpp,
/// timer_manager.hpp, ready_entity.hpp):
/// - A queue for each callback group, and a queue of the groups that have events. A thread takes the first event of the
///   first group; the group goes back to the end when the callback is over, if it has more. Groups so take turns, and
///   no two callbacks of a group run at once, be it reentrant or not: so also jobs of a task with `concurrency`.
/// - A timer is called when its event is taken, and expires again only after its callback is over
///   (TimerQueue::add_timer_to_running_map): the periods until then are lost but for one.
///
/// Not modelled: what queues, locks and waking threads cost; services, clients; in which order timers are called that
/// expire at one instant (here: as they are released).
///
/// A timer task is a timer, a data task a subscription; `group` is as in models/wait_set.hpp. Bounds of DAGs,
/// priorities and preemption are unknown to these executors.
class EventsScheduler final : public CallbackThreads {
 public:
  enum class Kind : std::uint8_t { Events, CallbackGroups };

  /// Requires Preemption::None and config.workers > 0, of which Kind::Events has 1.
  EventsScheduler(const Workload &workload, const Config &config, Kind kind);

 private:
  struct Entity {
    ReadyJobs ready;
    std::uint32_t group = 0;  // position in groups_
    bool armed = true;        // CallbackGroups, a timer: neither is its event in the queue, nor does its job run
  };
  struct Group {
    std::deque<TaskId> events;
    bool idle = true;  // not in the queue of groups, and no job of it runs
  };

  void on_ready(std::uint32_t slot) override;
  void on_withdrawn(std::uint32_t slot) override;
  void on_over(std::uint32_t slot) override;
  void on_reconfigured() override;

  [[nodiscard]] bool rearms(TaskId task) const { return kind_ == Kind::CallbackGroups && tasks_[task.value].timer; }
  std::uint32_t take() override;
  void before_taking() override { give_back_groups(); }
  std::uint32_t take_from(Group &group);
  void enqueue(TaskId task);
  void give_back_groups();
  void give_back(std::uint32_t group);

  Kind kind_;
  std::vector<Entity> entities_;            // by TaskId
  std::vector<Group> groups_;               // Events: one; else as group_of() says
  std::deque<std::uint32_t> ready_groups_;  // those with events of which no job runs, in turn
  std::vector<TaskId> ended_;               // jobs whose group is still to go back
};

}  // namespace redag::sched
