// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "peers.hpp"

#include "redag/base/check.hpp"

namespace redag_rclcpp::lab {

const std::vector<std::string> &peer_names() {
  static const std::vector<std::string> kNames = {"mte", "ste", "static", "events", "cbg"};
  return kNames;
}

bool has_one_thread(const std::string &peer) { return peer == "ste" || peer == "static" || peer == "events"; }

redag::Result<void> check_peer(const std::string &name) {
  if (name == "static" && !kHasStatic) {
    return redag::make_error("this version of ROS 2 has no executor 'static'",
                             "rclcpp's StaticSingleThreadedExecutor exists up to Kilted; 'ste' is the nearest");
  }
  if (name == "events" && !kHasEvents) {
    return redag::make_error("this version of ROS 2 has no executor 'events'",
                             "rclcpp's EventsExecutor came with Iron; take that or a newer distribution");
  }
  if (name == "cbg" && !kHasCbg) {
    return redag::make_error("redag_rclcpp_lab was built without the executor 'cbg'",
                             "rclcpp has its EventsCBGExecutor since Lyrical; for Jazzy and Kilted build the package "
                             "cm_executors in the workspace, then redag_rclcpp_lab again");
  }
  return {};
}

std::unique_ptr<rclcpp::Executor> make_peer(const std::string &name, std::size_t threads) {
  if (name == "mte") {
    return std::make_unique<rclcpp::executors::MultiThreadedExecutor>(rclcpp::ExecutorOptions(), threads);
  }
// Newer distributions declare these two as deprecated.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
#if REDAG_HAS_STATIC
  if (name == "static") return std::make_unique<rclcpp::executors::StaticSingleThreadedExecutor>();
#endif
#if REDAG_HAS_EVENTS
  if (name == "events") return std::make_unique<rclcpp::experimental::executors::EventsExecutor>();
#endif
#pragma GCC diagnostic pop
#if REDAG_HAS_CBG
  if (name == "cbg") {
    return std::make_unique<rclcpp::executors::EventsCBGExecutor>(rclcpp::ExecutorOptions(), threads);
  }
#endif
  REDAG_CHECK(name == "ste", "there is no such executor");
  return std::make_unique<rclcpp::executors::SingleThreadedExecutor>();
}

}  // namespace redag_rclcpp::lab
