// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The jobs of a run while its events pass by, and whose data each of them used. A job is kept as long as another one
// refers to it, or can still use its data: memory does not grow with the run. Internal to metrics/. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/why/why_cause.hpp"

namespace redag::metrics {

struct LinkedJob;
using JobHandle = std::shared_ptr<LinkedJob>;

/// When a job ended, for those that waited for it.
struct Ending {
  JobId job;
  bool is_known = false;
  Time time = 0;  // once it is known
};
/// Of jobs of which the first to end lets another one go on.
using Holders = std::vector<std::shared_ptr<const Ending>>;

/// A stretch between two decisions. Cause::Predecessor: the job lacked data. Cause::Execution: it had a worker.
struct Wait {
  Cause cause = Cause::Unknown;
  JobId by;
  Time begin = 0;
  Time end = 0;
  std::shared_ptr<const Holders> holders;  // the first of these to end will be `by`; null: `by` is known
};

struct LinkedJob {
  JobRecord record;                // of a job that has not ended, only what its release tells
  bool has_ended = false;          // or the run has: `record` is complete
  std::shared_ptr<Ending> ending;  // if one waits for it
  /// The predecessor's job that completed the job's data, or whose end it still waited for; null: there is none.
  JobHandle last;
  /// The predecessor's job with the oldest data that the job used; null: there is none.
  JobHandle oldest;
  /// From when its release was seen to its end, in order of time; only of jobs that are followed (why_waits.hpp).
  std::vector<Wait> waits;

  [[nodiscard]] JobId id() const { return {record.task, record.number}; }
};

class JobLinks {
 public:
  /// `run` must outlive this object.
  explicit JobLinks(const trace::RunInfo &run);

  /// Continues from the last call.
  void add(const JobEvent &event);
  /// The run is over: the jobs in flight are complete as they are.
  void finish();

  /// Passes the jobs that ended since the last call to visit(const JobHandle &), in order of their end.
  template <class Visit>
  void drain_ended(Visit &&visit) {
    for (const JobHandle &job : ended_) visit(job);
    ended_.clear();
  }

  /// Returns the job if it is in progress, else null.
  [[nodiscard]] JobHandle find(const JobId &job) const;
  /// When a job ended that has; the end of the run for a job in flight.
  [[nodiscard]] Time end_of(const LinkedJob &job) const;
  [[nodiscard]] const Task &task(TaskId task) const { return *refs_[task.value].task; }

 private:
  static constexpr std::size_t kRecent = 64;

  void release(const JobEvent &event);
  void end(const JobHandle &job, const JobRecord &record);
  void complete(LinkedJob &job) const;
  void link(LinkedJob &job) const;
  void link_unfinished(LinkedJob &job) const;
  [[nodiscard]] JobHandle data_of(TaskId predecessor, const LinkedJob &job) const;
  [[nodiscard]] TaskId predecessor(TaskId task, std::uint32_t index) const;

  const trace::RunInfo &run_;
  std::vector<TaskRef> refs_;
  std::vector<bool> is_sink_;  // by TaskId: no task uses its data
  JobFolder folder_;
  std::vector<std::vector<JobHandle>> live_;     // by TaskId: jobs that have not ended, in order of release
  std::vector<std::deque<JobHandle>> finished_;  // by TaskId: the last ones that finished, in this order
  std::vector<JobHandle> ended_;
};

/// Passes `job` and all jobs that an explanation of it can reach to visit(const JobHandle &), each once. Stops, and
/// returns false, when `visit` returns false.
template <class Visit>
bool visit_reachable(const JobHandle &job, Visit &&visit) {
  std::vector<JobHandle> found{job};
  const auto reach = [&found](const JobHandle &other) {
    if (other != nullptr && std::find(found.begin(), found.end(), other) == found.end()) found.push_back(other);
  };
  for (std::size_t i = 0; i < found.size(); ++i) {
    const JobHandle one = found[i];
    if (!visit(one)) return false;
    reach(one->last);
    reach(one->oldest);
  }
  return true;
}

}  // namespace redag::metrics
