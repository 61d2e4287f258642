// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Example components for the container: a planner that asks a map server for its map, and waits in its callback for the
// response. All callbacks of the planner are in its default group, as in most nodes. With
// client_->async_send_request(request).get() in the place of co_await, the planner would wait for itself.
#include <chrono>
#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"
#include "redag_rclcpp/coroutine.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace redag_rclcpp::examples {

using namespace std::chrono_literals;
using std_srvs::srv::Trigger;

class Map : public rclcpp::Node {
 public:
  explicit Map(const rclcpp::NodeOptions &options) : rclcpp::Node("map", options) {
    service_ = create_service<Trigger>(
        "get_map",
        redag_rclcpp::service_coroutine<Trigger>(
            [](std::shared_ptr<Trigger::Request>, std::shared_ptr<Trigger::Response> response) -> redag::Coroutine {
              co_await redag::sleep_for(5ms);  // reads the map from a disk
              response->success = true;
              response->message = "the map";
            }));
  }

 private:
  rclcpp::Service<Trigger>::SharedPtr service_;
};

class Planner : public rclcpp::Node {
 public:
  explicit Planner(const rclcpp::NodeOptions &options) : rclcpp::Node("planner", options) {
    client_ = create_client<Trigger>("get_map");
    timer_ = create_wall_timer(100ms, redag_rclcpp::coroutine([this] { return plan(); }));
  }

 private:
  redag::Coroutine plan() {
    const auto response = co_await redag_rclcpp::call(client_, std::make_shared<Trigger::Request>(), 1s);
    if (!response) {
      RCLCPP_WARN(get_logger(), "no map within a second");
      co_return;
    }
    RCLCPP_INFO_ONCE(get_logger(), "plans with %s", response->message.c_str());
  }

  rclcpp::Client<Trigger>::SharedPtr client_;
  rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace redag_rclcpp::examples

RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::examples::Map)
RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::examples::Planner)
