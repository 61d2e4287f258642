// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Keeps the kernel's throttling from jobs of high criticality: jobs of other DAGs give way (run on ordinary threads)
// before the kernel takes a processor from all real-time threads. docs/decisions/13 says why. Not thread-safe: the
// engine's lock guards it. The engine's guard thread looks at it as long as there are jobs.
#pragma once

#include <cstddef>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/runtime/job_placement.hpp"
#include "redag/runtime/realtime_share.hpp"
#include "redag/runtime/worker_pool.hpp"

namespace redag::runtime {

class ThrottlingGuard {
 public:
  ThrottlingGuard(const Throttling &throttling, const WorkerPool &pool, JobPlacement &placement)
      : throttling_(throttling), share_(throttling), pool_(pool), placement_(placement) {}

  /// The threads run on these processors.
  void start(const std::vector<int> &cpus);

  /// Call it after each decision: accounts for where real-time threads ran and run.
  void note(Time now);
  /// Lets jobs give way, if `can_give_way`, or ends that. Returns the time until the next look; kNever: not before
  /// must_wake() says so.
  Duration look(Time now, bool can_give_way);
  /// Call it when there are jobs. Returns true if the guard thread sleeps and has to be woken.
  [[nodiscard]] bool must_wake() {
    const bool sleeps = !is_awake_;
    is_awake_ = true;
    return sleeps;
  }
  /// For how long jobs gave way until `now`.
  [[nodiscard]] Duration gave_way(Time now) const;

 private:
  [[nodiscard]] std::size_t place_of(const WorkerThread &thread) const;
  void note_where_they_ran();
  void set_busy(Time now);

  Throttling throttling_;
  RealtimeShare share_;
  const WorkerPool &pool_;
  JobPlacement &placement_;
  std::vector<std::size_t> places_;  // by processor number: its index in `share_`
  std::vector<bool> busy_;           // by index in `share_`
  bool is_awake_ = false;            // the guard thread looks again by itself
  Time since_ = 0;                   // while jobs give way: since when
  Duration total_ = 0;               // of earlier times
};

}  // namespace redag::runtime
