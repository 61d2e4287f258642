// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The smallest executor and the smallest DAG, for tests that need no more. Pure functions.
#pragma once

#include <chrono>
#include <string>
#include <utility>

#include "redag/runtime/dag_builder.hpp"
#include "redag/runtime/executor_options.hpp"

namespace redag::testing {

[[nodiscard]] inline runtime::ExecutorOptions one_worker(PreemptionMode mode = PreemptionMode::None) {
  runtime::ExecutorOptions options;
  options.workers = 1;
  options.preemption = mode;
  return options;
}

/// The same with a device, "gpu", of one slot.
[[nodiscard]] inline runtime::ExecutorOptions one_worker_and_gpu(PreemptionMode mode = PreemptionMode::None) {
  runtime::ExecutorOptions options = one_worker(mode);
  options.devices = {{.name = "gpu"}};
  return options;
}

/// A DAG whose only task, "task", runs `body` once, when the executor starts.
[[nodiscard]] inline runtime::DagBuilder once(const std::string &name, runtime::TaskBody body,
                                              runtime::TaskOptions options = {}) {
  runtime::DagBuilder dag(name);
  dag.timer("task", std::chrono::hours(1), std::move(body), options);
  return dag;
}

}  // namespace redag::testing
