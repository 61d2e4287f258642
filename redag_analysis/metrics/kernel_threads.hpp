// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the rows of a kernel's record say of threads so far: their names and processes, and which of them ran a job.
// Internal to metrics/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>

#include "redag_analysis/metrics/kernel_record.hpp"

namespace redag::metrics {

class KernelThreads {
 public:
  void add(const KernelRow &row);

  /// "redag-0"; "thread 17" if the record does not name it.
  [[nodiscard]] std::string name_of(int thread) const;
  /// The process that ran jobs and has this thread; 0: none.
  [[nodiscard]] int process_of(int thread) const;
  /// The thread of a process with this name, if there is exactly one. Process 0: of the only process.
  [[nodiscard]] std::optional<int> thread_named(const std::string &name, int process) const;
  /// The thread that ran a job's body. Of more than kMostJobs the first ones are forgotten.
  [[nodiscard]] std::optional<int> thread_of(TaskId task, std::uint32_t number) const;
  /// By their numbers.
  [[nodiscard]] const std::map<int, std::string> &processes() const { return processes_; }

  static constexpr std::size_t kMostJobs = std::size_t{1} << 20U;

 private:
  std::map<int, std::string> processes_;
  std::map<int, KernelThread> own_;              // of these processes
  std::unordered_map<int, std::string> others_;  // names
  std::unordered_map<std::uint64_t, int> jobs_;
  std::deque<std::uint64_t> job_order_;  // keys of jobs_, the first ones first
};

}  // namespace redag::metrics
