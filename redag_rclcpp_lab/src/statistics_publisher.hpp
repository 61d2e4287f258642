// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Publishes the live pages of this machine for PlotJuggler and other readers of pal_statistics_msgs. Built where that
// package was found (REDAG_PAL_STATISTICS).
//
// Threads: publish() is called by one thread at a time.
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "live_statistics.hpp"
#include "pal_statistics_msgs/msg/statistics.hpp"
#include "pal_statistics_msgs/msg/statistics_names.hpp"
#include "pal_statistics_msgs/msg/statistics_values.hpp"
#include "rclcpp/rclcpp.hpp"

namespace redag_rclcpp::lab {

class StatisticsPublisher {
 public:
  /// Creates in `node` the publishers ~/names, ~/values and ~/full. `folder` has the live pages; `figures` are those of
  /// LiveStatistics.
  StatisticsPublisher(const rclcpp::Node::SharedPtr &node, std::string folder,
                      std::set<std::string, std::less<>> figures);

  /// Reads the pages. Publishes the values where somebody subscribes to them. Publishes the names first if they have
  /// changed, or if there is a new subscription to them.
  void publish();

 private:
  const rclcpp::Node::SharedPtr node_;
  const std::string folder_;
  LiveStatistics statistics_;
  std::size_t readers_of_names_ = 0;
  rclcpp::Publisher<pal_statistics_msgs::msg::StatisticsNames>::SharedPtr names_;
  rclcpp::Publisher<pal_statistics_msgs::msg::StatisticsValues>::SharedPtr values_;
  rclcpp::Publisher<pal_statistics_msgs::msg::Statistics>::SharedPtr full_;
};

}  // namespace redag_rclcpp::lab
