// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "peers.hpp"

#include <fmt/format.h>

#include "redag/base/check.hpp"

namespace redag_rclcpp::lab {

const std::vector<std::string> &peer_names() {
  static const std::vector<std::string> kNames = {"mte", "ste", "static", "events", "cbg"};
  return kNames;
}

bool has_one_thread(const std::string &peer) { return peer == "ste" || peer == "static" || peer == "events"; }

redag::Result<void> check_peer(const std::string &name) {
  if (name == "events" && !REDAG_HAS_EVENTS) {
    return redag::make_error(
        "this version of ROS 2 has no executor 'events'",
        fmt::format("it needs rclcpp 21 (Iron) or newer; this is rclcpp {}", RCLCPP_VERSION_MAJOR));
  }
  if (name == "cbg" && !kHasCbg) {
    return redag::make_error("redag_rclcpp_lab was built without the executor 'cbg'",
                             "it is the EventsCBGExecutor of the package cm_executors (Jazzy and newer): build that "
                             "package in the workspace, then redag_rclcpp_lab again");
  }
  return {};
}

std::unique_ptr<rclcpp::Executor> make_peer(const std::string &name, std::size_t threads) {
  if (name == "mte") {
    return std::make_unique<rclcpp::executors::MultiThreadedExecutor>(rclcpp::ExecutorOptions(), threads);
  }
  if (name == "static") return std::make_unique<rclcpp::executors::StaticSingleThreadedExecutor>();
#if REDAG_HAS_EVENTS
  if (name == "events") return std::make_unique<rclcpp::experimental::executors::EventsExecutor>();
#endif
#ifdef REDAG_HAS_CM_EXECUTORS
  if (name == "cbg") {
    return std::make_unique<rclcpp::executors::EventsCBGExecutor>(rclcpp::ExecutorOptions(), threads);
  }
#endif
  REDAG_CHECK(name == "ste", "there is no such executor");
  return std::make_unique<rclcpp::executors::SingleThreadedExecutor>();
}

}  // namespace redag_rclcpp::lab
