// What the tests of the monitor and of its parts share.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "diagnostic_msgs/msg/diagnostic_status.hpp"
#include "redag/model/workload_yaml.hpp"

namespace redag_rclcpp {

using diagnostic_msgs::msg::DiagnosticStatus;

inline redag::Workload parse(const std::string &text) {
  auto workload = redag::parse_workload(text, "test.yaml", redag::LoadOptions{.wcet_optional = true});
  EXPECT_TRUE(workload) << to_string(workload.error());
  return workload->workload;
}

constexpr const char *kOneTimer = R"(
name: test
dags:
  - {name: control, tasks: [{name: loop, wcet: 2ms, callback: {node: /robot, timer: 10ms}}]}
)";

inline const DiagnosticStatus *find_status(const std::vector<DiagnosticStatus> &statuses, const std::string &name) {
  for (const DiagnosticStatus &status : statuses) {
    if (status.name == name) return &status;
  }
  return nullptr;
}

}  // namespace redag_rclcpp
