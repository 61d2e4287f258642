// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Loads the plan of an experiment of any kind.
#pragma once

#include <memory>
#include <string>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/experiment.hpp"
#include "redag_lab/experiment/factorial.hpp"

namespace redag::experiment {

struct LoadedExperiment {
  std::string plan;     // the text of the file
  std::string subject;  // names what results follow from: the plan, its workloads and the version of the code
  std::unique_ptr<Experiment> experiment;
};
/// Reads a plan, whose key `experiment` says its kind. Errors: every mistake with its place.
[[nodiscard]] Result<LoadedExperiment> load_experiment(const std::string &path, const ExecutorNames &executors,
                                                       Drive drive);

}  // namespace redag::experiment
