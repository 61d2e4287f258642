// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reports overdue jobs while they still run: a thread looks at an engine's jobs at an interval. With it, `on_budget`
// (except abort) and HI mode need no preemption points; they take effect up to one interval late (Engine::watch). Owns
// its thread. Before the engine starts it sees no job. Join the engine after it.
#pragma once

#include <functional>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/engine/engine.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"
#include "redag/threads/values.hpp"

namespace redag::runtime {

class Watchdog {
 public:
  /// Called on the watchdog's thread, without locks, once for each overdue job. A long call delays the next look. Must
  /// not throw.
  using Report = std::function<void(const OverdueJob &)>;

  Watchdog(Engine &engine, WatchdogOptions options, Report report);
  ~Watchdog() { stop(); }
  Watchdog(const Watchdog &) = delete;
  Watchdog &operator=(const Watchdog &) = delete;

  /// In real-time programs, use a priority above that of jobs: below it, a job that spins would keep the thread from
  /// looking. If there is a thread already, does nothing. Error: the thread cannot be set up as asked.
  [[nodiscard]] Result<void> start(const ThreadSetup &setup);
  /// Ends the thread. Not from a report.
  void stop();
  [[nodiscard]] bool is_this_thread() const;

  /// Looks once, as if it were `as_of`. The thread does nothing else.
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

/// For example "in progress for 10.02 s, with 9.98 s of processor time". If the job used little, says what may keep it.
[[nodiscard]] std::string describe(const OverdueJob &job);

}  // namespace redag::runtime
