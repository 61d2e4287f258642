// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures the processor time that the jobs of one thread use. Asking the kernel is a system call of 0.2 to 0.5 us.
// Jobs that are over within kShort of the clock are therefore charged this clock time, which is at least what they
// used. For use by one thread.
#pragma once

#include "redag/base/time.hpp"
#include "redag/threads/clock.hpp"

namespace redag::runtime {

class CpuMeter {
 public:
  static constexpr Duration kShort = 10 * kMicrosecond;
  /// A reading older than this is not used as a job's start. It bounds how much too much a job can be charged that was
  /// expected to be short and is not.
  static constexpr Duration kStale = 100 * kMicrosecond;

  /// The thread's processor time when a job began. If not exact, a lower bound of it.
  struct Start {
    Duration cpu = 0;
    bool exact = true;
  };

  /// Returns true if a job that begins at `now` needs a new reading. `exact`: its start must be exact.
  [[nodiscard]] bool needs_reading(Time now, bool exact) const noexcept {
    return !fresh_ && (exact || now - read_at_ > kStale);
  }
  /// The start of a job that begins now.
  [[nodiscard]] Start start() const noexcept { return Start{read_, fresh_}; }
  /// Notes the thread's processor time at `now`, where the next job begins.
  void set(Duration cpu, Time now) noexcept {
    read_ = cpu;
    read_at_ = now;
    fresh_ = true;
  }
  /// Marks the last reading as old: time has passed that no job is charged for, or a job ended without a reading.
  void pass() noexcept { fresh_ = false; }
  /// Discards all readings, because another thread continues.
  void forget() noexcept { *this = CpuMeter(); }

 private:
  Duration read_ = 0;
  Time read_at_ = -kNever / 2;  // long ago
  bool fresh_ = false;
};

}  // namespace redag::runtime
