// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the text of the kernel's tracefs: sched_switch, interrupts and lost events. Its times are whole microseconds of
// CLOCK_MONOTONIC. Pure.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "redag_analysis/metrics/kernel_record.hpp"

namespace redag::lab {

class KernelText {
 public:
  /// Continues from the last call; a line may come in pieces. Lines that it does not know are ignored.
  void add(std::string_view text);

  /// Returns the events since the beginning, by time, with times since `origin`. Threads have the names that the kernel
  /// stated last. Call once.
  [[nodiscard]] metrics::KernelRecord take(Time origin);

 private:
  void read(std::string_view line);
  void read_switch(Time time, int cpu, std::string_view fields);

  std::string rest_;
  metrics::KernelRecord record_;
  std::map<std::pair<int, bool>, metrics::KernelInterrupt> open_;  // by processor, and true for a softirq
};

}  // namespace redag::lab
