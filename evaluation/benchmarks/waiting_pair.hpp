// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Two jobs that wait for each other in turns, on the engine's threads: the cost of a wait and its end. For the programs
// whose instructions are counted.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "redag/base/futex.hpp"
#include "redag/engine/coroutine_body.hpp"
#include "redag/engine/engine.hpp"
#include "redag/runtime/async_event.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/setup.hpp"

namespace redag::benchmarks {

class WaitingPair {
 public:
  explicit WaitingPair(const runtime::Setup &setup) {
    Workload workload;
    workload.dags.emplace_back();
    for (int side = 0; side < 2; ++side) {
      Task task;
      task.priority = 0;
      task.period = task.deadline = kSecond;
      task.wcet = kMillisecond;
      workload.dags[0].tasks.push_back(task);
    }
    runtime::EngineOptions options;
    options.config = setup.config;
    options.band = setup.band;
    engine_ = std::make_unique<runtime::Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config),
                                                options);
    std::vector<runtime::Body> bodies;
    for (std::size_t side = 0; side < 2; ++side) {
      bodies.push_back(runtime::coroutine_body([this, side](const runtime::Job &) { return play(side); }));
    }
    engine_->bind(workload, std::move(bodies));
    engine_->set_origin(runtime::monotonic_now());
  }

  /// Call it once, before run().
  [[nodiscard]] Result<void> start() {
    if (Result<void> ready = engine_->let_wait(); !ready) return ready;
    return engine_->start();
  }

  /// Returns after `waits` waits. Requires waits > 0.
  void run(std::uint64_t waits) {
    left_ = waits;
    const std::array releases = {runtime::Release{TaskId(std::size_t{0}), 0},
                                 runtime::Release{TaskId(std::size_t{1}), 0}};
    engine_->release(releases);
    while (done_.load() == 0) futex_wait(done_, 0);
  }

 private:
  // Each job wakes the other one and then waits for it.
  Coroutine play(std::size_t side) {
    if (side == 0) turn_[1].set();
    for (;;) {
      co_await turn_[side];
      if (left_ == 0) break;
      --left_;
      turn_[1 - side].set();
    }
    turn_[1 - side].set();
    if (++ended_ < 2) co_return;
    done_.store(1);
    futex_wake(done_, 1);
  }

  FutexWord done_{0};
  std::uint64_t left_ = 0;
  int ended_ = 0;
  std::array<AsyncEvent, 2> turn_;
  std::unique_ptr<runtime::Engine> engine_;  // last, because its threads use the other members
};

}  // namespace redag::benchmarks
