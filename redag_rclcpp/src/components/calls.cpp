// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Example components for the container: a planner that asks a map server for a parameter and for its map, and waits in
// its callback for the responses. All callbacks of the planner are in its default group, as in most nodes. With
// client_->async_send_request(request).get() in the place of co_await, the planner would wait for itself.
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "rclcpp_components/register_node_macro.hpp"
#include "redag_rclcpp/coroutine.hpp"
#include "redag_rclcpp/parameters_client.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace redag_rclcpp::examples {

using namespace std::chrono_literals;
using std_srvs::srv::Trigger;

class Map : public rclcpp::Node {
 public:
  explicit Map(const rclcpp::NodeOptions &options) : rclcpp::Node("map", options) {
    declare_parameter("resolution", 0.05);
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
    map_ = std::make_shared<redag_rclcpp::ParametersClient>(this, "map");
    timer_ = create_wall_timer(100ms, redag_rclcpp::coroutine([this] { return plan(); }));
  }

 private:
  redag::Coroutine plan() {
    const std::vector<std::string> names{"resolution"};
    const auto values = co_await map_->get_parameters(names, 1s);
    if (!values || values->empty()) {
      RCLCPP_WARN(get_logger(), "no resolution of the map within a second");
      co_return;
    }
    const auto response = co_await redag_rclcpp::call(client_, std::make_shared<Trigger::Request>(), 1s);
    if (!response) {
      RCLCPP_WARN(get_logger(), "no map within a second");
      co_return;
    }
    RCLCPP_INFO_ONCE(get_logger(), "plans with %s, cells of %.2f m", response->message.c_str(),
                     values->front().as_double());
  }

  rclcpp::Client<Trigger>::SharedPtr client_;
  std::shared_ptr<redag_rclcpp::ParametersClient> map_;
  rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace redag_rclcpp::examples

RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::examples::Map)
RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::examples::Planner)
