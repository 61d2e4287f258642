// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One thread that releases jobs when they are due, and sleeps until then. A thread without a job, the leader, can wait
// in its place and then run the job itself, which saves waking one thread by another (the leader/followers pattern:
// Schmidt, O'Ryan, Kircher, Pyarali, Buschmann, PLoP 2000). What is due is the business of the function that it calls.
//
// Threads: any thread may call release_due() and changed(); one leader at a time. stop() is async-signal-safe.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <utility>

#include "redag/base/alarm.hpp"
#include "redag/base/atomic.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/result.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/base/time.hpp"
#include "redag/threads/threads.hpp"

namespace redag::runtime {

class ReleaseThread {
 public:
  /// Releases what is due, and returns when it is to be called again (CLOCK_MONOTONIC; kNever: after changed()). Called
  /// by one thread at a time.
  using Expire = std::function<Time()>;

  explicit ReleaseThread(Expire expire) : expire_(std::move(expire)) {}
  ~ReleaseThread();  // stops and joins
  ReleaseThread(const ReleaseThread &) = delete;
  ReleaseThread &operator=(const ReleaseThread &) = delete;

  /// Creates the thread. If there is one already, does nothing. Error: what the system refused.
  [[nodiscard]] Result<void> start(const ThreadSetup &setup);
  /// Gives the thread this SCHED_FIFO priority, now or when it starts; 0: that of `setup`, which is the default. Any
  /// thread may call it, with any lock. Returns false if the system refused.
  bool set_priority(int priority) noexcept;
  /// The next release may have become earlier. Takes no lock.
  void changed() noexcept { alarm_.ring(); }
  /// Releases what is due, as the thread does. Returns the time of the next release; kNever: none is known, or stop()
  /// has taken effect.
  Time release_due();

  /// Ends the releases at this moment. Those that were due before are still made.
  void stop() noexcept;
  /// Waits for the thread, after stop().
  void join();

  // For the leader.

  /// Returns true if a release was expected when this was last known.
  [[nodiscard]] bool expects() const noexcept { return next_.load(std::memory_order_relaxed) != kNever; }
  /// Releases what is due, and returns when the leader is to call it again. The thread leaves that release to the
  /// leader for `patience` after its time (kNever: altogether), and goes on with earlier ones.
  Time lead(Duration patience);
  /// The leader has a job now: the thread makes the next release.
  void follow();

 private:
  void main() noexcept;
  void run() noexcept;
  Time expire() REDAG_REQUIRES(lock_);
  void set_alarm() REDAG_REQUIRES(lock_);

  const Expire expire_;
  PiMutex lock_{LockClass::Bounded};
  Time led_ REDAG_GUARDED_BY(lock_) = kNever;      // the release that the leader waits for; kNever: none
  Duration patience_ REDAG_GUARDED_BY(lock_) = 0;  // of the thread with the leader
  Time alarm_at_ REDAG_GUARDED_BY(lock_) = kNever;
  bool ended_ REDAG_GUARDED_BY(lock_) = false;
  std::atomic<Time> next_{kNever};  // written under the lock
  Alarm alarm_;
  Atomic<bool> stopping_{false};
  PiMutex priority_lock_{LockClass::Bounded};  // never held while something is released
  int priority_ REDAG_GUARDED_BY(priority_lock_) = 0;
  // The thread, until it ends.
  std::optional<decltype(std::declval<ThreadHandle &>().native_handle())> alive_ REDAG_GUARDED_BY(priority_lock_);
  ThreadHandle thread_;
};

}  // namespace redag::runtime
