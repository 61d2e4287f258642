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
#include "redag/runtime/clock.hpp"

namespace redag_rclcpp::lab {

using nav_msgs::msg::OccupancyGrid;
using nav_msgs::msg::Path;
using redag::Time;
using redag::runtime::monotonic_now;
using std_srvs::srv::Trigger;

namespace {

constexpr std::chrono::seconds kLimit(5);  // of an answer
constexpr std::chrono::seconds kStartLimit(90);
constexpr std::chrono::milliseconds kReplan(500);

}  // namespace

NavigationUser::NavigationUser()
    : node_(std::make_shared<rclcpp::Node>("bench_nav2")),
      is_active_(node_->create_client<Trigger>("/lifecycle_manager/is_active")),
      planner_(rclcpp_action::create_client<Plan>(node_, "/compute_path_to_pose")),
      controller_(rclcpp_action::create_client<Follow>(node_, "/follow_path")),
      costmaps_(node_->create_subscription<OccupancyGrid>(
          "/local_costmap/costmap", 10, [this](OccupancyGrid::ConstSharedPtr costmap) {
            if (monotonic_now() < begin_) return;
            costmap_stamps_.push_back(rclcpp::Time(costmap->header.stamp).nanoseconds());
          })) {
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
  const hall::Point &point = hall::kPlaces.at(place);
  Plan::Goal goal;
  goal.goal.header.frame_id = "map";
  goal.goal.pose.position.x = point.x;
  goal.goal.pose.position.y = point.y;
  goal.goal.pose.orientation.w = 1;
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

void NavigationUser::drive(Time begin, Time end) {
  begin_ = begin;
  if (!planner_->wait_for_action_server(kLimit) || !controller_->wait_for_action_server(kLimit)) {
    throw std::runtime_error("Nav2 offers no actions");
  }
  for (std::size_t place = 0; monotonic_now() < end; place = (place + 1) % hall::kPlaces.size()) {
    FollowResult result;  // not valid before the first plan is followed
    do {
      if (const Path path = plan(place); !path.poses.empty()) {
        if (FollowResult next = follow(path); next.valid()) result = std::move(next);
      }
    } while (!is_over(result) && monotonic_now() < end);
    if (!result.valid() || result.wait_for(std::chrono::seconds(0)) != std::future_status::ready) continue;
    count(result.get().code == rclcpp_action::ResultCode::SUCCEEDED ? reached_ : failed_);
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

void NavigationUser::report(Figures &figures, double update_rate) const {
  figures["places reached"] = reached_;
  figures["places not reached"] = failed_;
  figures["plans failed"] = unplanned_;
  figures["goals unserved"] = unserved_;
  add_samples(figures, "plan done after", plans_);
  Samples off;
  const auto period = static_cast<double>(redag::kSecond) / update_rate;
  for (std::size_t i = 1; i < costmap_stamps_.size(); ++i) {
    off.add(std::llround(std::abs(static_cast<double>(costmap_stamps_[i] - costmap_stamps_[i - 1]) - period)));
  }
  if (off.size() == 0) throw std::runtime_error("the local costmap was not published");
  add_samples(figures, "costmap interval off", off);
}

}  // namespace redag_rclcpp::lab
