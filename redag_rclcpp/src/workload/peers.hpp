// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The executors that ours is compared with, by the names of programs and tests: rclcpp's own, and what is built beside
// it. Which there are depends on the ROS distribution, and on the packages that were found when this was built.
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

namespace redag_rclcpp {

#ifdef REDAG_HAS_CM_EXECUTORS
inline constexpr bool kHasCbg = true;
#else
inline constexpr bool kHasCbg = false;
#endif

/// mte, ste, static, events, cbg: also those that are not here.
[[nodiscard]] const std::vector<std::string> &peer_names();

/// Has one thread, whatever is asked for.
[[nodiscard]] bool has_one_thread(const std::string &peer);

/// `name`: one of peer_names(). Error: it is not here, and what it takes to have it.
[[nodiscard]] redag::Result<void> check_peer(const std::string &name);

/// Requires check_peer(name).
[[nodiscard]] std::unique_ptr<rclcpp::Executor> make_peer(const std::string &name, std::size_t threads);

}  // namespace redag_rclcpp
