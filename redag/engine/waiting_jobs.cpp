// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/waiting_jobs.hpp"

#include <algorithm>
#include <bit>

#include "redag/base/check.hpp"
#include "redag/engine/event_state.hpp"
#include "redag/engine/frame_pool.hpp"
#include "redag/engine/task_table.hpp"
#include "redag/threads/clock.hpp"

namespace redag::runtime {

void *WaitingJob::operator new(std::size_t size) { return take_storage(size); }
void WaitingJob::operator delete(void *storage, std::size_t size) noexcept { give_back_storage(storage, size); }

void WaitingJobs::reserve(std::size_t jobs) {
  sleepers_.reserve(jobs);
  cancelled_.reserve(jobs);
}

void WaitingJobs::add(WaitingJob &job, Time now) {
  job.since = now;
  ++job.entry->away;
  const std::size_t slot = job.job.slot.value;
  if (slot >= by_slot_.size()) by_slot_.resize(std::bit_ceil(slot + 1), nullptr);
  by_slot_[slot] = &job;
  ++count_;
}

bool WaitingJobs::begin(detail::Wait &wait) {
  if (wait.kind == detail::Wait::Kind::Device) {
    devices_.join(wait.device);
    return true;
  }
  if (stopped_ || by_slot_[wait.job.value]->entry->waits_end) {
    wait.cancelled = true;
    return false;
  }
  if (wait.kind == detail::Wait::Kind::Event) {
    if (!wait.event->add(wait)) return false;
    if (wait.until != kNever) add_alarm(wait);
    return true;
  }
  if (wait.until <= monotonic_now()) return false;
  add_alarm(wait);
  return true;
}

void WaitingJobs::add_alarm(const detail::Wait &wait) {
  sleepers_.push_back({wait.until, wait.job});
  std::push_heap(sleepers_.begin(), sleepers_.end());
}

void WaitingJobs::end(JobSlot slot, Time now) {
  WaitingJob &job = *by_slot_[slot.value];
  if (job.wait != nullptr) {
    job.wait->is_over = true;
    if (job.wait->until != kNever) forget_alarm(*job.wait, slot);
  }
  --job.entry->away;
  job.waited += std::max<Duration>(0, now - job.since);
  job.entry->most_waits = std::max(job.entry->most_waits, ++job.waits);
  job.entry->longest_waits = std::max(job.entry->longest_waits, job.waited);
}

// A wait with a limit has ended. If another than its alarm has ended it, the alarm is still there.
void WaitingJobs::forget_alarm(const detail::Wait &wait, JobSlot slot) {
  const bool may_have_alarm = wait.cancelled || wait.kind == detail::Wait::Kind::Event;
  if (may_have_alarm && std::erase_if(sleepers_, [&](const Sleeper &sleeper) { return sleeper.job == slot; }) > 0) {
    std::make_heap(sleepers_.begin(), sleepers_.end());
  }
}

JobSlot WaitingJobs::take_sleeper() {
  const JobSlot first = sleepers_.front().job;
  std::pop_heap(sleepers_.begin(), sleepers_.end());
  sleepers_.pop_back();
  detail::Wait &wait = *by_slot_[first.value]->wait;
  if (wait.kind != detail::Wait::Kind::Event) return first;
  if (!wait.event->remove(wait)) return JobSlot();
  wait.timed_out = true;
  return first;
}

void WaitingJobs::serve(JobSlot slot, int priority, Time now) {
  const WaitingJob &job = *by_slot_[slot.value];
  detail::Wait &wait = *job.wait;
  if (!stopped_) return devices_.serve(wait, job.job.task, priority, now);
  devices_.leave(wait.device);
  wait.cancelled = true;
  cancelled_.push_back(slot);
}

void WaitingJobs::cancel_all() {
  stopped_ = true;
  sleepers_.clear();
  for_each([this](WaitingJob &job) {
    if (cancel(job.wait)) cancelled_.push_back(job.job.slot);
  });
}

void WaitingJobs::cancel(TaskId task) {
  for_each([&](WaitingJob &job) {
    if (job.job.task == task && cancel(job.wait)) cancelled_.push_back(job.job.slot);
  });
}

// A job whose event has just been set is woken by the thread that set it.
bool WaitingJobs::cancel(detail::Wait *wait) {
  if (wait == nullptr || wait->is_over) return false;
  switch (wait->kind) {
    case detail::Wait::Kind::Device: return false;
    case detail::Wait::Kind::Event:
      if (!wait->event->remove(*wait)) return false;
      break;
    case detail::Wait::Kind::Sleep: break;
  }
  wait->cancelled = true;
  return true;
}

}  // namespace redag::runtime
