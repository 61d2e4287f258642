// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The executors that ReDAGExecutor is compared with, by the names that programs and tests use: rclcpp's own, and others
// of the workspace. Which of them exist depends on the ROS distribution, and on the packages found at build time.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_rclcpp/rclcpp_executors.hpp"

namespace redag_rclcpp::lab {

// Which executors this build has; the other peers exist everywhere.
inline constexpr bool kHasStatic = REDAG_HAS_STATIC;
inline constexpr bool kHasEvents = REDAG_HAS_EVENTS;
inline constexpr bool kHasCbg = REDAG_HAS_CBG;

/// mte, ste, static, events, cbg: also those that this build lacks.
[[nodiscard]] const std::vector<std::string> &peer_names();

/// True if the executor always has one thread.
[[nodiscard]] bool has_one_thread(const std::string &peer);

/// `name`: one of peer_names(). Error: this build lacks it; the text says what it needs.
[[nodiscard]] redag::Result<void> check_peer(const std::string &name);

/// Requires check_peer(name).
[[nodiscard]] std::unique_ptr<rclcpp::Executor> make_peer(const std::string &name, std::size_t threads);

}  // namespace redag_rclcpp::lab
