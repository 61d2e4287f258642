// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Hands jobs to threads that have none. Such a job is the thread's mail. Waking the thread takes longer than many jobs:
// a thread that is awake and needs a job therefore steals mail. Mail need not even wake its thread while another thread
// soon looks for mail. Such mail is silent: of a tiny job beside another one, and of a job that a body releases shortly
// before its end (Sender). Without a trace that job even waits for the decision at this end. The lookout, a thread of
// its own, looks every kLookInterval for what has waited for a whole interval, and has its thread woken.
//
// Invariant: while mail is silent, the lookout is awake. Nothing here allocates. Not thread-safe: the engine's lock
// guards it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/base/time.hpp"
#include "redag/engine/worker_pool.hpp"

namespace redag::runtime {

/// Threads to wake. Real-time threads are woken at once, under the lock: a waker preempted between decision and wake-up
/// would leave an urgent job asleep. As the lock's owner, the waker is raised as soon as the next decision is due. The
/// exception is a thread that will preempt the waker (Mailboxes::post): it would soon wait for the lock.
class WakeUps {
 public:
  explicit WakeUps(bool at_once) : at_once_(at_once) {}
  void wake(WorkerThread &thread, bool preempts = false) {
    any_ = true;
    if ((at_once_ && !preempts) || count_ == late_.size()) {
      thread.parker.unpark();
    } else {
      late_[count_++] = &thread;
    }
  }
  /// Wakes a helper thread at once, under the lock.
  void wake_helper(Parker &helper) {
    any_ = true;
    helper.unpark();
  }
  /// Wakes the thread that runs users' functions after the lock: it could preempt the lock's owner. There is only one.
  void wake_late(Parker &reporter) {
    any_ = true;
    reporter_ = &reporter;
  }
  /// Wakes those that could wait for the end of the lock. Call it once.
  void wake_late() {
    for (std::size_t i = 0; i < count_; ++i) late_[i]->parker.unpark();
    if (reporter_ != nullptr) reporter_->unpark();
  }
  [[nodiscard]] bool any() const { return any_; }

 private:
  bool at_once_;
  bool any_ = false;
  Parker *reporter_ = nullptr;
  std::array<WorkerThread *, 32> late_;
  std::size_t count_ = 0;
};

/// The thread whose job's body releases jobs, if it is expected to end soon; otherwise null.
using Sender = WorkerThread *;
/// True if a job of this level may wait for the end of the sender's: a more urgent one starts at once.
inline bool may_wait_for(Sender sender, std::uint32_t level) { return sender != nullptr && sender->level <= level; }

class Mailboxes {
 public:
  /// How long the lookout sleeps between two looks.
  static constexpr Duration kLookInterval = 100 * kMicrosecond;

  /// For up to `threads` threads. `lookout` is null if no mail may be silent. Otherwise its thread, when it was
  /// woken, calls look() after every interval. `silences_tiny_jobs`: mail of tiny jobs may be silent, too.
  Mailboxes(std::size_t threads, Parker *lookout, bool silences_tiny_jobs);

  /// A look wakes not more threads than there are other processors.
  void set_processors(std::size_t processors) { other_processors_ = std::max<std::size_t>(processors, 2) - 1; }

  /// The thread has no job. Returns true if it is the leader from now on, which waits for releases: if it may, and
  /// there is no other.
  bool add_idle(WorkerThread &thread, bool may_lead = false) {
    if (leader_ == nullptr && may_lead) {
      leader_ = &thread;
      thread.leads.store(true, std::memory_order_relaxed);
      return true;
    }
    idle_.push_back(&thread);
    return false;
  }
  /// Posts a job. `write` is called with the thread that gets it, and writes the thread's mail. Requires an idle
  /// thread. One that ran last on processor `here`, where the caller is, is preferred, because the kernel lets it
  /// preempt the caller at once; negative: any. `sender`: it may take the job after its own.
  template <typename Write>
  void post(const TaskEntry &entry, Time now, int here, Sender sender, WakeUps &wake_ups, Write &&write) {
    const bool silent = lookout_ != nullptr && may_be_silent(entry, now, sender, wake_ups);
    WorkerThread &thread = take_idle(now, here);
    REDAG_CHECK(!thread.has_mail.load(std::memory_order_relaxed), "a worker was given two jobs");
    std::forward<Write>(write)(thread);
    deliver(thread, silent, here >= 0, wake_ups);
  }
  /// Returns true if a job may wait for the decision at the end of a body that released it, although a worker is free.
  bool defer(Time now, WakeUps &wake_ups) {
    if (!may_look(now, wake_ups)) return false;
    deferred_ = ++silent_posts_;
    return true;
  }
  /// Before look(): returns true, once, if a job that waits for a decision has done so since before the last look.
  [[nodiscard]] bool take_deferred() { return deferred_ > 0 && deferred_ <= seen_ && std::exchange(deferred_, 0) > 0; }
  /// Takes the mail of a thread that is not awake yet, if that job is above `level`, or is at this level and did not
  /// wake its thread. Returns that thread, which then finds no mail and is not idle yet, or null.
  WorkerThread *steal(std::uint32_t level) { return handed_.empty() ? nullptr : steal_mail(level); }

