// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reports deadline misses on a thread of its own, so that what the program does about a miss delays neither a release
// nor a decision, and may take any lock. Owns its thread, and the log in which an engine notes misses.
#pragma once

#include <functional>

#include "redag/base/atomic.hpp"
#include "redag/base/result.hpp"
#include "redag/engine/miss_log.hpp"
#include "redag/threads/threads.hpp"

namespace redag::runtime {

class MissReporter {
 public:
  /// Called on the thread, without locks, once for each miss. Must not throw. `unreported`: see MissInfo.
  using Report = std::function<void(const Miss &miss, std::uint64_t unreported)>;

  explicit MissReporter(Report report) : report_(std::move(report)), log_(kMostWaiting) {}
  ~MissReporter() { stop(); }
  MissReporter(const MissReporter &) = delete;
  MissReporter &operator=(const MissReporter &) = delete;

  /// If there is a thread already, does nothing. Error: the thread cannot be set up as asked.
  [[nodiscard]] Result<void> start(const ThreadSetup &setup);
  /// Reports what is noted, and ends the thread. Not from a report.
  void stop();
  [[nodiscard]] bool is_this_thread() const;

  /// For EngineOptions::misses.
  [[nodiscard]] MissLog &log() { return log_; }

 private:
  static constexpr std::size_t kMostWaiting = 1024;

  void main() noexcept;

  Report report_;
  MissLog log_;
  Atomic<bool> stopping_{false};
  ThreadHandle thread_;
};

}  // namespace redag::runtime
