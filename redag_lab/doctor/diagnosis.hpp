// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Whether a machine keeps real-time promises: one line for each setting that matters. Any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/doctor/checks.hpp"
#include "redag_lab/doctor/measure.hpp"

namespace redag::doctor {

struct Line {
  const char *name;
  Finding finding;
  const char *why;   // it matters
  const char *mend;  // a command, or what to write where
};

struct Diagnosis {
  std::vector<Line> lines;
  std::vector<Process> processes;  // running ones; empty: none was asked for
  std::vector<Thread> threads;     // theirs, as far as they can be read

  [[nodiscard]] std::size_t count(Verdict verdict) const;
};

/// Examines a machine, and the running process or container `pid` on it. Error: there is no such process.
[[nodiscard]] Result<Diagnosis> diagnose(const Machine &machine, std::optional<std::int64_t> pid);

/// Returns the line of a measurement.
[[nodiscard]] Line judge(const HistogramCounts &wake_ups);

}  // namespace redag::doctor
