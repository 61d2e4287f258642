// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The engine's tasks: bodies, limits and counts, by TaskId. Not thread-safe: the engine's lock guards it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "redag/base/histogram.hpp"
#include "redag/engine/job_body.hpp"
#include "redag/engine/running_job.hpp"
#include "redag/threads/cpu_meter.hpp"
#include "redag/threads/values.hpp"

namespace redag::runtime {

/// What a task is within its DAG.
struct TaskRole {
  DagId dag;
  bool is_sink = false;           // the DAG answers with its finish
  bool has_predecessors = false;  // its jobs can carry data of earlier releases
  Duration dag_deadline = 0;      // end to end; 0: none
};

/// What the engine keeps of a task: its body, its limits, and what its jobs used.
struct TaskEntry {
  static constexpr std::uint32_t kStreak = 8;
  /// The longest tiny job: another thread needs longer to wake up and take it.
  static constexpr Duration kTiny = kMicrosecond;
  static constexpr std::uint32_t kMostTinyScore = 12;

  /// Counts a job that ended, used `used` of processor time and took `took` on the clock.
  void count(Duration used, Duration took) {
    const bool as_ever = took <= kTiny && short_jobs == kStreak && tiny_score == kMostTinyScore;
    if (!as_ever) learn(took);
    ++usage.jobs;
    usage.total += used;
    usage.longest = std::max(usage.longest, used);
    if (used > least_limit) count_excess(used);
  }
  void set_limits(const Task &task);

  /// Processor time of the job's next limit, given what was reported before; kNever: none.
  [[nodiscard]] Duration next_limit(const RunningJob &job) const {
    Duration next = kNever;
    if (wcet_low > 0 && !job.used_wcet_low) next = wcet_low;
    if (budget > 0 && (cuts_off || !job.used_budget)) next = std::min(next, budget);
    return next;
  }

  /// Returns true if its last jobs were short: the next one is expected to be short, too.
  [[nodiscard]] bool expected_short() const { return short_jobs == kStreak && !always_measured; }
  /// Returns true if more than a quarter of its last jobs were tiny: where threads compete for the engine's lock, tiny
  /// jobs that release others often take longer.
  [[nodiscard]] bool expected_tiny() const { return tiny_score > kMostTinyScore / 3; }
  /// Returns true if its last jobs that released others from their bodies mostly ended within kShort after the first
  /// release. Two in a row that did not are enough for false.
  [[nodiscard]] bool releases_at_end() const { return tail_score > kStreak / 2; }
  /// Counts a job whose body released another job `tail` before it ended.
  void count_tail(Duration tail) {
    const std::uint32_t loss = std::min(tail_score, kStreak / 2);
    tail_score = tail <= CpuMeter::kShort ? std::min(tail_score + 1, kStreak) : tail_score - loss;
  }

  /// Returns true if a job that has been in progress for `elapsed` is overdue.
  [[nodiscard]] bool is_overdue(Duration elapsed, const WatchLimits &limits) const {
    return (limits.longest > 0 && elapsed > limits.longest) ||
           (limits.deadlines > 0 && deadline > 0 &&
            static_cast<double>(elapsed) > limits.deadlines * static_cast<double>(deadline));
  }

  Body body;
  std::shared_ptr<SkipListener> listener;  // can be null
  // set_limits():
  Duration wcet = 0;
  Duration wcet_low = 0;
  Duration budget = 0;
  bool cuts_off = false;  // on_budget: abort
  // Its jobs are always measured: their limits act at once, or its wcet is below the time charged without measuring.
  bool always_measured = false;
  Duration first_limit = kNever;  // next_limit() of a job that begins
  Duration least_limit = kNever;  // of wcet and budget; kNever: none

  Usage usage;
  Duration period = 0;
  Duration deadline = 0;
  Duration dag_deadline = kNever;        // of a sink; kNever: none
  std::shared_ptr<Histogram> response;   // null: not measured
  std::shared_ptr<Histogram> execution;  // null: not measured
  std::shared_ptr<Histogram>
      end_to_end;           // of a sink; null: not measured. `response` itself if nothing precedes the task
  bool is_special = false;  // more is done at a job's end: limits, an end-to-end deadline, a log of misses, a removal
  std::uint64_t late = 0;   // finished after the deadline
  std::uint64_t late_end_to_end = 0;  // finished after the DAG's deadline
  std::uint64_t preemptions = 0;
  std::uint64_t withdrawn = 0;    // jobs skipped by halt()
  std::uint64_t cancelled = 0;    // jobs whose wait was cancelled
  std::uint32_t most_waits = 0;   // of a job
  Duration longest_waits = 0;     // of a job, together
  std::uint64_t kept_worker = 0;  // calls that block for which no thread was left
  std::uint32_t concurrency = 0;  // jobs that can be in progress at once
  std::uint32_t busy = 0;         // jobs that have started and not ended
  std::uint32_t away = 0;         // of these, jobs that wait without a worker
  std::uint32_t short_jobs = 0;   // consecutive short jobs up to now; at most kStreak
  std::uint32_t tiny_score = 0;   // a tiny job adds 3, another one takes 1
  std::uint32_t tail_score = 0;   // a short tail (count_tail()) adds 1, another one takes 4; at most kStreak
  bool removed = false;
  bool waits_end = false;  // it was removed, and its jobs no longer wait

 private:
  void learn(Duration took) {
    short_jobs = took <= CpuMeter::kShort ? std::min(short_jobs + 1, kStreak) : 0;
    tiny_score = took <= kTiny ? std::min(tiny_score + 3, kMostTinyScore) : tiny_score - (tiny_score > 0 ? 1 : 0);
  }
  [[gnu::noinline]] void count_excess(Duration used) {
    if (wcet > 0 && used > wcet) ++usage.over_wcet;
    if (budget > 0 && used > budget) ++usage.over_budget;
  }
};

class TaskTable {
 public:
  /// measure: entries have histograms.
  /// logs_misses: somebody is told of every miss.
  TaskTable(bool measure, bool logs_misses) : measure_(measure), logs_misses_(logs_misses) {}

  /// Adds a task and takes its body. A reused id starts with a new entry: its former body was destroyed when its last
  /// job ended. `listener` can be null.
  void add(TaskId id, const Task &task, const TaskRole &role, Body &body, std::shared_ptr<SkipListener> listener);
  /// Moves the body to `doomed` unless a job is in progress: destructors are the user's code, to be run without the
  /// lock.
  void remove(TaskId id, std::vector<Body> &doomed);

  [[nodiscard]] TaskEntry &operator[](TaskId id) { return *entries_[id.value]; }
  [[nodiscard]] const TaskEntry &operator[](TaskId id) const { return *entries_[id.value]; }
  [[nodiscard]] std::size_t size() const { return entries_.size(); }
  /// How many jobs all tasks together can have in progress.
  [[nodiscard]] std::size_t most_started() const { return most_started_; }

 private:
  const bool measure_;
  const bool logs_misses_;
  std::vector<std::unique_ptr<TaskEntry>> entries_;  // entries keep their addresses
  std::size_t most_started_ = 0;
};

}  // namespace redag::runtime
