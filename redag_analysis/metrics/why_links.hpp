// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The jobs of a trace and whose data each of them used. Internal to metrics/. Pure after construction.
#pragma once

#include <cstddef>
#include <optional>
#include <unordered_map>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/why_cause.hpp"

namespace redag::metrics {

class JobLinks {
 public:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  /// `trace` must outlive this object.
  explicit JobLinks(const trace::Trace &trace);

  /// All jobs, in order of release.
  [[nodiscard]] const std::vector<JobRecord> &jobs() const { return jobs_; }
  /// The index of a job; kNone: there is no such job.
  [[nodiscard]] std::size_t find(const JobId &job) const;
  /// When the job ended; the end of the run for a job in flight.
  [[nodiscard]] Time end_of(std::size_t job) const;
  [[nodiscard]] const Task &task(TaskId task) const { return *refs_[task.value].task; }
  [[nodiscard]] const std::vector<TaskRef> &tasks() const { return refs_; }

  /// The predecessor's job that completed the job's data, or whose end it still waited for; kNone: there is none.
  [[nodiscard]] std::size_t last(std::size_t job) const { return last_[job]; }
  /// The predecessor's job with the oldest data that the job used; kNone: there is none.
  [[nodiscard]] std::size_t oldest(std::size_t job) const { return oldest_[job]; }

 private:
  void add(const JobEvent &event);
  void link(std::size_t job);
  void link_unfinished(std::size_t job);
  [[nodiscard]] std::size_t data_of(const Task &task, TaskId predecessor, const JobRecord &job) const;
  [[nodiscard]] TaskId predecessor(TaskId task, std::uint32_t index) const;

  const trace::Trace &trace_;
  std::vector<TaskRef> refs_;
  std::vector<JobRecord> jobs_;
  std::unordered_map<std::uint64_t, std::size_t> index_;
  std::vector<std::size_t> last_;
  std::vector<std::size_t> oldest_;
  // While the links are made, by task: jobs that have finished, in this order, and jobs that have not ended.
  std::vector<std::vector<std::size_t>> finished_;
  std::vector<std::vector<std::size_t>> live_;
};

}  // namespace redag::metrics
