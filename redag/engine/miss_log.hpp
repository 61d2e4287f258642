// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The deadline misses of an engine, on their way to the thread that reports them. note() runs under the engine's lock,
// which makes its callers one writer; it never waits and never allocates. One thread takes what was noted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"
#include "redag/model/job_event.hpp"
#include "redag/runtime/executor_options.hpp"
#include "redag/threads/parker.hpp"
#include "redag/trace/ring.hpp"

namespace redag::runtime {

struct Miss {
  Time at = 0;            // when the scheduler learned of it
  Duration lateness = 0;  // of a job that finished
  TaskId task;
  std::uint32_t job = 0;
  MissKind kind = MissKind::Late;
  Reason reason = Reason::None;
};

class MissLog {
 public:
  explicit MissLog(std::size_t capacity) : ring_(capacity) {}

  /// Returns true if the thread that reports misses must be woken: parker().unpark().
  [[nodiscard]] bool note(const Miss &miss) { return ring_.push(miss); }

  [[nodiscard]] std::optional<Miss> take() {
    Miss miss;
    return ring_.pop({&miss, 1}) == 1 ? std::optional(miss) : std::nullopt;
  }
  /// How many misses found no room.
  [[nodiscard]] std::uint64_t dropped() const { return ring_.dropped(); }
  [[nodiscard]] Parker &parker() { return parker_; }

 private:
  trace::RingOf<Miss> ring_;
  Parker parker_;
};

}  // namespace redag::runtime
