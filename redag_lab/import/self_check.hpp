// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Asks whether an imported workload does in the simulator what the robot did: the model of the executor that ran, with
// the phases, executions and delays of the recording, against the recorded response times. Prints nothing.
#pragma once

#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_analysis/metrics/distribution.hpp"
#include "redag_lab/import/model.hpp"
#include "redag_lab/run/session.hpp"

namespace redag::lab {

inline constexpr double kMostP50Error = 0.1;
inline constexpr double kMostP99Error = 0.25;

struct ReproducedTask {
  TaskId task;
  std::string name;
  metrics::Distribution recorded;
  metrics::Distribution simulated;

  double p50_error = 0;  // relative; 0 if the difference is below the noise floor
  double p99_error = 0;
  [[nodiscard]] bool is_reproduced() const { return p50_error <= kMostP50Error && p99_error <= kMostP99Error; }
};

struct SelfCheck {
  std::string executor;  // whose model ran
  std::vector<ReproducedTask> tasks;
  std::vector<std::string> unknown;  // tasks whose responses were not recorded
  metrics::Distribution noise;       // wake-ups of idle threads: a difference of p50 or p99 below theirs is none

  [[nodiscard]] bool is_reproduced() const;  // all of `tasks` are
};

/// A workload with the phases of the recording, and the options of a simulation that repeats its demands.
struct Replayed {
  Workload workload;
  SessionOptions options;
};

/// `workload` is the imported one, or a change of it with the same tasks. `imported` must outlive the result.
[[nodiscard]] Replayed replay(const ImportedWorkload &imported, const Workload &workload, const Variant &variant);

/// Simulates the recorded run. Errors: those of run_session().
[[nodiscard]] Result<SelfCheck> check_against_recording(const ImportedWorkload &imported);

}  // namespace redag::lab
