// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Looks up in the kernel's record what ran instead of a thread, and why. Internal to metrics/. Pure after construction.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "redag_analysis/metrics/kernel_record.hpp"
#include "redag_analysis/metrics/why_cause.hpp"

namespace redag::metrics {

class KernelView {
 public:
  /// A stretch of a thread's time. Cause::Execution: it executed. Cause::Unknown: the record does not tell.
  struct Stretch {
    Cause cause = Cause::Unknown;
    std::string program;
    Time begin = 0;
    Time end = 0;
  };

  /// `record` must outlive this object.
  explicit KernelView(const KernelRecord &record);

  /// The thread that ran a job's body, if it was recorded.
  [[nodiscard]] std::optional<int> thread_of(const JobId &job) const;

  /// Returns what the thread did in [begin, end), without gaps.
  [[nodiscard]] std::vector<Stretch> follow(int thread, Time begin, Time end) const;

  /// Returns what ran in [begin, end) on the processor where the thread executes at `end`, until it got that processor:
  /// it was to begin there. Stretches in which nothing of another program ran are Cause::Unknown.
  [[nodiscard]] std::vector<Stretch> before(int thread, Time begin, Time end) const;

  /// The threads of the process with this name.
  [[nodiscard]] std::vector<int> threads_named(const std::string &name) const;

 private:
  struct Slice {  // a thread on a processor
    Time begin = 0;
    Time end = 0;
    int cpu = 0;
    int thread = 0;
    int priority = 0;
    bool runnable = false;  // at its end
  };

  void occupants(int cpu, int priority, Time begin, Time end, std::vector<Stretch> &out) const;
  void executed(const Slice &slice, Time begin, Time end, std::vector<Stretch> &out) const;
  [[nodiscard]] std::string name_of(int thread) const;

  const KernelRecord &record_;
  std::map<JobId, int> jobs_;
  std::map<int, std::vector<Slice>> by_cpu_;
  std::map<int, std::vector<Slice>> by_thread_;
  std::map<int, std::vector<const KernelInterrupt *>> interrupts_;
};

}  // namespace redag::metrics
