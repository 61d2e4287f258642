// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Folds events into one JobRecord per job, as docs/model.md, "What is measured", defines it. Incremental: a long run's
// events need not be kept. Tolerant: it judges nothing (trace_checker.hpp does), and counts and ignores events of
// unknown jobs. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"

namespace redag::metrics {

enum class JobOutcome : std::uint8_t { InFlight, Finished, Skipped, Aborted };

[[nodiscard]] const char *to_string(JobOutcome outcome);

/// The record of one job. A time is kNever if the job did not get that far.
struct JobRecord {
  std::uint64_t sequence = 0;  // number of jobs of the whole run that were released before it
  TaskId task;
  std::uint32_t number = 0;
  std::uint32_t worker = WorkerId::kNoneValue;  // the worker on which it started
  Time release = kNever;                        // r, nominal
  Time ready = kNever;
  Time start = kNever;          // when its body began (Started), or else the decision to start it (Dispatched)
  Time finish = kNever;         // f as measured; for an aborted job its end, for a skipped one when it was skipped
  Time deadline = kNever;       // absolute, r + D
  Time origin = kNever;         // earliest source release whose data it carries
  Duration on_worker = 0;       // time that it held a worker; its execution time where the driver is exact
  Duration processor = kNever;  // processor time that its body used; not in jobs.csv
  Time seen = kNever;           // when the scheduler learned of the release; not in jobs.csv
  std::uint32_t preemptions = 0;
  bool deferred = false;
  bool exceeded = false;  // used its budget and continued; not in jobs.csv
  JobOutcome outcome = JobOutcome::InFlight;
  Reason reason = Reason::None;

  [[nodiscard]] bool has_started() const { return start != kNever; }
  /// f - r and f - ready. Both require a finished job.
  [[nodiscard]] Duration response() const { return finish - release; }
  [[nodiscard]] Duration response_from_ready() const { return finish - ready; }
  /// L = f - (r + D). Requires a finished job.
  [[nodiscard]] Duration lateness() const { return finish - deadline; }

  friend bool operator==(const JobRecord &, const JobRecord &) = default;
};

class JobFolder {
 public:
  explicit JobFolder(const Workload &workload);

  /// Continues from the last call.
  void add(std::span<const JobEvent> events);

  /// Moves out the jobs that ended since the last call, in order of their end.
  [[nodiscard]] std::vector<JobRecord> take_ended();

  /// Passes the same jobs one by one to visit(const JobRecord &), without an allocation.
  template <class Visit>
  void drain_ended(Visit &&visit) {
    for (const JobRecord &record : ended_) visit(record);
    ended_.clear();
  }

  /// Returns the jobs that have not ended, in order of release.
  [[nodiscard]] std::vector<JobRecord> in_flight() const;

  /// The number of events that named an unknown task or job.
  [[nodiscard]] std::uint64_t ignored_events() const { return ignored_; }

 private:
  struct Live {
    JobRecord record;
    Time since = 0;  // its latest change
    bool is_on_worker = false;

    /// Counts the time on a worker up to `now`. Earlier times than before count as the latest one.
    void move(bool onto_worker, Time now);
  };
  struct TaskJobs {
    Duration deadline = 0;
    std::vector<Live> live;  // in order of release; at most two or three, unless the task queues
  };

  void add(const JobEvent &event);
  void end(TaskJobs &task, std::size_t index, const JobEvent &event);

  std::vector<TaskJobs> tasks_;
  std::vector<JobRecord> ended_;
  std::uint64_t released_ = 0;
  std::uint64_t ignored_ = 0;
};

/// Returns all jobs of a complete stream, in order of release.
[[nodiscard]] std::vector<JobRecord> fold_jobs(const Workload &workload, std::span<const JobEvent> events);

}  // namespace redag::metrics
