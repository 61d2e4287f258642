// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The kernel's record of a run on threads: which thread had which processor, and interrupts. Times are those of the
// run's trace. Plain values, and their text form (kernel.jsonl, docs/results_format.md). redag_lab/run/ records it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/provenance.hpp"
#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/trace/trace.hpp"

namespace redag::metrics {

/// A processor goes from one thread to another. Thread 0: it idles.
struct KernelSwitch {
  Time time = 0;
  int cpu = 0;
  int from = 0;
  bool runnable = false;  // `from` could have continued; otherwise it waits for something
  int to = 0;
  int to_priority = 0;  // the kernel's: below 100 for real-time threads, smaller is more urgent

  friend bool operator==(const KernelSwitch &, const KernelSwitch &) = default;
};

/// A processor serves an interrupt.
struct KernelInterrupt {
  Time begin = 0;
  Time end = 0;
  int cpu = 0;
  std::string name;

  friend bool operator==(const KernelInterrupt &, const KernelInterrupt &) = default;
};

/// The thread that ran a job's body.
struct JobThread {
  TaskId task;
  std::uint32_t number = 0;
  int thread = 0;

  friend bool operator==(const JobThread &, const JobThread &) = default;
};

struct KernelRecord {
  Provenance run;                           // of the run, as in its trace: tells a record of another run
  std::vector<KernelSwitch> switches;       // by time
  std::vector<KernelInterrupt> interrupts;  // by time of their end
  std::vector<JobThread> jobs;
  std::map<int, std::string> names;  // of threads
  std::set<int> own;                 // threads of the process that ran the jobs
  std::uint64_t lost = 0;            // events that the kernel dropped

  friend bool operator==(const KernelRecord &, const KernelRecord &) = default;
};

/// True for the priority of a SCHED_FIFO, SCHED_RR or SCHED_DEADLINE thread, as the kernel counts.
[[nodiscard]] constexpr bool is_realtime_priority(int priority) { return priority < 100; }

/// Reads the record of a trace: kernel.jsonl beside its events.jsonl. Nothing if there is none, or that of another run
/// than `run`. Errors name file and line.
[[nodiscard]] Result<std::optional<KernelRecord>> read_kernel_record_of(const std::string &trace,
                                                                        const trace::RunInfo &run);

[[nodiscard]] Result<void> write_kernel_record(const std::string &path, const KernelRecord &record);

/// Reads a record. Errors name file and line.
[[nodiscard]] Result<KernelRecord> read_kernel_record(const std::string &path);

/// The same for text in memory; `file` is its name in errors.
[[nodiscard]] Result<KernelRecord> parse_kernel_record(std::string_view text, const std::string &file);

}  // namespace redag::metrics
