// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The engine's figures as the live page wants them. Pure functions.
#pragma once

#include "redag/live/publisher.hpp"
#include "redag/model/workload.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/setup.hpp"

namespace redag::runtime {

/// Counters and response times; what the task is (key, name, DAG, timing) stays as it is.
void fill(live::TaskSample &sample, const TaskFigures &figures);

[[nodiscard]] live::PublisherOptions live_options(const std::string &name, const std::string &driver, const Mode &mode,
                                                  const sched::Config &config);

}  // namespace redag::runtime
