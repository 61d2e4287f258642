// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The processor time that the jobs of one thread use. The kernel's answer is a system call of 0.2 to 0.5 us, so it is
// not asked about jobs that are over within kShort on the clock: those are charged what the clock says, which is at
// least what they used. One thread.
#pragma once

#include "redag/base/time.hpp"
#include "redag/runtime/clock.hpp"

namespace redag::runtime {

class CpuMeter {
 public:
  static constexpr Duration kShort = 10 * kMicrosecond;
  /// How much too early the start of a job can be taken to be that was thought short and is not.
  static constexpr Duration kStale = 100 * kMicrosecond;

  /// The thread's processor time when a job began; at most that if not exact.
  struct Start {
    Duration cpu = 0;
    bool exact = true;
  };

  /// A job begins. `exact`: its start has to be.
  Start begin(Time now, bool exact) noexcept {
    if (!fresh_ && (exact || now - read_at_ > kStale)) set(thread_cpu_now(), now);
    return Start{read_, fresh_};
  }
  /// The thread's processor time now is known; the next job begins here.
  void set(Duration cpu, Time now) noexcept {
    read_ = cpu;
    read_at_ = now;
    fresh_ = true;
  }
  /// Time has passed that no job is charged for, or a job ended without a reading.
  void pass() noexcept { fresh_ = false; }
  /// Another thread goes on.
  void forget() noexcept { *this = CpuMeter(); }

 private:
  Duration read_ = 0;
  Time read_at_ = -kNever / 2;  // long ago
  bool fresh_ = false;
};

}  // namespace redag::runtime
