// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/wait_set.hpp"

namespace redag::executors {

WaitSetScheduler::WaitSetScheduler(const Workload &workload, const sched::Config &config, Order order)
    : CallbackThreads(config), order_(order) {
  load(workload);
}

// Models Executor::get_next_executable: one free thread after the other takes from the window, or else from a new one.
std::uint32_t WaitSetScheduler::take() {
  const std::uint32_t slot = take_from_window();
  return slot == sched::kNil && wait() ? take_from_window() : slot;
}

// Models get_next_ready_executable: the first entity of the window whose group is free leaves the window. An entity
// whose job was skipped meanwhile has nothing to take, and leaves it, too.
std::uint32_t WaitSetScheduler::take_from_window() {
  for (const std::uint32_t task : registration_) {
    Entity &entity = entities_[task];
    if (!entity.in_window || room_[entity.group] == 0) continue;
    entity.in_window = false;
    if (entity.ready.empty()) continue;
    --room_[entity.group];
    return entity.ready.pop(jobs_);
  }
  return sched::kNil;
}

// Models wait_for_work: forgets the old window, and fills the new one with the ready entities of free groups. Returns
// false if there are none; the thread then continues to wait.
bool WaitSetScheduler::wait() {
  bool any = false;
  for (Entity &entity : entities_) {
    entity.in_window = !entity.ready.empty() && room_[entity.group] > 0;
    any = any || entity.in_window;
  }
  return any;
}

void WaitSetScheduler::on_ready(std::uint32_t slot) { entities_[jobs_[slot].task.value].ready.push(jobs_, slot); }

void WaitSetScheduler::on_withdrawn(std::uint32_t slot) { entities_[jobs_[slot].task.value].ready.remove(jobs_, slot); }

void WaitSetScheduler::on_over(std::uint32_t slot) { ++room_[entities_[jobs_[slot].task.value].group]; }

// Entities keep their jobs and their place in the window; the groups are renumbered.
void WaitSetScheduler::on_reconfigured() {
  entities_.resize(tasks_.size());
  registration_.clear();
  for (const bool first : {true, false}) {
    for (std::uint32_t t = 0; t < tasks_.size(); ++t) {
      if ((tasks_[t].timer == (order_ == Order::TimersFirst)) == first) registration_.push_back(t);
    }
  }
  room_.assign(tasks_.size() + group_count(), 1);
  for (std::uint32_t t = 0; t < tasks_.size(); ++t) {
    const std::uint32_t named = tasks_[t].group;
    Entity &entity = entities_[t];
    entity.group = named == sched::kNil ? t : static_cast<std::uint32_t>(tasks_.size()) + named;
    if (named == sched::kNil) room_[t] = tasks_[t].concurrency;
    if (entity.ready.empty()) entity.in_window = false;  // this id may now be another task's
  }
  for (const sched::Job &job : jobs_) {
    if (job.started()) --room_[entities_[job.task.value].group];
  }
}

}  // namespace redag::executors
