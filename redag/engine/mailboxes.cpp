// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/mailboxes.hpp"

#include <tuple>

namespace redag::runtime {
namespace {

bool has_mail(const WorkerThread &thread) { return thread.has_mail.load(std::memory_order_relaxed); }

// Among equals, the mail that has waited longest.
bool is_before(const WorkerThread &a, const WorkerThread &b) {
  return std::tie(a.level, a.silent) < std::tie(b.level, b.silent);
}

}  // namespace

Mailboxes::Mailboxes(std::size_t threads, Parker *lookout, bool silences_tiny_jobs)
    : lookout_(lookout), silences_tiny_jobs_(silences_tiny_jobs) {
  idle_.reserve(threads);
  handed_.reserve(threads);
}

bool Mailboxes::may_be_silent(const TaskEntry &entry, Time now, Sender sender, WakeUps &wake_ups) {
  const bool tiny = silences_tiny_jobs_ && look_soon_ > 0 && entry.expected_tiny();
  if ((sender == nullptr && !tiny) || !may_look(now, wake_ups)) return false;
  if (sender != nullptr) look_soon(*sender);
  return true;
}

// Returns true if the lookout is awake, or has been woken, as things are busy.
bool Mailboxes::may_look(Time now, WakeUps &wake_ups) {
  if (looks_) return true;
  if (now - std::exchange(last_wake_up_, now) >= kBusy) return false;
  looks_ = true;
  seen_ = silent_posts_;
  wake_ups.wake_helper(*lookout_);
  return true;
}

void Mailboxes::deliver(WorkerThread &thread, bool silent, bool preempts, WakeUps &wake_ups) {
  thread.silent = silent ? ++silent_posts_ : 0;
  thread.has_mail.store(true, std::memory_order_release);
  if (!thread.is_handed) handed_.push_back(&thread);
  thread.is_handed = true;
  if (!silent) wake_ups.wake(thread, preempts);
}

WorkerThread *Mailboxes::steal_mail(std::uint32_t level) {
  WorkerThread *victim = nullptr;
  for (std::size_t i = 0; i < handed_.size();) {
    WorkerThread &thread = *handed_[i];
    if (!has_mail(thread)) {
      thread.is_handed = false;
      handed_[i] = handed_.back();
      handed_.pop_back();
      continue;
    }
    const bool above = thread.level < level || (thread.level == level && thread.silent > 0);
    if (above && (victim == nullptr || is_before(thread, *victim))) victim = &thread;
    ++i;
  }
  return victim != nullptr && victim->take_mail() ? victim : nullptr;
}

bool Mailboxes::look(WakeUps &wake_ups) {
  const std::uint64_t until = std::exchange(seen_, silent_posts_);
  wake_silent(until, other_processors_, wake_ups);
  // Threads that are woken now may leave their next jobs. If silent mail is left, there are some, or it is new.
  looks_ = wake_ups.any() || silent_posts_ != until;
  return looks_;
}

void Mailboxes::wake_silent(std::uint64_t silent_posts, std::size_t most, WakeUps &wake_ups) {
  for (; most > 0; --most) {
    WorkerThread *next = nullptr;
    for (WorkerThread *thread : handed_) {
      if (!has_mail(*thread) || thread->silent == 0 || thread->silent > silent_posts) continue;
      if (next == nullptr || is_before(*thread, *next)) next = thread;
    }
    if (next == nullptr) return;
    next->silent = 0;
    wake_ups.wake(*next);
  }
}

}  // namespace redag::runtime
