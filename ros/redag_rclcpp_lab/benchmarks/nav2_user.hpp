// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The user of the robot in bench_nav2, in another process: waits until Nav2 is active, then lets the robot drive from
// place to place and use its behaviours. Measures how long plans take and how late goals are accepted, how regularly
// the behaviour tree ticks and the local costmap is updated, and how old the scans in the costmap are.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "nav2_msgs/action/back_up.hpp"
#include "nav2_msgs/action/compute_path_to_pose.hpp"
#include "nav2_msgs/action/drive_on_heading.hpp"
#include "nav2_msgs/action/follow_path.hpp"
#include "nav2_msgs/action/navigate_to_pose.hpp"
#include "nav2_msgs/action/spin.hpp"
#include "nav2_msgs/action/wait.hpp"
#include "nav_msgs/msg/occupancy_grid.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "redag/base/time.hpp"
#include "samples.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "stack_comparison.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace redag_rclcpp::lab {

/// Which servers the user asks, beside the controller and the planner.
struct NavigationServers {
  bool behaviors = true;  // behavior_server: after each place, the robot spins, backs up, drives on and waits
  bool navigator = true;  // bt_navigator: it plans and follows the plans. Without it, the user does
};

/// Rates in Hz that the user measures deviations from.
struct NavigationRates {
  double costmap;  // updates of the local costmap
  double tree;     // ticks of the behaviour tree
};

class NavigationUser {
 public:
  explicit NavigationUser(const NavigationServers &servers);

  /// Waits until Nav2's lifecycle manager says that all its servers are active. Throws std::runtime_error if that takes
  /// too long.
  void await_active();

  /// Drives from place to place until `end` on CLOCK_MONOTONIC, and measures from `begin` on. Without bt_navigator, the
  /// user plans anew all the time while the robot drives, as Nav2's default behaviour tree does, here every 500 ms.
  void drive(redag::Time begin, redag::Time end);

  void report(Figures &figures, const NavigationRates &rates) const;

 private:
  using Navigate = nav2_msgs::action::NavigateToPose;
  using Plan = nav2_msgs::action::ComputePathToPose;
  using Follow = nav2_msgs::action::FollowPath;
  using Spin = nav2_msgs::action::Spin;
  using BackUp = nav2_msgs::action::BackUp;
  using DriveOn = nav2_msgs::action::DriveOnHeading;
  using Wait = nav2_msgs::action::Wait;
  using FollowResult = std::shared_future<rclcpp_action::ClientGoalHandle<Follow>::WrappedResult>;

  /// Has bt_navigator drive to a place. Cancels the goal at `end`.
  void navigate(std::size_t place, redag::Time end);
  /// Plans and follows the plans, until the robot is at a place or it is `end`.
  void follow_plans(std::size_t place, redag::Time end);
  /// Empty if there is no plan.
  nav_msgs::msg::Path plan(std::size_t place);
  /// Sends the path, which takes the place of an earlier one. Not valid if Nav2 refuses it.
  FollowResult follow(const nav_msgs::msg::Path &path);
  /// Waits for the result until it is time to plan anew.
  bool is_over(const FollowResult &result);
  /// Has the robot do what a goal says, and waits for its end.
  template <class Action>
  void behave(rclcpp_action::Client<Action> &server, const typename Action::Goal &goal);
  /// Sends a goal to a server whose callbacks the container's executor runs, and notes how late it is accepted. Null if
  /// it is refused.
  template <class Action>
  typename rclcpp_action::ClientGoalHandle<Action>::SharedPtr send(
      rclcpp_action::Client<Action> &server, const typename Action::Goal &goal,
      const typename rclcpp_action::Client<Action>::SendGoalOptions &options = {});
  /// Adds one, if measuring has begun.
  void count(int &events) const;
  /// False if the answer does not come.
  template <class Future>
  bool await(const Future &future);

  NavigationServers servers_;
  rclcpp::Node::SharedPtr node_;
  rclcpp::executors::SingleThreadedExecutor executor_;
  rclcpp::Client<std_srvs::srv::Trigger>::SharedPtr is_active_;
  rclcpp_action::Client<Navigate>::SharedPtr navigator_;
  rclcpp_action::Client<Plan>::SharedPtr planner_;
  rclcpp_action::Client<Follow>::SharedPtr controller_;
  rclcpp_action::Client<Spin>::SharedPtr spin_;
  rclcpp_action::Client<BackUp>::SharedPtr back_up_;
  rclcpp_action::Client<DriveOn>::SharedPtr drive_on_;
  rclcpp_action::Client<Wait>::SharedPtr wait_;
  rclcpp::Subscription<nav_msgs::msg::OccupancyGrid>::SharedPtr costmaps_;
  rclcpp::Subscription<sensor_msgs::msg::PointCloud2>::SharedPtr scans_;
  redag::Time begin_ = 0;
  Samples plans_;
  Samples accepted_;
  int unplanned_ = 0;
  int reached_ = 0;
  int failed_ = 0;
  int behaved_ = 0;
  int misbehaved_ = 0;
  int recoveries_ = 0;
  int unserved_ = 0;  // refused, or without an answer: Nav2's lifecycle manager has shut the servers down
  std::vector<std::int64_t> costmap_stamps_;
  std::vector<std::pair<std::int64_t, std::int64_t>> scan_uses_;  // when an update used a scan, and the scan's stamp
  std::vector<std::int64_t> tick_intervals_;                      // of the behaviour tree
};

}  // namespace redag_rclcpp::lab
