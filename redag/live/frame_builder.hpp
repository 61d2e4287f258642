// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Turns counters that only grow into the figures that people want: percentiles, sums of DAGs, and recent figures. A
// value that remembers earlier samples, without clock or thread. Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/histogram.hpp"
#include "redag/live/frame.hpp"

namespace redag::live {

struct DagSample {
  std::string name;
  std::uint32_t max_active = 0;  // 0: no bound
  Duration deadline = 0;         // end to end; 0: none
};

/// The state of a task at some moment. Counters start when the task is added.
struct TaskSample {
  std::uint64_t key = 0;  // names the task from sample to sample
  std::string name;       // within its DAG
  std::uint32_t dag = 0;  // index among the DAGs
  Duration period = 0;
  Duration deadline = 0;  // 0: none
  Duration bound = 0;     // 0: not known
  int priority = 0;       // SCHED_FIFO; 0: none of its own
  std::uint64_t released = 0;
  std::uint64_t finished = 0;
  std::uint64_t skipped = 0;
  std::uint64_t aborted = 0;
  std::uint64_t misses = 0;
  std::uint64_t deferred = 0;
  std::uint64_t preemptions = 0;
  Duration cpu = 0;
  std::uint32_t active = 0;
  std::uint32_t away = 0;
  std::uint32_t ready = 0;
  std::uint32_t waiting = 0;
  std::shared_ptr<const Histogram> response;  // null: not measured
  // From the release of the data's source. Can be `response` itself. Null: not measured, or tasks of its DAG follow.
  std::shared_ptr<const Histogram> end_to_end;
  std::uint64_t late_end_to_end = 0;  // beyond the DAG's deadline
};

/// A worker thread.
struct ThreadSample {
  Duration used = 0;                       // processor time of the jobs that ended on it
  std::optional<std::uint64_t> task = {};  // key of the task whose job it runs
};

struct DeviceSample {
  std::string name;
  std::uint32_t slots = 1;
  std::uint32_t queued = 0;                // jobs that asked it and are not served yet
  std::uint64_t served = 0;                // services that have ended
  Duration busy = 0;                       // time of all its services, in progress or ended
  std::vector<std::uint64_t> serves = {};  // keys of the tasks of the jobs that it serves now
};

struct Sample {
  std::vector<DagSample> dags;
  std::vector<TaskSample> tasks;        // in any order; `dag` must be among the DAGs
  std::vector<ThreadSample> threads{};  // the same ones each time
  std::vector<DeviceSample> devices{};  // the same ones each time
  std::string alert{};                  // see Frame
};

class FrameBuilder {
 public:
  /// Recent figures go back at least `window` (once so much time has passed) and less than twice as far.
  FrameBuilder(Time began, Duration window);

  /// Sets the figures of `frame` at `now`: its rows, times and window. `now` must not decrease.
  void build(const Sample &sample, Time now, Frame &frame);

 private:
  struct Mark {
    std::uint64_t finished = 0;
    std::uint64_t misses = 0;
    std::uint64_t preemptions = 0;
    Duration cpu = 0;
    std::uint64_t late_end_to_end = 0;
    HistogramCounts response;
    HistogramCounts end_to_end;
  };
  struct History {
    std::shared_ptr<const Histogram> histogram;  // kept alive: a reused key has another histogram
    Mark base;                                   // recent figures count from here
    Mark next;                                   // the next base
    std::uint64_t seen = 0;
  };
  struct ThreadHistory {
    Duration base = 0;
    Duration next = 0;
  };
  struct DeviceMark {
    Duration busy = 0;
    std::uint64_t served = 0;
  };
  struct DeviceHistory {
    DeviceMark base;
    DeviceMark next;
  };

  void build_tasks(const Sample &sample, bool turns, Frame &frame);
  void build_threads(const Sample &sample, bool turns, Frame &frame);
  void build_devices(const Sample &sample, bool turns, Frame &frame);
  /// Returns the row of a task of this frame by its key; nothing if there is none.
  [[nodiscard]] std::optional<std::uint32_t> row_of(std::uint64_t key) const;

  static page::Figures figures_of(const TaskSample &task, const Mark &now, const HistogramCounts &recent,
                                  const Mark &base);

  const Time began_;
  const Duration window_;
  Time base_at_;
  Time next_at_;
  std::uint64_t builds_ = 0;
  std::map<std::uint64_t, History> histories_;     // by TaskSample::key
  std::map<std::uint64_t, std::uint32_t> row_of_;  // of the tasks of this frame, by key
  std::vector<ThreadHistory> threads_;             // as Sample::threads
  std::vector<DeviceHistory> devices_;             // as Sample::devices
};

}  // namespace redag::live
