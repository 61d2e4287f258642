// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A run in numbers: per task, per DAG and in total (docs/model.md, "What is measured"). Incremental: Summarizer takes
// events as they arrive, and memory does not grow with the length of a run. Percentiles are exact for the first
// kExactJobs / (number of tasks) jobs of each task, then of a sketch (duration_sketch.hpp). Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/activity.hpp"
#include "redag_analysis/metrics/distribution.hpp"
#include "redag_analysis/metrics/duration_sketch.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/miss.hpp"

namespace redag::metrics {

/// The number of jobs, over all tasks, whose times are kept for exact percentiles, 32 bytes each.
inline constexpr std::size_t kExactJobs = std::size_t{1} << 20U;

/// Its share of one of so many tasks: at least 16, below which exact values are cheaper than a sketch.
[[nodiscard]] std::size_t exact_jobs_of_task(std::size_t tasks, std::size_t exact_jobs = kExactJobs);

inline constexpr std::size_t kReasonCount = static_cast<std::size_t>(kLastReason) + 1;

/// Counts the jobs of a task, of a DAG, or of all. Jobs released before the end of the warm-up are not included. The
/// only time is an extreme, because mixed times of several tasks would describe none of them.
struct JobCounts {
  std::uint64_t released = 0;  // = finished + skipped + aborted + in_flight
  std::uint64_t finished = 0;
  std::uint64_t skipped = 0;
  std::uint64_t aborted = 0;
  std::uint64_t in_flight = 0;  // when the run ended
  std::uint64_t deferred = 0;
  std::uint64_t exceeded = 0;                           // used their budget and were not cut off
  std::uint64_t late = 0;                               // Miss::Deadline: finished after the deadline, or overdue
  std::uint64_t overdue = 0;                            // in flight with the deadline passed
  std::array<std::uint64_t, kReasonCount> by_reason{};  // skipped and aborted, by Reason
  std::uint64_t preemptions = 0;
  std::optional<Duration> max_lateness;  // L_max over finished jobs; if negative, the closest that a job came to its
                                         // deadline

  /// MR = late / released (eq. miss_rate); 0 where nothing was released.
  [[nodiscard]] double miss_ratio() const;
  /// Aborted jobs that found no data. Their absence delays nothing, and they are no misses.
  [[nodiscard]] std::uint64_t no_data() const { return by_reason[static_cast<std::size_t>(Reason::NoData)]; }
  /// Miss::Lost: skipped or aborted, except those without data.
  [[nodiscard]] std::uint64_t lost() const { return skipped + aborted - no_data(); }
  /// Late or lost.
  [[nodiscard]] std::uint64_t missed() const { return late + lost(); }
  /// missed / released; 0 where nothing was released.
  [[nodiscard]] double miss_ratio_with_lost() const;

  /// Counts a job, which was judged as `miss`.
  void count(const JobRecord &job, Miss miss);
  void add_counts(const JobCounts &other);
};

/// Jobs of one task.
struct JobStats : JobCounts {
  Distribution response;             // f - r, finished jobs
  Distribution response_from_ready;  // f - ready
  Distribution start_latency;        // start - ready; not of jobs without data
  Distribution on_worker;            // time on a worker; the execution time where nothing else could run there
};

/// The answers of one sink, from a source's release to the sink's finish.
struct SinkSummary {
  TaskId task;
  std::uint64_t due = 0;   // finishes that its sources' releases ask for: the fewest of any source it waits for
  std::uint64_t late = 0;  // beyond the DAG's deadline, including those in flight at the end
  Distribution response;   // f - origin, finished jobs
};

/// The end-to-end figures of a DAG. Its sinks are not mixed: each figure of `response` is that of the sink with the
/// worst one (worst_of).
struct EndToEnd {
  Duration deadline = 0;   // of the DAG; 0: none
  std::uint64_t late = 0;  // at all sinks
  Distribution response;
  std::vector<SinkSummary> sinks;

  /// Fills `late` and `response` from the sinks.
  void conclude();
  /// The sum over all sinks.
  [[nodiscard]] std::uint64_t due() const;
};

struct TaskSummary {
  TaskId task;
  std::string dag;
  std::string name;
  JobStats jobs;
};

struct DagSummary {
  std::string name;
  JobCounts jobs;
  EndToEnd end_to_end;
  std::uint32_t max_active = 0;   // 0: no bound
  std::uint32_t peak_active = 0;  // most jobs started and unfinished at any time, warm-up included
};

struct Summary {
  std::vector<TaskSummary> tasks;
  std::vector<DagSummary> dags;
  JobCounts total;
  Time begin = 0;  // start + warm-up
  Time end = 0;
  Inversions inversions;
  HighModeTime high_mode;
  std::vector<double> worker_busy;  // share of [begin, end or the last event after it]
  std::uint64_t group_overlaps = 0;
  bool all_enforced = true;  // every peak_active is within max_active, and jobs of one group never overlapped
  std::uint64_t lost_events = 0;
  std::uint64_t ignored_events = 0;  // of tasks or jobs that the stream does not know
};

class Summarizer {
 public:
  /// `run` must outlive this object; its `end` is not used.
  explicit Summarizer(const trace::RunInfo &run, std::size_t exact_jobs = kExactJobs);

  void add(std::span<const JobEvent> events);
  /// Ends the run at `end`. Call once.
  [[nodiscard]] Summary finish(Time end);
  /// The jobs so far that ended late or were lost, by DAG.
  [[nodiscard]] const std::vector<std::uint64_t> &missed() const { return missed_; }

 private:
  struct Samples {
    explicit Samples(std::size_t exact)
        : response(exact), response_from_ready(exact), start_latency(exact), on_worker(exact) {}

    DurationSketch response;
    DurationSketch response_from_ready;
    DurationSketch start_latency;
    DurationSketch on_worker;
  };

  void count(const JobRecord &job, Time end);
  void count_in_flight(Time end);
  [[nodiscard]] EndToEnd end_to_end_of(DagId dag, std::size_t first_task) const;
  static void fill(JobStats &stats, const Samples &samples);

  const trace::RunInfo &run_;
  Time begin_;
  std::vector<TaskRef> refs_;
  std::size_t exact_;  // exact jobs of a task
  std::vector<bool> is_sink_;
  std::vector<Duration> end_to_end_deadlines_;  // by TaskId; 0: none
  std::vector<JobStats> stats_;
  std::vector<Samples> samples_;
  std::vector<DurationSketch> end_to_end_;      // by TaskId; empty unless the task is a sink
  std::vector<std::uint64_t> end_to_end_late_;  // by TaskId
  std::vector<std::uint64_t> missed_;           // by DagId
  JobFolder folder_;
  Activity activity_;
};

/// Summarises a whole trace.
[[nodiscard]] Summary summarize(const trace::Trace &trace);

}  // namespace redag::metrics
