// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Makes the executor's engine of its options: checks them, chooses the preemption mode, and creates the engine, paused
// and without tasks. Values only.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/threads/setup.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

/// Returns the options. Throws std::invalid_argument for numbers out of range.
[[nodiscard]] ReDAGOptions checked(ReDAGOptions options);

/// Those of the workload's platform.
[[nodiscard]] const std::vector<redag::Device> &devices_of(const ReDAGOptions &options);

/// Throws std::runtime_error if the machine does not offer what the options ask for.
[[nodiscard]] redag::runtime::Setup set_up(const ReDAGOptions &options);

/// `origin`: zero of the engine's clock, on CLOCK_MONOTONIC.
/// `on_exception` is called on workers.
[[nodiscard]] std::unique_ptr<redag::runtime::Engine> make_engine(
    const ReDAGOptions &options, const redag::runtime::Setup &setup, redag::Time origin,
    std::function<void(const redag::runtime::Job &, std::exception_ptr)> on_exception);

}  // namespace redag_rclcpp
