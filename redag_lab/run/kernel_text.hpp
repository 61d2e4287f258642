// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the text of the kernel's tracefs: sched_switch, interrupts and lost events. Its times are whole microseconds of
// CLOCK_MONOTONIC. Pure.
#pragma once

#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag_analysis/metrics/kernel_record.hpp"

namespace redag::lab {

class KernelText {
 public:
  /// Continues from the last call; a line may come in pieces. Lines that it does not know are ignored.
  void add(std::string_view text);

  /// Takes what was added, up to `until`: names of threads, then lost events, then switches and interrupts in order of
  /// time. An event that is older than the last `until` counts as lost. Processes of threads are unknown (0).
  [[nodiscard]] std::vector<metrics::KernelRow> take(Time until);

 private:
  void read(std::string_view line);
  void read_switch(Time time, int cpu, std::string_view fields);

  std::string rest_;
  std::vector<metrics::KernelRow> events_;
  std::map<int, std::string> names_;
  std::vector<metrics::KernelRow> named_;  // since the last take()
  std::uint64_t lost_ = 0;                 // the same
  Time taken_until_ = std::numeric_limits<Time>::min();
  std::map<std::pair<int, bool>, metrics::KernelInterrupt> open_;  // by processor, and true for a softirq
};

}  // namespace redag::lab
