// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Asks whether an imported workload does in the simulator what the robot did: the model of the executor that ran, with
// the phases of the recording, against the recorded response times. Prints nothing.
#pragma once

#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_analysis/metrics/distribution.hpp"
#include "redag_lab/import/model.hpp"

namespace redag::lab {

inline constexpr double kMostP50Error = 0.1;
inline constexpr double kMostP99Error = 0.25;

struct ReproducedTask {
  std::string name;
  metrics::Distribution recorded;
  metrics::Distribution simulated;

  double p50_error = 0;  // relative; 0 if the difference is less than a thread takes to wake up
  double p99_error = 0;
  [[nodiscard]] bool is_reproduced() const { return p50_error <= kMostP50Error && p99_error <= kMostP99Error; }
};

struct SelfCheck {
  std::string executor;  // whose model ran
  std::vector<ReproducedTask> tasks;
  std::vector<std::string> unknown;  // tasks whose responses were not recorded
};

/// Simulates the recorded run. Errors: those of run_session().
[[nodiscard]] Result<SelfCheck> check_against_recording(const ImportedWorkload &imported);

}  // namespace redag::lab
