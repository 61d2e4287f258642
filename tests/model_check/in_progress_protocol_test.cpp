// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores every interleaving of calls in progress with a thread that waits for them, and with one that leaves them
// work, as ArrivalCallback of redag_rclcpp does.
#include "protocol.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/engine/in_progress.hpp"

namespace redag::model_check {
namespace {

using runtime::InProgress;

using explored::spawn;

/// Counts calls in progress, and takes work that is left to them.
class Calls {
 public:
  /// Returns false once the calls are closed.
  bool call() {
    {
      const LockGuard guard(lock_);
      if (!open_) return false;
      calls_.begin();
    }
    quiet.job_begins();
    quiet.job_ends();
    while (calls_.end()) {
      const LockGuard guard(lock_);
      if (work_ == 0 || !open_) return true;
      done_ += std::exchange(work_, 0);
      calls_.begin();
    }
    return true;
  }
  void close() {
    {
      const LockGuard guard(lock_);
      open_ = false;
    }
    calls_.wait();
  }
  void leave_work() {
    const LockGuard guard(lock_);
    ++work_;
    if (!calls_.tell()) done_ += std::exchange(work_, 0);
  }
  [[nodiscard]] int done() {
    const LockGuard guard(lock_);
    return done_;
  }

  Quiet quiet;

 private:
  PiMutex lock_;
  InProgress calls_;
  bool open_ REDAG_GUARDED_BY(lock_) = true;
  int work_ REDAG_GUARDED_BY(lock_) = 0;
  int done_ REDAG_GUARDED_BY(lock_) = 0;
};

TEST(InProgressProtocol, NoCallIsInProgressAfterTheWait) {
  for (const std::uint32_t spurious : {0U, 1U}) {
    expect_holds(
        [] {
          Calls calls;
          const std::uint32_t a = spawn([&] { calls.call(); });
          const std::uint32_t b = spawn([&] { calls.call(); });
          calls.close();
          calls.quiet.begin();
          explored::check(!calls.call(), "a call begins after the end");
          explored::join(a);
          explored::join(b);
        },
        ExploreOptions{true, 50'000'000, spurious, false});
  }
}

TEST(InProgressProtocol, TwoThreadsCanWait) {
  expect_holds([] {
    Calls calls;
    const std::uint32_t a = spawn([&] { calls.call(); });
    const std::uint32_t b = spawn([&] { calls.close(); });
    calls.close();
    calls.quiet.begin();
    explored::join(a);
    explored::join(b);
  });
}

TEST(InProgressProtocol, WorkThatIsLeftToCallsIsDone) {
  expect_holds([] {
    Calls calls;
    const std::uint32_t a = spawn([&] { calls.call(); });
    const std::uint32_t b = spawn([&] { calls.call(); });
    calls.leave_work();
    calls.leave_work();
    explored::join(a);
    explored::join(b);
    explored::check(calls.done() == 2, "work was left to a call that did not do it");
  });
}

}  // namespace
}  // namespace redag::model_check
