// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Jobs out of events: one JobRecord per job, as docs/model.md ("What is measured") means it. Incremental: a long run's
// events need not be kept. Tolerant: judges nothing (trace_checker.hpp does), and events of unknown jobs are counted
// and ignored. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"

namespace redag::metrics {

enum class JobOutcome : std::uint8_t { InFlight, Finished, Skipped, Aborted };

[[nodiscard]] const char *to_string(JobOutcome outcome);

/// Times are kNever where the job did not come that far.
struct JobRecord {
  std::uint64_t sequence = 0;  // how many jobs of the whole run were released before it
  TaskId task;
  std::uint32_t number = 0;
  std::uint32_t worker = WorkerId::kNoneValue;  // where it started
  Time release = kNever;                        // r, nominal
  Time ready = kNever;
  Time start = kNever;     // its body began (Started), or else the decision to start it (Dispatched)
  Time finish = kNever;    // f as measured; of aborted jobs: when they ended; of skipped ones: when they were skipped
  Time deadline = kNever;  // absolute, r + D
  Time origin = kNever;    // earliest source release whose data it carries
  Duration on_worker = 0;  // time it held a worker; its execution time where the driver is exact
  Duration processor = kNever;  // processor time that its body used; not in jobs.csv
  Time seen = kNever;           // when the scheduler was told of the release; not in jobs.csv
  std::uint32_t preemptions = 0;
  bool deferred = false;
  bool exceeded = false;  // used its budget and went on; not in jobs.csv
  JobOutcome outcome = JobOutcome::InFlight;
  Reason reason = Reason::None;

  [[nodiscard]] bool has_started() const { return start != kNever; }
  /// f - r and f - ready. Requires a finished job.
  [[nodiscard]] Duration response() const { return finish - release; }
  [[nodiscard]] Duration response_from_ready() const { return finish - ready; }
  /// L = f - (r + D). Requires a finished job.
  [[nodiscard]] Duration lateness() const { return finish - deadline; }

  friend bool operator==(const JobRecord &, const JobRecord &) = default;
};

class JobFolder {
 public:
  explicit JobFolder(const Workload &workload);

  /// Goes on where the last call stopped.
  void add(std::span<const JobEvent> events);

  /// Jobs that ended since the last call, in order of their end; moved out.
  [[nodiscard]] std::vector<JobRecord> take_ended();

  /// The same, one by one to visit(const JobRecord &), without an allocation.
  template <class Visit>
  void drain_ended(Visit &&visit) {
    for (const JobRecord &record : ended_) visit(record);
    ended_.clear();
  }

  /// Jobs that have not ended, in order of release.
  [[nodiscard]] std::vector<JobRecord> in_flight() const;

  /// Events that named a task or a job that is not there.
  [[nodiscard]] std::uint64_t ignored_events() const { return ignored_; }

 private:
  struct Live {
    JobRecord record;
    Time on_worker_since = kNever;
  };
  struct TaskJobs {
    Duration deadline = 0;
    std::vector<Live> live;  // in order of release; two or three at most, unless the task queues
  };

  void add(const JobEvent &event);
  void end(TaskJobs &task, std::size_t index, const JobEvent &event);

  std::vector<TaskJobs> tasks_;
  std::vector<JobRecord> ended_;
  std::uint64_t released_ = 0;
  std::uint64_t ignored_ = 0;
};

/// All jobs of a complete stream, in order of release.
[[nodiscard]] std::vector<JobRecord> fold_jobs(const Workload &workload, std::span<const JobEvent> events);

}  // namespace redag::metrics
