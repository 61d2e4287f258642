// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/wait_set.hpp"

#include <algorithm>
#include <utility>

#include "redag/sched/lifecycle_rules.hpp"

template class redag::sched::Lifecycle<redag::executors::WaitSetDispatcher>;

namespace redag::executors {

WaitSetDispatcher::WaitSetDispatcher(sched::JobTable &table, Order order, std::vector<std::uint32_t> ranks)
    : table_(table), threads_(table), order_(order), ranks_(std::move(ranks)) {}

void WaitSetDispatcher::decide(std::uint32_t most) {
  threads_.run(most, [this] { return take(); });
}

// Models Executor::get_next_executable: one free thread after the other takes from the window, or else from a new one.
std::uint32_t WaitSetDispatcher::take() {
  const std::uint32_t slot = take_from_window();
  return slot == sched::kNil && wait() ? take_from_window() : slot;
}

// Models get_next_ready_executable: the first entity of the window whose group is free leaves the window. An entity
// whose job was skipped meanwhile has nothing to take, and leaves it, too.
std::uint32_t WaitSetDispatcher::take_from_window() {
  for (const std::uint32_t task : registration_) {
    Entity &entity = entities_[task];
    if (!entity.in_window || room_[entity.group] == 0) continue;
    entity.in_window = false;
    if (entity.ready.empty()) continue;
    --room_[entity.group];
    return entity.ready.pop(table_.jobs);
  }
  return sched::kNil;
}

// Models wait_for_work: forgets the old window, and fills the new one with the ready entities of free groups. Returns
// false if there are none; the thread then continues to wait.
bool WaitSetDispatcher::wait() {
  bool any = false;
  for (Entity &entity : entities_) {
    entity.in_window = !entity.ready.empty() && room_[entity.group] > 0;
    any = any || entity.in_window;
  }
  return any;
}

void WaitSetDispatcher::on_ready(std::uint32_t slot) {
  entities_[table_.jobs[slot].task.value].ready.push(table_.jobs, slot);
}

void WaitSetDispatcher::on_withdrawn(std::uint32_t slot) {
  entities_[table_.jobs[slot].task.value].ready.remove(table_.jobs, slot);
}

void WaitSetDispatcher::on_end(std::uint32_t slot) {
  threads_.on_end(slot);
  ++room_[entities_[table_.jobs[slot].task.value].group];
}

// Entities keep their jobs and their place in the window; the groups are renumbered.
void WaitSetDispatcher::on_reconfigured() {
  entities_.resize(table_.tasks.size());
  registration_.clear();
  for (const bool first : {true, false}) {
    const auto begin = static_cast<std::ptrdiff_t>(registration_.size());
    for (std::uint32_t t = 0; t < table_.tasks.size(); ++t) {
      if ((table_.tasks[t].timer == (order_ == Order::TimersFirst)) == first) registration_.push_back(t);
    }
    if (ranks_.size() < table_.tasks.size()) continue;
    std::stable_sort(registration_.begin() + begin, registration_.end(),
                     [this](std::uint32_t a, std::uint32_t b) { return ranks_[a] < ranks_[b]; });
  }
  room_.assign(table_.tasks.size() + table_.group_slots(), 1);
  for (std::uint32_t t = 0; t < table_.tasks.size(); ++t) {
    const std::uint32_t named = table_.tasks[t].group;
    Entity &entity = entities_[t];
    entity.group = named == sched::kNil ? t : static_cast<std::uint32_t>(table_.tasks.size()) + named;
    if (named == sched::kNil) room_[t] = table_.tasks[t].concurrency;
    if (entity.ready.empty()) entity.in_window = false;  // this id may now be another task's
  }
  for (const sched::Job &job : table_.jobs) {
    if (job.started()) --room_[entities_[job.task.value].group];
  }
}

}  // namespace redag::executors
