// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "nav2_user.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <stdexcept>
#include <thread>
#include <utility>

#include "nav2_world.hpp"
#include "redag/threads/clock.hpp"

namespace redag_rclcpp::lab {

using nav_msgs::msg::OccupancyGrid;
using nav_msgs::msg::Path;
using redag::Time;
using redag::runtime::monotonic_now;
using sensor_msgs::msg::PointCloud2;
using std_srvs::srv::Trigger;

namespace {

constexpr std::chrono::seconds kLimit(5);  // of an answer
constexpr std::chrono::seconds kStartLimit(90);
constexpr std::chrono::milliseconds kReplan(500);
constexpr double kMove = 0.15;       // m that the robot backs up and drives on, where there is 1 m of room
constexpr double kMoveSpeed = 0.3;   // m/s
constexpr double kTurn = 0.8;        // rad
constexpr double kPause = 0.3;       // s
constexpr int kAllowance = 5;        // s for each behaviour
constexpr std::size_t kTicks = 200;  // of the behaviour tree that may wait for this process

geometry_msgs::msg::PoseStamped pose_of(std::size_t place) {
  const hall::Point &point = hall::kPlaces.at(place);
  geometry_msgs::msg::PoseStamped goal;
  goal.header.frame_id = "map";
  goal.pose.position.x = point.x;
  goal.pose.position.y = point.y;
  goal.pose.orientation.w = 1;
  return goal;
}

/// How far each interval is from the period of `rate` Hz.
Samples deviations(const std::vector<std::int64_t> &intervals, double rate) {
  Samples off;
  const auto period = static_cast<double>(redag::kSecond) / rate;
  for (const std::int64_t interval : intervals) off.add(std::llround(std::abs(static_cast<double>(interval) - period)));
  return off;
}

}  // namespace

NavigationUser::NavigationUser(const NavigationServers &servers)
    : servers_(servers),
      node_(std::make_shared<rclcpp::Node>("bench_nav2")),
      is_active_(node_->create_client<Trigger>("/lifecycle_manager/is_active")),
      planner_(rclcpp_action::create_client<Plan>(node_, "/compute_path_to_pose")),
      controller_(rclcpp_action::create_client<Follow>(node_, "/follow_path")),
      costmaps_(node_->create_subscription<OccupancyGrid>("/local_costmap/costmap", 10,
                                                          [this](OccupancyGrid::ConstSharedPtr costmap) {
                                                            if (monotonic_now() < begin_) return;
                                                            costmap_stamps_.push_back(
                                                                rclcpp::Time(costmap->header.stamp).nanoseconds());
                                                          })),
      // The voxel layer publishes this with the stamp of a scan when an update of the costmap uses the scan.
      scans_(node_->create_subscription<PointCloud2>(
          "/local_costmap/clearing_endpoints", 10,
          [this](PointCloud2::ConstSharedPtr scan, const rclcpp::MessageInfo &info) {
            scan_uses_.emplace_back(info.get_rmw_message_info().source_timestamp,
                                    rclcpp::Time(scan->header.stamp).nanoseconds());
          })) {
  if (servers.navigator) {
    rcl_action_client_options_t options = rcl_action_client_get_default_options();
    options.feedback_topic_qos.depth = kTicks;
    navigator_ = rclcpp_action::create_client<Navigate>(node_, "/navigate_to_pose", nullptr, options);
  }
  if (servers.behaviors) {
    spin_ = rclcpp_action::create_client<Spin>(node_, "/spin");
    back_up_ = rclcpp_action::create_client<BackUp>(node_, "/backup");
    drive_on_ = rclcpp_action::create_client<DriveOn>(node_, "/drive_on_heading");
    wait_ = rclcpp_action::create_client<Wait>(node_, "/wait");
  }
  executor_.add_node(node_);
}

template <class Future>
bool NavigationUser::await(const Future &future) {
  return executor_.spin_until_future_complete(future, kLimit) == rclcpp::FutureReturnCode::SUCCESS;
}

void NavigationUser::await_active() {
  const auto limit = std::chrono::steady_clock::now() + kStartLimit;
  while (std::chrono::steady_clock::now() < limit) {
    // The service answers once all servers have been activated, or if one of them failed.
    if (is_active_->wait_for_service(std::chrono::milliseconds(100))) {
      auto answer = is_active_->async_send_request(std::make_shared<Trigger::Request>());
      if (executor_.spin_until_future_complete(answer, std::chrono::seconds(1)) == rclcpp::FutureReturnCode::SUCCESS &&
          answer.get()->success) {
        return;
      }
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  throw std::runtime_error(fmt::format("Nav2 is not active after {} s", kStartLimit.count()));
}

Path NavigationUser::plan(std::size_t place) {
  Plan::Goal goal;
  goal.goal = pose_of(place);
  const Time sent = monotonic_now();
  auto accepted = planner_->async_send_goal(goal);
  if (!await(accepted) || !accepted.get()) {
    count(unserved_);
    return Path();
  }
  auto result = planner_->async_get_result(accepted.get());
  if (!await(result)) {
    count(unserved_);
    return Path();
  }
  const bool planned = result.get().code == rclcpp_action::ResultCode::SUCCEEDED;
  if (sent >= begin_ && planned) plans_.add(monotonic_now() - sent);
  if (!planned) count(unplanned_);
  return planned ? result.get().result->path : Path();
}

NavigationUser::FollowResult NavigationUser::follow(const Path &path) {
  Follow::Goal goal;
  goal.path = path;
  auto accepted = controller_->async_send_goal(goal);
  if (!await(accepted) || !accepted.get()) {
    count(unserved_);
    return {};
  }
  return controller_->async_get_result(accepted.get());
}

template <class Action>
typename rclcpp_action::ClientGoalHandle<Action>::SharedPtr NavigationUser::send(
    rclcpp_action::Client<Action> &server, const typename Action::Goal &goal,
    const typename rclcpp_action::Client<Action>::SendGoalOptions &options) {
  const Time sent = monotonic_now();
  auto accepted = server.async_send_goal(goal, options);
  if (!await(accepted) || !accepted.get()) {
    count(unserved_);
    return nullptr;
  }
  if (sent >= begin_) accepted_.add(monotonic_now() - sent);
  return accepted.get();
}

template <class Action>
void NavigationUser::behave(rclcpp_action::Client<Action> &server, const typename Action::Goal &goal) {
  const auto handle = send(server, goal);
  if (!handle) return;
  const auto result = server.async_get_result(handle);
  const bool is_done = executor_.spin_until_future_complete(result, kLimit + std::chrono::seconds(kAllowance)) ==
                           rclcpp::FutureReturnCode::SUCCESS &&
                       result.get().code == rclcpp_action::ResultCode::SUCCEEDED;
  count(is_done ? behaved_ : misbehaved_);
}

void NavigationUser::navigate(std::size_t place, Time end) {
  Navigate::Goal goal;
  goal.pose = pose_of(place);
  rclcpp_action::Client<Navigate>::SendGoalOptions options;
  struct Progress {
    std::optional<std::int64_t> last_tick;
    int recoveries = 0;
  };
  const auto progress = std::make_shared<Progress>();  // a goal that is accepted too late can outlive this call
  // Each tick of the tree tells the time since the goal was accepted.
  options.feedback_callback = [this, progress](const auto &,
                                               const std::shared_ptr<const Navigate::Feedback> &feedback) {
    const std::int64_t tick = rclcpp::Duration(feedback->navigation_time).nanoseconds();
    if (progress->last_tick && monotonic_now() >= begin_) tick_intervals_.push_back(tick - *progress->last_tick);
    progress->last_tick = tick;
    progress->recoveries = feedback->number_of_recoveries;
  };
  const auto handle = send(*navigator_, goal, options);
  if (!handle) {
    std::this_thread::sleep_for(kReplan);
    return;
  }
  const auto result = navigator_->async_get_result(handle);
  bool is_over = false;
  while (!is_over && monotonic_now() < end) {
    is_over = executor_.spin_until_future_complete(result, kReplan) == rclcpp::FutureReturnCode::SUCCESS;
  }
  if (is_over) {
    count(result.get().code == rclcpp_action::ResultCode::SUCCEEDED ? reached_ : failed_);
  } else {
    navigator_->async_cancel_goal(handle);
    await(result);
  }
  navigator_->stop_callbacks(handle);
  if (monotonic_now() >= begin_) recoveries_ += progress->recoveries;
}

void NavigationUser::follow_plans(std::size_t place, Time end) {
  FollowResult result;  // not valid before the first plan is followed
  do {
    if (const Path path = plan(place); !path.poses.empty()) {
      if (FollowResult next = follow(path); next.valid()) result = std::move(next);
    }
  } while (!is_over(result) && monotonic_now() < end);
  if (!result.valid() || result.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
  count(result.get().code == rclcpp_action::ResultCode::SUCCEEDED ? reached_ : failed_);
}

void NavigationUser::drive(Time begin, Time end) {
  begin_ = begin;
  if (!planner_->wait_for_action_server(kLimit) || !controller_->wait_for_action_server(kLimit) ||
      (servers_.navigator && !navigator_->wait_for_action_server(kLimit)) ||
      (servers_.behaviors && !wait_->wait_for_action_server(kLimit))) {
    throw std::runtime_error("Nav2 offers no actions");
  }
  const auto limited = [](auto goal) {
    goal.time_allowance.sec = kAllowance;
    return goal;
  };
  Spin::Goal turn;
  turn.target_yaw = static_cast<float>(kTurn);
  BackUp::Goal back;
  back.target.x = kMove;
  back.speed = static_cast<float>(kMoveSpeed);
  DriveOn::Goal on;
  on.target.x = kMove;
  on.speed = static_cast<float>(kMoveSpeed);
  Wait::Goal pause;
  pause.time = rclcpp::Duration::from_seconds(kPause);
  for (std::size_t place = 0; monotonic_now() < end; place = (place + 1) % hall::kPlaces.size()) {
    if (servers_.navigator) {
      navigate(place, end);
    } else {
      follow_plans(place, end);
    }
    if (!servers_.behaviors || monotonic_now() >= end) continue;
    behave(*spin_, limited(turn));
    behave(*back_up_, limited(back));
    behave(*drive_on_, limited(on));
    behave(*wait_, pause);
  }
}

bool NavigationUser::is_over(const FollowResult &result) {
  if (result.valid()) {
    return executor_.spin_until_future_complete(result, kReplan) == rclcpp::FutureReturnCode::SUCCESS;
  }
  executor_.spin_some();
  std::this_thread::sleep_for(kReplan);
  return false;
}

void NavigationUser::count(int &events) const {
  if (monotonic_now() >= begin_) ++events;
}

void NavigationUser::report(Figures &figures, const NavigationRates &rates) const {
  figures["places reached"] = reached_;
  figures["places not reached"] = failed_;
  figures["goals unserved"] = unserved_;
  if (!servers_.navigator) {
    figures["plans failed"] = unplanned_;
    add_samples(figures, "plan done after", plans_);
  }
  if (servers_.behaviors) {
    figures["behaviors done"] = behaved_;
    figures["behaviors failed"] = misbehaved_;
  }
  add_samples(figures, "goal accepted after", accepted_);
  if (servers_.navigator) {
    figures["recoveries"] = recoveries_;
    add_samples(figures, "tree tick off", deviations(tick_intervals_, rates.tree));
  }
  std::vector<std::int64_t> intervals;
  Samples ages;  // of the newest scan in an update
  std::size_t next_use = 0;
  for (std::size_t i = 1; i < costmap_stamps_.size(); ++i) {
    intervals.push_back(costmap_stamps_[i] - costmap_stamps_[i - 1]);
    std::optional<std::int64_t> scan;
    for (; next_use < scan_uses_.size() && scan_uses_[next_use].first <= costmap_stamps_[i]; ++next_use) {
      if (scan_uses_[next_use].first > costmap_stamps_[i - 1]) scan = scan_uses_[next_use].second;
    }
    if (scan) ages.add(costmap_stamps_[i] - *scan);
  }
  if (intervals.empty()) throw std::runtime_error("the local costmap was not published");
  if (ages.size() == 0) throw std::runtime_error("the local costmap used no scan");
  add_samples(figures, "costmap interval off", deviations(intervals, rates.costmap));
  add_samples(figures, "scan to costmap", ages);
}

}  // namespace redag_rclcpp::lab
