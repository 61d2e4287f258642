// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What an Executor can say about its jobs: counts, misses and distributions of the tasks of a DAG, and end to end. The
// terms are those of docs/model.md, "What is measured". Plain values.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/model/job_event.hpp"
#include "redag/sched/config.hpp"
#include "redag/threads/values.hpp"

namespace redag::runtime {

/// A distribution of durations, in buckets of 1/8 of an octave. Empty unless ExecutorOptions::measure is set.
class Distribution {
 public:
  /// What it is made of; not part of the interface.
  struct Content;

  Distribution() = default;
  explicit Distribution(std::shared_ptr<const Content> content) : content_(std::move(content)) {}

  [[nodiscard]] std::uint64_t count() const;
  /// Exact; 0 if empty.
  [[nodiscard]] Duration longest() const;
  /// The duration that `share` of the values do not exceed: quantile(0.99) is the 99th percentile. Exact to 1/8 above,
  /// never below. 0 if empty. Throws std::invalid_argument if `share` is not from 0 to 1.
  [[nodiscard]] Duration quantile(double share) const;

 private:
  std::shared_ptr<const Content> content_;  // null: empty
};

struct TaskStats {
  std::string task;  // "control.ekf"
  sched::Accounting jobs;
  Usage usage;
  Duration deadline = 0;          // relative to the release
  std::uint64_t late = 0;         // finished after the deadline
  std::uint64_t kept_worker = 0;  // scopes of redag::Blocking in which a job kept its worker; see Blocking::lends()
  std::uint64_t early = 0;        // of a DagBuilder::event(): releases before the minimum inter-arrival time had passed
  Distribution response = {};     // of finished jobs, from the release

  /// Jobs that finished late, were skipped, or were aborted although they had data. Jobs in flight do not count yet.
  [[nodiscard]] std::uint64_t misses() const { return jobs.misses(late); }
  /// The lateness (finish - deadline) that `share` of the finished jobs do not exceed; negative: they were in time. As
  /// exact as the response. 0 if `response` is empty. Throws as Distribution::quantile().
  [[nodiscard]] Duration lateness(double share) const {
    const Duration longest = response.quantile(share);
    return response.count() == 0 ? 0 : longest - deadline;
  }
};

/// The answers of a DAG at one of its sinks, the tasks without successors.
struct SinkStats {
  std::string task;              // "control.pid"
  std::uint64_t late = 0;        // finished after the DAG's deadline
  Distribution end_to_end = {};  // of finished jobs, from the earliest release of a source whose data they carry
};

struct DagStats {
  std::string dag;
  Duration deadline = 0;  // end to end; 0: none
  std::vector<TaskStats> tasks;
  std::vector<SinkStats> sinks;

  /// True if no job of a task was missed, and no sink was later than the DAG's deadline.
  [[nodiscard]] bool met_every_deadline() const;
};

struct MissInfo {
  std::string task;  // "control.ekf"
  std::uint32_t job = 0;
  MissKind kind = MissKind::Late;
  Reason reason = Reason::None;  // of Skipped and Aborted
  Duration lateness = 0;         // of Late and EndToEnd
  std::uint64_t unreported = 0;  // misses so far for which there was no room; they are only counted
  std::string text;              // all of it, for a log
};

}  // namespace redag::runtime
