// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The executors that ReDAGExecutor is compared with, by the names that programs and tests use: rclcpp's own, and others
// of the workspace. Which of them exist depends on the ROS distribution, and on the packages found at build time.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "rclcpp/executors.hpp"
#include "rclcpp/version.h"
#include "redag/base/result.hpp"
#define REDAG_HAS_EVENTS (RCLCPP_VERSION_MAJOR >= 21)
#if REDAG_HAS_EVENTS
#include "rclcpp/experimental/executors/events_executor/events_executor.hpp"
#endif
#ifdef REDAG_HAS_CM_EXECUTORS
#include "cm_executors/events_cbg_executor.hpp"
#endif

namespace redag_rclcpp::lab {

#ifdef REDAG_HAS_CM_EXECUTORS
inline constexpr bool kHasCbg = true;
#else
inline constexpr bool kHasCbg = false;
#endif

/// mte, ste, static, events, cbg: also those that this build lacks.
[[nodiscard]] const std::vector<std::string> &peer_names();

/// True if the executor always has one thread.
[[nodiscard]] bool has_one_thread(const std::string &peer);

/// `name`: one of peer_names(). Error: this build lacks it; the text says what it needs.
[[nodiscard]] redag::Result<void> check_peer(const std::string &name);

/// Requires check_peer(name).
[[nodiscard]] std::unique_ptr<rclcpp::Executor> make_peer(const std::string &name, std::size_t threads);

}  // namespace redag_rclcpp::lab