  /// Returns true if no thread has mail.
  [[nodiscard]] bool all_empty() const { return handed_.empty(); }
  /// Returns true if mail may be silent.
  [[nodiscard]] bool any_silent() const { return looks_ && !handed_.empty(); }

  /// The thread begins a job, and looks for mail when that has ended.
  void begin(WorkerThread &thread, const TaskEntry &entry) {
    if (silences_tiny_jobs_ && entry.expected_tiny()) look_soon(thread);
  }
  void end(WorkerThread &thread) {
    if (!thread.looks_soon) return;
    thread.looks_soon = false;
    --look_soon_;
  }

  /// Returns true if a thread should post its next job and sleep, because others are in tiny jobs, too: a single thread
  /// ends them sooner than several that compete for the lock. `waited`: the thread waited for the lock.
  [[nodiscard]] bool should_leave(const TaskEntry &next, bool waited) const {
    return silences_tiny_jobs_ && look_soon_ > 0 && (waited || looks_) && next.expected_tiny();
  }
  /// To be called after posting: no mail stays silent if no thread is left that soon looks for it.
  void settle(WakeUps &wake_ups) {
    if (looks_ && look_soon_ == 0) wake_silent(silent_posts_, handed_.size(), wake_ups);
  }
  /// Has threads woken whose mail has been silent since before the last look: the most urgent, as many as there are
  /// other processors. Returns true if the lookout should look again, and false if it should sleep.
  bool look(WakeUps &wake_ups);

 private:
  /// Removes an idle thread: the leader if it wakes up now anyway or is the only one, otherwise the one that became
  /// idle last, of those on processor `here` if there are any.
  WorkerThread &take_idle(Time now, int here) {
    if (leader_ != nullptr && (idle_.empty() || leader_->wakes_at.load(std::memory_order_relaxed) <= now)) {
      leader_->leads.store(false, std::memory_order_relaxed);
      return *std::exchange(leader_, nullptr);
    }
    REDAG_CHECK(!idle_.empty(), "more jobs started than there are threads");
    std::size_t at = idle_.size() - 1;
    if (here >= 0) {
      for (std::size_t i = idle_.size(); i-- > 0;) {
        if (processor_of(idle_[i]->processor) != here) continue;
        at = i;
        break;
      }
    }
    WorkerThread &thread = *idle_[at];
    idle_.erase(idle_.begin() + static_cast<std::ptrdiff_t>(at));
    return thread;
  }
  /// Two wake-ups within this time that mail could have done without wake the lookout.
  static constexpr Duration kBusy = 200 * kMicrosecond;

  WorkerThread *steal_mail(std::uint32_t level);
  bool may_be_silent(const TaskEntry &entry, Time now, Sender sender, WakeUps &wake_ups);
  bool may_look(Time now, WakeUps &wake_ups);
  void look_soon(WorkerThread &thread) {
    if (!thread.looks_soon) ++look_soon_;
    thread.looks_soon = true;
  }
  void deliver(WorkerThread &thread, bool silent, bool preempts, WakeUps &wake_ups);
  /// Wakes up to `most` threads with mail of the first `silent_posts` silent posts.
  void wake_silent(std::uint64_t silent_posts, std::size_t most, WakeUps &wake_ups);

  Parker *lookout_;
  bool silences_tiny_jobs_;
  std::size_t other_processors_ = 1;
  std::vector<WorkerThread *> idle_;    // without the leader; the last one is used first
  WorkerThread *leader_ = nullptr;      // an idle thread, or null
  std::vector<WorkerThread *> handed_;  // threads that may have mail; each once
  bool looks_ = false;                  // the lookout is awake
  std::uint32_t look_soon_ = 0;         // threads with looks_soon
  std::uint64_t silent_posts_ = 0;      // since the start
  std::uint64_t deferred_ = 0;          // the number of the last defer(), as if it were a silent post; 0: seen to
  std::uint64_t seen_ = 0;              // silent posts at the last look
  Time last_wake_up_ = -kBusy;          // the last one that mail could have done without
};

}  // namespace redag::runtime
