// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the measurement lets the runtime run: its workload, bodies that record when they did not run, and a look at the
// release timer's processor time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <ctime>
#include <optional>
#include <span>
#include <vector>

#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag_lab/doctor/figures.hpp"
#include "redag_lab/run/run_workload.hpp"

namespace redag::doctor {

/// Returns the workload of the measurement: short jobs at high rates above long ones that fill half of the workers'
/// time.
[[nodiscard]] Workload measured_workload(std::uint32_t workers);

/// The bodies of the long jobs. Each records the intervals in which it did not run. Must outlive the run.
class AbsenceRecorder {
 public:
  explicit AbsenceRecorder(std::size_t tasks) : absences_(tasks) {}

  /// Replaces the bodies of the long tasks.
  [[nodiscard]] std::vector<runtime::Body> replace(const Workload &workload, std::vector<runtime::Body> bodies,
                                                   const lab::Now &now);

  /// By TaskId. Requires that the run has ended.
  [[nodiscard]] const std::vector<std::vector<Absence>> &absences() const { return absences_; }

 private:
  [[nodiscard]] runtime::Body body(const Task &task, TaskId id, const lab::Now &now);

  std::vector<std::vector<Absence>> absences_;
};

/// Means of the processor time that the release timer's thread, one of this process, takes for a release.
class TimerWatch {
 public:
  explicit TimerWatch(const Workload &workload);

  /// Called during the run, with all events so far.
  void look(std::span<const JobEvent> events);

  [[nodiscard]] const std::vector<Duration> &means() const { return means_; }

 private:
  std::vector<bool> is_timer_;
  std::optional<clockid_t> clock_;
  std::size_t seen_ = 0;
  std::uint64_t releases_ = 0;
  std::optional<Duration> last_used_;
  std::vector<Duration> means_;
};

}  // namespace redag::doctor
