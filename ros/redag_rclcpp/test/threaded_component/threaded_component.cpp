// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A component that starts a thread in its constructor, as rosbag2's Recorder does. The thread writes its policy,
// priority and name to the file of the parameter `report`.
#include <pthread.h>
#include <sched.h>

#include <array>
#include <fstream>
#include <string>
#include <thread>

#include "rclcpp/node.hpp"
#include "rclcpp_components/register_node_macro.hpp"

namespace redag_rclcpp {

class Threaded : public rclcpp::Node {
 public:
  explicit Threaded(const rclcpp::NodeOptions &options) : Node("threaded", options) {
    const std::string file = declare_parameter<std::string>("report");
    std::thread([&file] {
      int policy = 0;
      sched_param parameters{};
      std::array<char, 16> name{};
      pthread_getschedparam(pthread_self(), &policy, &parameters);
      pthread_getname_np(pthread_self(), name.data(), name.size());
      std::ofstream(file) << policy << " " << parameters.sched_priority << " " << name.data();
    }).join();
  }
};

}  // namespace redag_rclcpp

RCLCPP_COMPONENTS_REGISTER_NODE(redag_rclcpp::Threaded)
