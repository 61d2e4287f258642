// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the doctor examines, and one function for each setting that it judges (diagnosis.cpp says why they matter). They
// throw Unreadable where they cannot judge. Any thread.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag_lab/doctor/machine.hpp"

namespace redag::doctor {

/// In the order in which one tells more than the other: green is only what nothing contradicts.
enum class Verdict : std::uint8_t { Green, Unknown, Yellow, Red };

[[nodiscard]] const char *to_string(Verdict verdict);

struct Finding {
  Verdict verdict = Verdict::Unknown;
  std::string found;  // Unknown: why
};

/// What is examined: a machine, and on it this program, or running processes.
struct Subject {
  Machine machine;
  std::vector<Process> processes;
  bool attached = false;  // false: `processes` is this program alone

  /// The threads of all processes.
  [[nodiscard]] std::vector<Thread> threads() const;
  /// The processors where workers run, or would run; at least one.
  [[nodiscard]] std::vector<int> cpus() const;
  /// True if one of the processes has arguments for ROS 2, or threads of its middleware.
  [[nodiscard]] bool is_ros() const;
};

using Check = Finding(const Subject &subject);

// Rights of the processes.
Check check_realtime_right, check_memory_lock;
// Running processes.
Check check_threads, check_middleware, check_simulated_time, check_live_page;
// Settings of the kernel and the processors.
Check check_throttling, check_preemption, check_governor, check_idle_states, check_smt, check_isolation,
    check_interrupts, check_clock_source, check_steal, check_swap;

/// Returns the finding that tells most: the first one with the highest verdict. Unknown if there is none.
[[nodiscard]] Finding worst_of(const std::vector<Finding> &findings);

}  // namespace redag::doctor
