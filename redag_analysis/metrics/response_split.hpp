// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Where the time of a job goes from its release to its end: the stays that follow each other without a gap. Of a
// finished job, their lengths sum exactly to the response time. Plain values.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "redag/base/time.hpp"

namespace redag::metrics {

enum class Stay : std::uint8_t {
  NotReady,     // its release was not seen yet, or a predecessor was incomplete
  Ready,        // could start, but for a worker, max_active, its group, or an earlier job of its task; or was woken
  OnWorker,     // had a worker
  Preempted,    // lost its worker to another job
  DeviceQueue,  // had asked a device that served others
  Device,       // was served by a device
  Waits,        // waited without a worker for something else: an event, a time, a call that blocks
};
inline constexpr std::size_t kStays = 7;

/// The name in files, such as "device_queue".
[[nodiscard]] const char *to_string(Stay stay);

/// Lengths by Stay: of one job, or of several together.
struct ResponseSplit {
  std::array<Duration, kStays> length{};

  [[nodiscard]] Duration &operator[](Stay stay) { return length[static_cast<std::size_t>(stay)]; }
  [[nodiscard]] Duration operator[](Stay stay) const { return length[static_cast<std::size_t>(stay)]; }
  [[nodiscard]] Duration sum() const;
  void add(const ResponseSplit &other);

  friend bool operator==(const ResponseSplit &, const ResponseSplit &) = default;
};

/// Follows one job from its release.
class StayClock {
 public:
  StayClock() = default;
  explicit StayClock(Time release) : since_(release) {}

  /// The job stays elsewhere from `now` on. Earlier times than before count as the latest one.
  void move(Stay stay, Time now);
  /// The job ended. On threads, the end of a body can precede the decision that took its worker: it was not preempted
  /// then.
  void end(Time now);
  /// Until the last change.
  [[nodiscard]] const ResponseSplit &split() const { return split_; }

 private:
  ResponseSplit split_;
  Stay stay_ = Stay::NotReady;
  Time since_ = 0;
};

/// The splits of the finished jobs of a task.
struct ResponseSplits {
  ResponseSplit total;    // of all of them together; the sum is that of their response times
  ResponseSplit longest;  // of the first job with the longest response time
  std::uint64_t jobs = 0;

  void add(const ResponseSplit &split);
  void add(const ResponseSplits &other);
};

}  // namespace redag::metrics
