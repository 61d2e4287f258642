// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One callback of ReDAGExecutor with one worker, and the delivery of a message within the process, for
// tools/count_instructions to count the instructions. While the ring runs, the executor's other threads sleep.
#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "counted.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag_rclcpp/executor.hpp"
#include "ring.hpp"
#include "rmw/rmw.h"
#include "virtual_time.hpp"

namespace {

using redag::PreemptionMode;
using redag::benchmarks::Case;

std::uint64_t callbacks(std::uint64_t count, PreemptionMode mode, std::size_t subscriptions) try {
  rclcpp::init(0, nullptr);
  redag_rclcpp::ReDAGOptions options;
  options.workers = 1;
  options.preemption = mode;
  redag_rclcpp::ReDAGExecutor executor(options);
  std::uint64_t calls = 0;
  redag_rclcpp::lab::Ring ring(subscriptions, [&] {
    if (++calls == 1) redag::benchmarks::begin_virtual_time_here();
    if (calls < count) return true;
    redag::benchmarks::end_virtual_time_here();
    executor.cancel();
    return false;
  });
  executor.add_node(ring.node());
  ring.publish();
  executor.spin();
  executor.remove_node(ring.node());
  rclcpp::shutdown();
  return calls;
} catch (const std::exception &error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 0;
}

}  // namespace

int main(int argc, char **argv) {
  const auto ring_of = [](PreemptionMode mode, std::size_t subscriptions) {
    return Case{"callback/" + std::string(to_string(mode)) + "/ring_of_" + std::to_string(subscriptions),
                [=](std::uint64_t least) { return callbacks(least, mode, subscriptions); }};
  };
  const std::vector<Case> cases{ring_of(PreemptionMode::None, 1), ring_of(PreemptionMode::None, 50),
                                ring_of(PreemptionMode::Os, 1)};
  const std::string environment = "rclcpp " REDAG_RCLCPP ", " + std::string(rmw_get_implementation_identifier());
  return redag::benchmarks::run_counted(argc, argv, cases, environment);
}
