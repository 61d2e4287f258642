// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Graphs whose nodes have empty bodies, and two loops that run them: through the scheduler alone, and on the engine's
// threads. Shared by the benchmarks and by the programs whose instructions are counted.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/base/futex.hpp"
#include "redag/derived/rng.hpp"
#include "redag/engine/engine.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/setup.hpp"

namespace redag::benchmarks {

enum class Shape : std::uint8_t { Single, Chain, FanOut, Random };
inline constexpr std::array<std::string_view, 4> kShapes = {"single", "chain", "fan_out", "random"};

inline constexpr std::uint32_t kNodes = 64;
[[nodiscard]] constexpr std::uint32_t nodes_of(Shape shape) { return shape == Shape::Single ? 1 : kNodes; }

/// Returns the predecessors of each node. Node 0 is the only source, and the last node is the only sink.
inline std::vector<std::vector<std::uint32_t>> predecessors_of(Shape shape) {
  const std::uint32_t nodes = nodes_of(shape);
  std::vector<std::vector<std::uint32_t>> predecessors(nodes);
  Rng rng(7);
  std::vector<bool> has_successor(nodes, false);
  for (std::uint32_t v = 1; v + 1 < nodes; ++v) {
    switch (shape) {
      case Shape::Single: break;
      case Shape::Chain: predecessors[v] = {v - 1}; break;
      case Shape::FanOut: predecessors[v] = {0}; break;
      case Shape::Random:
        for (std::uint32_t u = v < 8 ? 0 : v - 8; u < v; ++u) {
          if (rng.uniform(0, 3) == 0) predecessors[v].push_back(u);
        }
        if (predecessors[v].empty()) predecessors[v] = {v - 1};
        break;
    }
    for (const std::uint32_t u : predecessors[v]) has_successor[u] = true;
  }
  for (std::uint32_t u = 0; u + 1 < nodes; ++u) {
    if (!has_successor[u]) predecessors[nodes - 1].push_back(u);
  }
  return predecessors;
}

/// Returns a workload of one DAG of that shape. Its policy is meant to be `fixed`.
inline Workload graph_workload(Shape shape) {
  Workload workload;
  workload.dags.emplace_back();
  for (const auto &predecessors : predecessors_of(shape)) {
    Task task;
    task.priority = static_cast<int>(workload.dags[0].tasks.size());  // the sink does not preempt itself
    task.period = task.deadline = kSecond;
    task.wcet = kMillisecond;
    task.activation = predecessors.empty() ? Activation::Timer : Activation::Data;
    task.predecessors = predecessors;
    workload.dags[0].tasks.push_back(task);
  }
  return workload;
}

/// Runs a graph through the scheduler alone, on one worker.
class SchedulerGraph {
 public:
  SchedulerGraph(Shape shape, sched::Preemption preemption)
      : scheduler_(graph_workload(shape), {1, preemption, PolicyKind::Fixed, 0, 0}) {}

  /// Releases the source, and completes each job that is dispatched, until none is left. Returns the number of jobs.
  std::uint32_t round() {
    std::uint32_t jobs = 0;
    scheduler_.release(TaskId(0), now_, now_);
    for (JobSlot job = dispatch(); job.valid(); job = dispatch()) {
      ++now_;
      ++jobs;
      scheduler_.complete(job, now_, sched::Outcome::Finished);
    }
    return jobs;
  }

 private:
  JobSlot dispatch() {
    const sched::Step step = scheduler_.dispatch(now_);
    return step.dispatches.empty() ? JobSlot() : step.dispatches.back().job;
  }

  sched::PriorityScheduler scheduler_;
  Time now_ = 0;
};

/// Runs a graph on the engine's threads. The last node starts the graph anew, so that the threads need no one else.
class EngineGraph {
 public:
  EngineGraph(Shape shape, const runtime::Setup &setup, std::uint32_t spins) : runs_(nodes_of(shape)) {
    const Workload workload = graph_workload(shape);
    runtime::EngineOptions options;
    options.config = setup.config;
    options.band = setup.band;
    options.spins = spins;
    engine_ = std::make_unique<runtime::Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config),
                                                options);
    std::vector<runtime::Body> bodies(runs_.size(), [this](const runtime::Job &job) {
      runs_[job.task.value].fetch_add(1, std::memory_order_relaxed);
      return sched::Outcome::Finished;
    });
    bodies.back() = [this](const runtime::Job &) {
      if (--left_ > 0) {
        engine_->release(TaskId(0), 0);
      } else {
        done_.store(1);
        futex_wake(done_, 1);
      }
      return sched::Outcome::Finished;
    };
    engine_->bind(workload, std::move(bodies));
    engine_->set_origin(runtime::monotonic_now());
  }

  /// Call it once, before run().
  [[nodiscard]] Result<void> start() { return engine_->start(); }

  /// Waits until the graph has run `rounds` times. Requires rounds > 0.
  void run(std::uint32_t rounds) {
    left_ = rounds;
    done_.store(0);
    engine_->release(TaskId(0), 0);
    while (done_.load() == 0) futex_wait(done_, 0);
  }

 private:
  FutexWord done_{0};
  std::uint32_t left_ = 0;
  std::vector<std::atomic<std::uint32_t>> runs_;
  std::unique_ptr<runtime::Engine> engine_;  // last, because its threads use the other members
};

}  // namespace redag::benchmarks
