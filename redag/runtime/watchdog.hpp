// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Names jobs that do not end, while they do not: a thread that looks at an engine's jobs now and then. With it,
// `on_budget` and HI mode take effect without preemption points, up to an interval late (Engine::watch). Owns its
// thread. The engine must be started before and joined after.
#pragma once

#include <functional>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/parker.hpp"
#include "redag/runtime/threads.hpp"

namespace redag::runtime {

class Watchdog {
 public:
  /// Called on the watchdog's thread, without locks, once for each such job. What is done for long there delays the
  /// next look. Must not throw.
  using Report = std::function<void(const OverdueJob &)>;

  Watchdog(Engine &engine, WatchdogOptions options, Report report);
  ~Watchdog();  // stops and joins
  Watchdog(const Watchdog &) = delete;
  Watchdog &operator=(const Watchdog &) = delete;

  /// In real-time programs at a priority above that of jobs: below it, a job that spins would not let it look. Error:
  /// the thread cannot be set up as asked.
  [[nodiscard]] Result<void> start(const ThreadSetup &setup);

  /// One look, as if it were `as_of`. The thread does nothing else.
  void look(Time as_of);

 private:
  void main() noexcept;

  Engine &engine_;
  WatchdogOptions options_;
  Report report_;
  std::vector<OverdueJob> overdue_;
  Event stop_;
  ThreadHandle thread_;
};

/// "in progress for 10.02 s, 9.98 s of processor time" or "...: it waits, or more urgent jobs leave it no processor".
[[nodiscard]] std::string describe(const OverdueJob &job);

}  // namespace redag::runtime
