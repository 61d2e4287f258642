// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The smallest executor, for tests that need no more. A pure function.
#pragma once

#include "redag/runtime/executor_options.hpp"

namespace redag::testing {

[[nodiscard]] inline runtime::ExecutorOptions one_worker(PreemptionMode mode = PreemptionMode::None) {
  runtime::ExecutorOptions options;
  options.workers = 1;
  options.preemption = mode;
  return options;
}

}  // namespace redag::testing
