// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The user of the robot in bench_nav2, in another process: waits until Nav2 is active, then lets it drive from place to
// place, and measures how long plans take and how regularly the local costmap is updated.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "nav2_msgs/action/compute_path_to_pose.hpp"
#include "nav2_msgs/action/follow_path.hpp"
#include "nav_msgs/msg/occupancy_grid.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "redag/base/time.hpp"
#include "samples.hpp"
#include "stack_comparison.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace redag_rclcpp::lab {

class NavigationUser {
 public:
  NavigationUser();

  /// Waits until Nav2's lifecycle manager says that all its servers are active. Throws std::runtime_error if that takes
  /// too long.
  void await_active();

  /// Drives from place to place until `end` on CLOCK_MONOTONIC. As Nav2's default behaviour tree does, it plans anew
  /// all the time while the robot drives, here every 500 ms. Measures from `begin` on.
  void drive(redag::Time begin, redag::Time end);

  /// `update_rate`: of the local costmap in Hz.
  void report(Figures &figures, double update_rate) const;

 private:
  using Plan = nav2_msgs::action::ComputePathToPose;
  using Follow = nav2_msgs::action::FollowPath;
  using FollowResult = std::shared_future<rclcpp_action::ClientGoalHandle<Follow>::WrappedResult>;

  /// Empty if there is no plan.
  nav_msgs::msg::Path plan(std::size_t place);
  /// Sends the path, which takes the place of an earlier one. Not valid if Nav2 refuses it.
  FollowResult follow(const nav_msgs::msg::Path &path);
  /// Waits for the result until it is time to plan anew.
  bool is_over(const FollowResult &result);
  /// Adds one, if measuring has begun.
  void count(int &events) const;
  /// False if the answer does not come.
  template <class Future>
  bool await(const Future &future);

  rclcpp::Node::SharedPtr node_;
  rclcpp::executors::SingleThreadedExecutor executor_;
  rclcpp::Client<std_srvs::srv::Trigger>::SharedPtr is_active_;
  rclcpp_action::Client<Plan>::SharedPtr planner_;
  rclcpp_action::Client<Follow>::SharedPtr controller_;
  rclcpp::Subscription<nav_msgs::msg::OccupancyGrid>::SharedPtr costmaps_;
  redag::Time begin_ = 0;
  Samples plans_;
  int unplanned_ = 0;
  int reached_ = 0;
  int failed_ = 0;
  int unserved_ = 0;  // refused, or without an answer: Nav2's lifecycle manager has shut the servers down
  std::vector<std::int64_t> costmap_stamps_;
};

}  // namespace redag_rclcpp::lab
