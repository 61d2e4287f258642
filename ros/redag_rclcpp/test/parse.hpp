// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Parses a workload from text, for tests.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"

namespace redag_rclcpp {

inline redag::Workload parse(const std::string &text) {
  auto workload = redag::parse_workload(text, "test.yaml", redag::LoadOptions{.wcet_optional = true, .waits = true});
  EXPECT_TRUE(workload) << to_string(workload.error());
  return workload->workload;
}

inline redag::ValidWorkload valid(const std::string &text) { return redag::validated(parse(text)).value(); }

}  // namespace redag_rclcpp
