// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What each executor would do with a robot that was recorded, which deadlines are shown to hold, and what to change.
// Callbacks that the self-check does not reproduce get no verdict. Prints nothing.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_lab/import/model.hpp"
#include "redag_lab/import/self_check.hpp"

namespace redag::lab {

/// What one executor does with the workload, or a change of it.
struct Outcome {
  std::string executor;
  std::uint32_t workers = 1;
  metrics::Summary summary;  // of a simulation with the demands of the recording
  std::vector<bool> held;    // by TaskId: the deadline is shown to be met in every case

  // Of the callbacks with a verdict, in total:
  std::uint64_t released = 0;
  std::uint64_t missed = 0;
  std::size_t shown = 0;      // deadlines that are shown to be met
  double worst_response = 0;  // largest p99, as a share of the deadline
};

struct TriedChange {
  std::string words;
  Outcome outcome;
};

struct WhatIf {
  std::vector<std::string> refused;  // by TaskId: why there is no verdict; empty: there is one
  std::vector<Outcome> outcomes;     // the recorded executor is first, on the recorded workers, then on the others
  std::vector<TriedChange> changes;  // each alone, of the recorded robot; the best is first, and none makes it worse

  [[nodiscard]] std::size_t judged() const;  // number of callbacks with a verdict
};

/// The most changes that are named.
inline constexpr std::size_t kMostChanges = 3;

struct JudgeOptions {
  std::uint32_t other_workers = 1;
  const std::atomic<bool> *stop = nullptr;              // ends it, with an error
  std::function<void(double done)> progress = nullptr;  // before each simulation: 0 to 1
};

/// Simulates and analyses the executor that ran, and ReDAG-RT in modes `none` and `os`, each on the recorded number of
/// workers and on the other one; then the changes. Errors: those of run_session(), and the stop.
[[nodiscard]] Result<WhatIf> judge(const ImportedWorkload &imported, const SelfCheck &check, JudgeOptions options);

}  // namespace redag::lab
