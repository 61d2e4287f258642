// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// From counters that only grow to what people want to see: percentiles, sums of DAGs, and what happened lately. A value
// with memory of earlier samples; no clock, no thread.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "redag/base/histogram.hpp"
#include "redag/live/frame.hpp"

namespace redag::live {

struct DagSample {
  std::string name;
  std::uint32_t max_active = 0;  // 0: no bound
};

/// What is known of a task at some moment; counters since it was added.
struct TaskSample {
  std::uint64_t key = 0;  // names the task from sample to sample
  std::string name;       // within its DAG
  std::uint32_t dag = 0;  // position among the DAGs
  Duration period = 0;
  Duration deadline = 0;  // 0: none
  Duration bound = 0;     // 0: not known
  std::uint64_t released = 0;
  std::uint64_t finished = 0;
  std::uint64_t skipped = 0;
  std::uint64_t aborted = 0;
  std::uint64_t misses = 0;
  std::uint64_t deferred = 0;
  std::uint64_t preemptions = 0;
  Duration cpu = 0;
  std::uint32_t active = 0;
  std::uint32_t ready = 0;
  std::uint32_t waiting = 0;
  std::shared_ptr<const Histogram> response;  // null: not measured
};

struct Sample {
  std::vector<DagSample> dags;
  std::vector<TaskSample> tasks;  // of any order; `dag` must be among the DAGs
};

class FrameBuilder {
 public:
  /// What is recent goes back for at least `window` (once there was so much time) and less than twice that.
  FrameBuilder(Time began, Duration window);

  /// The figures of `frame` at `now`: its rows, times and window. `now` must not decrease.
  void build(const Sample &sample, Time now, Frame &frame);

 private:
  struct Mark {
    std::uint64_t finished = 0;
    std::uint64_t misses = 0;
    std::uint64_t preemptions = 0;
    Duration cpu = 0;
    HistogramCounts response;
  };
  struct History {
    std::shared_ptr<const Histogram> histogram;  // kept: another task's is another one
    Mark base;                                   // what is recent came after it
    Mark next;                                   // the base to come
    std::uint64_t seen = 0;
  };

  static page::Figures figures_of(const TaskSample &task, const Mark &now, const HistogramCounts &recent,
                                  const Mark &base);

  const Time began_;
  const Duration window_;
  Time base_at_;
  Time next_at_;
  std::uint64_t builds_ = 0;
  std::map<std::uint64_t, History> histories_;  // by key
};

}  // namespace redag::live
