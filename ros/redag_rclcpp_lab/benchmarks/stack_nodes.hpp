// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the components of the stack comparisons share: times as parameters, and reports as files.
#pragma once

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "rclcpp/rclcpp.hpp"
#include "redag/base/time.hpp"
#include "samples.hpp"

namespace redag_rclcpp::lab {

/// Declares a parameter in seconds.
inline redag::Duration read_seconds(rclcpp::Node &node, const char *name, double initial) {
  return std::llround(node.declare_parameter<double>(name, initial) * static_cast<double>(redag::kSecond));
}

/// In milliseconds; empty without samples.
inline nlohmann::json summary(const Samples &samples) {
  if (samples.size() == 0) return nlohmann::json::object();
  return {{"p50", samples.milliseconds(0.5)}, {"p99", samples.milliseconds(0.99)}, {"max", samples.milliseconds(1)}};
}

/// Writes what a node measured to the file of its parameter `report`.
inline void write_report(const rclcpp::Node &node, const std::string &file, const nlohmann::json &figures) {
  std::ofstream out(file);
  out << figures << "\n";
  if (!out.flush()) RCLCPP_ERROR(node.get_logger(), "cannot write the parameter report's file '%s'", file.c_str());
}

}  // namespace redag_rclcpp::lab
