// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Converts the engine's figures for the live page. Pure functions.
#pragma once

#include <span>

#include "redag/engine/engine.hpp"
#include "redag/live/publisher.hpp"
#include "redag/model/workload.hpp"
#include "redag/threads/setup.hpp"

namespace redag::runtime {

/// Sets counters and response times of `sample`. The task's description (key, name, DAG, timing) is left as it is.
void fill(live::TaskSample &sample, const TaskFigures &figures);

/// Appends the threads of `engine`. A task's key is its id, or that of `ids` at its id's place.
void add_threads(live::Sample &sample, const Engine &engine, std::span<const TaskId> ids = {});

/// Appends the devices of `engine`. A task's key is its id.
void add_devices(live::Sample &sample, const Engine &engine);

/// What stops the engine, or breaks its order, now; empty: nothing.
[[nodiscard]] std::string alert_of(const Engine &engine);

[[nodiscard]] live::PublisherOptions live_options(const std::string &name, const std::string &driver, const Mode &mode,
                                                  const sched::Config &config);

}  // namespace redag::runtime
