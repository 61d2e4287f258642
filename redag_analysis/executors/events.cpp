// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/events.hpp"

#include <algorithm>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/sched/lifecycle_rules.hpp"

template class redag::sched::Lifecycle<redag::executors::EventsDispatcher>;

namespace redag::executors {

EventsDispatcher::EventsDispatcher(sched::JobTable &table, Kind kind) : table_(table), threads_(table), kind_(kind) {
  REDAG_CHECK(kind != Kind::Events || table.config.workers == 1, "rclcpp's EventsExecutor has one thread");
  table.keeps_timer_releases = kind == Kind::Events;
}

void EventsDispatcher::decide(std::uint32_t most) {
  give_back_groups();
  threads_.run(most, [this] { return take(); });
}

// Models FirstInFirstOutScheduler::get_next_ready_entity.
std::uint32_t EventsDispatcher::take() {
  while (!ready_groups_.empty()) {
    const std::uint32_t group = ready_groups_.front();
    ready_groups_.pop_front();
    const std::uint32_t slot = take_from(groups_[group]);
    if (slot != sched::kNil) return slot;
    give_back(group);  // its only events were of messages that are gone: the turn is over at once
  }
  return sched::kNil;
}

// Models FirstInFirstOutCallbackGroupHandle::get_next_ready_entity. An event of a timer without a job, or of a removed
// task, is passed over. An event of a message that is gone uses up the turn.
std::uint32_t EventsDispatcher::take_from(Group &group) {
  while (!group.events.empty()) {
    const TaskId task = group.events.front();
    group.events.pop_front();
    Entity &entity = entities_[task.value];
    if (!entity.ready.empty()) return entity.ready.pop(table_.jobs);
    entity.armed = true;
    if (!table_.tasks[task.value].timer && table_.tasks[task.value].life == sched::TaskLife::Live) return sched::kNil;
  }
  return sched::kNil;
}

void EventsDispatcher::enqueue(TaskId task) {
  const std::uint32_t position = entities_[task.value].group;
  Group &group = groups_[position];
  group.events.push_back(task);
  if (!group.idle) return;
  group.idle = false;
  ready_groups_.push_back(position);
}

void EventsDispatcher::on_ready(std::uint32_t slot) {
  const TaskId task = table_.jobs[slot].task;
  Entity &entity = entities_[task.value];
  entity.ready.push(table_.jobs, slot);
  if (rearms(task) && !std::exchange(entity.armed, false)) return;
  enqueue(task);
}

// The queued event is kept, as in rclcpp; it will find nothing to run.
void EventsDispatcher::on_withdrawn(std::uint32_t slot) {
  entities_[table_.jobs[slot].task.value].ready.remove(table_.jobs, slot);
}

// The job's messages are queued before its group goes back: they were published during the callback, and are reported
// next.
void EventsDispatcher::on_end(std::uint32_t slot) {
  threads_.on_end(slot);
  give_back_groups();
  ended_.push_back(table_.jobs[slot].task);
}

// Models CallbackGroupHandle::mark_as_executed. Afterwards the timers' thread sees what expired during the callback.
void EventsDispatcher::give_back_groups() {
  for (const TaskId task : ended_) {
    Entity &entity = entities_[task.value];
    give_back(entity.group);
    if (!rearms(task)) continue;
    entity.armed = entity.ready.empty();
    if (!entity.armed) enqueue(task);
  }
  ended_.clear();
}

void EventsDispatcher::give_back(std::uint32_t position) {
  Group &group = groups_[position];
  group.idle = group.events.empty();
  if (!group.idle) ready_groups_.push_back(position);
}

// Positions are valid as long as their tasks and named groups: even for tasks alone in their group, odd for named
// groups. Events without a job are removed, because an id may now be another task's.
void EventsDispatcher::on_reconfigured() {
  give_back_groups();
  entities_.resize(table_.tasks.size());
  groups_.resize(kind_ == Kind::Events ? 1 : 2 * std::max(table_.tasks.size(), table_.group_slots()) + 1);
  for (Group &group : groups_) {
    std::erase_if(group.events, [this](TaskId task) {
      const bool stale = entities_[task.value].ready.empty();
      if (stale) entities_[task.value].armed = true;
      return stale;
    });
  }
  for (std::uint32_t t = 0; t < table_.tasks.size(); ++t) {
    const std::uint32_t named = table_.tasks[t].group;
    const std::uint32_t own = named == sched::kNil ? 2 * t : 2 * named + 1;
    entities_[t].group = kind_ == Kind::Events ? 0 : own;
  }
}

}  // namespace redag::executors
